#include "tools/isowave/surface_options.hpp"

#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string_view>

#include "core/api/convert.hpp"
#include "core/api/frame_parts.hpp"
#include "core/base/error.hpp"
#include "core/frame/colors.hpp"
#include "core/frame/surfaces.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

/// A field of an option. Throws Error if it is no number.
double parse_field(const char *option, const std::string &text, std::string_view field) {
  const std::optional<double> value = parse_finite(field);
  if (!value || std::abs(*value) > std::numeric_limits<float>::max())
    throw Error("{} {}: '{}' is no finite number that float32 holds", option, text, field);
  return *value;
}

/// index: of the surface in its frame
isowave::Surface parse_surface(const std::string &text, std::size_t index) {
  isowave::Surface surface{.color = isowave::surface_color(index)};
  const std::string_view value = read_surface_fields("--surface", text, "VALUE", surface);
  surface.isovalue = parse_field("--surface", text, value);
  return surface;
}

}  // namespace

std::array<float, 3> parse_color(const char *option, std::string_view text) {
  try {
    return from_glm(core::parse_color(text));
  } catch (const Error &error) {
    throw Error("{}: {}", option, error.what());
  }
}

std::string_view read_surface_fields(const char *option, const std::string &text, const char *what,
                                     isowave::Surface &surface) {
  const std::vector<std::string_view> fields = split_at_commas(text);
  bool is_whole = false, is_own = false,
       is_good = !fields.front().empty() && !fields.back().empty();
  for (std::size_t i = 3; i < fields.size(); ++i) {
    bool &is_set = fields[i] == "own" ? is_own : is_whole;
    is_good = is_good && !is_set && (fields[i] == "own" || fields[i] == "whole");
    is_set = true;
  }
  if (!is_good)
    throw Error(
        "{0} {1}: give {2}, {2},COLOR, {2},COLOR,OPACITY or {2},COLOR,OPACITY and whole, "
        "own or both",
        option, text, what);
  if (fields.size() > 1 && !fields[1].empty()) surface.color = parse_color(option, fields[1]);
  if (fields.size() > 2 && !fields[2].empty())
    surface.opacity = static_cast<float>(parse_field(option, text, fields[2]));
  surface.clipped = !is_whole;
  surface.mapped = !is_own;
  return fields.front();
}

void read_background(const std::string &text, isowave::Appearance &appearance) {
  const std::vector<std::string_view> colors = split_at_commas(text);
  if (colors.size() > 2 || colors.back().empty())
    throw Error("--background {}: give COLOR, or COLOR,COLOR: lower edge, upper edge", text);
  appearance.background = parse_color("--background", colors.front());
  if (colors.size() == 2) appearance.background_top = parse_color("--background", colors.back());
}

void add_light_options(CLI::App &command, LightOptions &options) {
  CLI::Option *light = command
                           .add_option("--light", options.direction,
                                       "direction towards a light of the scene, in world space, "
                                       "instead of one that turns with the camera")
                           ->type_name("X,Y,Z");
  command
      .add_option(
          "--shadow", options.shadow_rays,
          "rays of each hit towards the light, whose shadows are then drawn: 1, hard "
          "shadows; 16 and more, soft ones. Each takes about as long as a frame without any")
      ->check(CLI::Range(1u, ISO_MAX_AMBIENT_RAYS))
      ->needs(light);
  command
      .add_option("--bounce", options.bounce_rays,
                  "rays of each hit that bring light from other places of opaque surfaces, as matt "
                  "surfaces send it on: 16 and more. They are its ambient rays, too. Each takes "
                  "about as long as two frames without any")
      ->check(CLI::Range(1u, ISO_MAX_AMBIENT_RAYS))
      ->needs(light);
  command
      .add_option("--light-angle", options.angle,
                  "half of the angle that the light has in soft shadows [degrees]")
      ->check(CLI::Range(0.01, 45.0))
      ->needs("--shadow")
      ->capture_default_str();
}

void read_light(const LightOptions &options, isowave::Appearance &appearance) {
  appearance.shadow_rays = options.shadow_rays;
  appearance.bounce_rays = options.bounce_rays;
  appearance.light_angle = options.angle;
  if (options.direction.empty()) return;
  Vector3 direction{};
  const std::vector<std::string_view> fields = split_at_commas(options.direction);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto value = i < fields.size() ? parse_finite(fields[i]) : std::nullopt;
    if (!value || fields.size() != 3)
      throw Error("--light {}: give X,Y,Z, three finite numbers", options.direction);
    direction[i] = *value;
  }
  check_light(to_glm(direction));
  appearance.light_direction = direction;
}

void add_color_map_options(CLI::App &command, ColorMapOptions &options) {
  command
      .add_option("--color-by", options.by,
                  "colour surfaces by the distance from the world's origin along an axis: x, y, z "
                  "or a direction; or along the view: depth; or by the values of a second volume "
                  "at the hits: its file, or "
                  "`volume` to show the voxels of the same one on caps. LOW,HIGH: distances or "
                  "values of the first and the "
                  "last colour [those of the volume's box, or of the field at the hits; with "
                  "--surface, of the whole field]. `labels`: with --labels, by each label; or by "
                  "those of another segmentation: FILE,labels")
      ->type_name("x|y|z|NX,NY,NZ|depth|FILE|volume[,LOW,HIGH]|labels|FILE,labels");
  command
      .add_option("--color-map", options.map, "colours of --color-by [viridis; by labels, labels]")
      ->check(CLI::IsMember(isowave::color_map_names()))
      ->needs("--color-by");
  command
      .add_option("--field-index", options.index,
                  "--index of the file that --color-by names, or the scene's field")
      ->type_name("t=N");
}

