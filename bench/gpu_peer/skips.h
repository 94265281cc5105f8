#pragma once
// What rays skip: bricks of 8^3 cells and macro bricks of 4^3 bricks without a cell that changes,
// by value ranges; and, with masks, cells. A brick is a leaf of NanoVDB. For host and device.

#include <cstdint>

#include "bench/gpu_peer/cell_root.h"

namespace isowave::core::bench {

constexpr int kBrickLog = 3, kMacroLog = 5;  ///< log2 of the cells along an edge
constexpr std::uint32_t kMaskWords = 16;     ///< of a brick

/// Cells, bricks or macro bricks of a grid.
struct Counts3 {
  int n[3];

  PEER_BOTH std::uint32_t all() const { return std::uint32_t(n[0]) * n[1] * n[2]; }
  PEER_BOTH std::uint32_t id_of(int x, int y, int z) const {
    return std::uint32_t(x) + std::uint32_t(n[0]) * (y + std::uint32_t(n[1]) * z);
  }
  PEER_BOTH void place_of(std::uint32_t id, int at[3]) const {
    at[0] = static_cast<int>(id % n[0]);
    at[1] = static_cast<int>(id / n[0] % n[1]);
    at[2] = static_cast<int>(id / n[0] / n[1]);
  }
};

/// Boxes of 2^log cells that cover the cells of dims voxels.
inline Counts3 boxes_of(const int dims[3], int log) {
  Counts3 boxes;
  for (int a = 0; a < 3; ++a) boxes.n[a] = ((dims[a] - 2) >> log) + 1;
  return boxes;
}

struct ValueRange {
  float low, high;

  PEER_BOTH bool changes(float isovalue) const { return low < isovalue && high >= isovalue; }
};

/// What is known of a volume at an isovalue.
struct Skips {
  int dims[3];
  Counts3 bricks, macros;
  const std::uint32_t *brick_bits, *macro_bits;  ///< 1: has cells that change
  const std::uint32_t *slots;                    ///< [brick] place of its mask; masks alone
  const std::uint32_t *masks;  ///< [slot][kMaskWords] 1: the cell changes, bit z + 8 y + 64 x

  PEER_BOTH bool macro_changes(const int cell[3]) const {
    return bit_of(macro_bits,
                  macros.id_of(cell[0] >> kMacroLog, cell[1] >> kMacroLog, cell[2] >> kMacroLog));
  }
  PEER_BOTH std::uint32_t brick_of(const int cell[3]) const {
    return bricks.id_of(cell[0] >> kBrickLog, cell[1] >> kBrickLog, cell[2] >> kBrickLog);
  }
  PEER_BOTH bool brick_changes(const int cell[3]) const {
    return bit_of(brick_bits, brick_of(cell));
  }
  PEER_BOTH static bool bit_of(const std::uint32_t *bits, std::uint32_t id) {
    return (bits[id >> 5] >> (id & 31u) & 1u) != 0;
  }
};

PEER_BOTH int least(int a, int b) {
  return a < b ? a : b;
}

// ---- making them: each is called for every i of a number of things, in any order

/// Value ranges of bricks, with the voxels behind their last cells.
template <class Voxels>
struct FindBrickRange {
  Voxels voxels;
  Skips skips;
  ValueRange *ranges;

  PEER_BOTH void operator()(std::uint32_t brick) const {
    int first[3];
    skips.bricks.place_of(brick, first);
    for (int a = 0; a < 3; ++a) first[a] <<= kBrickLog;
    typename Voxels::Reader reader(voxels);
    reader.enter(first);
    ValueRange range{INFINITY, -INFINITY};
    for (int x = first[0]; x <= least(first[0] + 8, skips.dims[0] - 1); ++x) {
      for (int y = first[1]; y <= least(first[1] + 8, skips.dims[1] - 1); ++y) {
        for (int z = first[2]; z <= least(first[2] + 8, skips.dims[2] - 1); ++z) {
          const float value = reader.value(x, y, z);
          range.low = fminf(range.low, value);
          range.high = fmaxf(range.high, value);
        }
      }
    }
    ranges[brick] = range;
  }
};

/// Value ranges of macro bricks.
struct FindMacroRange {
  Skips skips;
  const ValueRange *of_bricks;
  ValueRange *ranges;

