#pragma once
// The way of blocks to the device when the compressed volume stays on the host: gathered into
// pinned memory, uploaded on a second queue into one half of a window, and decoded from there while
// the other half is filled.

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/ocl/buffer.hpp"
#include "core/ocl/in_flight.hpp"
#include "core/ocl/pinned_buffer.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

class StreamWindow {
 public:
  /// volume         must outlive the window
  /// window_blocks  blocks that one half holds, at least 1
  /// max_copy       most bytes of a payload in a file that is copied to host memory; each block of
  ///                a larger one is read when it is requested, which costs a system call
  StreamWindow(ocl::Device &device, const CompressedVolume &volume, std::uint32_t window_blocks,
               std::uint64_t max_copy = default_max_copy());
  /// A quarter of the host's memory.
  static std::uint64_t default_max_copy();
  StreamWindow(const StreamWindow &) = delete;
  StreamWindow &operator=(const StreamWindow &) = delete;

  /// Words of a block in the window, where each block begins with a whole word: of every block at a
  /// fixed rate, otherwise of most blocks.
  static std::uint64_t words_per_block(const CompressedVolume &volume);
  /// Buffers of both halves and their staging memory. Each half holds the places where blocks begin
  /// and end (kernels_cl/device/block_stream.h) unless all have one length, then the blocks, then
  /// two words that decoders read past their block.
  static ocl::BufferSizes sizes(const CompressedVolume &volume, std::uint32_t window_blocks);

  /// A function that enqueues launches which read blocks block_ids[first .. first + count), one
  /// after the other in `words`.
  using Use =
      std::function<void(const ocl::Buffer<uint> &words, std::uint32_t first, std::uint32_t count)>;
  /// Brings blocks to the device, as many at a time as fit, and calls `use` for each of these runs,
  /// in order. Waits for the uploads of all runs except the last two. Throws Error if the file that
  /// blocks are read from has become shorter.
  void bring(std::span<const uint> block_ids, const Use &use);

  /// Waits for all that was enqueued before, and returns the first counts.decoded_count of
  /// block_ids. The caller may change them; they are valid until the next call.
  std::span<uint> read_granted(const ocl::Buffer<PassCounts> &counts,
                               const ocl::Buffer<uint> &block_ids);

  std::uint64_t uploaded_blocks() const { return uploaded_blocks_; }  ///< since it was made
  std::uint64_t uploaded_bytes() const { return uploaded_bytes_; }    ///< since it was made

 private:
  struct Half {
    ocl::Buffer<uint> words;
    ocl::PinnedBuffer staging;
    cl::Event uploaded;  ///< staging may be filled again
    cl::Event used;      ///< words may be overwritten
  };

  StreamWindow(ocl::Device &device, const CompressedVolume &volume, std::uint32_t window_blocks,
               const ocl::BufferSizes &sizes);
  void copy_payload(std::uint64_t max_copy);
  /// The number of the first block_ids that fit one half; at least one.
  std::size_t run_length(std::span<const uint> block_ids) const;
  /// The volume's bits from the beginning of block block_id on, as many as `out` has.
  void read_block(std::uint32_t block_id, std::span<uint> out) const;
  /// Fills `half` with these blocks; returns the words that are to be uploaded.
  std::span<uint> gather(std::span<const uint> block_ids, Half &half) const;

  ocl::Device &device_;
  const CompressedVolume &volume_;
  std::uint32_t window_blocks_;
  std::vector<std::uint32_t> copy_;  ///< the payload, as CompressedVolume::words; or empty
  std::array<Half, 2> halves_;
  std::size_t next_half_ = 0;
  std::uint64_t uploaded_blocks_ = 0, uploaded_bytes_ = 0;
  struct Granted {
    PassCounts counts{};
    std::vector<uint> block_ids;
  };
  ocl::InFlight<Granted> granted_;  ///< what read_granted() reads
};

}  // namespace isowave::core
