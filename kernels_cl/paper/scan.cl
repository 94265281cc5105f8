/// scan.cl -- exclusive prefix sum and stream compaction (Sec. 3.6, 4.2).
/// Counts live on the device: `counts` are the words of PassCounts, `count_field` says which of
/// them is the number of entries. Compaction = compact_count -> scan_exclusive of the tile sums ->
/// compact_values. A tile is ISO_GROUP_SIZE * ISO_SCAN_ITEMS entries; groups stride over the tiles.
/// No group ever waits for another one.
#include "device/work_group.h"

#define TILE (ISO_GROUP_SIZE * ISO_SCAN_ITEMS)

/// values[i] = sum of values[0..i), in place, for ceil(count / divisor) entries.
///
/// total_field  of counts: gets the sum of all; ISO_INVALID_ID: none does
/// Launch       one work-group: made for tables of tiles, which are short
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void scan_exclusive(
    global uint *values, global ISO_WORDS(PassCounts) *counts, uint count_field, uint divisor,
    uint total_field) {
  local uint sums[ISO_GROUP_SIZE];
  const uint count = (counts[count_field] + divisor - 1) / divisor;
  const uint total = scan_table(sums, values, count);
  if (get_local_id(0) == 0 && total_field != ISO_INVALID_ID) counts[total_field] = total;
}

/// tile_sums[tile] = number of nonzero mask entries of the tile.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void compact_count(
    global const uint *mask, global const ISO_WORDS(PassCounts) *counts, uint count_field,
    global uint *tile_sums) {
  local uint sums[ISO_GROUP_SIZE];
  const uint count = counts[count_field];
  for (uint tile = get_group_id(0); tile * TILE < count; tile += get_num_groups(0)) {
    uint sum = 0, total;
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      const uint entry = tile * TILE + i * ISO_GROUP_SIZE + get_local_id(0);
      sum += entry < count && mask[entry] != 0;
    }
    group_scan(sums, sum, &total);
    if (get_local_id(0) == 0) tile_sums[tile] = total;
  }
}

/// out = values[i] of every i with mask[i] != 0, in order. tile_offsets: scanned sums of
/// compact_count.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void compact_values(
    global const uint *mask, global const uint *values, global const ISO_WORDS(PassCounts) *counts,
    uint count_field, global const uint *tile_offsets, global uint *out) {
  local uint sums[ISO_GROUP_SIZE];
  const uint count = counts[count_field];
  for (uint tile = get_group_id(0); tile * TILE < count; tile += get_num_groups(0)) {
    const uint begin = tile * TILE + get_local_id(0) * ISO_SCAN_ITEMS;
    uint sum = 0, total, to;
    for (uint i = begin; i < begin + ISO_SCAN_ITEMS; ++i) sum += i < count && mask[i] != 0;
    to = tile_offsets[tile] + group_scan(sums, sum, &total);
    for (uint i = begin; i < begin + ISO_SCAN_ITEMS; ++i) {
      if (i < count && mask[i] != 0) out[to++] = values[i];
    }
  }
}
