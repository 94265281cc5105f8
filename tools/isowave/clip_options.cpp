#include "tools/isowave/clip_options.hpp"

#include <fmt/format.h>

#include <cmath>
#include <glm/glm.hpp>
#include <limits>
#include <optional>
#include <string_view>

#include "core/base/error.hpp"
#include "core/view/clip.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

/// The numbers between commas; none for a field that is empty. Throws Error if a field is no
/// number.
std::vector<std::optional<double>> parse_list(const char *option, std::string_view text) {
  std::vector<std::optional<double>> numbers;
  for (const std::string_view field : split_at_commas(text)) {
    numbers.push_back(parse_finite(field));
    if (!field.empty() && !numbers.back())
      throw Error("{} {}: '{}' is no finite number", option, text, field);
  }
  return numbers;
}

std::vector<ClipPlane> parse_box(const std::string &text) {
  const std::vector<std::optional<double>> sides = parse_list("--clip-box", text);
  if (sides.size() != 6) throw Error("--clip-box {}: give X0,X1,Y0,Y1,Z0,Z1", text);
  glm::dvec3 begin, end;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    constexpr double kOpen = std::numeric_limits<double>::infinity();
    const auto i = static_cast<glm::length_t>(axis);
    begin[i] = sides[2 * axis].value_or(-kOpen);
    end[i] = sides[2 * axis + 1].value_or(kOpen);
  }
  std::vector<ClipPlane> planes;
  for (const ClipPlane &plane : box_planes(begin, end)) {
    if (std::isfinite(plane.offset)) planes.push_back(plane);
  }
  if (planes.empty()) throw Error("--clip-box {}: give at least one of its sides", text);
  return planes;
}

}  // namespace

ClipPlane parse_plane(const char *option, const std::string &text, const VolumeInfo &info) {
  std::string list = text;
  const std::size_t axis = std::string_view("xyz").find(text.substr(0, text.find(',')));
  if (axis != std::string_view::npos && text.find(',') != 0)
    list.replace(0, 1, axis == 0 ? "1,0,0" : axis == 1 ? "0,1,0" : "0,0,1");
  const std::vector<std::optional<double>> numbers = parse_list(option, list);
  if (numbers.size() < 3 || numbers.size() > 4 || !numbers[0] || !numbers[1] || !numbers[2] ||
      !numbers.back())
    throw Error("{} {}: give NX,NY,NZ or NX,NY,NZ,D", option, text);
  const glm::dvec3 normal(*numbers[0], *numbers[1], *numbers[2]);
  check_plane({normal, 0}, fmt::format("{} {}: the plane", option, text));
  const glm::dvec3 direction = glm::normalize(normal);
  if (numbers.size() == 4) return {direction, *numbers[3]};
  const glm::dvec3 middle =
      info.origin + info.index_to_world() * (0.5 * (glm::dvec3(info.dims) - 1.0));
  return {direction, glm::dot(direction, middle)};
}

Clip read_clip(const ClipOptions &options, const VolumeInfo &info) {
  Clip clip{.caps = !options.no_caps};
  for (const std::string &text : options.planes)
    clip.planes.push_back(parse_plane("--clip", text, info));
  if (!options.box.empty()) {
    const std::vector<ClipPlane> sides = parse_box(options.box);
    clip.planes.insert(clip.planes.end(), sides.begin(), sides.end());
  }
  if (options.no_caps && clip.planes.empty())
    throw Error("--no-caps: nothing is cut: give --clip or --clip-box");
  check_clip(clip);
  return clip;
}

void add_clip_options(CLI::App &command, ClipOptions &options) {
  command
      .add_option("--clip", options.planes,
                  "clipping plane: draws what lies in front of it, towards an axis or the "
                  "direction NX,NY,NZ. D: the plane's distance from the world's origin along that "
                  "direction [world "
                  "units]; without D, it goes through the middle of the volume; repeat it for more "
                  "planes")
      ->type_name("x|y|z|NX,NY,NZ[,D]")
      ->allow_extra_args(false);
  command
      .add_option("--clip-box", options.box,
                  "draws what lies in this box, with edges along the world's axes [world units]; "
                  "an empty number leaves that side open: ,,,,20,30")
      ->type_name("X0,X1,Y0,Y1,Z0,Z1");
  command.add_flag(
      "--no-caps", options.no_caps,
      "leave cuts open, which shows the surface from within; otherwise flat caps close "
      "them where values are above the isovalue");
}

}  // namespace isowave::core::tools
