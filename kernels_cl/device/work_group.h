/// work_group.h -- what kernels of ISO_GROUP_SIZE work-items a group do together. OpenCL C 1.2.
#ifndef ISOWAVE_WORK_GROUP_H
#define ISOWAVE_WORK_GROUP_H

#include "portable/shared_types.h"

/// Exclusive prefix sum of one value per work-item; *total gets the sum. sums [ISO_GROUP_SIZE]. All
/// items must call it.
ISO_INLINE uint group_scan(local uint *sums, uint value, uint *total) {
  const uint item = get_local_id(0);
  uint inclusive = value;
  sums[item] = value;
  for (uint distance = 1; distance < ISO_GROUP_SIZE; distance *= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint left = item >= distance ? sums[item - distance] : 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    inclusive += left;
    sums[item] = inclusive;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  *total = sums[ISO_GROUP_SIZE - 1];
  barrier(CLK_LOCAL_MEM_FENCE);
  return inclusive - value;
}

/// values[i] = sum of values[0..i), in place, for `count` entries. Returns the sum of all. sums
/// [ISO_GROUP_SIZE]. All items of the only work-group must call it: for short tables.
ISO_INLINE uint scan_table(local uint *sums, global uint *values, uint count) {
  const uint step = ISO_GROUP_SIZE * ISO_SCAN_ITEMS;
  uint carry = 0;
  for (uint first = 0; first < count; first += step) {
    const uint begin = first + get_local_id(0) * ISO_SCAN_ITEMS;
    uint own[ISO_SCAN_ITEMS];
    uint sum = 0, total;
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      own[i] = begin + i < count ? values[begin + i] : 0;
      sum += own[i];
    }
    uint before = carry + group_scan(sums, sum, &total);
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      if (begin + i < count) values[begin + i] = before;
      before += own[i];
    }
    carry += total;
  }
  return carry;
}

/// Counts the work-items with `takes`, and gives each of these a place of its own behind those that
/// were counted before. All items of the work-group must call it.
///
/// counters  [2] of the work-group; counters[0]: 0 before and after
ISO_INLINE uint take_place(int takes, volatile local uint *counters, volatile global uint *count) {
  uint place = 0;
  if (takes) place = atomic_inc(&counters[0]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0 && counters[0] != 0) counters[1] = atomic_add(count, counters[0]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (takes) place += counters[1];
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  return place;
}

/// Appends an entry to list [*count]. All items must call it. Returns its place.
/// goes_on: this work-item has one. counters [2] of the work-group: 0 on entry and on return.
ISO_INLINE uint append_entry(int goes_on, uint entry, volatile local uint *counters,
                             volatile global uint *count, global uint *list) {
  const uint place = take_place(goes_on, counters, count);
  if (goes_on) list[place] = entry;
  return place;
}

#endif
