#include "core/host/host_blocks.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <mutex>
#include <utility>

#include "core/base/parallel_for.hpp"
#include "core/base/wait_while.hpp"
#include "core/view/frame.hpp"
#include "core/volume/range_thresholds.hpp"
#include "core/zfp/block_chunks.hpp"
#include "kernels_cl/portable/block_bound.h"
#include "kernels_cl/portable/block_cells.h"
#include "kernels_cl/portable/label_table.h"

namespace isowave::core {

namespace {

/// Macrocells that a thread looks at at a time.
constexpr std::uint64_t kRunMacrocells = 1024;
constexpr std::uint32_t kEdge = ISO_MACROCELL_BLOCKS;

/// How far a block is, in decoded_ and Selection::opened. In the latter, numbers from
/// kFirstSelection on: it is open for that number; for any other it is as if it were kNone.
constexpr uchar kNone = 0, kBeingMade = 1, kFirstSelection = 2;
static_assert(HostField::kDecoded > kBeingMade);

/// Least number of pages: each block of a dual grid may lie on a page of its own.
constexpr std::uint64_t kLeastPages = 8 + 1;

void add(std::optional<BlockBox> &box, const glm::ivec3 &block) {
  if (!box) box = BlockBox{block, block + 1};
  box->begin = glm::min(box->begin, block);
  box->end = glm::max(box->end, block + 1);
}

void add(std::optional<BlockBox> &box, const std::optional<BlockBox> &other) {
  if (!other) return;
  add(box, other->begin);
  add(box, other->end - 1);
}

void fill(std::vector<std::atomic<uchar>> &states, uchar value) {
  for (std::atomic<uchar> &state : states) state.store(value, std::memory_order_relaxed);
}

}  // namespace

HostValues::HostValues(const CompressedVolume &level, bool is_finest, double voxel_error,
                       FieldBound bound, const std::array<float, 2> &value_range)
    : HostValues(level) {
  const BlockPrecision planes = with_fewer_planes(level.precision, voxel_error);
  min_exponent = planes.min_exponent;
  whole = whole_numbers_of(level.info.type, planes);
  plane_error = isowave::core::plane_error(level.precision, voxel_error);
  if (bound == FieldBound::kNone) return;
  const ValueOffset offset =
      value_offset(LevelError(level, is_finest), bound, plane_error, value_range);
  uniform = offset.uniform;
  unit = offset.unit;
}

std::uint64_t HostBlocks::bytes(const VolumeInfo &info, bool is_in_chunks) {
  const BlockGrid grid = make_grid(info);
  const std::uint64_t num_blocks = block_count(grid), macrocells = num_macrocells(grid);
  return macrocells * (is_in_chunks ? 1 : 65) * sizeof(BlockRange) + num_blocks +
         Values::table_bytes(num_blocks * ISO_BLOCK_VOXELS) + kNumThresholds * sizeof(float) +
         bytes_per_isovalue(info);
}

std::uint64_t HostBlocks::bytes_per_isovalue(const VolumeInfo &info) {
  const BlockGrid grid = make_grid(info);
  const std::uint64_t num_blocks = block_count(grid);
  return num_macrocells(grid) * sizeof(ulong) + num_blocks + Changing::table_bytes(num_blocks);
}

std::uint64_t HostBlocks::ray_bytes() {
  return kLeastPages * Values::page_bytes();
}

HostBlocks::HostBlocks(const CompressedVolume &volume, std::uint64_t memory_limit,
                       std::uint32_t num_threads)
    : HostBlocks(volume, std::make_unique<HostRoom>(memory_limit, num_threads), num_threads) {}

HostBlocks::HostBlocks(const CompressedVolume &volume, std::unique_ptr<HostRoom> room,
                       std::uint32_t num_threads)
    : HostBlocks(volume, *room, num_threads) {
  own_room_ = std::move(room);
}

HostBlocks::HostBlocks(const CompressedVolume &volume, HostRoom &room, std::uint32_t num_threads,
                       std::vector<std::uint8_t> labels)
    : volume_(&volume),
      room_(&room),
      num_threads_(num_threads),
      blocks_(volume.num_blocks()),
      macrocells_((blocks_ + kEdge - 1u) / kEdge),
      num_macrocells_(num_macrocells(make_grid(volume.info))),
      values_(volume.block_count() * ISO_BLOCK_VOXELS),
      decoded_(volume.block_count()),
      decoded_as_(volume),
      labels_(std::move(labels)) {
  selections_.push_back(std::make_unique<Selection>(*this));
  find_ranges();
  room.hold(bytes(volume.info, volume.chunks != nullptr));
  room.add([this] { drop(); });
}

HostBlocks::Selection::Selection(HostBlocks &blocks)
    : of(&blocks),
      masks(blocks.num_macrocells_),
      changing(blocks.decoded_.size()),
      opened(blocks.decoded_.size()),
      number(kFirstSelection) {}

/// As far as decode() needs it, in host memory or in a chunk.
EncodedBlock HostBlocks::encoded(std::size_t block) const {
  const WholeNumbers whole = whole_numbers_of(volume_->info.type, volume_->precision);
  const BlockChunks::Block of =
      volume_->chunks
          ? volume_->chunks->block(block)
          : BlockChunks::Block{volume_->words.data(), volume_->block_begin(block),
                               volume_->block_bits(block), volume_->no_data.mask(block)};
  return {.words = of.words,
          .first_bit = of.first_bit,
          .num_bits = of.num_bits,
          .min_exponent = volume_->precision.min_exponent,
          .least = whole.least,
          .greatest = whole.greatest,
          .size_x = 4,
          .size_y = 4,
          .size_z = 4,
          .no_data = of.no_data};
}

/// The box around the blocks for which there are bits in holds(macrocell), called by all threads.
template <class Holds>
std::optional<BlockBox> HostBlocks::box_of(Holds holds) const {
  std::optional<BlockBox> box;
  std::mutex box_mutex;
  parallel_for((num_macrocells_ + kRunMacrocells - 1) / kRunMacrocells, num_threads_,
               [&](std::uint64_t run, std::uint32_t) {
                 std::optional<BlockBox> box_here;
                 const std::size_t end =
                     std::min<std::uint64_t>(num_macrocells_, (run + 1) * kRunMacrocells);
                 for (std::size_t macrocell = run * kRunMacrocells; macrocell < end; ++macrocell) {
                   const ulong mask = holds(macrocell);
                   if (mask == 0) continue;
                   const glm::uvec3 first = kEdge * place_of(macrocell, macrocells_);
                   for (ulong bits = mask; bits != 0; bits &= bits - 1) {
                     const auto bit = static_cast<uint>(std::countr_zero(bits));
                     add(box_here, glm::ivec3(first + glm::uvec3(bit & 3, bit >> 2 & 3, bit >> 4)));
                   }
                 }
                 const std::lock_guard lock(box_mutex);
                 add(box, box_here);
               });
  return box;
}

void HostBlocks::decode_as(const HostValues &values) {
  if (decoded_as_ == values) return;
  decoded_as_ = values;
  for (const auto &selection : selections_) selection->isovalue.reset();
  forget();
}

/// May cells whose values of all planes are from low to high have values on both sides, as blocks
/// are decoded now? Rounding keeps the order of values: sums of a larger value and a larger offset
/// are no smaller.
///
/// bound_code  the largest of the cells' blocks (BlockBounds)
bool HostBlocks::may_hold(float low, float high, std::uint32_t bound_code, float isovalue) const {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const float offset = decoded_as_.uniform + decoded_as_.unit * block_bound(bound_code);
  if (decoded_as_.plane_error != 0) {
    low = std::nextafter(static_cast<float>(double{low} - decoded_as_.plane_error), -kInfinity);
    high = std::nextafter(static_cast<float>(double{high} + decoded_as_.plane_error), kInfinity);
  }
  return !(low + std::min(offset, 0.0f) - isovalue >= 0.0f) &&
         high + std::max(offset, 0.0f) - isovalue >= 0.0f;
}

/// The largest code of a block and those neighbours whose voxels its dual cells have.
std::uint32_t HostBlocks::dual_grid_code(const glm::uvec3 &block) const {
  std::uint32_t code = 0;
  for (uint corner = 0; corner < 8; ++corner) {
    const glm::uvec3 at = glm::min(block + corner_of(corner), blocks_ - 1u);
    code = std::max<std::uint32_t>(code, volume_->bounds.codes[block_at(at)]);
  }
  return code;
}

/// The bits of a macrocell's blocks that may hold the isovalue.
ulong HostBlocks::blocks_that_hold(std::size_t macrocell, float isovalue) const {
  const bool has_codes = decoded_as_.unit != 0;
  const std::uint32_t widest = has_codes ? ISO_BOUND_CODES - 1 : 0;
  const float *low = ranges_.low.data() + 64 * macrocell,
              *high = ranges_.high.data() + 64 * macrocell;
  if (!may_hold(macrocell_ranges_.low[macrocell], macrocell_ranges_.high[macrocell], widest,
                isovalue))
    return 0;
  if (volume_->chunks) return owning_blocks(macrocell);
  if (decoded_as_.plane_error == 0 && decoded_as_.uniform == 0)
    return host_loops().inside(high, isovalue) & ~host_loops().inside(low, isovalue);
  ulong mask = 0;
  const glm::uvec3 first = kEdge * place_of(macrocell, macrocells_);
  for (uint bit = 0; bit < 64; ++bit) {
    if (low[bit] > high[bit] || !may_hold(low[bit], high[bit], widest, isovalue)) continue;
    const glm::uvec3 block = first + glm::uvec3(bit & 3, bit >> 2 & 3, bit >> 4);
    const bool holds = !has_codes || may_hold(low[bit], high[bit], dual_grid_code(block), isovalue);
    mask |= static_cast<ulong>(holds) << bit;
  }
  return mask;
}

/// Those of a macrocell's blocks that have dual cells.
ulong HostBlocks::owning_blocks(std::size_t macrocell) const {
  const glm::uvec3 first = kEdge * place_of(macrocell, macrocells_), dims = volume_->info.dims,
                   end(num_owning_blocks(dims.x), num_owning_blocks(dims.y),
                       num_owning_blocks(dims.z));
  ulong mask = 0;
  for (uint bit = 0; bit < 64; ++bit) {
    const glm::uvec3 block = first + glm::uvec3(bit & 3, bit >> 2 & 3, bit >> 4);
    mask |= static_cast<ulong>(glm::all(glm::lessThan(block, end))) << bit;
  }
  return mask;
}

void HostBlocks::select(std::span<const float> isovalues) {
  const std::uint64_t bytes_of_one = bytes_per_isovalue(volume_->info);
  while (selections_.size() > isovalues.size()) {
    release(selections_.back()->changing);
    selections_.pop_back();
    room_->give_back(bytes_of_one);
  }
  while (selections_.size() < isovalues.size()) {
    selections_.push_back(std::make_unique<Selection>(*this));
    room_->hold(bytes_of_one);
  }
  for (std::size_t i = 0; i < isovalues.size(); ++i) select(*selections_[i], isovalues[i]);
}

/// A block has cells that change if its dual cells have voxels on both sides: any two of these
/// voxels are connected by cells of the block, so that one of the cells has both. A block that is
/// not active is on the side of its values of all planes, too.
void HostBlocks::select(Selection &selection, float isovalue) {
  if (selection.isovalue == isovalue) return;
  selection.isovalue.reset();
  if (++selection.number == 0) {
    fill(selection.opened, kNone);
    selection.number = kFirstSelection;
  }
  const std::optional<BlockBox> box = box_of([&](std::size_t macrocell) {
    return selection.masks[macrocell] = blocks_that_hold(macrocell, isovalue);
  });
  const BlockBox around = box.value_or(BlockBox{glm::ivec3(0), glm::ivec3(0)});
  selection.surface = {.isovalue = isovalue,
                       .isovalue_index = 0,
                       .active_begin_x = around.begin.x,
                       .active_begin_y = around.begin.y,
                       .active_begin_z = around.begin.z,
                       .active_end_x = around.end.x,
                       .active_end_y = around.end.y,
                       .active_end_z = around.end.z};
  selection.isovalue = isovalue;
}

/// macrocell_masks() takes a block as active whose range, rounded outward to thresholds, has values
/// below the isovalue and values not below it.
std::optional<BlockBox> HostBlocks::rounded_box(float isovalue) const {
  if (volume_->chunks)
    return box_of([&](std::size_t macrocell) { return blocks_that_hold(macrocell, isovalue); });
  const std::uint32_t index = threshold_index(thresholds_, double{isovalue});
  if (index == 0 || index == kNumThresholds) return {};
  const float below = thresholds_[index - 1], above = thresholds_[index];
  const auto holds = [&](const DualRanges &ranges, std::size_t i) {
    return ranges.low[i] < above && ranges.high[i] > below;
  };
  return box_of([&](std::size_t macrocell) {
    ulong mask = 0;
    if (!holds(macrocell_ranges_, macrocell)) return mask;
    for (uint bit = 0; bit < 64; ++bit)
      mask |= static_cast<ulong>(holds(ranges_, 64 * macrocell + bit)) << bit;
    return mask;
  });
}

std::array<float, 2> HostBlocks::extremes() const {
  return {std::ranges::min(macrocell_ranges_.low), std::ranges::max(macrocell_ranges_.high)};
}

// ---- Blocks, when rays come to them
//
// A block's values are written only by the thread that sets decoded_ from kNone to kBeingMade; the
// thread releases kDecoded afterwards. A thread that acquires kDecoded may read the values. A
// selection's `opened` guards its `changing` in the same way. A thread acquires kDecoded of the
// eight blocks of the dual grid before it releases `opened`. So a thread that acquires `opened` may
// read the values of all eight, even if other threads wrote them. Between two calls of run(), no
// other thread is at work: parallel_for() has joined.

HostField HostBlocks::field(std::size_t selection) {
  Selection &of = *selections_.at(selection);
  return {.values = values_.items(),
          .changing = of.changing.items(),
          .masks = of.masks.data(),
          .highs = volume_->chunks ? nullptr : ranges_.high.data(),
          .macrocell_highs = macrocell_ranges_.high.data(),
          .has_gaps = !volume_->no_data.empty(),
          .decoded = decoded_.data(),
          .opened = of.opened.data(),
          .selection = of.number,
          .maker = &of};
}

void HostBlocks::open(Selection &selection, std::size_t block) {
  const glm::uvec3 place = place_of(block, blocks_);
  std::array<std::size_t, 8> dual_grid;
  // Beyond the volume, any voxels do: they matter to cells outside it alone.
  for (uint corner = 0; corner < 8; ++corner)
    dual_grid[corner] = block_at(glm::min(place + corner_of(corner), blocks_ - 1u));
  const bool are_there = find_chunks(dual_grid);
  room_->with_room([&] {
    decode_or_guess(dual_grid, are_there);
    take_page(selection.changing, block);
    if (are_there) {
      find_changing(selection, block, dual_grid);
    } else {
      selection.changing.items()[block] = 0;
    }
  });
}

void HostBlocks::decode(std::span<const std::size_t> blocks) {
  const bool are_there = find_chunks(blocks);
  room_->with_room([&] { decode_or_guess(blocks, are_there); });
}

/// Whether these blocks are there, or have been decoded. If not, all chunks that they lack are
/// noted.
///
/// Throws  ChunkIsMissing: not, and the rays may not guess (BlockChunks)
bool HostBlocks::find_chunks(std::span<const std::size_t> blocks) const {
  if (!volume_->chunks) return true;
  bool are_there = true;
  for (const std::size_t id : blocks)
    are_there = (is_decoded(id) || volume_->chunks->is_there(id)) && are_there;
  if (!are_there) volume_->chunks->guess();
  return are_there;
}

/// Decodes blocks; or if some are not there, has memory at their places, with any values.
void HostBlocks::decode_or_guess(std::span<const std::size_t> blocks, bool are_there) {
  for (const std::size_t id : blocks) {
    if (are_there) {
      decode_once(id);
    } else {
      take_page(values_, std::uint64_t{ISO_BLOCK_VOXELS} * id);
    }
  }
}

void HostBlocks::decode_once(std::size_t block) {
  std::atomic<uchar> &state = decoded_[block];
  uchar seen = state.load(std::memory_order_acquire);
  while (seen != HostField::kDecoded) {
    if (seen == kBeingMade) {
      wait_while(state, kBeingMade);
      seen = state.load(std::memory_order_acquire);
      continue;
    }
    // Acquires what a thread wrote that was stopped by an exception.
    if (!state.compare_exchange_weak(seen, kBeingMade, std::memory_order_acquire)) continue;
    try {
      take_page(values_, std::uint64_t{ISO_BLOCK_VOXELS} * block);
      decode_to(block, values(block));
      seen = HostField::kDecoded;
    } catch (...) {
      set_and_wake(state, kNone);
      throw;
    }
    set_and_wake(state, seen);
    num_decoded_.fetch_add(1, std::memory_order_relaxed);
  }
}

void HostBlocks::decode_to(std::size_t block, float *values) const {
  EncodedBlock bits = encoded(block);
  bits.min_exponent = decoded_as_.min_exponent;
  bits.least = decoded_as_.whole.least;
  bits.greatest = decoded_as_.whole.greatest;
  std::array<uint, (ISO_MAX_BLOCK_BITS + 31) / 32 + kDecoderAhead> words;
  if (volume_->file) {
    volume_->read_words(bits.first_bit,
                        std::span(words).first((bits.num_bits + 31) / 32 + kDecoderAhead));
    bits.words = words.data();
    bits.first_bit = 0;
  }
  host_loops().decode(bits, values);
  if (!labels_.empty()) to_group(values);
  if (decoded_as_.uniform == 0) return;
  const ValueOffset offset{decoded_as_.uniform, decoded_as_.unit};
  for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
    values[v] += offset_of_voxel(offset, volume_->bounds, block, v);
}

/// Finds the cells of the block that change, from the values of its decoded dual grid.
void HostBlocks::find_changing(Selection &selection, std::size_t block,
                               std::span<const std::size_t, 8> dual_grid) {
  std::atomic<uchar> &state = selection.opened[block];
  const float isovalue = selection.surface.isovalue;
  uchar seen = state.load(std::memory_order_acquire);
  while (seen != selection.number) {
    if (seen == kBeingMade) {
      wait_while(state, kBeingMade);
      seen = state.load(std::memory_order_acquire);
      continue;
    }
    if (!state.compare_exchange_weak(seen, kBeingMade, std::memory_order_acquire)) continue;
    ulong inside[8];
    for (uint corner = 0; corner < 8; ++corner) {
      inside[corner] = host_loops().inside(values(dual_grid[corner]), isovalue);
    }
    selection.changing.items()[block] = changing_cells(inside);
    seen = selection.number;
    set_and_wake(state, seen);
  }
}

/// The page of this item will be written to. The page counts before it is marked as taken, so that
/// none is ever written to without having been counted.
template <class T>
void HostBlocks::take_page(BlockPages<T> &pages, std::uint64_t item) {
  if (pages.is_taken(item)) return;
  room_->take(pages.page_bytes());
  if (!pages.take(item)) room_->give_back(pages.page_bytes());
}

bool HostBlocks::is_decoded(std::size_t block) const {
  return decoded_[block].load(std::memory_order_relaxed) == HostField::kDecoded;
}

void HostBlocks::forget() {
  fill(decoded_, kNone);
  for (const auto &selection : selections_) fill(selection->opened, kNone);
}

/// Forgets what is decoded, and gives its memory back.
void HostBlocks::drop() {
  forget();
  release(values_);
  for (const auto &selection : selections_) release(selection->changing);
}

template <class T>
void HostBlocks::release(BlockPages<T> &pages) {
  room_->give_back(pages.release() * pages.page_bytes());
}

}  // namespace isowave::core
