// Camera -> the pixels whose rays meet an active block: start_rays.cl.

#include <cmath>

#include "bench/rays_rig.hpp"

namespace isowave::core::bench {
namespace {

struct StartRaysInput : RaysRig {
  StartRaysInput(ocl::Device &device, std::int64_t width) : RaysRig(device, width) {
    start_frame();
    check(read_counts().next_active_count == num_started, "rays of the frame begun again");
    for (const HitRecord &hit : rays.hits.read()) check(std::isinf(hit.t), "hits before any");
  }
};

void start_frame(benchmark::State &state) {
  auto &in = input<StartRaysInput>(state.range(0));
  const auto pixels = static_cast<double>(in.rays.num_rays);
  measure(
      state, {pixels, pixels * sizeof(HitRecord) + 2.0 * sizeof(uint) * in.num_started},
      [&] { in.rays.forget_rays(); }, [&] { in.start_rays(in.macrocells, in.rays); });
  state.counters["active_rays"] = in.num_started;
}

const bool kRegistered = [] {
  stage_benchmark("start_rays", start_frame)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
