// Between two rounds of ambient rays: counts those of the last, and makes the next (ambient.cl).
// All hits of a frame. And what takes rays out that have met a surface.

#include "bench/rays_rig.hpp"
#include "core/stages/ambient.hpp"

namespace isowave::core::bench {
namespace {

struct AmbientInput : RaysRig {
  AmbientInput(ocl::Device &device, std::int64_t width)
      : RaysRig(device, width), ambient(device, rays.num_rays) {
    rays.given = {device, "given rays", rays.num_rays};
    rays.given_hits = {device, "hits of given rays", rays.num_rays};
    rays.open_counts = {device, "open ambient rays", 2 * rays.num_rays};
    VolumeInfo info;
    info.dims = {params.grid.dims_x, params.grid.dims_y, params.grid.dims_z};
    ambient.begin(info, 0, {.num_ambient = 2});
    ambient(rays, 0);
    rays.given_hits.copy(rays.hits, rays.num_rays);  // all closed
    ambient(rays, 1);
    for (const uchar count : rays.open_counts.read()) check(count == 0, "rays that are open");
  }

  Ambient ambient;
};

void ambient(benchmark::State &state) {
  auto &in = input<AmbientInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits);
  measure(
      state, {hits, hits * (sizeof(HitRecord) + sizeof(float) + sizeof(GivenRay) + 2)}, [] {},
      [&] { in.ambient(in.rays, 1); });
  state.counters["hits"] = hits;
}

/// All rays of a round have met something.
void block_rays(benchmark::State &state) {
  auto &in = input<AmbientInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits);
  measure(
      state, {hits, hits * (2 * sizeof(GivenRay) + sizeof(float))}, [&] { in.ambient(in.rays, 1); },
      [&] { in.ambient.block(in.rays); });
  state.counters["hits"] = hits;
}

using Case = std::pair<const char *, void (*)(benchmark::State &)>;

const bool kRegistered = [] {
  for (const auto &[name, function] : {Case{"ambient", ambient}, Case{"ambient/block", block_rays}})
    stage_benchmark(name, function)
        ->ArgName("width")
        ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
