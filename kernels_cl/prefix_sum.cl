/// prefix_sum.cl -- the exclusive prefix sum of a long table whose length the host knows.
///
///   prefix_tile_sums -> prefix_tile_offsets -> prefix_tiles
///
/// A tile is ISO_GROUP_SIZE * ISO_SCAN_ITEMS entries; groups stride over the tiles. No group ever
/// waits for another one. Sums wrap at 2^32.
#include "device/work_group.h"

#define TILE (ISO_GROUP_SIZE * ISO_SCAN_ITEMS)

/// tile_sums[tile] = sum of values[tile * TILE ..] of that tile.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void prefix_tile_sums(
    global const uint *values, uint count, global uint *tile_sums) {
  local uint sums[ISO_GROUP_SIZE];
  for (uint tile = get_group_id(0); tile * TILE < count; tile += get_num_groups(0)) {
    uint sum = 0, total;
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      const uint entry = tile * TILE + i * ISO_GROUP_SIZE + get_local_id(0);
      sum += entry < count ? values[entry] : 0;
    }
    group_scan(sums, sum, &total);
    if (get_local_id(0) == 0) tile_sums[tile] = total;
  }
}

/// The sums of the tiles become the sums of those before them; values[count] the sum of all.
///
/// Launch  one work-group
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void prefix_tile_offsets(
    uint count, global uint *tile_sums, global uint *values) {
  local uint sums[ISO_GROUP_SIZE];
  const uint total = scan_table(sums, tile_sums, (count + TILE - 1) / TILE);
  if (get_local_id(0) == 0) values[count] = total;
}

/// values[i] = sum of values[0..i), in place.
///
/// tile_offsets  of prefix_tile_offsets
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void prefix_tiles(
    global uint *values, uint count, global const uint *tile_offsets) {
  local uint sums[ISO_GROUP_SIZE];
  for (uint tile = get_group_id(0); tile * TILE < count; tile += get_num_groups(0)) {
    const uint begin = tile * TILE + get_local_id(0) * ISO_SCAN_ITEMS;
    uint own[ISO_SCAN_ITEMS];
    uint sum = 0, total;
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      own[i] = begin + i < count ? values[begin + i] : 0;
      sum += own[i];
    }
    uint before = tile_offsets[tile] + group_scan(sums, sum, &total);
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      if (begin + i < count) values[begin + i] = before;
      before += own[i];
    }
  }
}
