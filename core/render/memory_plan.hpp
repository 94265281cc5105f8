#pragma once
// Every device buffer of a renderer, added up before any of them is made, for the memory budget.
// The owners of the buffers state their lengths by sizes().

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/ocl/buffer_sizes.hpp"
#include "core/ocl/device.hpp"
#include "core/render/pipeline.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/layers.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/wavefront.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// The place of the compressed volume while frames are drawn.
enum class StreamPlace {
  kAuto,    ///< on the device if that leaves room for a useful cache, otherwise on the host
  kDevice,  ///< whole
  kHost     ///< in memory or in its file; blocks are uploaded when they are requested
};
std::string_view to_string(StreamPlace place);
/// Throws  Error naming the places there are
StreamPlace stream_place_from_string(std::string_view name);

/// Everything that the memory of a renderer depends on, beside its volume.
struct MemoryRequest {
  std::uint64_t num_rays = 0;
  PipelinePtr pipeline = rays_pipeline();
  std::uint32_t group_size = 64;
  StreamPlace stream = StreamPlace::kAuto;
  std::uint64_t largest_stream_part =
      0;                            ///< bytes of one buffer of the compressed volume; 0: no limit
  std::uint32_t window_blocks = 0;  ///< see StreamWindow; 0: by the size of cache and blocks
  bool with_levels = false;         ///< the volume's coarser levels are on the device, too
  bool with_bounds = false;         ///< the bounds of blocks' errors are on the device, too
  std::uint64_t kept_rays = 0;      ///< rays of KeptPicture
  bool with_given_rays = false;     ///< rays of any origin, and ambient rays
  std::uint32_t max_surfaces = 0;   ///< of frames with layers
  bool with_field = false;          ///< hits have values of a field
  bool with_labels = false;         ///< voxels are labels
  bool with_bounce = false;         ///< ambient rays may bring light

  ByteTable bytes() const {
    return with_labels ? ByteTable::kGroups : with_bounds ? ByteTable::kBounds : ByteTable::kNone;
  }
};

/// Limits that the lengths of a renderer's buffers depend on, beside its compressed volume. The
/// plan adds up the sizes() of these limits, and the renderer makes its buffers from them.
struct RendererLimits {
  MacrocellBuffers::Limits macrocells{};
  Wavefront::Limits rays{};
  BlockCache::Limits cache{};
  WaveLimits wave{};            ///< camera rays
  std::uint64_t kept_rays = 0;  ///< rays of KeptPicture; 0: there is none
  Layers::Limits layers{};
};

/// The memory of a field beside the volume (core/render/field_wave.hpp).
struct FieldPlan {
  bool shares_blocks = false;    ///< stream and cache are the drawn volume's
  std::uint32_t num_labels = 0;  ///< see FieldValues::sizes()
  BlockCache::Limits cache{};
  StreamPlace stream = StreamPlace::kDevice;  ///< kDevice or kHost
  std::uint32_t window_blocks = 0;            ///< kHost: see StreamWindow
  std::uint64_t largest_stream_part = 0;      ///< as MemoryRequest
  std::uint64_t bytes = 0;                    ///< all its buffers, scratch of its making included
};

struct MemoryPlan {
  PipelinePtr pipeline;
  RendererLimits limits{};
  ocl::BufferSizes buffers;  ///< buffers that live as long as the renderer
  std::uint64_t setup_bytes =
      0;  ///< all that exists while the value ranges are built, scratch included
  std::uint32_t cache_slots = 0;
  /// The cache may grow to so many, between frames; cache_slots if it cannot grow.
  std::uint32_t most_slots = 0;
  StreamPlace stream = StreamPlace::kDevice;  ///< kDevice or kHost
  std::uint32_t window_blocks = 0;            ///< kHost: see StreamWindow
  std::uint64_t stream_bytes = 0;             ///< bytes of the compressed volume's buffers
  FieldPlan field{};                          ///< of 0 bytes: there is none
  std::string reason;  ///< reason for the place: "the compressed volume of 10 bytes ..."

  std::uint64_t total() const { return buffers.bytes() + field.bytes; }
  /// The most bytes that exist while the cache has this size. A cache is freed before a larger one
  /// is made, so after the cache has grown this is also the most that ever existed.
  std::uint64_t peak() const { return std::max(total(), setup_bytes); }
  bool can_grow() const { return cache_slots < most_slots; }
};

/// The plan of the same renderer once its cache has so many slots.
MemoryPlan resized(MemoryPlan plan, std::uint32_t cache_slots);

/// Initial number of slots of a cache that may grow: twice the blocks that a frame needs in most
/// volumes, so that the next frame finds free slots. Twice that with rays that come to more blocks
/// than the camera's to their first hits: ambient rays, and those behind translucent surfaces. A
/// cache that grows for them makes the second frame a cold one.
std::uint32_t first_cache_slots(std::uint64_t num_blocks, std::uint64_t num_rays,
                                bool with_further_rays = false);

/// Slots for the next frame, after one that lacked `lacking` of them; plan.cache_slots if these are
/// enough.
std::uint32_t grown_cache_slots(const MemoryPlan &plan, std::uint64_t lacking);

/// The plan of a field that is the volume itself, and shares its blocks.
FieldPlan plan_shared_field();

/// The plan of a field with blocks of its own. It takes at most half the budget, if it can: its
/// cache then has fewer slots, and kAuto leaves its stream on the host.
///
/// request      of the volume
/// cache_slots  0: first_cache_slots()
FieldPlan plan_field(const CompressedVolume &field, const MemoryRequest &request,
                     std::uint64_t budget, std::uint32_t cache_slots);

/// The plan with so many cache slots, and with the stream at the place of request.stream; kAuto: on
/// the device.
///
/// Throws  Error: the stream does not fit four buffers on the device
MemoryPlan plan_memory(const CompressedVolume &volume, const MemoryRequest &request,
                       std::uint32_t cache_slots);

/// As plan_memory(), but kAuto leaves the stream on the host if the plan would otherwise exceed the
/// budget, and the stream on the host takes less.
///
/// budget  [bytes]
MemoryPlan plan_with_slots(const CompressedVolume &volume, const MemoryRequest &request,
                           std::uint64_t budget, std::uint32_t cache_slots);

/// The plan with the most cache slots whose peak is within a budget, and whose buffers the device
/// can allocate. kAuto leaves the stream on the host if that gives more slots, and the device would
/// not have enough useful ones beside the stream.
///
/// budget     [bytes]
/// max_slots  the most slots wanted
/// Throws     Error: not even kMinCacheSlots fit; names the smallest budget that would do
MemoryPlan plan_within(const ocl::Device &device, const CompressedVolume &volume,
                       const MemoryRequest &request, std::uint64_t budget, std::uint32_t max_slots);

/// A plan that can grow to as many slots as plan_within() gives. It begins with first_slots, or if
/// that is 0 with first_cache_slots(), or with as little as half of these if that keeps it below
/// the decoded volume.
///
/// budget, max_slots, Throws  as plan_within()
MemoryPlan plan_to_grow(const ocl::Device &device, const CompressedVolume &volume,
                        const MemoryRequest &request, std::uint64_t budget, std::uint32_t max_slots,
                        std::uint32_t first_slots = 0);

}  // namespace isowave::core
