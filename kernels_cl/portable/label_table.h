/// label_table.h -- the groups of a segmentation's labels: a byte for each label, with bit g if the
/// label is in group g. A group's field is 1 at voxels with one of its labels, and 0 at the others.
/// Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_LABEL_TABLE_H
#define ISOWAVE_LABEL_TABLE_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

#define ISO_NUM_LABELS 65536u
#define ISO_LABEL_ISOVALUE 0.5f  ///< of each group's surface in its field

/// Is a voxel's value a label? That of a broken file may be none.
ISO_INLINE int is_label(float value) {
  return value >= 0.0f && value < (float)ISO_NUM_LABELS;
}

/// The groups of a voxel's label, a bit for each; none if the value is no label.
///
/// table  [ISO_NUM_LABELS / 4] four labels a word
/// value  of the voxel
ISO_INLINE uint groups_of_label(ISO_GLOBAL const uint *table, float value) {
  uint label;
  if (!is_label(value)) return 0;
  label = (uint)value;
  return table[label >> 2] >> 8u * (label & 3u) & 0xFFu;
}

/// The value of a group's field in a voxel of these groups.
ISO_INLINE float group_field(uint groups, uint group) {
  return (float)(groups >> group & 1u);
}

ISO_NAMESPACE_END

#endif
