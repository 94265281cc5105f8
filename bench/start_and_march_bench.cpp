// Camera -> hits, all blocks cached: start_and_march.cl. What start_rays and march do one after the
// other.

#include "core/stages/start_and_march.hpp"

#include "bench/rays_rig.hpp"

namespace isowave::core::bench {
namespace {

struct StartAndMarchInput : RaysRig {
  StartAndMarchInput(ocl::Device &device, std::int64_t width)
      : RaysRig(device, width), start_and_march(device, rays.num_rays, kGroupSize, kDefaultSolver) {
    open_pass();
    start_and_march(macrocells, cache, rays);
    check(read_counts().hit_count == num_hits, "hits of the frame drawn again");
    check(read_counts().next_active_count == 0, "rays that wait");
  }

  void open_pass() {
    rays.forget_rays();
    rays.open_pass();
  }

  StartAndMarch start_and_march;
};

void draw_frame(benchmark::State &state) {
  auto &in = input<StartAndMarchInput>(state.range(0));
  const auto pixels = static_cast<double>(in.rays.num_rays);
  measure(
      state, {pixels, pixels * sizeof(HitRecord)}, [&] { in.open_pass(); },
      [&] { in.start_and_march(in.macrocells, in.cache, in.rays); });
  state.counters["hits"] = double(in.num_hits);
}

const bool kRegistered = [] {
  stage_benchmark("start_and_march", draw_frame)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
