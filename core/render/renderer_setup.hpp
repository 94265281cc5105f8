#pragma once
// What a renderer is made of: its options, their checks, its memory, and what it keeps on the
// device.

#include <cstdint>

#include "core/render/memory_plan.hpp"
#include "core/render/pipeline.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave {

/// What a renderer is made for. Everything is allocated and compiled when it is made, so what
/// requests may ask for is said here.
struct RendererOptions {
  ImageSize max_size;  ///< no request has more rays; a kept picture is of half of it (halved())
  PipelineKind pipeline = PipelineKind::kAuto;
  std::uint64_t memory_budget = 0;  ///< bound on all device memory [bytes]; 0: 3/4 of the device's
  std::uint32_t cache_slots = 0;    ///< decoded blocks kept, at least 8; 0: as many as the budget
                                    ///< allows, or kAmpleCacheSlots where there is none
  std::uint32_t max_speculation =
      64;  ///< blocks a ray looks ahead at most, 1..64; 1 turns speculation off
  bool per_ray_speculation = true;  ///< each ray by what it has missed, not all alike
  Solver solver = kDefaultSolver;   ///< root finder in a cell
  std::uint32_t group_size = 64;    ///< work-items per work-group, a power of two in 8..256
  /// How a pass's pairs are gathered by block.
  Grouping grouping = kDefaultGrouping;
  ClosestHit closest =
      kDefaultClosestHit;  ///< how a ray's closest result is found (pipeline `blocks`)
  StreamPlace stream = StreamPlace::kAuto;  ///< where the compressed volume is
  /// Bytes of one of its at most four buffers; 0: what the device allows.
  std::uint64_t largest_stream_part = 0;
  /// Blocks uploaded at a time from a volume on the host, at least 8; 0: by the size of cache and
  /// blocks.
  std::uint32_t window_blocks = 0;
  bool with_levels = false;        ///< requests may set voxel_pixels
  bool with_bounds = false;        ///< requests may set bound
  bool with_kept_picture = false;  ///< keep_picture() may be called
  bool with_shading =
      true;  ///< shade() will be called: else its kernel is not built before that is
};

/// Slots (325 MiB with their share of the tables) that no budget was asked for are enough: a cold
/// 720p frame of a 1024^3 volume touches about 400,000 blocks.
inline constexpr std::uint32_t kAmpleCacheSlots = 1u << 20;

/// The options with those defaults filled in that need no plan.
/// errors: Error where one of them is out of range, or the volume cannot be drawn with them.
RendererOptions checked_options(RendererOptions options, const CompressedVolume &volume,
                                const ocl::Device &device);

/// All memory of a renderer, before any is taken.
/// options: from checked_options().
/// errors: Error where it does not suffice.
MemoryPlan plan_renderer(const ocl::Device &device, const CompressedVolume &volume,
                         const RendererOptions &options);

/// Uploads the volume, builds its macrocell ranges, and makes the buffers of rays and cache.
FrameState make_frame_state(ocl::Device &device, const CompressedVolume &volume,
                            const RendererOptions &options, const MemoryPlan &plan);

/// How the blocks of a level are decoded: what the cache holds depends on it.
struct LevelDecoding {
  std::int32_t min_exponent = ISO_ALL_PLANES;  ///< BlockPrecision::min_exponent
  bool whole_numbers = false;                  ///< BlockPrecision::whole_numbers
  double plane_error = 0;  ///< how far values of fewer bit planes are from those of all
  float uniform_offset = 0, unit_offset = 0;  ///< ValueOffset of the bound that is drawn

  bool operator==(const LevelDecoding &) const = default;
};

/// index: of the level. voxel_error, bound: of the request. value_range: of the volume.
/// errors: Error where voxel_error is out of range, or the level's error is not known, and a bound
/// needs it.
LevelDecoding decoding_of(const Level &level, std::size_t index, double voxel_error,
                          FieldBound bound, const std::array<float, 2> &value_range);

/// From now on, blocks of the level are decoded like that.
void set_decoding(Level &level, const LevelDecoding &decoding);

}  // namespace isowave
