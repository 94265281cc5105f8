// Counting and writing the triangles of a surface whose blocks are cached: marching_cubes.cl.

#include "bench/surface_rig.hpp"

namespace isowave::core::bench {
namespace {

void count_triangles(benchmark::State &state) {
  auto &in = input<SurfaceRig>(state.range(0), Gradients::kNone);
  const double blocks = in.num_listed;
  measure(
      state, {blocks, blocks * (8 * (2 * sizeof(uint) + sizeof(ulong)) + sizeof(BlockEdges) + 8)},
      [] {}, [&] { in.count(); });
}

struct WriteInput : SurfaceRig {
  WriteInput(ocl::Device &device, std::int64_t edge, Gradients with)
      : SurfaceRig(device, edge, with), mesh(device, num_vertices, num_triangles, with) {
    run();
    uint largest = 0;
    for (const MeshTriangle &triangle : mesh.triangles.read())
      largest = std::max({largest, triangle.a, triangle.b, triangle.c});
    check(largest + 1 == num_vertices, "triangles name all vertices");
  }
  void run() { cubes.write(frame, cache, listed, 0, num_listed, *surface, mesh); }

  MeshBuffers mesh;
};

void write_triangles(benchmark::State &state, Gradients gradients) {
  auto &in = input<WriteInput>(state.range(0), gradients);
  const double blocks = in.num_listed, vertex = gradients == Gradients::kSmooth ? 20 : 8;
  measure(
      state,
      {double(in.num_triangles), 256 * blocks + vertex * in.num_vertices + 12.0 * in.num_triangles},
      [] {}, [&] { in.run(); });
  state.counters["triangles"] = in.num_triangles;
}

const bool kRegistered = [] {
  stage_benchmark("marching_cubes/count", count_triangles)
      ->ArgName("edge")
      ->ArgsProduct({{kSurfaceEdges.begin(), kSurfaceEdges.end()}});
  for (const auto &[gradients, name] :
       {std::pair(Gradients::kNone, "positions"), {Gradients::kSmooth, "gradients"}}) {
    stage_benchmark(
        fmt::format("marching_cubes/write/{}", name),
        [gradients = gradients](benchmark::State &state) { write_triangles(state, gradients); })
        ->ArgName("edge")
        ->ArgsProduct({{kSurfaceEdges.begin(), kSurfaceEdges.end()}});
  }
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
