#include "core/stream/stream_window.hpp"

#include <algorithm>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/platform/memory.hpp"

namespace isowave::core {

namespace {

/// Blocks that one thread gathers at a time: a random read of memory each, far more than what
/// starting a thread costs.
constexpr std::size_t kGatherBlocks = 4096;
/// Entries of the request list that are read together with its length: one round trip instead of
/// two.
constexpr std::size_t kIdsAtOnce = 4096;
/// Words of a copied payload that are read at a time.
constexpr std::uint64_t kCopyWords = 1u << 20;

void wait(const cl::Event &event) {
  try {
    if (event() != nullptr) event.wait();
  } catch (const cl::Error &error) {
    throw Error("a transfer of compressed blocks failed: {}: {}", error.what(),
                ocl::error_name(error.err()));
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
    throw Error("device '{}' failed: {}: {}", device.info().name, error.what(),
                ocl::error_name(error.err()));
  }
}

/// Makes commands that are enqueued on the device's main queue from now on wait for the event.
void hold_back(ocl::Device &device, const cl::Event &event) {
  try {
    const std::vector<cl::Event> events{event};
    device.queue().enqueueBarrierWithWaitList(&events);
  } catch (const cl::Error &error) {
    throw Error("device '{}' failed: {}: {}", device.info().name, error.what(),
                ocl::error_name(error.err()));
  }
}

}  // namespace

StreamWindow::StreamWindow(ocl::Device &device, const CompressedVolume &volume,
                           std::uint32_t window_blocks, const ocl::BufferSizes &sizes)
    : device_(device),
      volume_(volume),
      window_blocks_(window_blocks),
      halves_{Half{{device, sizes["stream window"]}, {device, sizes["stream staging"]}, {}, {}},
              Half{{device, sizes["stream window"]}, {device, sizes["stream staging"]}, {}, {}}},
      granted_(device) {}

StreamWindow::StreamWindow(ocl::Device &device, const CompressedVolume &volume,
                           std::uint32_t window_blocks, std::uint64_t max_copy)
    : StreamWindow(device, volume, window_blocks, sizes(volume, window_blocks)) {
  copy_payload(max_copy);
}

void StreamWindow::copy_payload(std::uint64_t max_copy) {
  const std::uint64_t num_words = volume_.word_count();
  if (!volume_.file || num_words * sizeof(std::uint32_t) > max_copy) return;
  copy_.resize(num_words);
  parallel_for(
      (num_words + kCopyWords - 1) / kCopyWords, 0, [&](std::uint64_t part, std::uint32_t) {
        const std::uint64_t first = part * kCopyWords;
        volume_.read_words(32 * first,
                           std::span(copy_).subspan(
                               first, std::min<std::uint64_t>(kCopyWords, num_words - first)));
      });
}

std::uint64_t StreamWindow::default_max_copy() {
  return platform::host_memory() / 4;
}

std::uint64_t StreamWindow::words_per_block(const CompressedVolume &volume) {
  if (!volume.is_indexed()) return (volume.bits_per_block + 31) / 32;
  return volume.payload_bits() / 32 / volume.block_count() + 1;
}

ocl::BufferSizes StreamWindow::sizes(const CompressedVolume &volume, std::uint32_t window_blocks) {
  std::uint64_t words = window_blocks * words_per_block(volume) + kDecoderAhead;
  if (volume.is_indexed()) {
    const std::uint64_t largest = (volume.max_block_bits() + 31) / 32 + kDecoderAhead;
    words = std::max(words, largest) + window_blocks + 1;
  }
  const ocl::BufferSize window = ocl::buffer_size<uint>("stream window", words),
                        staging = ocl::buffer_size<uint>("stream staging", words);
  return {window, window, staging, staging};
}

std::size_t StreamWindow::run_length(std::span<const uint> block_ids) const {
  const std::size_t most = std::min<std::size_t>(window_blocks_, block_ids.size());
  if (!volume_.is_indexed()) return most;
  std::size_t count = 0;
  std::uint64_t left = halves_[0].words.size() - kDecoderAhead - window_blocks_ - 1;
  for (; count < most; ++count) {
    const std::uint64_t words = (volume_.block_bits(block_ids[count]) + 31) / 32;
    if (words > left) break;
    left -= words;
  }
  return count;
}

void StreamWindow::read_block(std::uint32_t block_id, std::span<uint> out) const {
  const std::uint64_t begin = volume_.block_begin(block_id);
  if (copy_.empty()) return volume_.read_words(begin, out);
  copy_bits(std::as_bytes(std::span(copy_)), begin, 32 * std::uint64_t{out.size()}, out);
}

std::span<uint> StreamWindow::gather(std::span<const uint> block_ids, Half &half) const {
  const std::span<uint> words = half.staging.words();
  const std::size_t count = block_ids.size(), each = words_per_block(volume_);
  std::size_t end = count * each;
  if (volume_.is_indexed()) {
    end = count + 1;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t bits = volume_.block_bits(block_ids[i]), num_words = (bits + 31) / 32;
      words[i] = window_entry(static_cast<uint>(end), 32 * num_words - bits);
      end += num_words;
    }
    words[count] = window_entry(static_cast<uint>(end), 0);
  }
  parallel_for(
      (count + kGatherBlocks - 1) / kGatherBlocks, 0, [&](std::uint64_t part, std::uint32_t) {
        const std::size_t first = part * kGatherBlocks;
        for (std::size_t i = first; i < std::min(first + kGatherBlocks, count); ++i) {
          const std::size_t begin = volume_.is_indexed() ? entry_bit(words[i]) / 32 : i * each;
          const std::size_t num_words =
              volume_.is_indexed() ? entry_bit(words[i + 1]) / 32 - begin : each;
          read_block(block_ids[i], words.subspan(begin, num_words));
        }
      });
  return words.first(end + kDecoderAhead);
}

void StreamWindow::bring(std::span<const uint> block_ids, const Use &use) {
  for (std::size_t first = 0; first < block_ids.size();) {
    const std::size_t count = run_length(block_ids.subspan(first));
    Half &half = halves_[next_half_++ % halves_.size()];
    wait(half.uploaded);
    const std::span<uint> words = gather(block_ids.subspan(first, count), half);
    {
      const auto stage = device_.timer().stage("upload");
      half.words.upload(words, half.used, half.uploaded);
    }
    hold_back(device_, half.uploaded);
    use(half.words, static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count));
    half.used = mark(device_);
    uploaded_blocks_ += count;
    uploaded_bytes_ += (words.size() - kDecoderAhead) * sizeof(uint);
    first += count;
  }
}

std::span<uint> StreamWindow::read_granted(const ocl::Buffer<PassCounts> &counts,
                                           const ocl::Buffer<uint> &block_ids) {
  const cl::Event reached = mark(device_);
  cl::Event counts_read, ids_read;
  if (granted_->block_ids.size() != block_ids.size()) {
    device_.finish();  // a download that failed may still write to the old list
    granted_->block_ids.resize(block_ids.size());
  }
  const std::span<uint> ids = granted_->block_ids;
  const std::size_t at_once = std::min(kIdsAtOnce, ids.size());
  counts.download({&granted_->counts, 1}, 0, reached, counts_read);
  block_ids.download(ids.first(at_once), 0, reached, ids_read);
  wait(counts_read);
  wait(ids_read);
  const std::uint32_t count = granted_->counts.decoded_count;
  if (count > at_once) {
    block_ids.download(ids.subspan(at_once, count - at_once), at_once, reached, ids_read);
    wait(ids_read);
  }
  return ids.first(count);
}

}  // namespace isowave::core
