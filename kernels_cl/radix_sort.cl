/// radix_sort.cl -- stable LSD radix sort of (key, value) pairs, ISO_RADIX_BITS per pass (Sec. 3.6).
/// One pass = radix_histogram -> scan_exclusive of `table` (scan.cl) -> radix_scatter.
/// table[digit * num_tiles + tile]: with the digit outermost, ONE scan over the whole table gives every
/// (digit, tile) its first output slot [Satish et al. 2009]. A tile is ISO_GROUP_SIZE * ISO_RADIX_ITEMS
/// pairs; each work-item owns consecutive ones, so ranking by (digit, work-item) keeps equal keys in order.
#include "shared_types.h"

#define TILE (ISO_GROUP_SIZE * ISO_RADIX_ITEMS)

ISO_INLINE uint digit_of(uint key, uint shift) {
  return (key >> shift) & (ISO_RADIX_DIGITS - 1);
}

/// Counts the digits of each tile. Groups stride over tiles.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void radix_histogram(
    global const uint *keys, global const uint *counts, uint count_field, uint shift, global uint *table) {
  local uint histogram[ISO_RADIX_DIGITS];
  const uint count = counts[count_field];
  const uint num_tiles = (count + TILE - 1) / TILE;
  for (uint tile = get_group_id(0); tile < num_tiles; tile += get_num_groups(0)) {
    for (uint digit = get_local_id(0); digit < ISO_RADIX_DIGITS; digit += ISO_GROUP_SIZE)
      histogram[digit] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = 0; i < ISO_RADIX_ITEMS; ++i) {
      const uint entry = tile * TILE + i * ISO_GROUP_SIZE + get_local_id(0);
      if (entry < count) atomic_inc(&histogram[digit_of(keys[entry], shift)]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint digit = get_local_id(0); digit < ISO_RADIX_DIGITS; digit += ISO_GROUP_SIZE) {
      table[digit * num_tiles + tile] = histogram[digit];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}

/// Moves the pairs of each tile to their places. table: scanned.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void radix_scatter(
    global const uint *keys, global const uint *values, global const uint *counts, uint count_field,
    uint shift, global const uint *table, global uint *out_keys, global uint *out_values) {
  local ushort ranks[ISO_RADIX_DIGITS * ISO_GROUP_SIZE]; /* [digit][work-item]: counts, then first ranks */
  const uint count = counts[count_field];
  const uint num_tiles = (count + TILE - 1) / TILE;
  const uint item = get_local_id(0);
  for (uint tile = get_group_id(0); tile < num_tiles; tile += get_num_groups(0)) {
    const uint begin = tile * TILE + item * ISO_RADIX_ITEMS;
    const uint end = min(begin + ISO_RADIX_ITEMS, count);
    for (uint digit = 0; digit < ISO_RADIX_DIGITS; ++digit) ranks[digit * ISO_GROUP_SIZE + item] = 0;
    for (uint i = begin; i < end; ++i) ++ranks[digit_of(keys[i], shift) * ISO_GROUP_SIZE + item];
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint digit = item; digit < ISO_RADIX_DIGITS; digit += ISO_GROUP_SIZE) {
      uint sum = 0;
      for (uint i = 0; i < ISO_GROUP_SIZE; ++i) {
        const uint own = ranks[digit * ISO_GROUP_SIZE + i];
        ranks[digit * ISO_GROUP_SIZE + i] = (ushort)sum;
        sum += own;
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = begin; i < end; ++i) {
      const uint digit = digit_of(keys[i], shift);
      const uint to = table[digit * num_tiles + tile] + ranks[digit * ISO_GROUP_SIZE + item]++;
      out_keys[to] = keys[i];
      out_values[to] = values[i];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
