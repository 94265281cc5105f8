/// radix_sort.cl -- stable LSD radix sort of (key, value) pairs (Sec. 3.6), `bits` of the keys in
/// each pass: at most ISO_RADIX_BITS, so digits = 2^bits are at most ISO_RADIX_DIGITS.
///
/// One pass = radix_histogram -> radix_scan -> radix_scatter, over tiles of ISO_GROUP_SIZE *
/// ISO_RADIX_ITEMS pairs. table: first [digits] the pairs of each digit; then [digits][tiles] those
/// in each tile, which radix_scan turns into those in the tiles before. It does so digit by digit,
/// each in a work-group of its own; where the pairs of a digit begin, every group of radix_scatter
/// finds out for itself: digits are few [Satish et al. 2009].
///
/// Two ways to rank the pairs of a tile, by -D ISO_RADIX_SERIAL: 0, all work-items of a group
/// together (place_round); 1, the first work-item alone, one after the other: four times as fast on
/// a CPU whose work-items are turns of a loop and whose atomics are slow (PoCL).
#include "device/work_group.h"
#include "portable/radix_sort.h"

#define TILE (ISO_GROUP_SIZE * ISO_RADIX_ITEMS)

/// Pairs that are ranked together, a bit each: whole rows of work-items, and no more than the tile.
#if TILE < ISO_RADIX_ROUND
#define ROUND TILE
#elif ISO_GROUP_SIZE > ISO_RADIX_ROUND
#define ROUND ISO_GROUP_SIZE
#else
#define ROUND ISO_RADIX_ROUND
#endif
#define ROUND_ITEMS (ROUND / ISO_GROUP_SIZE) /* of each work-item */
#define ROUND_WORDS ((ROUND + 31) / 32)

#ifndef ISO_RADIX_SERIAL
#define ISO_RADIX_SERIAL 0
#endif

ISO_INLINE uint digit_of(uint key, uint shift, uint bits) {
  return (key >> shift) & ((1u << bits) - 1u);
}

/// The entry of the table for the pairs of a digit in a tile.
ISO_INLINE uint table_entry(uint bits, uint num_tiles, uint digit, uint tile) {
  return (1u << bits) + digit * num_tiles + tile;
}

/// Counts the digits of each tile. Groups stride over tiles.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void radix_histogram(
    global const uint *keys, global const ISO_WORDS(PassCounts) *counts, uint count_field,
    uint shift, uint bits, global uint *table) {
  local uint histogram[ISO_RADIX_DIGITS];
  const uint count = counts[count_field], digits = 1u << bits, item = get_local_id(0);
  const uint num_tiles = (count + TILE - 1) / TILE;
  for (uint tile = get_group_id(0); tile < num_tiles; tile += get_num_groups(0)) {
    const uint begin = tile * TILE, size = min(count - begin, (uint)TILE);
    for (uint digit = item; digit < digits; digit += ISO_GROUP_SIZE) histogram[digit] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
#if ISO_RADIX_SERIAL
    if (item == 0) {
      for (uint i = 0; i < size; ++i) ++histogram[digit_of(keys[begin + i], shift, bits)];
    }
#else
    uint own[ISO_RADIX_ITEMS]; /* all are under way before one is waited for */
    ISO_UNROLL
    for (uint i = 0; i < ISO_RADIX_ITEMS; ++i) {
      const uint entry = i * ISO_GROUP_SIZE + item;
      own[i] = entry < size ? keys[begin + entry] : 0;
    }
    ISO_UNROLL
    for (uint i = 0; i < ISO_RADIX_ITEMS; ++i) {
      if (i * ISO_GROUP_SIZE + item < size) atomic_inc(&histogram[digit_of(own[i], shift, bits)]);
    }
#endif
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint digit = item; digit < digits; digit += ISO_GROUP_SIZE) {
      table[table_entry(bits, num_tiles, digit, tile)] = histogram[digit];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}

/// Pairs of a digit in each tile -> in the tiles before; their sum to the table's beginning. A
/// work-group per digit.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void radix_scan(
    global const ISO_WORDS(PassCounts) *counts, uint count_field, uint bits, global uint *table) {
  local uint sums[ISO_GROUP_SIZE];
  const uint num_tiles = (counts[count_field] + TILE - 1) / TILE, digit = get_group_id(0);
  global uint *row = table + table_entry(bits, num_tiles, digit, 0);
  uint carry = 0;
  for (uint first = 0; first < num_tiles; first += ISO_GROUP_SIZE * ISO_SCAN_ITEMS) {
    const uint begin = first + get_local_id(0) * ISO_SCAN_ITEMS;
    uint own[ISO_SCAN_ITEMS];
    uint sum = 0, total, before;
    ISO_UNROLL
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) own[i] = begin + i < num_tiles ? row[begin + i] : 0;
    ISO_UNROLL
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) sum += own[i];
    before = carry + group_scan(sums, sum, &total);
    ISO_UNROLL
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      if (begin + i < num_tiles) row[begin + i] = before;
      before += own[i];
    }
    carry += total;
  }
  if (get_local_id(0) == 0) table[digit] = carry;
}

