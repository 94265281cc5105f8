#include "core/extract/extractor.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/stages/prefix_sum.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

namespace {

/// A closed surface has about twice as many triangles as vertices.
constexpr std::uint64_t kTrianglesPerVertex = 2;
using Clock = std::chrono::steady_clock;

SurfaceBlocks::Options block_options(const ocl::Device &device, const ExtractorOptions &options,
                                     Gradients gradients) {
  return {.gradients = gradients,
          .memory_budget = options.memory_budget != 0 ? options.memory_budget
                                                      : SurfaceBlocks::default_budget(device),
          .stream = options.stream,
          .beside = MarchingCubes::sizes()};
}

/// The sum of counts of which there are 32-bit prefix sums, which may have wrapped around.
std::uint64_t total_of(const std::vector<uint> &offsets) {
  std::uint64_t total = 0;
  for (std::size_t i = 0; i + 1 < offsets.size(); ++i) total += uint{offsets[i + 1] - offsets[i]};
  return total;
}

}  // namespace

/// An extraction at work.
struct Extractor::Run {
  std::uint32_t num_listed;
  SurfaceCounts surface;
  PrefixSum sum;
  MeshSink &sink;
  const Progress &progress;
  Plan plan{};
  ExtractStats stats{};
  std::vector<uint> block_ids{}, vertex_offsets{}, triangle_offsets{};  ///< on the host
  std::vector<MeshVertex> vertices{};                                   ///< of a part
  std::vector<float> gradients{};
  std::vector<MeshTriangle> triangles{};

  /// step: 0 counts, 1 writes; done: of its blocks.
  void report(std::uint32_t step, std::uint32_t done) const {
    const std::uint64_t all = 2 * std::uint64_t{num_listed};
    const std::uint64_t now = std::uint64_t{num_listed} * step + done;
    if (progress) progress(static_cast<std::uint32_t>(now * 1000 / all), 1000);
  }
};

Extractor::Extractor(ocl::Device &device, const CompressedVolume &volume,
                     const ExtractorOptions &options)
    : device_(device),
      options_(options),
      info_(volume.info),
      gradients_(options.with_normals ? Gradients::kSmooth : Gradients::kNone),
      blocks_(device, volume, block_options(device, options, gradients_)),
      marching_cubes_(device, gradients_, blocks_.cache().slot_type) {
  if (options.cache_slots != 0 && options.cache_slots < blocks_of_block(gradients_)) {
    throw Error("a cache of {} blocks cannot be used: a block of the surface needs {}",
                options.cache_slots, blocks_of_block(gradients_));
  }
}

Extractor::Plan Extractor::plan_for(std::uint64_t num_listed, std::uint64_t num_needed,
                                    float isovalue) const {
  const auto mesh_bytes = [&](std::uint64_t vertices) {
    return MeshBuffers::sizes(vertices, kTrianglesPerVertex * vertices, gradients_).bytes();
  };
  const std::uint64_t budget = blocks_.budget();
  const std::uint64_t surface = blocks_.fixed_bytes() + SurfaceCounts::sizes(num_listed).bytes() +
                                PrefixSum::sizes(num_listed, ocl::kGroupSize).bytes();
  const std::uint32_t least_slots = blocks_.least_slots();
  const std::uint64_t least = surface + blocks_.cache_bytes(least_slots) +
                              std::max(blocks_.count_bytes(), mesh_bytes(kBlockVertices));
  if (least > budget) {
    throw Error(
        "a memory budget of {} bytes is too small for the {} blocks of the surface at {}: {} would "
        "do",
        budget, num_listed, isovalue, least);
  }
  Plan plan;
  const std::uint64_t left = budget - surface - blocks_.cache_bytes(least_slots);
  std::uint64_t vertices =
      std::min<std::uint64_t>(options_.part_vertices, kBlockVertices * num_listed);
  while (vertices > kBlockVertices && mesh_bytes(vertices) > left / 4) vertices /= 2;
  plan.part_vertices = std::max<std::uint64_t>(vertices, kBlockVertices);
  plan.part_triangles = kTrianglesPerVertex * plan.part_vertices;
  const std::uint64_t beside = surface + mesh_bytes(plan.part_vertices);
  const std::uint64_t most = options_.cache_slots != 0 ? options_.cache_slots : ISO_MAX_CACHE_SLOTS;
  plan.cache_slots =
      blocks_.most_slots(static_cast<std::uint32_t>(std::clamp<std::uint64_t>(
                             num_needed, least_slots, std::max<std::uint64_t>(most, least_slots))),
                         beside);
  const std::uint32_t there = blocks_.num_slots();
  if (there > plan.cache_slots && blocks_.can_have(there) &&
      beside + blocks_.cache_bytes(there) <= budget)
    plan.cache_slots = there;
  plan.bytes = beside + blocks_.cache_bytes(plan.cache_slots);
  return plan;
}

