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

/// Appends an entry to list [*count]. All items must call it. Returns its place.
/// goes_on: this work-item has one. counters [2] of the work-group: 0 on entry and on return.
ISO_INLINE uint append_entry(int goes_on, uint entry, volatile local uint *counters,
                             volatile global uint *count, global uint *list) {
  uint place = 0;
  if (goes_on) place = atomic_inc(&counters[0]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0 && counters[0] != 0) counters[1] = atomic_add(count, counters[0]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (goes_on) {
    place += counters[1];
    list[place] = entry;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  return place;
}

#endif
