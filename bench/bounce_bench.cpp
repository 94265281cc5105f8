// Light that ambient rays bring (bounce.cl): rays towards the light, what they bring, alone and by
// colours, the nearest surface, and a step of the filter. All hits of a frame.

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
        bounce(device, rays.num_rays, false, rays.num_rays),
        layers(device, "surfaces", 1),
        nothing_met(device, "no hits", rays.num_rays) {
    rays.given = {device, "given rays", rays.num_rays};
    rays.given_hits = {device, "hits of given rays", rays.num_rays};
    rays.open_counts = {device, "open ambient rays", 2 * rays.num_rays};
    rays.bounced = {device, "bounced light", ISO_LAYER_SUMS * rays.num_rays};
    rays.bounced_next = {device, "bounced light, next", ISO_LAYER_SUMS * rays.num_rays};
    LayerParams one_surface{};
    one_surface.surfaces[0] = {1, 0.5f, 0.25f, 1};
    one_surface.num_surfaces = 1;
    layers.write({&one_surface, 1});
    nothing_met.write(std::vector<HitRecord>(rays.num_rays, no_hit()));
    VolumeInfo info;
    info.dims = {params.grid.dims_x, params.grid.dims_y, params.grid.dims_z};
    const LightRays light{.num_ambient = 1, .light = {0.6, 0, 0.8}, .bounces = true};
    ambient.begin(info, 0, light);
    bounce.begin(info, 0, light);
    start_to_light();
    bounce.add(rays, 0);
    num_lit = count_lit();
    check(num_lit > 0, "rays that get light");
    start_nearest();
    bounce.take_nearest(rays, 0);
    start_to_light(bounce.nearest);
    bounce.add_colored(rays, 0, layers, 0);
    check(count_lit() == 3 * num_lit, "colours of rays that get light");
  }

  std::int64_t count_lit() const {
    return std::ranges::count_if(rays.bounced.read(), [](float sum) { return sum > 0; });
  }

  /// A round of ambient rays. Each has met the surface that it began at.
  void start_round() {
    ambient(rays, 0);
    rays.given_hits.copy(rays.hits, rays.num_rays);
  }
  /// The same, before any of it is the nearest.
  void start_nearest() {
    start_round();
    bounce.nearest.copy(nothing_met, rays.num_rays);
  }
  /// Rays towards the light, which have met nothing. met: as of Bounce::go_to_light()
  void start_to_light(const ocl::Buffer<HitRecord> &met) {
    start_round();
    bounce.go_to_light(rays, 0, met);
    rays.given_hits.copy(nothing_met, rays.num_rays);
  }
  void start_to_light() { start_to_light(rays.given_hits); }

  Ambient ambient;
  Bounce bounce;
  ocl::Buffer<LayerParams> layers;
  ocl::Buffer<HitRecord> nothing_met;
  std::int64_t num_lit = 0;
};

void go_to_light(benchmark::State &state) {
  auto &in = input<BounceInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits);
  measure(
      state, {hits, hits * (sizeof(HitRecord) + 2 * sizeof(GivenRay) + sizeof(float))},
      [&] { in.start_round(); }, [&] { in.bounce.go_to_light(in.rays, 0, in.rays.given_hits); });
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

void take_nearest(benchmark::State &state) {
  auto &in = input<BounceInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits);
  measure(
      state, {hits, hits * (sizeof(GivenRay) + sizeof(float) + 2 * sizeof(HitRecord))},
      [&] { in.start_nearest(); }, [&] { in.bounce.take_nearest(in.rays, 0); });
  state.counters["hits"] = hits;
}

void add_colored(benchmark::State &state) {
  auto &in = input<BounceInput>(state.range(0));
  const auto lit = static_cast<double>(in.num_lit);
  measure(
      state, {lit, lit * (2 * sizeof(GivenRay) + (2 + 2 * ISO_LAYER_SUMS) * sizeof(float))},
      [&] { in.start_to_light(in.bounce.nearest); },
      [&] { in.bounce.add_colored(in.rays, 0, in.layers, 0); });
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
  for (const auto &[name, function] :
       {Case{"bounce/go_to_light", go_to_light}, Case{"bounce/add", add},
        Case{"bounce/filter", filter}, Case{"bounce/take_nearest", take_nearest},
        Case{"bounce/add_colored", add_colored}})
    stage_benchmark(name, function)
        ->ArgName("width")
        ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
