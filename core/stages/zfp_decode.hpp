#pragma once
// New blocks -> 4^3 values in their cache slots (Sec. 3.5).

#include <optional>
#include <span>

#include "core/stages/block_cache.hpp"
#include "core/stages/wavefront.hpp"
#include "core/stream/device_stream.hpp"
#include "kernels/zfp_decode.hpp"

namespace isowave::core {

class ZfpDecode {
 public:
  /// The buffers; none for one level of detail alone, or if streams are whole on the device.
  static ocl::BufferSizes sizes(std::uint64_t max_blocks, bool stream_on_host, bool levels);
  /// max_blocks      the most a call may decode
  /// stream_defines  DeviceStream::defines() of the streams to come
  /// levels          block ids count on through several levels of detail (LevelPlace), and only
  ///                 blocks of the levels at hand are decoded
  ZfpDecode(ocl::Device &device, std::uint64_t max_blocks, const ocl::Defines &stream_defines = {},
            bool levels = false, SlotType slots = SlotType::kFloat32);

  /// Up to so many blocks from now on: as BlockCache::resize().
  void resize(std::uint64_t max_blocks);

  /// Launches the kernel without a block to decode, see Device::Compiling.
  void compile(const DeviceStream &stream, const CountsBuffer &counts, BlockCache &cache);

  /// A level's compressed blocks, and the frame whose part it draws.
  struct Source {
    const DeviceStream &stream;
    const FrameParams &frame;
  };
  /// Whether blocks of this level can be decoded together with those that a call is for.
  bool can_join(const DeviceStream &next) const;

  /// Decodes blocks to slots of a cache. Bit-exact with libzfp.
  ///
  /// In      block_ids, slots [counts.decoded_count]
  /// Out     values [64 * slots], of the slots' type, x + 4y + 16z within a slot; inside [slots], a
  /// bit for each voxel Throws  Error: the stream stays on the host, and the volume's file has
  /// become shorter Waits   if the stream stays on the host, for all that is enqueued
  void operator()(const DeviceStream &stream, const FrameParams &frame, const CountsBuffer &counts,
                  const ocl::Buffer<uint> &block_ids, const ocl::Buffer<uint> &slots,
                  ocl::Buffer<SlotValue> &values, ocl::Buffer<ulong> &inside) {
    const Source source{stream, frame};
    decode(source, source, counts, block_ids, slots, values, inside);
  }
  /// The same for what the cache has granted, of one level or two that can be joined (or the same
  /// twice).
  void operator()(const Source &source, const Source &next, const CountsBuffer &counts,
                  BlockCache &cache) {
    decode(source, next, counts, cache.request_block_ids, cache.decode_slots, cache.values,
           cache.inside);
  }

 private:
  void decode(const Source &source, const Source &next, const CountsBuffer &counts,
              const ocl::Buffer<uint> &block_ids, const ocl::Buffer<uint> &slots,
              ocl::Buffer<SlotValue> &values, ocl::Buffer<ulong> &inside);
  std::size_t take_own(std::span<uint> block_ids, const FrameParams &frame);

  ocl::Device &device_;
  ocl::Defines stream_defines_;
  ocl::Range range_;
  std::optional<ocl::Buffer<uint>>
      places_;  ///< of this level's requests, if several levels' streams are in windows
  ocl::Kernel<kernels::zfp_decode> kernel_;
};

}  // namespace isowave::core
