// Triangles of an isosurface drawn into the hit buffer: rasterise.cl.

#include <cmath>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/paper/mesh_renderer.hpp"

namespace isowave::core::bench {
namespace {

/// The mesh of mixing_layer(edge) is made; what is timed is a further frame of it.
struct RasterInput {
  RasterInput(ocl::Device &device, std::int64_t edge, std::int64_t width)
      : camera(orbit_cameras(mixing_layer(edge).info, 1)[0]),
        renderer(device, mixing_layer(edge), {.size = image_of_width(width)}) {
    const MeshFrameStats stats = renderer.render(camera, kMixingLayerIsovalue);
    triangles = double(stats.num_triangles);
    check(stats.is_kept && triangles > 0, "there is a mesh");
    std::size_t num_hits = 0;
    for (const HitRecord &hit : renderer.hits()) num_hits += std::isfinite(hit.t) ? 1 : 0;
    check(num_hits > 0, "there are hits");
  }

  Camera camera;
  MeshRenderer renderer;
  double triangles = 0;
};

void rasterise(benchmark::State &state) {
  auto &in = input<RasterInput>(state.range(0), state.range(1));
  const auto pixels = static_cast<double>(pixels_of_width(state.range(1)));
  // Each turn reads all vertices; pictures are cleared, and written.
  measure(
      state,
      {in.triangles,
       2 * 3 * sizeof(BlockVertex) * in.triangles + pixels * (8 + 2 * sizeof(HitRecord))},
      [] {}, [&] { in.renderer.render(in.camera, kMixingLayerIsovalue); });
  state.counters["triangles"] = in.triangles;
}

const bool kRegistered = [] {
  stage_benchmark("rasterise", rasterise)
      ->ArgNames({"edge", "width"})
      ->ArgsProduct({{128, 256}, {kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
