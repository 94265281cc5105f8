// Rays -> hits, or the blocks that they wait at: march.cl. The first pass of a frame, all blocks
// cached, where every ray hits or leaves; and none cached, where all wait. march/given: the
// camera's rays as a list of rays of any origin.

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

struct MarchGivenInput : RaysRig {
  MarchGivenInput(ocl::Device &device, std::int64_t width)
      : RaysRig(device, width, true),
        start_given(device, rays.num_rays, kGroupSize, false, RaySource::kGiven),
        march_given(device, rays.num_rays, kGroupSize, kDefaultSolver, false, RaySource::kGiven) {
    std::vector<GivenRay> given(rays.num_rays);
    for (uint pixel = 0; pixel < given.size(); ++pixel) {
      const Ray ray = make_ray(&params, pixel);
      given[pixel] = {ray.x.o, ray.y.o, ray.z.o, ray.x.d, ray.y.d, ray.z.d, 0};
    }
    rays.given.write(given);
    start();
    num_given = previous_active();
    march_given(macrocells, cache, rays);
    const PassCounts counts = read_counts();
    check(counts.hit_count > num_hits / 100 * 99, "hits of the camera's rays");
    check(counts.next_active_count == 0, "rays that wait");
  }

  void start() {
    rays.forget_rays();
    start_given(macrocells, rays);
    rays.open_pass();
  }
  uint previous_active() const { return rays.previous_counts.read()[0].next_active_count; }

  StartRays start_given;
  March march_given;
  uint num_given = 0;
};

void march_given(benchmark::State &state) {
  auto &in = input<MarchGivenInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits), given = static_cast<double>(in.num_given);
  const double bytes = hits * sizeof(HitRecord) + given * (sizeof(GivenRay) + 2 * sizeof(uint));
  measure(
      state, {given, bytes}, [&] { in.start(); },
      [&] { in.march_given(in.macrocells, in.cache, in.rays); });
}

const bool kRegistered = [] {
  stage_benchmark("march", march_rays)
      ->ArgNames({"width", "cached"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {0, 1}});
  stage_benchmark("march/given", march_given)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
