// Decoding boxes of voxels on the host, by all processors: voxel_region.cpp, over rates, for the
// whole volume and for slices across each axis. No device takes part.

#include <chrono>
#include <vector>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/zfp/voxel_region.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::int64_t kEdge = 256;
constexpr int kWhole = 3;  // 0 to 2: a slice across that axis

VoxelRegion region_of(int across) {
  VoxelRegion region{.end = glm::uvec3(kEdge)};
  if (across == kWhole) return region;
  region.begin[across] = kEdge / 2;
  region.end[across] = kEdge / 2 + 1;
  return region;
}

void check_decoded(const CompressedVolume &volume, const VoxelRegion &region,
                   const std::vector<float> &got) {
  const std::vector<float> whole = decode_with_libzfp(volume);
  std::vector<float> expected;
  for (std::size_t z = region.begin.z; z < region.end.z; ++z) {
    for (std::size_t y = region.begin.y; y < region.end.y; ++y) {
      for (std::size_t x = region.begin.x; x < region.end.x; ++x)
        expected.push_back(whole[x + kEdge * (y + kEdge * z)]);
    }
  }
  check(same_bits<float>(expected, got), "decoded voxels");
}

void decode_voxels(benchmark::State &state) {
  const CompressedVolume &volume = mixing_layer(kEdge, state.range(0));
  const VoxelRegion region = region_of(static_cast<int>(state.range(1)));
  const glm::u64vec3 dims(region.dims());
  std::vector<float> voxels(dims.x * dims.y * dims.z);
  decode_region(volume, region, voxels);
  check_decoded(volume, region, voxels);
  for (auto _ : state) {
    const auto begin = std::chrono::steady_clock::now();
    decode_region(volume, region, voxels);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    state.SetIterationTime(taken.count());
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(voxels.size()) * state.iterations());
}

const bool kRegistered = [] {
  stage_benchmark("voxel_region", decode_voxels)
      ->ArgNames({"rate", "across"})
      ->ArgsProduct({{4, 16}, {0, 1, 2, kWhole}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