namespace {

void set_map(const ColorMapOptions &options, const char *otherwise,
             isowave::Appearance &appearance) {
  appearance.color_map = options.map.empty() ? otherwise : options.map;
}

/// labels or FILE,labels; false: it is neither.
bool read_labelled_field(ColorMapOptions &options, isowave::Appearance &appearance) {
  constexpr std::string_view kEnd = ",labels";
  std::string name = options.by;
  if (name == "labels") {
    name = "volume";
  } else if (name.ends_with(kEnd) && !std::filesystem::exists(name)) {
    name.resize(name.size() - kEnd.size());
  } else {
    return false;
  }
  if (name != "volume" && !std::filesystem::is_regular_file(name)) return false;
  set_map(options, "labels", appearance);
  appearance.color_by_field = appearance.color_by_label = true;
  options.field = name;
  options.by_field = true;
  return true;
}

/// FILE[,LOW,HIGH] or volume[,LOW,HIGH]; false: it is neither. An axis stays one if a file has its
/// name: ./z is that file.
bool read_field(ColorMapOptions &options, isowave::Appearance &appearance) {
  const std::string first = options.by.substr(0, options.by.find(','));
  if (first == "x" || first == "y" || first == "z" || first == "depth") return false;
  std::string name = options.by;
  std::vector<double> range;
  while (range.size() < 2 && !std::filesystem::exists(name)) {
    const std::size_t comma = name.rfind(',');
    if (comma == std::string::npos) break;
    const std::optional<double> value = parse_finite(std::string_view(name).substr(comma + 1));
    if (!value) return false;
    range.insert(range.begin(), *value);
    name.resize(comma);
  }
  if ((name != "volume" && !std::filesystem::is_regular_file(name)) || range.size() == 1)
    return false;
  set_map(options, "viridis", appearance);
  appearance.color_by_field = true;
  appearance.color_caps_alone = name == "volume";  // a surface has one value of its own volume
  options.field = name;
  options.by_field = true;
  if (range.empty()) return true;
  appearance.color_low = range[0];
  appearance.color_high = range[1];
  check_color_by_field({.low = range[0], .high = range[1]});
  return true;
}

}  // namespace

void read_color_map(ColorMapOptions &options, isowave::Appearance &appearance) {
  if (options.by.empty() || read_labelled_field(options, appearance) ||
      read_field(options, appearance))
    return;
  const auto refuse = [&] {
    return Error(
        "--color-by {}: give x, y, z, NX,NY,NZ, depth, volume or a file, and LOW,HIGH if "
        "wanted; or labels, or a file and labels",
        options.by);
  };
  std::vector<double> numbers;
  for (const std::string_view field : split_at_commas(options.by)) {
    const std::size_t axis = std::string_view("xyz").find(field);
    if (numbers.empty() && field == "depth") {
      numbers = {0, 0, 1};
      appearance.color_by_depth = true;
    } else if (numbers.empty() && field.size() == 1 && axis != std::string_view::npos) {
      numbers.resize(3);
      numbers[axis] = 1;
    } else if (const std::optional<double> value = parse_finite(field)) {
      numbers.push_back(*value);
    } else {
      throw refuse();
    }
  }
  if (numbers.size() != 3 && numbers.size() != 5) throw refuse();
  set_map(options, "viridis", appearance);
  appearance.color_axis = {numbers[0], numbers[1], numbers[2]};
  ColorByAxis by{.axis = {numbers[0], numbers[1], numbers[2]}};
  if (numbers.size() == 5) {
    appearance.color_low = by.low = numbers[3];
    appearance.color_high = by.high = numbers[4];
  }
  check_color_by(by);
}

std::vector<isowave::Surface> read_surfaces(const std::vector<std::string> &texts) {
  std::vector<isowave::Surface> surfaces;
  std::vector<SurfaceStyle> styles;
  for (const std::string &text : texts) {
    surfaces.push_back(parse_surface(text, surfaces.size()));
    styles.push_back(core_style(surfaces.back()));
    styles.back().isovalue = static_cast<float>(surfaces.back().isovalue);
  }
  check_surfaces(styles);
  return surfaces;
}

void add_surface_option(CLI::App &command, std::vector<std::string> &texts) {
  command
      .add_option("--surface", texts,
                  "isovalue of a surface, its colour, and its opacity, above 0 to 1; repeat it for "
                  "up to 8 surfaces in one picture, seen through each other: --surface "
                  "500,skin,0.3 --surface 1150,bone. Colours: #RRGGBB, " +
                      color_names() +
                      " [a colour unlike the others'; opacity 1]. whole: clipping planes do not "
                      "cut it; own: --color-by leaves it its own colour")
      ->type_name("VALUE[,COLOR[,OPACITY[,whole][,own]]]")
      ->allow_extra_args(false);
}

nlohmann::ordered_json surfaces_json(const std::vector<isowave::Surface> &surfaces) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const isowave::Surface &surface : surfaces) {
    nlohmann::ordered_json &entry = json.emplace_back();
    for_each_surface_field(surface,
                           [&](const char *name, const auto &field) { entry[name] = field; });
    entry.erase(surface.labels.empty() ? "labels" : "isovalue");
  }
  return json;
}

}  // namespace isowave::core::tools
