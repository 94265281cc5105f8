#pragma once
// The blocks that an isosurface passes, listed, and brought into a cache batch by batch: what is
// common to all who make triangles of a compressed volume.
//
//   active blocks -> [ request -> cache -> decode ]*

#include <cstdint>

#include "core/render/block_store.hpp"
#include "core/stages/active_blocks.hpp"
#include "core/stages/request_surface.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Not thread-safe, as the device.
class SurfaceBlocks {
 public:
  struct Options {
    Gradients gradients = Gradients::kNone;
    std::uint64_t memory_budget = 0;          ///< bound on all device memory [bytes]
    StreamPlace stream = StreamPlace::kAuto;  ///< place of the compressed volume
    /// Other buffers that the owner keeps on the device as long as this.
    ocl::BufferSizes beside{};
    /// Rays of the Wavefront: a picture's, or one.
    std::uint64_t num_rays = 1;
  };

  /// The budget if none is given: 3/4 of the device's memory.
  static std::uint64_t default_budget(const ocl::Device &device);

  /// Uploads the volume and builds its macrocell ranges.
  ///
  /// device  must outlive this; volume, too
  /// Throws  Error: the device's memory or the budget does not suffice
  /// Waits   yes
  SurfaceBlocks(ocl::Device &device, const CompressedVolume &volume, const Options &options);

  /// Finds the blocks for an isovalue.
  ///
  /// Returns  how many there are
  /// Throws   Error: a NaN isovalue
  /// Waits    yes
  std::uint32_t find(float isovalue);
  /// Lists the blocks that find() found.
  ///
  /// Out    block_ids [find()]
  /// Waits  no
  void list(ocl::Buffer<uint> &block_ids) { listed_.list(frame(), block_ids); }
  /// How many different blocks the first `count` entries of the list need. Takes count_bytes() of
  /// device memory meanwhile.
  ///
  /// Waits  yes
  std::uint32_t count_needed(const ocl::Buffer<uint> &block_ids, std::uint32_t count) {
    return request_.count_needed(frame(), block_ids, count);
  }
  std::uint64_t count_bytes() const;

  /// Slots that serve any surface, and the bytes of a cache with so many.
  std::uint32_t least_slots() const { return blocks_of_block(gradients_); }
  std::uint64_t cache_bytes(std::uint32_t num_slots) const;
  /// Whether the device can allocate the values of so many slots.
  bool can_have(std::uint32_t num_slots) const;
  /// From `least_slots` to `wanted`, the most for which beside + cache_bytes() is within the
  /// budget.
  std::uint32_t most_slots(std::uint32_t wanted, std::uint64_t beside) const;
  /// Has a cache of so many slots for the isovalue of find(). One that is there and has as many is
  /// kept, with its blocks.
  void open_cache(std::uint32_t num_slots);
  /// Forgets all decoded blocks; their slots stay.
  void clear_cache();
  /// Forgets all decoded blocks, and gives their memory back, but for least_slots().
  void drop_cache() { resize_cache(least_slots()); }

  /// Caches the blocks that the entries [begin, end) of a list need. Returns false, and caches
  /// nothing, if there are not enough slots.
  ///
  /// Waits  yes
  bool bring(const ocl::Buffer<uint> &block_ids, std::uint32_t begin, std::uint32_t end);

  const FrameParams &frame() const { return store_.levels[0].frame; }  ///< grid, isovalue
  const ActiveBlocks &listed() const { return listed_; }
  const DeviceStream &stream() const { return store_.levels[0].stream; }
  const BlockCache &cache() const { return store_.cache; }
  std::uint32_t num_slots() const { return store_.cache.num_slots; }
  std::uint32_t num_cached() const { return num_cached_; }
  std::uint64_t num_decoded() const { return num_decoded_; }  ///< so far
  std::uint64_t budget() const { return budget_; }
  /// Bytes of all buffers that live as long as this, but the cache's; those of `beside` included.
  std::uint64_t fixed_bytes() const { return fixed_bytes_; }
  /// The hits of a picture, and what cache and decoder use of frames.
  Wavefront &rays() { return rays_; }

 private:
  void open(float isovalue);
  void resize_cache(std::uint32_t num_slots);

  Gradients gradients_;
  BlockGrid grid_;
  std::uint64_t budget_, fixed_bytes_;
  BlockStore store_;
  Wavefront rays_;
  ActiveBlocks listed_;
  RequestSurface request_;
  std::uint32_t num_cached_ = 0;
  std::uint64_t num_decoded_ = 0;
};

/// Batches of blocks: as many at a time as the cache has turned out to hold.
class BatchSize {
 public:
  BatchSize(std::uint32_t num_slots, std::uint64_t num_needed);

  std::uint32_t size() const { return size_; }  ///< at least 1
  void served();
  /// A batch of so many did not fit.
  void refused(std::uint32_t size);

 private:
  std::uint32_t size_;
};

}  // namespace isowave::core
