#pragma once
// Draws frames of one volume on the host, without OpenCL: at once, while a device's renderer would
// wait for its kernels to be compiled, and if there is no device.

#include <cstdint>
#include <memory>

#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

struct HostRendererOptions {
  /// Bound on value ranges and decoded blocks [bytes]; 0: a quarter of the host's memory. Ranges
  /// take 0.17 bytes a voxel. Frames are the same with any limit; if the blocks that a frame needs,
  /// 4 bytes a voxel, pass it, they are decoded more than once.
  std::uint64_t memory_limit = 0;
  std::uint32_t num_threads = 0;  ///< 0: one per processor. The result is the same for any number
};

/// A renderer that decodes the blocks that rays come to, and keeps them in host memory. It draws
/// requests without voxel_pixels, voxel_error, bound, max_surface_error, time_budget_ms and
/// want_bounds. Reads the whole volume for its value ranges, and keeps it alive.
///
/// Throws  Error: no volume; the memory limit does not suffice; a file that cannot be read
Renderer make_host_renderer(std::shared_ptr<const Volume> volume,
                            const HostRendererOptions &options = {});

}  // namespace isowave
