#include "core/zfp_decode.hpp"

namespace isowave {

namespace {
constexpr std::uint32_t kGroupSize = 64;
}

ZfpDecode::ZfpDecode(ocl::Device &device, std::uint64_t max_blocks)
    : range_(ocl::Range::strided(max_blocks, kGroupSize, device)),
      kernel_(device, "zfp_decode", "zfp_decode", group_defines(kGroupSize)) {}

void ZfpDecode::operator()(const DeviceStream &stream, const ocl::Buffer<FrameParams> &frame,
                           const CountsBuffer &counts, const ocl::Buffer<uint> &block_ids,
                           const ocl::Buffer<uint> &slots, const ocl::Buffer<uint> &entries,
                           ocl::Buffer<float> &values, ocl::Buffer<BlockEntry> &table) {
  kernel_(range_, frame, stream.words, stream.bits_per_block, counts, block_ids, slots, entries, values,
          table);
}

}  // namespace isowave
