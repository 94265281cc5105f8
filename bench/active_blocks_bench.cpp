// The list of the blocks of a surface: active_blocks.cl, and the wait for how many there are.

#include "bench/surface_rig.hpp"

namespace isowave::core::bench {
namespace {

void active_blocks(benchmark::State &state) {
  auto &in = input<SurfaceRig>(state.range(0), Gradients::kNone);
  const double cells = static_cast<double>(num_macrocells(in.frame.grid));
  measure(
      state, {cells, 32 * cells + 4.0 * in.num_listed}, [] {},
      [&] {
        in.listed.count(in.frame, in.blocks.levels[0].macrocells.masks());
        in.listed.list(in.frame, in.surface->block_ids);
      });
  state.counters["listed"] = in.num_listed;
}

const bool kRegistered = [] {
  stage_benchmark("active_blocks", active_blocks)
      ->ArgName("edge")
      ->ArgsProduct({{kSurfaceEdges.begin(), kSurfaceEdges.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
