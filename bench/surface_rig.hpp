#pragma once
// The stages of an extraction with nothing hidden: for benchmarks of one of them.

#include <memory>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/marching_cubes.hpp"
#include "core/stages/prefix_sum.hpp"
#include "core/stages/zfp_decode.hpp"

namespace isowave::core::bench {

/// The surface of mixing_layer(edge), whose blocks are listed and counted, and all that it needs
/// cached.
struct SurfaceRig {
  SurfaceRig(ocl::Device &device, std::int64_t edge, Gradients with)
      : gradients(with),
        frame(make_grid_params(mixing_layer(edge).info)),
        stream(device, mixing_layer(edge)),
        macrocells(device, frame, stream),
        listed(device, num_macrocells(frame.grid)),
        request(device, with),
        cubes(device, with),
        rays(device, {.num_rays = 1, .with_pairs = false}) {
    frame.surface.isovalue = kMixingLayerIsovalue;
    macrocells.select(frame);
    num_listed = listed.count(frame, macrocells.masks());
    surface = std::make_unique<SurfaceCounts>(device, num_listed);
    listed.list(frame, surface->block_ids);
    num_needed = request.count_needed(frame, surface->block_ids, num_listed);
    cache = std::make_unique<BlockCache>(
        device, BlockCache::limits_for(frame.grid, num_needed, num_needed), kGroupSize);
    frame.schedule.table_groups = cache->table_groups;
    rays.frame = frame;
    ask();
    check(rays.counts.read()[0].requested_count == num_needed, "all needed blocks are asked for");
    cache->assign(rays.counts, rays);
    ZfpDecode decode(device, cache->capacity, stream.defines());
    decode({stream, frame}, {stream, frame}, rays.counts, *cache);
    count();
    PrefixSum sum(device, num_listed, kGroupSize);
    sum(surface->vertex_offsets, num_listed);
    sum(surface->triangle_offsets, num_listed);
    num_vertices = surface->vertex_offsets.read().back();
    num_triangles = surface->triangle_offsets.read().back();
    check(num_vertices > 0 && num_triangles > num_vertices, "there is a surface");
  }

  /// Opens a pass, and asks for all blocks.
  void ask() {
    PassCounts counts{};
    counts.ray_count = 1;
    counts.pass = counts.frame_pass = counts.last_frame_pass = ++pass;
    rays.counts.write({&counts, 1});
    request(surface->block_ids, 0, num_listed, *cache, rays);
  }
  void count() { cubes.count(frame, *cache, 0, num_listed, *surface); }

  Gradients gradients;
  FrameParams frame;
  DeviceStream stream;
  Macrocells macrocells;
  ActiveBlocks listed;
  RequestSurface request;
  MarchingCubes cubes;
  Wavefront rays;
  uint pass = 1, num_listed = 0, num_needed = 0, num_vertices = 0, num_triangles = 0;
  std::unique_ptr<SurfaceCounts> surface;
  std::unique_ptr<BlockCache> cache;
};

inline constexpr std::array<std::int64_t, 2> kSurfaceEdges = {128, 256};

}  // namespace isowave::core::bench
