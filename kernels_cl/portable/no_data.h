/// no_data.h -- which voxels of a volume have no data: nothing is known there. Their decoded value
/// is NaN. A cell with such a corner has no surface. Portable: OpenCL C 1.2 and C++.
///
/// A table of words. It begins with three words for each group of 32 blocks: a bit for each block
/// with a mask; a bit for each block without any data; the place of the group's first mask. The
/// masks follow, in the order of their blocks, two words each: bit x + 4y + 16z is set if that
/// voxel has no data. A place counts pairs of words from the table's beginning.
#ifndef ISOWAVE_NO_DATA_H
#define ISOWAVE_NO_DATA_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

#define ISO_NO_DATA_BLOCKS 32u  ///< of a group
#define ISO_NO_DATA_WORDS 3u    ///< of a group

/// Bit x + 4y + 16z of a block: the voxel has no data. All bits of a block without any data are
/// set.
ISO_INLINE ulong no_data_mask(ISO_GLOBAL const uint *table, ulong block) {
  ISO_GLOBAL const uint *group = table + ISO_NO_DATA_WORDS * (block / ISO_NO_DATA_BLOCKS);
  const uint some = group[0], bit = 1u << (uint)(block % ISO_NO_DATA_BLOCKS);
  ulong at;
  if ((group[1] & bit) != 0u) return ~(ulong)0;
  if ((some & bit) == 0u) return 0;
  at = 2u * ((ulong)group[2] + popcount(some & (bit - 1u)));
  return (ulong)table[at + 1u] << 32 | table[at];
}

/// Is a decoded value that of a voxel without data?
ISO_INLINE int is_no_data(float value) {
  return value != value;
}

/// Has a cell a corner without data? w [8]: its corners, or their differences to an isovalue.
ISO_INLINE int lacks_data(const float *w) {
  return is_no_data(w[0]) || is_no_data(w[1]) || is_no_data(w[2]) || is_no_data(w[3]) ||
         is_no_data(w[4]) || is_no_data(w[5]) || is_no_data(w[6]) || is_no_data(w[7]);
}

ISO_NAMESPACE_END

#endif
