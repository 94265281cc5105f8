#include "core/zfp/stated_errors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/input_file.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/voxel_region.hpp"
#include "kernels_cl/portable/block_bound.h"

namespace isowave::core {

namespace {

/// Part that errors, and their sums here, may have lost in double precision.
constexpr double kRounding = 0x1p-40;

std::string name_of(const CompressedVolume &volume) {
  return volume.file ? volume.file->what() : "the volume's file";
}

/// Layers [begin, end) of a level, the first dims.x * dims.y voxels of each.
std::vector<float> decode_layers(const CompressedVolume &level, const glm::uvec3 &dims,
                                 std::uint32_t begin, std::uint32_t end) {
  std::vector<float> voxels(std::size_t{dims.x} * dims.y * (end - begin));
  decode_region(level, {.begin = {0, 0, begin}, .end = {dims.x, dims.y, end}}, voxels);
  return voxels;
}

/// Voxels of a level that lie in the domain of the finest, along each axis. Behind it, a level's
/// values have no bound.
glm::uvec3 inner_dims(const glm::uvec3 &finest, std::size_t level) {
  return (finest - 1u) / (1u << level) + 1u;
}

}  // namespace

void check_value_range(const CompressedVolume &volume, const std::array<float, 2> &decoded) {
  const LevelError error(volume, true);
  const double least = double{volume.value_range[0]}, largest = double{volume.value_range[1]};
  if (!error.uniform || !std::isfinite(least) || !std::isfinite(largest)) return;
  const double below = double{decoded[0]}, above = double{decoded[1]};
  const double slack =
      error.largest + kRounding * (std::abs(least) + std::abs(largest) + error.largest);
  if (below >= least - slack && above <= largest + slack) return;
  throw Error(
      "{}: its trailer says that values are {} to {} and at most {} off, its blocks hold {} to {}",
      name_of(volume), least, largest, error.largest, below, above);
}

void check_stated_errors(const CompressedVolume &volume, const Progress &progress) {
  std::array<float, 2> range = {kUnknownRange[1], kUnknownRange[0]};
  double magnitude = 0;
  std::uint64_t num_missing = 0;
  for (std::size_t i = 0; i == 0 || i < volume.coarser_levels.size(); ++i) {
    const CompressedVolume &fine = i == 0 ? volume : volume.coarser_levels[i - 1];
    const CompressedVolume *const coarse =
        i < volume.coarser_levels.size() ? &volume.coarser_levels[i] : nullptr;
    const LevelError fine_error(fine, i == 0);
    const glm::uvec3 dims = inner_dims(volume.info.dims, i);
    std::optional<LevelBounds> between;
    if (coarse != nullptr && fine_error.uniform && !coarse->bounds.codes.empty())
      between.emplace(dims, coarse->info.dims, 0);
    std::uint32_t coarse_z = 0;
    for (std::uint32_t z = 0; z < dims.z && (i == 0 || between); z += kBlockEdge) {
      const std::uint32_t end = std::min(z + kBlockEdge, dims.z);
      const std::vector<float> voxels = decode_layers(fine, dims, z, end);
      if (i == 0) {
        for (const float voxel : voxels) {  // NaN of those without data changes no range
          num_missing += std::isnan(voxel) ? 1 : 0;
          range[0] = voxel < range[0] ? voxel : range[0];
          range[1] = voxel > range[1] ? voxel : range[1];
        }
        if (progress) progress(end, dims.z);
      }
      if (!between) continue;
      for (; coarse_z <= end / 2; coarse_z += kBlockEdge) {
        const std::vector<float> layers =
            decode_layers(*coarse, coarse->info.dims, coarse_z,
                          std::min(coarse_z + kBlockEdge, coarse->info.dims.z));
        between->add_coarse(layers, layers);
      }
      between->add_fine(voxels);
    }
    if (i == 0) {
      if (num_missing != volume.no_data.num_voxels()) {
        throw Error("{}: its trailer says that {} voxels have no data, its blocks hold {} NaN",
                    name_of(volume), volume.no_data.num_voxels(), num_missing);
      }
      check_value_range(volume, range);
      magnitude = double{std::max(std::abs(range[0]), std::abs(range[1]))};
    }
    if (!between) continue;
    const std::vector<float> off = between->finish({}).decoded;
    const double unit = std::ldexp(1.0, coarse->bounds.exponent);
    for (std::size_t block = 0; block < off.size(); ++block) {
      const double stated = unit * double{block_bound(coarse->bounds.codes[block])};
      const double most = stated + fine_error.largest;
      if (double{off[block]} <= most + kRounding * (magnitude + most)) continue;
      throw Error("{}: block {} of level {} is {} off from the level before, its bounds allow {}",
                  name_of(volume), block, i + 1, off[block], most);
    }
  }
}

}  // namespace isowave::core
