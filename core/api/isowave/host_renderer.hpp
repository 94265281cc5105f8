#pragma once
// Draws frames of one volume on the host, without OpenCL and without waiting for kernels.

#include <cstdint>
#include <memory>

#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

struct HostRendererOptions {
  /// Bound on value ranges and decoded blocks [bytes]; 0: a quarter of the host's memory. Ranges
  /// take 0.17 bytes a voxel, decoded blocks 4. Frames are the same with any limit. If a frame
  /// needs more blocks than the limit allows, blocks are decoded more than once.
  std::uint64_t memory_limit = 0;
  std::uint32_t num_threads = 0;  ///< 0: one per processor. The result is the same for any number
  std::shared_ptr<const Volume> field{};  ///< as RendererOptions::field
  ImageSize largest{};                    ///< picture for Renderer::camera(); frames may be larger
};

/// Makes a renderer that decodes the blocks that rays come to, and keeps them in host memory. It
/// draws all that a device's renderer with all of its options draws, with the same bits. Reads the
/// whole volume for its value ranges, and keeps the volume alive.
///
/// Throws  Error: no volume; a memory limit that is too small; a file that cannot be read
Renderer make_host_renderer(std::shared_ptr<const Volume> volume,
                            const HostRendererOptions &options = {});

}  // namespace isowave
