// Light that ambient rays bring (bounce.cl): rays towards the light, what they bring, and a step of
// the filter. All hits of a frame.

#include <algorithm>
#include <utility>
#include <vector>

#include "bench/rays_rig.hpp"
#include "core/stages/ambient.hpp"
#include "core/stages/bounce.hpp"
#include "kernels_cl/portable/bounce.h"

namespace isowave::core::bench {
namespace {

struct BounceInput : RaysRig {
  BounceInput(ocl::Device &device, std::int64_t width)
      : RaysRig(device, width),
        ambient(device, rays.num_rays),
        bounce(device, rays.num_rays),
        nothing_met(device, "no hits", rays.num_rays) {
    rays.given = {device, "given rays", rays.num_rays};
    rays.given_hits = {device, "hits of given rays", rays.num_rays};
    rays.open_counts = {device, "open ambient rays", 2 * rays.num_rays};
    rays.bounced = {device, "bounced light", rays.num_rays};
    rays.bounced_next = {device, "bounced light, next", rays.num_rays};
    nothing_met.write(std::vector<HitRecord>(rays.num_rays, no_hit()));
    VolumeInfo info;
    info.dims = {params.grid.dims_x, params.grid.dims_y, params.grid.dims_z};
    const LightRays light{.num_ambient = 1, .light = {0.6, 0, 0.8}, .bounces = true};
    ambient.begin(info, 0, light);
    bounce.begin(info, 0, light);
    start_to_light();
    bounce.add(rays, 0);
    num_lit = std::ranges::count_if(rays.bounced.read(), [](float sum) { return sum > 0; });
    check(num_lit > 0, "rays that get light");
  }

  /// A round of ambient rays. Each has met the surface that it began at.
  void start_round() {
    ambient(rays, 0);
    rays.given_hits.copy(rays.hits, rays.num_rays);
  }
  /// Rays towards the light, which have met nothing.
  void start_to_light() {
    start_round();
    bounce.go_to_light(rays, 0);
    rays.given_hits.copy(nothing_met, rays.num_rays);
  }

  Ambient ambient;
  Bounce bounce;
  ocl::Buffer<HitRecord> nothing_met;
  std::int64_t num_lit = 0;
};

void go_to_light(benchmark::State &state) {
  auto &in = input<BounceInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits);
  measure(
      state, {hits, hits * (sizeof(HitRecord) + 2 * sizeof(GivenRay) + sizeof(float))},
      [&] { in.start_round(); }, [&] { in.bounce.go_to_light(in.rays, 0); });
  state.counters["hits"] = hits;
}

void add(benchmark::State &state) {
  auto &in = input<BounceInput>(state.range(0));
  const auto lit = static_cast<double>(in.num_lit);
  measure(
      state, {lit, lit * (2 * sizeof(GivenRay) + 3 * sizeof(float))}, [&] { in.start_to_light(); },
      [&] { in.bounce.add(in.rays, 0); });
  state.counters["lit"] = lit;
}

/// All steps. Each reads nine places and their light.
void filter(benchmark::State &state) {
  auto &in = input<BounceInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits);
  measure(
      state,
      {hits, hits * ISO_BOUNCE_STEPS * (9 * (sizeof(GivenRay) + sizeof(float)) + sizeof(float))},
      [] {}, [&] { in.bounce.filter(in.rays); });
  state.counters["hits"] = hits;
}

using Case = std::pair<const char *, void (*)(benchmark::State &)>;

const bool kRegistered = [] {
  for (const auto &[name, function] : {Case{"bounce/go_to_light", go_to_light},
                                       Case{"bounce/add", add}, Case{"bounce/filter", filter}})
    stage_benchmark(name, function)
        ->ArgName("width")
        ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
