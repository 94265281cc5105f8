#pragma once
// Values of a second volume, the field, at a frame's hits: what all renderers share.

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "core/frame/appearance.hpp"
#include "core/frame/frame_request.hpp"
#include "core/frame/labels.hpp"
#include "core/volume/volume.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/field_value.h"

namespace isowave::core {

/// levels  of detail that may have hits, the finest first
/// Throws  Error: a volume's directions do not span space
FieldMap make_field_map(std::span<const VolumeInfo> levels, const VolumeInfo &field);

/// [level] From hits in a level of detail to the voxels of that level. Arguments as
/// make_field_map().
std::vector<FieldMap> make_own_maps(std::span<const VolumeInfo> levels);

/// Whether the frame has blocks of the finest level decoded to the volume's own values, which a
/// field has.
inline bool draws_own_values(const FrameRequest &request) {
  return request.voxel_error == 0 && request.bound == FieldBound::kNone;
}

/// What hits of a frame read of a field.
struct FieldReading {
  FieldMap map{};
  /// If map.labels is ISO_FIELD_OWN_LABELS: label_table() of the frame's surfaces, as words
  /// [ISO_NUM_LABELS / 4]; else empty.
  std::vector<uint> label_table{};
};

/// map     make_field_map()
/// is_own  the field is the volume that is drawn
FieldReading reading_of(const FrameRequest &request, const FieldMap &map, bool is_own);

/// The least and the largest voxel of a volume; none if they are not known.
std::optional<std::array<float, 2>> known_range(const CompressedVolume &volume);

/// The shading of a frame of several or translucent surfaces.
///
/// field_range  known_range() of the renderer's field, if it has one
/// Throws       Error: colours by a field begin or end at values that are neither given nor known
Shading make_layer_shading(const VolumeInfo &info, const FrameRequest &request,
                           const std::optional<std::array<float, 2>> &field_range);

/// The least and the largest of such values; none if all are NaN.
std::optional<std::array<float, 2>> range_of_values(std::span<const float> values);

}  // namespace isowave::core
