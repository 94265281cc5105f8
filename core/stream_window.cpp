#include "core/stream_window.hpp"

#include <algorithm>

#include "core/error.hpp"
#include "core/io/mapped_file.hpp"
#include "core/parallel_for.hpp"

namespace isowave {

namespace {

/// Blocks that one thread gathers at a time: a random read of memory each, far more than what starting a thread costs.
constexpr std::size_t kGatherBlocks = 4096;
/// Of the request list, so many are read together with its length: one round trip instead of two.
constexpr std::size_t kIdsAtOnce = 4096;

void wait(const cl::Event &event) {
  try {
    if (event() != nullptr) event.wait();
  } catch (const cl::Error &error) {
    throw Error("a transfer of compressed blocks failed: {}: {}", error.what(), ocl::error_name(error.err()));
  }
}

/// Completes when all that is enqueued on the device's main queue has.
cl::Event mark(ocl::Device &device) {
  try {
    cl::Event event;
    device.queue().enqueueMarkerWithWaitList(nullptr, &event);
    device.queue().flush();
    return event;
  } catch (const cl::Error &error) {
    throw Error("device '{}' failed: {}: {}", device.info().name, error.what(), ocl::error_name(error.err()));
  }
}

/// What is enqueued on the device's main queue from now on begins after the event.
void hold_back(ocl::Device &device, const cl::Event &event) {
  try {
    const std::vector<cl::Event> events{event};
    device.queue().enqueueBarrierWithWaitList(&events);
  } catch (const cl::Error &error) {
    throw Error("device '{}' failed: {}: {}", device.info().name, error.what(), ocl::error_name(error.err()));
  }
}

}  // namespace

StreamWindow::StreamWindow(ocl::Device &device, const CompressedVolume &volume, std::uint32_t window_blocks)
    : device_(device),
      volume_(volume),
      window_blocks_(window_blocks),
      halves_{Half{{device, "stream window", half_words(volume.bits_per_block, window_blocks)},
                   {device, "stream staging", half_words(volume.bits_per_block, window_blocks)},
                   {},
                   {}},
              Half{{device, "stream window", half_words(volume.bits_per_block, window_blocks)},
                   {device, "stream staging", half_words(volume.bits_per_block, window_blocks)},
                   {},
                   {}}} {}

StreamWindow::~StreamWindow() {
  try {
    for (const Half &half : halves_) wait(half.uploaded);
  } catch (...) {  // a device error is reported by whoever waits next
  }
}

void StreamWindow::gather(std::span<const uint> block_ids, std::span<uint> words) const {
  if (volume_.file) volume_.file->check();
  const std::size_t block_words = words_per_block(volume_.bits_per_block);
  parallel_for((block_ids.size() + kGatherBlocks - 1) / kGatherBlocks, 0,
               [&](std::uint64_t part, std::uint32_t) {
                 const std::size_t begin = part * kGatherBlocks;
                 const std::size_t end = std::min(begin + kGatherBlocks, block_ids.size());
                 for (std::size_t i = begin; i < end; ++i) {
                   volume_.read_words(std::uint64_t{block_ids[i]} * volume_.bits_per_block,
                                      words.subspan(i * block_words, block_words));
                 }
               });
}

void StreamWindow::bring(std::span<const uint> block_ids, const Use &use) {
  for (std::size_t first = 0; first < block_ids.size(); first += window_blocks_) {
    const std::size_t count = std::min<std::size_t>(window_blocks_, block_ids.size() - first);
    Half &half = halves_[next_half_++ % halves_.size()];
    wait(half.uploaded);
    const std::span<uint> words = half.staging.words().first(half_words(volume_.bits_per_block, count));
    gather(block_ids.subspan(first, count), words);
    {
      const auto stage = device_.timer().stage("upload");
      half.words.upload(words, half.used, half.uploaded);  // with what decoders read past the last block
    }
    hold_back(device_, half.uploaded);
    use(half.words, static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count));
    half.used = mark(device_);
    uploaded_blocks_ += count;
  }
}

std::span<const uint> StreamWindow::read_granted(const CountsBuffer &counts,
                                                 const ocl::Buffer<uint> &block_ids) {
  const cl::Event reached = mark(device_);
  cl::Event counts_read, ids_read;
  granted_.resize(block_ids.size());
  const std::size_t at_once = std::min(kIdsAtOnce, granted_.size());
  counts.download({&counts_, 1}, 0, reached, counts_read);
  block_ids.download(std::span(granted_).first(at_once), 0, reached, ids_read);
  wait(counts_read);
  wait(ids_read);
  if (counts_.decoded_count > at_once) {
    block_ids.download(std::span(granted_).subspan(at_once, counts_.decoded_count - at_once), at_once,
                       reached, ids_read);
    wait(ids_read);
  }
  return std::span(granted_).first(counts_.decoded_count);
}

}  // namespace isowave
