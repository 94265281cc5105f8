#include "tools/isowave/view_options.hpp"

#include <array>
#include <map>
#include <vector>

#include "core/base/error.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

constexpr std::array<std::pair<const char *, Side>, 7> kSides{{{"front", Side::kFront},
                                                               {"back", Side::kBack},
                                                               {"left", Side::kLeft},
                                                               {"right", Side::kRight},
                                                               {"top", Side::kTop},
                                                               {"bottom", Side::kBottom},
                                                               {"iso", Side::kIso}}};

std::vector<std::string> names_of_sides() {
  std::vector<std::string> names;
  names.reserve(kSides.size());
  for (const auto &[name, side] : kSides) names.emplace_back(name);
  return names;
}

/// "x", "-z", or "0,0,1".
glm::dvec3 parse_up(const std::string &text) {
  constexpr std::string_view kAxes = "xyz";
  const bool is_negative = text.starts_with('-');
  const std::string_view name = std::string_view(text).substr(is_negative ? 1 : 0);
  glm::dvec3 up(0.0);
  if (name.size() == 1 && kAxes.find(name) != kAxes.npos) {
    up[static_cast<int>(kAxes.find(name))] = is_negative ? -1 : 1;
    return up;
  }
  const std::vector<std::string_view> fields = split_at_commas(text);
  if (fields.size() != 3) throw Error("--up {}: give x, y, z, -x, -y, -z, or X,Y,Z", text);
  for (int axis = 0; axis < 3; ++axis) {
    const std::optional<double> value = parse_finite(fields[static_cast<std::size_t>(axis)]);
    if (!value) throw Error("--up {}: give x, y, z, -x, -y, -z, or X,Y,Z", text);
    up[axis] = *value;
  }
  return orientation_of({}, up).up;
}

}  // namespace

void add_side_options(CLI::App &command, ViewOptions &options) {
  command
      .add_option("--view", options.side,
                  "side from which the volume is seen. In a patient's space (NIfTI, NRRD, "
                  "MetaImage) front is anterior, left and right are the patient's own, and top is "
                  "superior; else front is +z, right +x, and top +y. iso is from the front right "
                  "and above, where all edges look equally long [from the front right, and a bit "
                  "above]")
      ->check(CLI::IsMember(names_of_sides()));
  command
      .add_option("--up", options.up,
                  "direction of the world that is up: x, y, z, -x, -y, -z, or X,Y,Z; the sides "
                  "turn with it [superior in a patient's space, else y]")
      ->type_name("DIRECTION");
  command
      .add_option("--zoom", options.zoom,
                  "magnifies pictures about their middle, 0.01 to 1000; the eye stays")
      ->capture_default_str();
}

void add_view_options(CLI::App &command, ViewOptions &options) {
  add_side_options(command, options);
  command
      .add_option("--fit", options.fit,
                  "what fills the picture. box: the volume's box, the same for all steps of a "
                  "series, and for all compressions of a volume. surface: the blocks of voxels "
                  "that the surfaces may be in")
      ->check(CLI::IsMember({"box", "surface"}))
      ->capture_default_str();
  command.add_option("--save-camera", options.save,
                     "writes the cameras of the pictures as a file for --cameras");
}

std::optional<glm::dvec3> up_of(const ViewOptions &options) {
  if (options.up.empty()) return std::nullopt;
  return parse_up(options.up);
}

Viewpoint viewpoint_of(const ViewOptions &options, std::uint32_t num_views) {
  Viewpoint from{.up = up_of(options), .num_views = num_views};
  for (const auto &[name, side] : kSides) {
    if (options.side == name) from.side = side;
  }
  return from;
}

bool chooses_view(const CLI::App &command) {
  return command.count("--view") + command.count("--up") + command.count("--fit") > 0;
}

void check_view_options(const CLI::App &command, const ViewOptions &options, bool from_file) {
  if (command.count("--orbit") > 0)
    refuse_options(command, {"--view", "--fit"},
                   "--orbit stands on a circle around the volume: use --turntable");
  if (from_file)
    refuse_options(command, {"--view", "--up", "--fit"},
                   "--cameras says from where: leave out either");
  up_of(options);
  zoomed({}, options.zoom);  // or throws
}

}  // namespace isowave::core::tools
