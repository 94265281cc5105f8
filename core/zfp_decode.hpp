#pragma once
// New blocks -> 4^3 float32 values in their cache slots (Sec. 3.5).

#include "core/block_cache.hpp"
#include "core/ocl/kernel.hpp"
#include "core/wavefront.hpp"
#include "core/zfp_stream.hpp"

namespace isowave {

/// The compressed volume on the device.
struct DeviceStream {
  /// Uploads and waits. Throws Error when the stream does not fit one allocation of the device.
  DeviceStream(ocl::Device &device, const CompressedVolume &volume)
      : words(device, "zfp stream", std::span<const uint>(volume.words)),
        bits_per_block(volume.bits_per_block) {}

  ocl::Buffer<uint> words;       ///< payload, block b at bit b * bits_per_block
  std::uint32_t bits_per_block;  ///< 9..2048
};

class ZfpDecode {
 public:
  /// max_blocks: the most a call may decode.
  ZfpDecode(ocl::Device &device, std::uint64_t max_blocks);

  /// Decodes blocks block_ids[0..n) to slots[0..n) of values, n = counts.decoded_count, and notes in entries[0..n) of the
  /// table which voxels are inside. Bit-exact with libzfp. Asynchronous.
  void operator()(const DeviceStream &stream, const ocl::Buffer<FrameParams> &frame,
                  const CountsBuffer &counts, const ocl::Buffer<uint> &block_ids,
                  const ocl::Buffer<uint> &slots, const ocl::Buffer<uint> &entries,
                  ocl::Buffer<float> &values, ocl::Buffer<BlockEntry> &table);
  /// The same for what the cache has granted.
  void operator()(const DeviceStream &stream, const ocl::Buffer<FrameParams> &frame,
                  const CountsBuffer &counts, BlockCache &cache) {
    (*this)(stream, frame, counts, cache.request_block_ids, cache.decode_slots, cache.decode_entries,
            cache.values, cache.table);
  }

 private:
  ocl::Range range_;
  ocl::Kernel<ocl::In<FrameParams>, ocl::In<uint>, uint, ocl::In<PassCounts>, ocl::In<uint>, ocl::In<uint>,
              ocl::In<uint>, ocl::Out<float>, ocl::Out<BlockEntry>>
      kernel_;
};

}  // namespace isowave
