#include "core/bricks/surface_work.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "core/base/parallel_for.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/zfp/block_decoder.hpp"

namespace isowave::core {

namespace {

glm::ivec3 cubes_along(const glm::ivec3 &blocks) {
  return (blocks + (kWorkUnit - 1)) / kWorkUnit;
}

bool touches(std::span<const float> voxels, std::span<const float> isovalues) {
  float least = std::numeric_limits<float>::infinity(), most = -least;
  for (const float voxel : voxels) {  // NaN of those without data changes nothing
    least = voxel < least ? voxel : least;
    most = voxel > most ? voxel : most;
  }
  return std::ranges::any_of(isovalues,
                             [&](float isovalue) { return least < isovalue && isovalue <= most; });
}

}  // namespace

std::vector<std::uint32_t> count_touched(const CompressedVolume &brick,
                                         std::span<const float> isovalues) {
  const glm::ivec3 kept = blocks_along(brick.info), begin(brick.info.brick.before),
                   end = kept - glm::ivec3(brick.info.brick.behind),
                   cubes = cubes_along(end - begin);
  const std::size_t layer = std::size_t(cubes.x) * std::size_t(cubes.y);
  std::vector<std::uint32_t> counts(layer * std::size_t(cubes.z));
  parallel_for(static_cast<std::uint32_t>(cubes.z), 0, [&](std::uint32_t cube_z, std::uint32_t) {
    BlockDecoder decoder(brick);
    std::array<float, ISO_BLOCK_VOXELS> voxels{};
    const int first_z = begin.z + kWorkUnit * static_cast<int>(cube_z);
    for (int z = first_z; z < std::min(first_z + kWorkUnit, end.z); ++z) {
      for (int y = begin.y; y < end.y; ++y) {
        const std::uint64_t row =
            std::uint64_t(kept.x) * (std::uint64_t(y) + std::uint64_t(kept.y) * std::uint64_t(z));
        for (int x = begin.x; x < end.x; ++x) {
          decoder.decode(row + std::uint64_t(x), voxels);
          counts[layer * cube_z + std::size_t((y - begin.y) / kWorkUnit * cubes.x) +
                 std::size_t((x - begin.x) / kWorkUnit)] += touches(voxels, isovalues) ? 1 : 0;
        }
      }
    }
  });
  return counts;
}

SurfaceWork::SurfaceWork(const glm::ivec3 &blocks, std::span<const std::uint32_t> counts)
    : cubes_(cubes_along(blocks)) {
  const glm::ivec3 n = cubes_ + 1;
  sums_.resize(std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z));
  auto count = counts.begin();
  for (int z = 1; z < n.z; ++z) {
    for (int y = 1; y < n.y; ++y) {
      std::uint64_t row = 0;
      for (int x = 1; x < n.x; ++x) {
        row += *count++;
        sums_[std::size_t(x) +
              std::size_t(n.x) * (std::size_t(y) + std::size_t(n.y) * std::size_t(z))] =
            row + before({x, y - 1, z}) + before({x, y, z - 1}) - before({x, y - 1, z - 1});
      }
    }
  }
}

std::uint64_t SurfaceWork::before(const glm::ivec3 &cube) const {
  const glm::u64vec3 at(cube), n(cubes_ + 1);
  return sums_[at.x + n.x * (at.y + n.y * at.z)];
}

std::uint64_t SurfaceWork::operator()(const BlockBox &box) const {
  const glm::ivec3 begin = cubes_along(box.begin), end = cubes_along(box.end);
  std::uint64_t sum = 0;  // wraps around on the way
  for (int corner = 0; corner < 8; ++corner) {
    const glm::ivec3 at(corner & 1 ? begin.x : end.x, corner & 2 ? begin.y : end.y,
                        corner & 4 ? begin.z : end.z);
    const bool is_odd = ((corner ^ corner >> 1 ^ corner >> 2) & 1) != 0;
    sum += is_odd ? -before(at) : before(at);
  }
  return sum;
}

}  // namespace isowave::core
