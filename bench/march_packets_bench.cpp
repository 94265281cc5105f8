// Camera -> hits, or the blocks that rays wait at, eight rays at a time: march_packets.cl. The
// first pass of a frame, all blocks cached, where every ray hits or leaves; and none cached, where
// all wait. march and start_rays do the same ray by ray.

#include "core/stages/march_packets.hpp"

#include "bench/rays_rig.hpp"

namespace isowave::core::bench {
namespace {

struct MarchPacketsInput : RaysRig {
  MarchPacketsInput(ocl::Device &device, std::int64_t width, bool cached)
      : RaysRig(device, width), march_packets(device, rays.num_rays, kDefaultSolver) {
    if (!cached) cache.clear();
    begin();
    march_packets(macrocells, stream, cache, rays);
    const PassCounts counts = read_counts();
    check(counts.active_count == num_started, "rays of the frame begun again");
    check(counts.hit_count == (cached ? num_hits : 0), "hits of the frame drawn again");
    check(counts.next_active_count == (cached ? 0 : num_started), "rays that wait");
  }

  void begin() {
    rays.forget_rays();
    march_packets.begin_frame();
    rays.open_pass();
  }

  MarchPackets march_packets;
};

void march_packets(benchmark::State &state) {
  auto &in = input<MarchPacketsInput>(state.range(0), state.range(1) != 0);
  const auto pixels = static_cast<double>(in.rays.num_rays);
  const double waiting = state.range(1) != 0 ? 0.0 : in.num_started;
  measure(
      state, {pixels, pixels * sizeof(HitRecord) + 2.0 * sizeof(uint) * waiting},
      [&] { in.begin(); }, [&] { in.march_packets(in.macrocells, in.stream, in.cache, in.rays); });
  state.counters["hits"] = state.range(1) != 0 ? double(in.num_hits) : 0;
}

const bool kRegistered = [] {
  stage_benchmark("march_packets", march_packets)
      ->ArgNames({"width", "cached"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {0, 1}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