/// bases [digits] = the pairs of smaller digits, from totals [digits]. sums [ISO_GROUP_SIZE]. All
/// items must call it.
ISO_INLINE void scan_digits(global const uint *totals, uint digits, local uint *sums,
                            local uint *bases) {
  const uint share = (digits + ISO_GROUP_SIZE - 1) / ISO_GROUP_SIZE,
             begin = get_local_id(0) * share;
  const uint end = min(begin + share, digits);
  uint sum = 0, total, before;
  for (uint digit = begin; digit < end; ++digit) sum += totals[digit];
  before = group_scan(sums, sum, &total);
  for (uint digit = begin; digit < end; ++digit) {
    bases[digit] = before;
    before += totals[digit];
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

#if !ISO_RADIX_SERIAL
/// Sends the keys of a round, staged [TILE] from `round` on, to their places, and leaves these
/// there instead. Each work-item looks after entries of its own. A key goes behind those of its
/// digit in the rounds before (next) and in this one: members [ROUND_WORDS][ISO_RADIX_DIGITS] has a
/// bit for each of its pairs, in order, that says whether it has the digit. 0 between rounds.
ISO_INLINE void place_round(uint round, uint size, uint shift, uint bits, local uint *members,
                            local uint *next, local uint *staged, global uint *out_keys) {
  uint digits[ROUND_ITEMS],
      ends[ROUND_ITEMS]; /* ends: where the next round goes on, if last of its digit */
  ISO_UNROLL
  for (uint i = 0; i < ROUND_ITEMS; ++i) {
    const uint place = i * ISO_GROUP_SIZE + get_local_id(0);
    digits[i] = ISO_INVALID_ID;
    if (round + place < size) {
      digits[i] = digit_of(staged[round + place], shift, bits);
      atomic_or(&members[place / 32 * ISO_RADIX_DIGITS + digits[i]], 1u << (place % 32));
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  ISO_UNROLL
  for (uint i = 0; i < ROUND_ITEMS; ++i) {
    const uint place = i * ISO_GROUP_SIZE + get_local_id(0), bit = 1u << (place % 32);
    ends[i] = ISO_INVALID_ID;
    if (digits[i] != ISO_INVALID_ID) {
      uint to = next[digits[i]], later = 0;
      ISO_UNROLL
      for (uint word = 0; word < ROUND_WORDS; ++word) {
        const uint mask = members[word * ISO_RADIX_DIGITS + digits[i]];
        const uint earlier = word < place / 32 ? mask : word == place / 32 ? mask & (bit - 1) : 0;
        to += popcount(earlier);
        later |= mask ^ earlier ^ (word == place / 32 ? bit : 0);
      }
      out_keys[to] = staged[round + place];
      staged[round + place] = to;
      if (later == 0) ends[i] = to + 1;
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  ISO_UNROLL
  for (uint i = 0; i < ROUND_ITEMS; ++i) {
    if (ends[i] != ISO_INVALID_ID) {
      next[digits[i]] = ends[i];
      ISO_UNROLL
      for (uint word = 0; word < ROUND_WORDS; ++word)
        members[word * ISO_RADIX_DIGITS + digits[i]] = 0;
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}
#endif

/// Moves the pairs of each tile to their places. table: after radix_scan. Groups stride over tiles.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void radix_scatter(
    global const uint *keys, global const uint *values, global const ISO_WORDS(PassCounts) *counts,
    uint count_field, uint shift, uint bits, global const uint *table, global uint *out_keys,
    global uint *out_values) {
  local uint sums[ISO_GROUP_SIZE];
  local uint bases[ISO_RADIX_DIGITS];
  local uint next[ISO_RADIX_DIGITS]; /* where the next pair of each digit goes */
#if !ISO_RADIX_SERIAL
  local uint members[ROUND_WORDS * ISO_RADIX_DIGITS];
  local uint staged[TILE];
#endif
  const uint count = counts[count_field], digits = 1u << bits, item = get_local_id(0);
  const uint num_tiles = (count + TILE - 1) / TILE;
#if !ISO_RADIX_SERIAL
  for (uint i = item; i < ROUND_WORDS * ISO_RADIX_DIGITS; i += ISO_GROUP_SIZE) members[i] = 0;
#endif
  scan_digits(table, digits, sums, bases);
  for (uint tile = get_group_id(0); tile < num_tiles; tile += get_num_groups(0)) {
    const uint begin = tile * TILE, size = min(count - begin, (uint)TILE);
#if !ISO_RADIX_SERIAL
    ISO_UNROLL
    for (uint i = 0; i < ISO_RADIX_ITEMS; ++i) {
      const uint entry = i * ISO_GROUP_SIZE + item;
      if (entry < size) staged[entry] = keys[begin + entry];
    }
#endif
    for (uint digit = item; digit < digits; digit += ISO_GROUP_SIZE) {
      next[digit] = bases[digit] + table[table_entry(bits, num_tiles, digit, tile)];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
#if ISO_RADIX_SERIAL
    if (item == 0) {
      for (uint i = begin; i < begin + size; ++i) {
        const uint to = next[digit_of(keys[i], shift, bits)]++;
        out_keys[to] = keys[i];
        out_values[to] = values[i];
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
#else
    for (uint round = 0; round < TILE; round += ROUND) {
      place_round(round, size, shift, bits, members, next, staged, out_keys);
    }
    ISO_UNROLL
    for (uint i = 0; i < ISO_RADIX_ITEMS; ++i) {
      const uint entry = i * ISO_GROUP_SIZE + item;
      if (entry < size) out_values[staged[entry]] = values[begin + entry];
    }
#endif
  }
}
