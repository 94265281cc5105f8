// Rays -> their next N_Spec blocks: traverse.cl. The first pass of a frame, with as many rays as
// give each N_Spec; each with as many places, or with as many as it fills.

#include "bench/frame_rig.hpp"
#include "bench/scenes.hpp"

namespace isowave::core::bench {
namespace {

FrameSetup setup_of(std::int64_t width, std::int64_t edge, std::int64_t spec_count,
                    std::int64_t scanned_pairs) {
  FrameSetup setup =
      mixing_layer_setup(edge, image_of_width(width), static_cast<std::uint32_t>(spec_count));
  setup.scanned_pairs = scanned_pairs != 0;
  return setup;
}

struct TraverseInput : FrameRig {
  TraverseInput(ocl::Device &device, std::int64_t width, std::int64_t edge, std::int64_t spec_count,
                std::int64_t scanned_pairs)
      : FrameRig(device, mixing_layer(edge), setup_of(width, edge, spec_count, scanned_pairs)) {
    start();
    thin_wavefront(params.schedule.max_spec_count);
    begin_pass();
    before.emplace(rays);
    traverse(macrocells, rays);
    verify();
  }

  /// Every block found is one that the isovalue is in the range of; those of a ray come without
  /// gaps.
  void verify() {
    counts = read_counts();
    const std::vector<uint> masks = macrocells.masks().read();
    std::vector<uint> block_ids(counts.pair_slot_count);
    rays.pair_block_ids.read(block_ids);
    check(counts.spec_count == params.schedule.max_spec_count && counts.active_count > 0, "N_Spec");
    const uint coarse_x = (params.grid.blocks_x + 3) / 4, coarse_y = (params.grid.blocks_y + 3) / 4;
    uint num_pairs = 0;
    for (std::size_t pair = 0; pair < block_ids.size(); ++pair) {
      if (block_ids[pair] == ISO_INVALID_ID) continue;
      ++num_pairs;
      check(params.schedule.scanned_pairs || pair % counts.spec_count == 0 ||
                block_ids[pair - 1] != ISO_INVALID_ID,
            "order of a ray's blocks");
      const uint x = block_ids[pair] % params.grid.blocks_x,
                 y = block_ids[pair] / params.grid.blocks_x % params.grid.blocks_y,
                 z = block_ids[pair] / params.grid.blocks_x / params.grid.blocks_y;
      const std::size_t cell = x / 4 + coarse_x * (y / 4 + std::size_t{coarse_y} * (z / 4));
      const uint bit = x % 4 + 4 * (y % 4) + 16 * (z % 4);
      check((masks[2 * cell + bit / 32] >> (bit % 32) & 1u) == 1u, "block without the isovalue");
    }
    check(num_pairs == counts.pair_count, "number of ray-block pairs");
  }

  std::optional<WavefrontSnapshot> before;
  PassCounts counts{};
};

void find_blocks(benchmark::State &state) {
  auto &in = input<TraverseInput>(state.range(0), state.range(1), state.range(2), state.range(3));
  const double bytes = 12.0 * in.counts.active_count + 4.0 * in.counts.pair_slot_count;
  measure(
      state, {double(in.counts.active_count), bytes}, [&] { in.before->restore(); },
      [&] { in.traverse(in.macrocells, in.rays); });
  state.counters["pairs"] = in.counts.pair_count;
}

const bool kRegistered = [] {
  stage_benchmark("traverse", find_blocks)
      ->ArgNames({"width", "edge", "n_spec", "scanned"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {128, 256}, {1, 8, 64}, {0, 1}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
