#pragma once
// Pipelines: ways to trace the camera's rays, with the same finished picture bit for bit.
//
//   rays    each ray intersects the cells that it meets in cached blocks
//           (core/render/ray_waves.hpp)
//   blocks  the paper's, to compare with (core/paper/blocks_pipeline.hpp)

#include <cstdint>
#include <memory>
#include <string_view>

#include "core/ocl/buffer_sizes.hpp"
#include "core/stages/wavefront.hpp"

namespace isowave::core {

class BlockStore;
class Wave;
struct RendererOptions;

/// Whether rays march in packets of eight; kOn: if the device can (MarchPackets).
enum class RayPackets { kAuto, kOn, kOff };

/// Whether packets decode the blocks that they come to, instead of waiting for the next pass; never
/// if the stream stays on the host.
enum class DecodeOnDemand { kAuto, kOn, kOff };

/// Limits that the lengths of a wave's buffers depend on.
struct WaveLimits {
  std::uint64_t num_rays = 0;
  std::uint32_t num_slots = 0;  ///< of the cache
  std::uint32_t group_size = 64;
};

class Pipeline {
 public:
  virtual ~Pipeline() = default;

  virtual std::string_view name() const = 0;
  /// Whether it draws several levels of detail.
  virtual bool has_levels() const = 0;
  /// Whether it draws clipped volumes.
  virtual bool has_clipping() const { return false; }
  /// Adds the arrays of a Wavefront that its rays need.
  virtual void add_to(Wavefront::Limits &limits) const = 0;
  /// The buffers of its wave beside those of BlockStore and Wavefront.
  virtual ocl::BufferSizes sizes(const WaveLimits &limits) const = 0;
  /// The wave of camera rays. blocks, rays: must outlive it.
  virtual std::unique_ptr<Wave> make_wave(BlockStore &blocks, Wavefront &rays,
                                          const WaveLimits &limits,
                                          const RendererOptions &options) const = 0;
};
using PipelinePtr = std::shared_ptr<const Pipeline>;

/// The default pipeline, which was faster in nearly all measurements (bench/h100.md).
PipelinePtr rays_pipeline();

}  // namespace isowave::core
