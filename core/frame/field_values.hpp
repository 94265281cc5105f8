#pragma once
// Values of a second volume, the field, at a frame's hits: what all renderers share.

#include <array>
#include <optional>
#include <span>

#include "core/volume/volume.hpp"
#include "kernels_cl/portable/field_value.h"

namespace isowave::core {

/// levels  of detail that may have hits, the finest first
/// Throws  Error: a volume's directions do not span space
FieldMap make_field_map(std::span<const VolumeInfo> levels, const VolumeInfo &field);

/// The least and the largest of such values; none if all are NaN.
std::optional<std::array<float, 2>> range_of_values(std::span<const float> values);

}  // namespace isowave::core
