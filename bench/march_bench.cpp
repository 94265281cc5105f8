// Rays -> hits, or the blocks that they wait at: march.cl. The first pass of a frame, all blocks
// cached, where every ray hits or leaves; and none cached, where all wait.

#include "bench/rays_rig.hpp"

namespace isowave::core::bench {
namespace {

struct MarchInput : RaysRig {
  MarchInput(ocl::Device &device, std::int64_t width, bool cached) : RaysRig(device, width) {
    if (!cached) cache.clear();
    start_first_pass();
    march(macrocells, cache, rays);
    const PassCounts counts = read_counts();
    check(counts.hit_count == (cached ? num_hits : 0), "hits of the frame drawn again");
    check(counts.next_active_count == (cached ? 0 : num_started), "rays that wait");
  }
};

void march_rays(benchmark::State &state) {
  auto &in = input<MarchInput>(state.range(0), state.range(1) != 0);
  const double written = state.range(1) != 0 ? double(in.num_hits) * sizeof(HitRecord)
                                             : 2.0 * sizeof(uint) * in.num_started;
  measure(
      state, {double(in.num_started), written + 2.0 * sizeof(uint) * in.num_started},
      [&] { in.start_first_pass(); }, [&] { in.march(in.macrocells, in.cache, in.rays); });
  state.counters["hits"] = state.range(1) != 0 ? double(in.num_hits) : 0;
}

const bool kRegistered = [] {
  stage_benchmark("march", march_rays)
      ->ArgNames({"width", "cached"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {0, 1}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
