#include "tools/isowave/compare_volumes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <vector>

#include "core/api/frame_parts.hpp"
#include "core/base/error.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

constexpr std::uint64_t kVoxelsAtOnce = 1u << 24;

using SharedVolume = std::shared_ptr<const isowave::Volume>;

/// Adds layers of voxels; `rms` is the sum of squares so far.
void add_layers(const std::vector<float> &a, const std::vector<float> &b, VoxelComparison &sum) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    const bool in_a = !std::isnan(a[i]), in_b = !std::isnan(b[i]);
    if (!in_a && !in_b) continue;
    if (std::bit_cast<std::uint32_t>(a[i]) != std::bit_cast<std::uint32_t>(b[i]))
      ++sum.num_differing;
    if (in_a != in_b) {
      ++sum.without_data_in_one;
      continue;
    }
    ++sum.with_data_in_both;
    const double difference = std::abs(double(a[i]) - double(b[i]));
    sum.max = std::max(sum.max, difference);
    sum.rms += difference * difference;
  }
}

VoxelComparison compare_voxels(const isowave::Volume &a, const isowave::Volume &b) {
  const auto [nx, ny, nz] = a.grid().dims;
  VoxelComparison result{.num_voxels = std::uint64_t{nx} * ny * nz};
  // Whole layers of blocks, so that none is decoded twice.
  const std::uint64_t fit = kVoxelsAtOnce / (std::uint64_t{nx} * ny);
  const auto layers = static_cast<std::uint32_t>(std::max<std::uint64_t>(4, fit / 4 * 4));
  for (std::uint32_t begin = 0; begin < nz; begin += layers) {
    const isowave::Region region{{0, 0, begin}, {nx, ny, std::min(nz, begin + layers)}};
    add_layers(a.decode(0, region), b.decode(0, region), result);
  }
  if (result.rms != 0) result.rms = std::sqrt(result.rms / double(result.with_data_in_both));
  return result;
}

double isovalue_of(const isowave::Volume &volume, const CompareVolumesOptions &options) {
  if (options.isovalue) return *options.isovalue;
  const std::vector<double> suggested = volume.suggested_isovalues();
  if (suggested.empty()) throw Error("A suggests no isovalue: give --isovalue");
  return suggested.front();
}

isowave::Camera camera_for(const isowave::Volume &volume, const CompareVolumesOptions &options) {
  const ImageSize &size = options.size;
  if (!options.cameras.empty())
    return public_camera(
        zoomed(read_camera_file(options.cameras).cameras.front(), options.view.zoom));
  const Viewpoint from = viewpoint_of(options.view, 1);
  const auto up =
      from.up ? std::optional(isowave::Vector3{from.up->x, from.up->y, from.up->z}) : std::nullopt;
  return isowave::box_camera(volume.grid(),
                             {static_cast<isowave::Side>(from.side), up, options.view.zoom},
                             {size.width, size.height});
}

void draw(const SharedVolume &volume, const ComparedVolumes &compared, const ImageSize &size,
          FloatImage &depth, Image8 &picture) {
  if (const std::string notice = volume->isovalue_notice(compared.isovalue); !notice.empty())
    warn(notice);
  isowave::Renderer renderer = isowave::make_host_renderer(volume);
  const isowave::Frame frame = renderer.render({.camera = compared.camera,
                                                .isovalue = compared.isovalue,
                                                .size = {size.width, size.height},
                                                .want_picture = true,
                                                .want_depth = true});
  depth = {frame.columns, frame.rows, frame.depth.to_vector()};
  picture = {size.width, size.height, 3, frame.picture.to_vector()};
}

}  // namespace

ComparedVolumes compare_volumes(const std::filesystem::path &path_a,
                                const std::filesystem::path &path_b,
                                const CompareVolumesOptions &options) {
  const isowave::RawFile chosen{.step = parse_index("--index", options.index)};
  const SharedVolume a = isowave::open_volume(path_a, {}, chosen);
  const SharedVolume b = isowave::open_volume(path_b, {}, chosen);
  for (const SharedVolume &volume : {a, b}) {
    for (const std::string &notice : volume->notices()) warn(notice);
  }
  ComparedVolumes compared;
  if (a->grid().dims == b->grid().dims) compared.voxels = compare_voxels(*a, *b);
  compared.isovalue = isovalue_of(*a, options);
  compared.camera = camera_for(*a, options);
  draw(a, compared, options.size, compared.depth_a, compared.picture_a);
  draw(b, compared, options.size, compared.depth_b, compared.picture_b);
  return compared;
}

}  // namespace isowave::core::tools
