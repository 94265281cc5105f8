// Triangles of an isosurface drawn into the hit buffer: rasterise.cl.

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/paper/mesh_renderer.hpp"

namespace isowave::core::bench {
namespace {

/// The mesh of mixing_layer(edge) is made; what is timed is a further frame of it.
struct RasterInput {
  RasterInput(ocl::Device &device, std::int64_t edge, std::int64_t width)
      : request{.camera = orbit_cameras(mixing_layer(edge).info, 1)[0],
                .isovalue = kMixingLayerIsovalue},
        renderer(device, mixing_layer(edge), {.size = image_of_width(width)}) {
    const FrameStats stats = renderer.render(request);
    triangles = double(renderer.last_frame().num_triangles);
    check(renderer.last_frame().is_kept && triangles > 0, "there is a mesh");
    check(renderer.num_hits(stats) > 0, "there are hits");
  }

  FrameRequest request;
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
      [] {}, [&] { in.renderer.render(in.request); });
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
