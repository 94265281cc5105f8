// Counting and writing triangles that are drawn, of a surface whose blocks are cached:
// block_triangles.cl. marching_cubes makes meshes of the same surfaces.

#include "bench/surface_rig.hpp"
#include "core/paper/block_triangles.hpp"

namespace isowave::core::bench {
namespace {

struct TrianglesInput : SurfaceRig {
  TrianglesInput(ocl::Device &device, std::int64_t edge)
      : SurfaceRig(device, edge, Gradients::kNone),
        triangles(device),
        offsets(device, "triangle offsets", num_listed + 1),
        vertices(device, "mesh vertices", 3 * std::size_t{num_triangles}) {
    count_into(offsets);
    PrefixSum sum(device, num_listed, kGroupSize);
    sum(offsets, num_listed);
    check(offsets.read().back() == num_triangles, "as many triangles as marching_cubes counts");
    write_all();
    const BlockVertex last = vertices.read().back();
    check(last.steps != 0 || last.block_id != 0, "the last triangle is written");
  }
  void count_into(ocl::Buffer<uint> &counts) {
    triangles.count(frame, cache, surface->block_ids, {0, num_listed, 0}, counts);
  }
  void write_all() {
    triangles.write(frame, cache, surface->block_ids, {0, num_listed, 0}, offsets, 0, vertices);
  }

  BlockTriangles triangles;
  ocl::Buffer<uint> offsets;
  ocl::Buffer<BlockVertex> vertices;
};

void count_triangles(benchmark::State &state) {
  auto &in = input<TrianglesInput>(state.range(0));
  const double blocks = in.num_listed;
  ocl::Buffer<uint> counts(Session::current().device(), "counts", in.num_listed + 1);
  measure(
      state, {blocks, blocks * (8 * (2 * sizeof(uint) + sizeof(ulong)) + sizeof(uint))}, [] {},
      [&] { in.count_into(counts); });
}

void write_triangles(benchmark::State &state) {
  auto &in = input<TrianglesInput>(state.range(0));
  measure(
      state,
      {double(in.num_triangles),
       256.0 * in.num_listed + 3 * sizeof(BlockVertex) * double(in.num_triangles)},
      [] {}, [&] { in.write_all(); });
  state.counters["triangles"] = in.num_triangles;
}

const bool kRegistered = [] {
  stage_benchmark("block_triangles/count", count_triangles)
      ->ArgName("edge")
      ->ArgsProduct({{kSurfaceEdges.begin(), kSurfaceEdges.end()}});
  stage_benchmark("block_triangles/write", write_triangles)
      ->ArgName("edge")
      ->ArgsProduct({{kSurfaceEdges.begin(), kSurfaceEdges.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
