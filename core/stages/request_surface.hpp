#pragma once
// Listed blocks -> requests to the block cache for all that a mesh of them needs
// (kernels_cl/request_surface.cl).

#include "core/stages/block_cache.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/request_surface.hpp"
#include "kernels_cl/portable/marching_cubes.h"

namespace isowave::core {

/// Whether the vertices of a mesh have gradients, which need more blocks.
enum class Gradients { kNone, kSmooth };

/// Blocks that one listed block needs at most: the fewest slots of a cache that serves any surface.
constexpr std::uint32_t blocks_of_block(Gradients gradients) {
  return gradients == Gradients::kSmooth ? ISO_MESH_NEIGHBOURS : 8;
}

class RequestSurface {
 public:
  RequestSurface(ocl::Device &device, Gradients gradients);

  /// Scratch that count_needed() makes while it is at work.
  static ocl::BufferSizes count_sizes(std::uint64_t num_macrocells);
  /// How many different blocks the first `count` entries of the list need.
  ///
  /// frame  its grid is used
  /// Waits  yes
  std::uint32_t count_needed(const FrameParams &frame, const ocl::Buffer<uint> &block_ids,
                             std::uint32_t count);

  /// Asks for the blocks that entries [begin, end) of the list need, and stamps those that are
  /// cached.
  ///
  /// In     rays.frame; rays.counts: of a pass that has asked for nothing
  /// Out    cache.request_block_ids; rays.counts.requested_count
  /// Waits  no
  void operator()(const ocl::Buffer<uint> &block_ids, std::uint32_t begin, std::uint32_t end,
                  BlockCache &cache, Wavefront &rays);

 private:
  ocl::Device &device_;
  uint with_gradients_;
  ocl::Kernel<kernels::request_surface> request_;
  ocl::Kernel<kernels::count_needed> count_;
};

}  // namespace isowave::core
