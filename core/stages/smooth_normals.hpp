#pragma once
// The last wave of a frame: hits get smooth gradients (kernels_cl/smooth_normals.cl).

#include "core/stages/block_cache.hpp"
#include "core/stages/levelled_kernel.hpp"
#include "kernels/smooth_normals.hpp"

namespace isowave::core {

class SmoothNormals {
 public:
  /// levels: frames may have several levels of detail.
  SmoothNormals(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size,
                bool levels = false, SlotType slots = SlotType::kFloat32);

  /// The hits whose blocks are cached get their gradients; rays of the others ask for blocks, as
  /// far as they are in the pass's window.
  ///
  /// of      whose hits: rays.hits_of()
  /// begins  all hits, unless the pass before has left rays: then nothing happens. Not begins: of
  ///         the rays that the pass before has left, when its requests have been provided
  /// In      the hits; previous_counts: of the pass before; counts: opened; active_ray_ids, unless
  ///         it begins
  /// Out     gradients of the hits; next_active_ray_ids of the rays that wait; counts.active_count
  ///         (0 if it begins), window_count, requested_count, next_active_count; the cache's
  ///         requests, and the block that it must serve
  /// Waits   no
  void operator()(BlockCache &cache, Wavefront &rays, bool begins,
                  RaySource of = RaySource::kCamera);

 private:
  ocl::Range range_;
  LevelledKernel<kernels::smooth_normals> kernel_;
};

}  // namespace isowave::core
