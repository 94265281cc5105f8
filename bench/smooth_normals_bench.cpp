// Hits -> smooth gradients: smooth_normals.cl. All hits of a frame, all blocks cached, as in a
// frame that is drawn again.

#include "bench/rays_rig.hpp"
#include "core/stages/smooth_normals.hpp"

namespace isowave::core::bench {
namespace {

struct NormalsInput : RaysRig {
  NormalsInput(ocl::Device &device, std::int64_t width)
      : RaysRig(device, width), normals(device, rays.num_rays, kGroupSize) {
    begin();
    run(true);
    check(read_counts().next_active_count != 0, "blocks for normals alone");
    while (read_counts().next_active_count != 0) {
      rays.open_pass();
      blocks.provide(rays.previous_counts, {}, rays);
      run(false);
    }
    begin();
    run(true);
    check(read_counts().next_active_count == 0, "all normals of the hits");
  }
  void begin() { rays.open_pass(); }
  void run(bool begins) { normals(cache, rays, begins); }

  SmoothNormals normals;
};

void smooth_normals(benchmark::State &state) {
  auto &in = input<NormalsInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits);
  measure(
      state, {hits, hits * (sizeof(HitRecord) + 32 * sizeof(float))}, [&] { in.begin(); },
      [&] { in.run(true); });
  state.counters["hits"] = hits;
}

const bool kRegistered = [] {
  stage_benchmark("smooth_normals", smooth_normals)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
