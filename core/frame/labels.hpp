#pragma once
// Groups of a segmentation's labels: a surface of a frame may be that of a group
// (kernels_cl/portable/label_table.h).

#include <cstdint>
#include <span>
#include <vector>

#include "core/frame/surfaces.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/label_table.h"

namespace isowave::core {

/// A byte for each label, [ISO_NUM_LABELS]: bit i if surface i has the label.
using LabelTable = std::vector<std::uint8_t>;

/// Throws  Error: a value is no label
std::vector<std::uint16_t> labels_of(std::span<const float> values);

LabelTable label_table(const std::vector<SurfaceStyle> &surfaces);

/// Whether all voxels of the volume are labels, and decoded as they were.
///
/// Throws  Error: they are not
void check_labels(const CompressedVolume &volume);

}  // namespace isowave::core
