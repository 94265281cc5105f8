#pragma once
// Groups of a segmentation's labels: a surface of a frame may be that of a group, of a field that
// is 1 at voxels with one of its labels and 0 at the others, at 0.5.
//
// A renderer of labels has a table on its device, a byte for each label, with a bit for each of up
// to eight groups (kernels_cl/portable/label_table.h). Voxels go through the table when blocks are
// decoded. So a voxel of a cache slot is a mask of groups, and a slot holds the fields of all
// groups in 64 bytes. field_of_slot() takes the bit of the group at work where kernels read slots,
// and all behind it is as for isosurfaces. Ranges of blocks are the groups that all voxels are in,
// and those that any voxel is in. A frame of other groups writes the table, has the ranges made
// anew, which decodes all blocks once, and empties the cache. The kernels of such renderers are
// built with ISO_LABELS; those of others do not change by it.
//
// The host has blocks of its own for each group, whose values are 0 and 1: HostLevels.

#include <cstdint>
#include <vector>

#include "core/frame/surfaces.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/label_table.h"

namespace isowave::core {

/// A byte for each label, [ISO_NUM_LABELS]: bit i if surface i has the label.
using LabelTable = std::vector<std::uint8_t>;

LabelTable label_table(const std::vector<SurfaceStyle> &surfaces);

/// Whether all voxels of the volume are labels, and decoded as they were.
///
/// Throws  Error: they are not. are_labels() throws nothing
void check_labels(const CompressedVolume &volume);
bool are_labels(const CompressedVolume &volume);

}  // namespace isowave::core
