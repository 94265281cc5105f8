#pragma once
// The options that a renderer is made with.

#include <cstdint>
#include <vector>

#include "core/frame/solvers.hpp"
#include "core/render/memory_plan.hpp"

namespace isowave::core {

/// Frames ask for the rest (FrameRequest).
struct RendererOptions {
  ImageSize size{};  ///< the largest picture: frames may have as many rays, in any shape
  PipelinePtr pipeline = rays_pipeline();
  std::uint64_t memory_budget = 0;  ///< bound on all device memory [bytes]; 0: 3/4 of the device's
  /// Decoded blocks kept, at least 8. 0: as many as the budget allows; without one, as many as
  /// frames need: the cache grows, up to kAmpleCacheSlots (MemoryPlan::most_slots).
  std::uint32_t cache_slots = 0;
  /// Initial number of cache slots when the cache may grow; 0: first_cache_slots().
  std::uint32_t first_slots = 0;
  std::uint32_t max_speculation =
      64;  ///< blocks a ray looks ahead at most, 1..64; 1 turns speculation off
  bool per_ray_speculation = true;  ///< each ray looks ahead by what it has missed
  Solver solver = kDefaultSolver;   ///< root finder in a cell
  /// Whether rays march in packets of eight (pipeline `rays`); kAuto: if MarchPackets suits.
  RayPackets packets = RayPackets::kAuto;
  /// Whether packets decode the blocks that they come to; kAuto: if MarchPackets may.
  DecodeOnDemand on_demand = DecodeOnDemand::kAuto;
  std::uint32_t group_size = 64;            ///< work-items per work-group, a power of two in 8..256
  StreamPlace stream = StreamPlace::kAuto;  ///< place of the compressed volume
  /// Bytes of one of its at most four buffers; 0: what the device allows.
  std::uint64_t largest_stream_part = 0;
  /// Blocks uploaded at a time from a volume on the host, at least 8; 0: by the size of cache and
  /// blocks.
  std::uint32_t window_blocks = 0;
  bool with_levels = false;        ///< frames may use the volume's levels of detail
  bool with_bounds = false;        ///< frames may draw bounds of the volume
  bool with_kept_picture = false;  ///< DeviceRenderer::keep_picture() will be called
  std::uint32_t max_surfaces = 0;  ///< most FrameRequest::surfaces of a frame
  bool with_labels = false;        ///< frames have surfaces of labels alone; needs max_surfaces
  /// A second volume for FrameRequest::field_values; null: none. Must outlive the renderer.
  const CompressedVolume *field = nullptr;
  /// Slots of the field's own cache, at least 8; 0: as many as frames need.
  std::uint32_t field_slots = 0;
  bool with_given_rays = false;  ///< frames may have ambient rays, and rays may be cast
  bool with_bounce = false;      ///< the same, and ambient rays may bring light
  /// Frames are drawn for pictures: else the kernels of smooth normals and of shade() are built
  /// when they are needed.
  bool with_shading = true;
  /// Macrocells::thresholds() of the finest level; none: of a sample of its blocks.
  std::vector<float> range_thresholds{};
};

/// The most slots of a cache without a budget. They take 1.3 GiB of float32, or 0.6 GiB of 8-bit
/// integers, with their share of the tables. A cold 720p frame of a 1024^3 volume touches about
/// 400,000 blocks, one of 2048 x 2048 x 1920 1.1 million. The cache has room for two frames.
inline constexpr std::uint32_t kAmpleCacheSlots = 1u << 22;

/// The options with their defaults filled in, except those that the memory plan decides. Throws
/// Error if an option is out of range, or if volume or device cannot do what it asks for.
RendererOptions checked(RendererOptions options, const CompressedVolume &volume,
                        const ocl::Device &device);

/// Whether the field has no blocks of its own: it is the volume that is drawn. Labels have, since
/// drawn blocks of labels hold the groups that labels are in, and not the labels.
bool shares_blocks(const RendererOptions &options, const CompressedVolume &volume);

/// The plan of all memory, before any is taken.
///
/// Throws  Error: the memory is not enough
MemoryPlan make_plan(const ocl::Device &device, const CompressedVolume &volume,
                     const RendererOptions &options);

}  // namespace isowave::core
