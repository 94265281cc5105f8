#pragma once
// A compressed volume, or one of its levels of detail, for rays on the host: the value ranges of
// all blocks; for blocks that rays come to, also their voxels, and the cells that an isovalue
// crosses.

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/host/block_pages.hpp"
#include "core/host/host_loops.hpp"
#include "core/host/host_room.hpp"
#include "core/volume/block_box.hpp"
#include "core/zfp/block_chunks.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// The values that blocks are decoded to: with fewer bit planes, or raised or lowered.
struct HostValues {
  /// voxel_error   see with_fewer_planes()
  /// is_finest     it is the volume itself
  /// value_range   of the volume
  /// Throws        Error: as value_offset()
  HostValues(const CompressedVolume &level, bool is_finest, double voxel_error, FieldBound bound,
             const std::array<float, 2> &value_range);
  /// All bit planes of the volume itself.
  explicit HostValues(const CompressedVolume &level)
      : min_exponent(level.precision.min_exponent),
        whole(whole_numbers_of(level.info.type, level.precision)) {}
  bool operator==(const HostValues &) const = default;

  std::int32_t min_exponent;
  WholeNumbers whole;
  double plane_error = 0;       ///< how far values may be from those of all planes
  float uniform = 0, unit = 0;  ///< of ValueOffset
};

/// The blocks of a volume. Not thread-safe, except the functions that rays call (BlockMaker).
class HostBlocks {
 public:
  /// Memory of a volume with this grid if nothing is decoded, for one isovalue. is_in_chunks: see
  /// CompressedVolume::chunks
  static std::uint64_t bytes(const VolumeInfo &info, bool is_in_chunks = false);
  /// Memory of each further isovalue.
  static std::uint64_t bytes_per_isovalue(const VolumeInfo &info);
  /// Room for the blocks that a single ray needs at a time.
  static std::uint64_t ray_bytes();
  /// The least limit.
  static std::uint64_t least_bytes(const VolumeInfo &info) { return bytes(info) + ray_bytes(); }
  static constexpr std::uint64_t kNoLimit = HostRoom::kNoLimit;

  /// Decodes the finest level once, only for the ranges. This takes 128 more bytes for each block
  /// of a layer along z. The ranges of a volume in chunks are those of its macrocells, which are
  /// there; rays that come to a chunk that is missing end with ChunkIsMissing.
  ///
  /// volume        must outlive this
  /// memory_limit  bound on bytes(); at least least_bytes()
  /// num_threads   0: one per processor
  /// Throws        Error: a file that the volume is in has become shorter, or cannot be read
  HostBlocks(const CompressedVolume &volume, std::uint64_t memory_limit, std::uint32_t num_threads);
  HostBlocks(CompressedVolume &&, std::uint64_t, std::uint32_t) = delete;
  /// The same within memory that others share.
  ///
  /// room    must outlive this
  /// labels  as show_labels(); empty: the field is the volume's
  HostBlocks(const CompressedVolume &volume, HostRoom &room, std::uint32_t num_threads,
             std::vector<std::uint8_t> labels = {});

  /// Shows the field of another group of labels, of a volume that was made with one: it is 1 at
  /// voxels with a label of the group, and 0 at the others. Decodes all blocks once, for the
  /// ranges, unless the group is in use.
  ///
  /// labels  [ISO_NUM_LABELS] 1: the label is in the group; else 0
  /// Throws  Error: as the constructor
  void show_labels(const std::vector<std::uint8_t> &labels);

  /// Has blocks decoded to these values, and forgets those of others. Before: all planes.
  void decode_as(const HostValues &values);

  /// Finds the blocks that may have cells whose corners are not all on one side of an isovalue, for
  /// field() and surface(). Does nothing if the isovalue is in use. Other cells cannot have a hit
  /// (cell_intersect.h), so rays may skip them. Decoded blocks stay.
  void select(float isovalue) { select({&isovalue, 1}); }
  /// The same for several isovalues at once, one or more. All fields have the same decoded blocks.
  void select(std::span<const float> isovalues);

  /// The field that rays walk through, within run(). Stays valid until the next select().
  ///
  /// selection  which of the isovalues that were selected
  HostField field(std::size_t selection = 0);
  /// A selected isovalue, and the box around the blocks that may have such a cell.
  const Surface &surface(std::size_t selection = 0) const {
    return selections_.at(selection)->surface;
  }

  /// As HostRoom::run().
  ///
  /// Throws  Error: a file cannot be read; an exception of work
  void run(std::uint64_t num_items,
           const std::function<void(std::uint64_t item, bool is_alone)> &work) {
    room_->run(num_items, work);
  }

  /// Forgets all decoded blocks. Their memory is kept, and counted.
  void forget();
  bool is_decoded(std::size_t block) const;
  /// Number of blocks that have been decoded for rays, from the start.
  std::uint64_t num_decoded() const { return num_decoded_.load(std::memory_order_relaxed); }
  /// Memory at present: value ranges and decoded blocks, in whole pages of the system.
  std::uint64_t bytes() const { return room_->bytes(); }