  PEER_BOTH void operator()(std::uint32_t macro) const {
    int first[3], end[3];
    skips.macros.place_of(macro, first);
    for (int a = 0; a < 3; ++a) {
      first[a] <<= kMacroLog - kBrickLog;
      end[a] = least(first[a] + (1 << (kMacroLog - kBrickLog)), skips.bricks.n[a]);
    }
    ValueRange range{INFINITY, -INFINITY};
    for (int z = first[2]; z < end[2]; ++z) {
      for (int y = first[1]; y < end[1]; ++y) {
        for (int x = first[0]; x < end[0]; ++x) {
          const ValueRange of_brick = of_bricks[skips.bricks.id_of(x, y, z)];
          range.low = fminf(range.low, of_brick.low);
          range.high = fmaxf(range.high, of_brick.high);
        }
      }
    }
    ranges[macro] = range;
  }
};

/// A word of brick_bits or macro_bits; with `slots`, a slot for each brick that changes.
struct MarkBoxes {
  const ValueRange *ranges;
  std::uint32_t count;  ///< of the boxes
  float isovalue;
  std::uint32_t *bits;
  std::uint32_t *slots, *slot_boxes, *slot_count;  ///< or all null

  PEER_BOTH void operator()(std::uint32_t word) const {
    std::uint32_t marked = 0, num_marked = 0;
    for (std::uint32_t i = 0; i < 32 && 32 * word + i < count; ++i) {
      if (!ranges[32 * word + i].changes(isovalue)) continue;
      marked |= 1u << i;
      ++num_marked;
    }
    bits[word] = marked;
    if (slots == nullptr || num_marked == 0) return;
    std::uint32_t slot = add(slot_count, num_marked);
    for (std::uint32_t i = 0; i < 32; ++i) {
      if ((marked >> i & 1u) == 0) continue;
      slots[32 * word + i] = slot;
      slot_boxes[slot] = 32 * word + i;
      ++slot;
    }
  }
  /// Returns what was there before.
  PEER_BOTH static std::uint32_t add(std::uint32_t *to, std::uint32_t n) {
#ifdef __CUDA_ARCH__
    return atomicAdd(to, n);
#else
    *to += n;
    return *to - n;
#endif
  }
};

/// A word of a mask: 4 x 8 cells of one x.
template <class Voxels>
struct MarkCells {
  Voxels voxels;
  Skips skips;
  float isovalue;
  const std::uint32_t *slot_boxes;
  std::uint32_t *masks;

  PEER_BOTH void operator()(std::uint32_t i) const {
    int first[3];
    skips.bricks.place_of(slot_boxes[i / kMaskWords], first);
    for (int a = 0; a < 3; ++a) first[a] <<= kBrickLog;
    typename Voxels::Reader reader(voxels);
    reader.enter(first);
    const std::uint32_t word = i % kMaskWords;
    const int x = first[0] + static_cast<int>(word >> 1);
    const int y = first[1] + static_cast<int>(4 * (word & 1u));
    std::uint32_t mask = 0, all_before = 0, any_before = 0;
    for (int row = 0; row <= 4; ++row) {
      const std::uint32_t near = inside_row(reader, x, y + row, first[2]);
      const std::uint32_t far = inside_row(reader, x + 1, y + row, first[2]);
      const std::uint32_t all = near & far, any = near | far;
      if (row > 0) {
        const std::uint32_t all4 = all & all_before, any4 = any | any_before;
        mask |= ((any4 | any4 >> 1) & ~(all4 & all4 >> 1) & 0xffu) << 8 * (row - 1);
      }
      all_before = all;
      any_before = any;
    }
    masks[i] = mask;
  }

 private:
  /// A bit for each of 9 voxels along z: whether it is inside. Behind the last one are its copies.
  PEER_BOTH std::uint32_t inside_row(typename Voxels::Reader &reader, int x, int y, int z) const {
    std::uint32_t bits = 0;
    x = least(x, skips.dims[0] - 1);
    y = least(y, skips.dims[1] - 1);
    for (int i = 0; i < 9; ++i) {
      const bool inside = reader.value(x, y, least(z + i, skips.dims[2] - 1)) >= isovalue;
      bits |= std::uint32_t{inside} << i;
    }
    return bits;
  }
};

}  // namespace isowave::core::bench
