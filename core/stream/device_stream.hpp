#pragma once
// The compressed volume as decoding kernels see it (kernels_cl/device/block_stream.h): whole on the
// device, in as many buffers as its largest allocation demands, or on the host, behind a window.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/ocl/kernel.hpp"
#include "core/stream/stream_window.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// OpenCL promises that a buffer may have a quarter of a device's memory.
inline constexpr std::uint32_t kMaxStreamParts = 4;

/// How a volume's words are cut so that no buffer is too large.
struct StreamSplit {
  std::uint32_t num_parts = 0;  ///< 1..4; 0: more would be needed
  std::uint32_t words_per_part =
      0;  ///< from the beginning of one part to that of the next; 0: there is only one
  std::vector<std::uint64_t> words{};  ///< of each part: the next part's first are at its end, so
                                       ///< that a block which begins in it is whole
};
/// largest_part: bytes.
StreamSplit split_stream(const CompressedVolume &volume, std::uint64_t largest_part);

/// The table of voxels without data (kernels_cl/portable/no_data.h) on the device. The default: all
/// voxels have data.
struct NoDataOnDevice {
  const ocl::Buffer<uint> *words = nullptr;
  uint begin = ISO_INVALID_ID;  ///< the table's first word

  /// Kernels need a buffer in any case.
  const ocl::Buffer<uint> &words_or(const ocl::Buffer<uint> &other) const {
    return words != nullptr ? *words : other;
  }
};

/// The tag of a stream that stays on the host.
struct OnHost {
  std::uint32_t window_blocks = 0;  ///< see StreamWindow
  std::uint64_t max_copy = StreamWindow::default_max_copy();
};

/// What the index of a stream has a byte of for each block, or for each label.
enum class ByteTable {
  kNone,
  kBounds,  ///< codes of the blocks' bounds, for layout.bound_unit
  kGroups   ///< groups of the labels (kernels_cl/portable/label_table.h)
};

class DeviceStream {
 public:
  /// Buffers of a whole stream in such parts, or of a stream behind a window, with the table of
  /// voxels without data, and that of bytes.
  static ocl::BufferSizes sizes(const CompressedVolume &volume, const StreamSplit &split,
                                ByteTable bytes);
  static ocl::BufferSizes sizes(const CompressedVolume &volume, OnHost host, ByteTable bytes);

  /// Uploads the whole volume and waits.
  ///
  /// largest_part  most bytes of a buffer; 0: what the device allows
  /// bytes         the table that is there, too; of groups, every label is in none
  /// Throws        Error: four such buffers do not hold the volume
  DeviceStream(ocl::Device &device, const CompressedVolume &volume, std::uint64_t largest_part = 0,
               ByteTable bytes = ByteTable::kNone);
  /// Leaves the volume on the host. The volume must outlive the stream.
  DeviceStream(ocl::Device &device, const CompressedVolume &volume, OnHost host,
               ByteTable bytes = ByteTable::kNone);

  /// Puts labels into groups, of a stream with ByteTable::kGroups.
  ///
  /// table  [ISO_NUM_LABELS]
  /// Waits  yes
  void set_groups(std::span<const std::uint8_t> table);
  bool has_groups() const { return bytes_ == ByteTable::kGroups; }

  /// For kernels that include block_stream.h.
  ocl::Defines defines() const;
  /// Do these defines stand for a stream on the host?
  static bool is_window(const ocl::Defines &defines);
  /// Buffer i of 0..3 of a whole stream; the first if there are fewer.
  const ocl::Buffer<uint> &part(std::size_t i) const { return parts[i < parts.size() ? i : 0]; }
  /// The places of a whole stream's blocks (block_index.h), the table of bytes, and that of voxels
  /// without data; any buffer if there is none of them. words: the window's, if
  /// there is a window.
  const ocl::Buffer<uint> &index() const { return block_index ? *block_index : parts[0]; }
  const ocl::Buffer<uint> &index(const ocl::Buffer<uint> &words) const {
    return block_index ? *block_index : words;
  }
  NoDataOnDevice no_data() const {
    return {layout.no_data_begin != ISO_INVALID_ID ? &*block_index : nullptr, layout.no_data_begin};
  }

  std::vector<ocl::Buffer<uint>> parts;  ///< 1..4; none if the volume stays on the host
  /// The places of blocks, the table of bytes, and that of voxels without data; empty if there is
  /// none of the three.
  std::optional<ocl::Buffer<uint>> block_index;
  std::unique_ptr<StreamWindow> window;  ///< if the volume stays on the host
  StreamLayout layout;

 private:
  void add_index(ocl::Device &device, std::span<const std::uint32_t> index,
                 std::span<const std::uint8_t> bytes, std::span<const std::uint32_t> no_data);

  bool indexed_;
  ByteTable bytes_;
};

}  // namespace isowave::core