  /// The box around the blocks that hold an isovalue, by value ranges in 8 bits as Macrocells has
  /// them. So views from this box are those of a device.
  ///
  /// Returns  nothing if there is no such block
  std::optional<BlockBox> rounded_box(float isovalue) const;
  /// The least and the largest of all voxels with data, of all bit planes.
  std::array<float, 2> extremes() const;
  /// Value ranges of the cells of macrocells, x fastest, of all bit planes.
  MacrocellRanges macrocell_ranges() const {
    return {macrocell_ranges_.low, macrocell_ranges_.high};
  }

 private:
  using Values = BlockPages<float>;
  using Changing = BlockPages<ulong>;

  /// Dual cells of each block [macrocell][64]: the order of masks. Blocks without such cells:
  /// ranges that hold nothing. A volume in chunks has none.
  struct DualRanges {
    std::vector<float> low, high;
  };

  /// The blocks that an isovalue crosses, and of those that are open, the cells that change.
  struct Selection final : BlockMaker {
    explicit Selection(HostBlocks &blocks);
    void open(std::size_t block) override { of->open(*this, block); }
    void decode(std::span<const std::size_t> blocks) override { of->decode(blocks); }

    HostBlocks *of;
    std::vector<ulong> masks;  ///< as in HostField
    Changing changing;         ///< [block]
    std::vector<std::atomic<uchar>> opened;
    uchar number;
    std::optional<float> isovalue;
    Surface surface{};
  };

  HostBlocks(const CompressedVolume &volume, std::unique_ptr<HostRoom> room,
             std::uint32_t num_threads);
  void select(Selection &selection, float isovalue);
  void open(Selection &selection, std::size_t block);
  void decode(std::span<const std::size_t> blocks);
  void drop();
  template <class T>
  void release(BlockPages<T> &pages);
  template <class T>
  void take_page(BlockPages<T> &pages, std::uint64_t item);
  bool find_chunks(std::span<const std::size_t> blocks) const;
  void decode_or_guess(std::span<const std::size_t> blocks, bool are_there);
  void decode_once(std::size_t block);
  void decode_to(std::size_t block, float *values) const;
  void find_changing(Selection &selection, std::size_t block,
                     std::span<const std::size_t, 8> dual_grid);

  ulong owning_blocks(std::size_t macrocell) const;
  ulong blocks_that_hold(std::size_t macrocell, float isovalue) const;
  bool may_hold(float low, float high, std::uint32_t bound_code, float isovalue) const;
  std::uint32_t dual_grid_code(const glm::uvec3 &block) const;
  void find_ranges();
  void take_ranges_of_chunks();
  void to_group(float *values) const;
  void ranges_of_labels(const EncodedBlock &block, BlockRange *parts) const;
  void ranges_of_layer(std::uint32_t z, std::span<BlockRange> ranges,
                       std::span<float> sampled) const;
  void set_dual_ranges(std::uint32_t z, std::span<const BlockRange> layer,
                       std::span<const BlockRange> above);
  template <class Holds>
  std::optional<BlockBox> box_of(Holds holds) const;

  EncodedBlock encoded(std::size_t block) const;
  std::size_t block_at(const glm::uvec3 &block) const {
    return block.x + blocks_.x * (block.y + std::size_t{blocks_.y} * block.z);
  }
  float *values(std::size_t block) const {
    return &values_.items()[std::uint64_t{ISO_BLOCK_VOXELS} * block];
  }
  /// Item `number` of a grid of at most ISO_MAX_BLOCK_IDS, x first. By 32 bits, which processors
  /// divide faster.
  static glm::uvec3 place_of(std::uint64_t number, const glm::uvec3 &size) {
    const auto id = static_cast<std::uint32_t>(number);
    return {id % size.x, id / size.x % size.y, id / size.x / size.y};
  }
  static glm::uvec3 corner_of(uint corner) { return {corner & 1, corner >> 1 & 1, corner >> 2}; }

  const CompressedVolume *volume_;
  std::unique_ptr<HostRoom> own_room_;
  HostRoom *room_;
  std::uint32_t num_threads_;
  glm::uvec3 blocks_, macrocells_;  ///< numbers of, along each axis
  std::size_t num_macrocells_;
  DualRanges ranges_;
  DualRanges macrocell_ranges_;  ///< [macrocell]
  std::vector<float> thresholds_;
  Values values_;  ///< [block][64]
  std::vector<std::atomic<uchar>> decoded_;
  std::atomic<std::uint64_t> num_decoded_ = 0;
  HostValues decoded_as_;
  std::vector<std::uint8_t> labels_;  ///< of show_labels(); empty: the field is the volume's
  std::vector<std::unique_ptr<Selection>> selections_;  ///< one or more
};

}  // namespace isowave::core
