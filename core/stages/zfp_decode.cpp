#include "core/stages/zfp_decode.hpp"

#include <limits>
#include <stdexcept>

#include "kernels_cl/portable/block_grid.h"

namespace isowave::core {

namespace {

ocl::Defines all_defines(ocl::Defines stream_defines, bool levels) {
  stream_defines.merge(with_levels(group_defines(ocl::kGroupSize), levels));
  return stream_defines;
}

}  // namespace

ocl::BufferSizes ZfpDecode::sizes(std::uint64_t max_blocks, bool stream_on_host, bool levels) {
  if (!stream_on_host || !levels) return {};
  return {ocl::buffer_size<uint>("decode places", max_blocks)};
}

ZfpDecode::ZfpDecode(ocl::Device &device, std::uint64_t max_blocks,
                     const ocl::Defines &stream_defines, bool levels, SlotType slots)
    : device_(device),
      stream_defines_(stream_defines),
      range_(ocl::Range::strided(max_blocks, ocl::kGroupSize, device)),
      kernel_(device, with_slots(all_defines(stream_defines, levels), slots)) {
  const bool stream_on_host = DeviceStream::is_window(stream_defines);
  if (stream_on_host && levels)
    places_.emplace(device, sizes(max_blocks, stream_on_host, levels)["decode places"]);
}

void ZfpDecode::resize(std::uint64_t max_blocks) {
  range_ = ocl::Range::strided(max_blocks, ocl::kGroupSize, device_);
  if (!places_) return;
  { const ocl::Buffer<uint> gone = std::move(*places_); }
  *places_ = {device_, sizes(max_blocks, true, true)["decode places"]};
}

void ZfpDecode::compile(const DeviceStream &stream, const CountsBuffer &counts, BlockCache &cache) {
  const ocl::Buffer<uint> &words = cache.request_block_ids;  // stands in for what is not read
  const FrameParams frame{};
  for (const ocl::Range &range :
       {ocl::Range{1, ocl::kGroupSize}, range_}) {  // PoCL compiles large ones anew
    kernel_(range, frame, words, words, words, words, words, stream.layout, frame, words, words,
            stream.layout, 0, 0, counts, words, words, cache.decode_slots, cache.values,
            cache.inside);
  }
}

bool ZfpDecode::can_join(const DeviceStream &next) const {
  ocl::Defines in_one_part = stream_defines_;
  in_one_part.erase("ISO_STREAM_PARTS");
  return !DeviceStream::is_window(stream_defines_) && next.defines() == in_one_part;
}

void ZfpDecode::decode(const Source &source, const Source &next, const CountsBuffer &counts,
                       const ocl::Buffer<uint> &block_ids, const ocl::Buffer<uint> &slots,
                       ocl::Buffer<SlotValue> &values, ocl::Buffer<ulong> &inside) {
  const DeviceStream &stream = source.stream;
  if (stream.defines() != stream_defines_) {
    throw std::invalid_argument("ZfpDecode was built for a stream in another number of parts");
  }
  if (!stream.window) {
    kernel_(range_, source.frame, stream.part(0), stream.part(1), stream.part(2), stream.part(3),
            stream.index(), stream.layout, next.frame, next.stream.part(0), next.stream.index(),
            next.stream.layout, 0, std::numeric_limits<uint>::max(), counts, block_ids, block_ids,
            slots, values, inside);
    return;
  }
  std::span<uint> granted = stream.window->read_granted(counts, block_ids);
  if (places_) granted = granted.first(take_own(granted, source.frame));
  stream.window->bring(
      granted, [&](const ocl::Buffer<uint> &words, std::uint32_t first, std::uint32_t count) {
        kernel_(ocl::Range::strided(count, ocl::kGroupSize, device_), source.frame, words, words,
                words, words, stream.index(words), stream.layout, source.frame, words,
                stream.index(words), stream.layout, first, first + count, counts,
                places_ ? *places_ : block_ids, block_ids, slots, values, inside);
      });
}

/// Keeps the first of block_ids for those of this level, as places in it, and tells the device
/// which they were. Returns how many.
std::size_t ZfpDecode::take_own(std::span<uint> block_ids, const FrameParams &frame) {
  std::vector<uint> places;
  for (std::size_t i = 0; i < block_ids.size(); ++i) {
    const uint block = level_block_of(&frame, block_ids[i]);
    if (block == ISO_INVALID_ID) continue;
    block_ids[places.size()] = block;
    places.push_back(static_cast<uint>(i));
  }
  places_->write(places);
  return places.size();
}

}  // namespace isowave::core
