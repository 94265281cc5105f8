#include "tools/isowave/slice_options.hpp"

#include <glm/glm.hpp>
#include <optional>
#include <string_view>

#include "core/api/convert.hpp"
#include "core/base/error.hpp"
#include "core/view/clip.hpp"
#include "tools/isowave/clip_options.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

std::vector<isowave::Slice> read_slices(const SliceOptions &options, const VolumeInfo &info,
                                        isowave::Appearance &appearance) {
  std::vector<isowave::Slice> slices;
  for (const std::string &text : options.planes) {
    const ClipPlane plane = parse_plane("--slice", text, info);
    slices.push_back({.normal = from_glm(plane.normal),
                      .offset = plane.offset,
                      .opacity = static_cast<float>(options.opacity)});
  }
  appearance.slice_map = options.map;
  if (options.range.empty()) return slices;
  const std::vector<std::string_view> fields = split_at_commas(options.range);
  std::vector<double> ends;
  for (const std::string_view field : fields) {
    if (const std::optional<double> value = parse_finite(field)) ends.push_back(*value);
  }
  if (fields.size() != 2 || ends.size() != 2 || ends[0] == ends[1])
    throw Error("--slice-range {}: give LOW,HIGH, two numbers that differ", options.range);
  appearance.slice_low = ends[0];
  appearance.slice_high = ends[1];
  return slices;
}

void add_slice_options(CLI::App &command, SliceOptions &options) {
  CLI::Option *slice =
      command
          .add_option("--slice", options.planes,
                      "plane that shows the voxels, beside surfaces. Its normal is an axis or a "
                      "direction. D: the plane's distance from the world's origin along it [world "
                      "units]; without D, it goes through the middle of the volume; repeat it for "
                      "more slices, up to 8 with the surfaces")
          ->type_name("x|y|z|NX,NY,NZ[,D]")
          ->allow_extra_args(false);
  command.add_option("--slice-opacity", options.opacity, "opacity of slices, above 0 to 1")
      ->check(CLI::Range(0.001, 1.0))
      ->needs(slice)
      ->capture_default_str();
  command.add_option("--slice-map", options.map, "colour map of slices")
      ->check(CLI::IsMember(isowave::color_map_names()))
      ->needs(slice)
      ->capture_default_str();
  command
      .add_option("--slice-range", options.range,
                  "voxel values of the first and the last colour of slices [the volume's]")
      ->type_name("LOW,HIGH")
      ->needs(slice);
}

nlohmann::ordered_json slices_json(const std::vector<isowave::Slice> &slices) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const isowave::Slice &slice : slices)
    for_each_slice_field(slice, [&, &entry = json.emplace_back()](
                                    const char *name, const auto &field) { entry[name] = field; });
  return json;
}

}  // namespace isowave::core::tools