void Extractor::count(Run &run) {
  const auto begin_time = Clock::now();
  BatchSize batch(run.plan.cache_slots, run.stats.needed_blocks);
  for (std::uint32_t begin = 0; begin < run.num_listed;) {
    const std::uint32_t size = std::min(batch.size(), run.num_listed - begin);
    if (!blocks_.bring(run.surface.block_ids, begin, begin + size)) {
      batch.refused(size);
      continue;
    }
    marching_cubes_.count(blocks_.frame(), blocks_.cache(), begin, begin + size, run.surface,
                          blocks_.stream().no_data());
    begin += size;
    batch.served();
    ++run.stats.count_batches;
    run.report(0, begin);
  }
  run.sum(run.surface.vertex_offsets, run.num_listed);
  run.sum(run.surface.triangle_offsets, run.num_listed);
  run.vertex_offsets = run.surface.vertex_offsets.read();
  run.triangle_offsets = run.surface.triangle_offsets.read();
  run.stats.count_ms = ms_since(begin_time);
}

void Extractor::write(Run &run) {
  MeshBuffers mesh(device_, run.plan.part_vertices, run.plan.part_triangles, gradients_);
  run.block_ids = run.surface.block_ids.read();
  BatchSize batch(run.plan.cache_slots, run.stats.needed_blocks);
  for (std::uint32_t begin = 0; begin < run.num_listed;) {
    const auto num_in = [&](const std::vector<uint> &offsets, std::uint32_t end) {
      return uint{offsets[end] - offsets[begin]};
    };
    const std::uint32_t most =
        begin + std::min({batch.size(), run.num_listed - begin, kMaxWrittenBlocks});
    std::uint32_t end = begin + 1;
    while (end < most && num_in(run.vertex_offsets, end + 1) <= run.plan.part_vertices &&
           num_in(run.triangle_offsets, end + 1) <= run.plan.part_triangles)
      ++end;
    if (!blocks_.bring(run.surface.block_ids, begin, end)) {
      batch.refused(end - begin);
      continue;
    }
    marching_cubes_.write(blocks_.frame(), blocks_.cache(), blocks_.listed(), begin, end,
                          run.surface, mesh, blocks_.stream().no_data());
    run.vertices.resize(num_in(run.vertex_offsets, end));
    run.triangles.resize(num_in(run.triangle_offsets, end));
    mesh.vertices.read(run.vertices);
    mesh.triangles.read(run.triangles);
    if (options_.with_normals) {
      run.gradients.resize(3 * run.vertices.size());
      mesh.gradients.read(run.gradients);
    }
    give(run, begin);
    begin = end;
    batch.served();
    ++run.stats.write_batches;
    run.report(1, begin);
  }
}

