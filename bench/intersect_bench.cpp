// A block's rays against its dual grid: intersect.cl, from 1 to 1000 rays per block. A camera looks
// straight at a slab of blocks that all hold the surface; its field of view says how many of them
// share the rays.

#include <cmath>
#include <numbers>

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::uint32_t kBlocksX = 640, kBlocksY = 360;

const CompressedVolume &slab() {
  static const CompressedVolume kVolume = wavy_slab(kBlocksX, kBlocksY);
  return kVolume;
}

const std::vector<float> &slab_voxels() {
  static const std::vector<float> kVoxels = decode_with_libzfp(slab());
  return kVoxels;
}

/// Far away, so that the rays are nearly parallel.
FrameSetup slab_setup(std::int64_t width, std::int64_t rays_per_block) {
  constexpr double kDistance = 4096, kMargin = 0.98;
  FrameSetup setup;
  setup.size = image_of_width(width);
  const double rays_per_side = std::sqrt(static_cast<double>(rays_per_block));
  const double height =
      kMargin * 4 * setup.size.height / rays_per_side;  // seen of the slab [voxels]
  const glm::dvec3 centre(2.0 * kBlocksX, 2.0 * kBlocksY, 2.0);
  setup.camera = {centre - glm::dvec3(0, 0, kDistance),
                  centre,
                  {0, 1, 0},
                  360 / std::numbers::pi * std::atan(height / 2 / kDistance)};
  setup.isovalue = 0.0f;
  return setup;
}

struct IntersectInput : FrameRig {
  IntersectInput(ocl::Device &device, std::int64_t width, std::int64_t rays_per_block)
      : FrameRig(device, slab(), slab_setup(width, rays_per_block)) {
    start();
    begin_pass();
    find_blocks();
    run();
    verify();
  }
  void run() { intersect(cache, group.groups(), rays); }

  /// The cells that the twin hits, by the same rays.
  void verify() {
    counts = read_counts();
    const std::vector<HitRecord> expected = render_scalar(params, slab_voxels());
    std::vector<uint> active(counts.active_count), block_ids(counts.pair_slot_count);
    std::vector<PairHit> got(counts.pair_slot_count);
    rays.active_ray_ids.read(active);
    rays.pair_block_ids.read(block_ids);
    rays.pair_hits.read(got);
    std::size_t num_hits = 0;
    for (std::size_t pair = 0; pair < got.size(); ++pair) {
      const HitRecord &hit = expected[active[pair]];
      if (got[pair].cell >= ISO_NO_HIT) continue;
      ++num_hits;
      check(hit.block_id == block_ids[pair] && hit.cell == got[pair].cell, "cell that a ray hits");
    }
    check(num_hits > active.size() / 10 * 9, "number of rays that hit");
  }

  PassCounts counts{};
};

void intersect_blocks(benchmark::State &state) {
  auto &in = input<IntersectInput>(state.range(0), state.range(1));
  const double pairs = in.counts.granted_count, blocks = in.counts.visible_count;
  const double bytes =
      pairs * (8 + sizeof(PairHit)) + blocks * (ISO_DUAL_GRID_VERTICES * sizeof(float) + 12);
  measure(
      state, {pairs, bytes}, [] {}, [&] { in.run(); });
  state.counters["rays/block"] = pairs / blocks;
}

const bool kRegistered = [] {
  stage_benchmark("intersect", intersect_blocks)
      ->ArgNames({"width", "rays_per_block"})
      ->ArgsProduct({{640}, {1, 4, 16, 100, 1000}})
      ->ArgsProduct({{1280}, {16, 1000}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
