#include "core/zfp_decode.hpp"

#include <limits>
#include <stdexcept>

#include "kernels_cl/block_grid.h"

namespace isowave {

namespace {

ocl::Defines all_defines(ocl::Defines stream_defines, bool levels) {
  stream_defines.merge(with_levels(group_defines(ocl::kGroupSize), levels));
  return stream_defines;
}

}  // namespace

ZfpDecode::ZfpDecode(ocl::Device &device, std::uint64_t max_blocks, const ocl::Defines &stream_defines,
                     bool levels)
    : device_(device),
      stream_defines_(stream_defines),
      levels_(levels),
      range_(ocl::Range::strided(max_blocks, ocl::kGroupSize, device)),
      kernel_(device, "zfp_decode", "zfp_decode", all_defines(stream_defines, levels)) {}

void ZfpDecode::operator()(const DeviceStream &stream, const FrameParams &frame, const CountsBuffer &counts,
                           const ocl::Buffer<uint> &block_ids, const ocl::Buffer<uint> &slots,
                           ocl::Buffer<float> &values, ocl::Buffer<ulong> &inside) {
  if (stream.defines() != stream_defines_) {
    throw std::invalid_argument("ZfpDecode was built for a stream in another number of parts");
  }
  if (!stream.window) {
    kernel_(range_, frame, stream.part(0), stream.part(1), stream.part(2), stream.part(3), stream.index(),
            stream.layout, 0, std::numeric_limits<uint>::max(), counts, block_ids, slots, values, inside);
    return;
  }
  const std::span<uint> granted = stream.window->read_granted(counts, block_ids);
  for (uint &id : granted) id = levels_ ? level_block_of(&frame, id) : id;
  stream.window->bring(granted,
                       [&](const ocl::Buffer<uint> &words, std::uint32_t first, std::uint32_t count) {
                         kernel_(ocl::Range::strided(count, ocl::kGroupSize, device_), frame, words, words,
                                 words, words, stream.index(words), stream.layout, first, first + count,
                                 counts, block_ids, slots, values, inside);
                       });
}

}  // namespace isowave