/// Turns a part of the mesh, of entries from `begin` on, to the world, and hands it on.
void Extractor::give(Run &run, std::uint32_t begin) {
  constexpr std::size_t kAtOnce = 1u << 14;
  const MeshPlacement placement(info_, options_.vertices);
  const std::size_t num_vertices = run.vertices.size(), num_triangles = run.triangles.size();
  std::vector<glm::dvec3> positions(num_vertices);
  std::vector<glm::vec3> normals(options_.with_normals ? num_vertices : 0);
  std::vector<Triangle> triangles(num_triangles);
  const auto each = [&](std::size_t count, const auto &work) {
    parallel_for((count + kAtOnce - 1) / kAtOnce, 0, [&](std::uint64_t piece, std::uint32_t) {
      for (std::size_t i = piece * kAtOnce; i < std::min<std::size_t>(count, (piece + 1) * kAtOnce);
           ++i)
        work(i);
    });
  };
  each(num_vertices, [&](std::size_t i) {
    const MeshVertex &vertex = run.vertices[i];
    const uint id = run.block_ids[begin + (vertex.edge >> ISO_VERTEX_BLOCK_SHIFT)];
    const BlockCoords b = block_coords(&blocks_.frame(), id);
    positions[i] = placement.position({b.x, b.y, b.z}, vertex);
    if (options_.with_normals) {
      const float *g = &run.gradients[3 * i];
      normals[i] = placement.normal({g[0], g[1], g[2]});
    }
  });
  each(num_triangles, [&](std::size_t i) { triangles[i] = placement.triangle(run.triangles[i]); });
  run.sink.add({positions, normals, triangles});
}

ExtractStats Extractor::extract(float isovalue, MeshSink &sink, const Progress &progress) {
  const auto begin = Clock::now();
  const std::uint64_t decoded_before = blocks_.num_decoded();
  ExtractStats stats;
  stats.size.has_normals = options_.with_normals;
  const std::uint32_t num_listed = blocks_.find(isovalue);
  stats.listed_blocks = num_listed;
  stats.device_bytes = blocks_.fixed_bytes() + blocks_.cache_bytes(blocks_.num_slots());
  if (num_listed == 0) {
    sink.begin(stats.size);
    stats.total_ms = ms_since(begin);
    return stats;
  }
  // Throws where not even the least fits, before any of it is taken.
  plan_for(num_listed, blocks_of_block(gradients_), isovalue);
  if (blocks_.fixed_bytes() + blocks_.cache_bytes(blocks_.num_slots()) +
          SurfaceCounts::sizes(num_listed).bytes() + blocks_.count_bytes() +
          PrefixSum::sizes(num_listed, ocl::kGroupSize).bytes() >
      blocks_.budget())
    blocks_.drop_cache();
  Run run{.num_listed = num_listed,
          .surface = SurfaceCounts(device_, num_listed),
          .sum = PrefixSum(device_, num_listed, ocl::kGroupSize),
          .sink = sink,
          .progress = progress,
          .stats = stats};
  blocks_.list(run.surface.block_ids);
  run.stats.needed_blocks = blocks_.count_needed(run.surface.block_ids, num_listed);
  run.plan = plan_for(num_listed, run.stats.needed_blocks, isovalue);
  run.stats.cache_slots = run.plan.cache_slots;
  run.stats.device_bytes = run.plan.bytes;
  run.stats.list_ms = ms_since(begin);
  try {
    blocks_.open_cache(run.plan.cache_slots);
    count(run);
    MeshSize &size = run.stats.size;
    size.num_vertices = total_of(run.vertex_offsets);
    size.num_triangles = total_of(run.triangle_offsets);
    if (size.num_vertices > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(
          "the surface at {} has {} vertices, more than triangles of 32-bit numbers can name: take "
          "a coarser level of detail",
          isovalue, size.num_vertices);
    }
    const auto begin_write = Clock::now();
    sink.begin(size);
    write(run);
    run.stats.write_ms = ms_since(begin_write);
  } catch (...) {  // blocks may have slots, but no values
    blocks_.drop_cache();
    throw;
  }
  run.stats.decoded_blocks = blocks_.num_decoded() - decoded_before;
  run.stats.total_ms = ms_since(begin);
  return run.stats;
}

}  // namespace isowave::core
