#pragma once
// The stages of an extraction with nothing hidden: for benchmarks of one of them.

#include <memory>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/render/block_store.hpp"
#include "core/stages/marching_cubes.hpp"
#include "core/stages/prefix_sum.hpp"

namespace isowave::core::bench {

/// The surface of mixing_layer(edge), whose blocks are listed and counted, and all that it needs
/// cached.
struct SurfaceRig {
  SurfaceRig(ocl::Device &device, std::int64_t edge, Gradients with)
      : gradients(with),
        frame(make_grid_params(mixing_layer(edge).info)),
        rays(device, {.num_rays = 1, .with_pairs = false}),
        blocks(device, mixing_layer(edge), DeviceStream(device, mixing_layer(edge)),
               limits(kMinCacheSlots), kGroupSize),
        listed(device, num_macrocells(frame.grid)),
        request(device, with),
        cubes(device, with) {
    open();
    num_listed = listed.count(frame, blocks.levels[0].macrocells.masks());
    surface = std::make_unique<SurfaceCounts>(device, num_listed);
    listed.list(frame, surface->block_ids);
    num_needed = request.count_needed(frame, surface->block_ids, num_listed);
    blocks.resize(limits(num_needed), rays);
    open();
    begin_pass();
    ask();
    check(rays.counts.read()[0].requested_count == num_needed, "all needed blocks are asked for");
    blocks.provide(rays.counts, {}, rays);
    count();
    PrefixSum sum(device, num_listed, kGroupSize);
    sum(surface->vertex_offsets, num_listed);
    sum(surface->triangle_offsets, num_listed);
    num_vertices = surface->vertex_offsets.read().back();
    num_triangles = surface->triangle_offsets.read().back();
    check(num_vertices > 0 && num_triangles > num_vertices, "there is a surface");
  }

  void begin_pass() { blocks.begin_host_pass(rays); }
  /// Asks for all blocks.
  void ask() { request(surface->block_ids, 0, num_listed, cache, rays); }
  void count() { cubes.count(frame, cache, 0, num_listed, *surface); }

  Gradients gradients;
  FrameParams frame;
  Wavefront rays;
  BlockStore blocks;
  BlockCache &cache = blocks.cache;
  ActiveBlocks listed;
  RequestSurface request;
  MarchingCubes cubes;
  uint num_listed = 0, num_needed = 0, num_vertices = 0, num_triangles = 0;
  std::unique_ptr<SurfaceCounts> surface;

 private:
  BlockCache::Limits limits(uint num_slots) const {
    return BlockCache::limits_for(frame.grid, num_slots, ISO_MAX_CACHE_SLOTS);
  }
  void open() {
    frame.surface.isovalue = kMixingLayerIsovalue;
    blocks.open(rays, {frame}, {{blocks.levels[0].stream.layout, 0}}, FieldBound::kNone,
                RaySource::kGiven);
    frame = rays.frame;
  }
};

inline constexpr std::array<std::int64_t, 2> kSurfaceEdges = {128, 256};

}  // namespace isowave::core::bench
