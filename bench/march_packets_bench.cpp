// Camera -> hits, or the blocks that rays wait at, eight rays at a time: march_packets.cl. The
// first pass of a frame, all blocks cached, where every ray hits or leaves; and none cached, where
// all wait, or decode the blocks on demand, on devices that may. march and start_rays do the same
// ray by ray.

#include "core/stages/march_packets.hpp"

#include "bench/rays_rig.hpp"

namespace isowave::core::bench {
namespace {

enum class Blocks { kMissing, kCached, kOnDemand };

struct MarchPacketsInput : RaysRig {
  MarchPacketsInput(ocl::Device &device, std::int64_t width, Blocks of)
      : RaysRig(device, width),
        blocks(of),
        march_packets(device, rays.num_rays, kDefaultSolver,
                      blocks == Blocks::kOnDemand ? &stream : nullptr) {
    if (blocks == Blocks::kMissing) cache.clear();
    begin();
    march_packets(macrocells, stream, cache, rays);
    const PassCounts counts = read_counts();
    check(counts.active_count == num_started, "rays of the frame begun again");
    if (blocks == Blocks::kOnDemand) {  // rays do not wait long for each other's blocks
      check(counts.hit_count <= num_hits && counts.hit_count + counts.next_active_count >= num_hits,
            "hits of the frame drawn again");
      return;
    }
    const bool all_wait = blocks == Blocks::kMissing;
    check(counts.hit_count == (all_wait ? 0 : num_hits), "hits of the frame drawn again");
    check(counts.next_active_count == (all_wait ? num_started : 0), "rays that wait");
  }

  void begin() {
    if (blocks == Blocks::kOnDemand) cache.clear();
    rays.forget_rays();
    march_packets.begin_frame();
    rays.open_pass();
  }

  Blocks blocks;
  MarchPackets march_packets;
};

void march_packets(benchmark::State &state) {
  const bool on_demand = Blocks(state.range(1)) == Blocks::kOnDemand;
  if (on_demand && !MarchPackets::may_decode(Session::current().device().info()))
    return state.SkipWithError("blocks are decoded on demand on PoCL alone");
  auto &in = input<MarchPacketsInput>(state.range(0), Blocks(state.range(1)));
  const auto pixels = static_cast<double>(in.rays.num_rays);
  const double waiting = in.blocks == Blocks::kMissing ? in.num_started : 0.0;
  measure(
      state, {pixels, pixels * sizeof(HitRecord) + 2.0 * sizeof(uint) * waiting},
      [&] { in.begin(); }, [&] { in.march_packets(in.macrocells, in.stream, in.cache, in.rays); });
  state.counters["hits"] = in.blocks == Blocks::kMissing ? 0.0 : double(in.num_hits);
}

const bool kRegistered = [] {
  stage_benchmark("march_packets", march_packets)
      ->ArgNames({"width", "cached"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {0, 1}});
  stage_benchmark("march_packets/on_demand", march_packets)
      ->ArgNames({"width", "cached"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {2}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
