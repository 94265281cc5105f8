#pragma once
// The twin of values of a field at hits: the same portable header as the kernels, in a plain loop
// over voxels that libzfp has decoded.

#include <span>
#include <vector>

#include "core/frame/field_values.hpp"

namespace isowave::core {

/// The value at a hit of voxels, x fastest; NaN: it has none.
float value_at_hit(const FieldReading &reading, const glm::uvec3 &dims,
                   std::span<const float> voxels, const HitRecord &hit);

class FieldTwin {
 public:
  /// Decodes the field.
  explicit FieldTwin(const CompressedVolume &field);

  /// levels   of the volume that has the hits, the finest first
  /// request  of their frame
  /// Returns  [hit] NaN: it has no value
  std::vector<float> values(std::span<const VolumeInfo> levels, std::span<const HitRecord> hits,
                            const FrameRequest &request = {}) const;
  /// The field's least and largest values; none if they are not known.
  std::optional<std::array<float, 2>> volume_range() const { return range_; }

 private:
  VolumeInfo info_;
  std::optional<std::array<float, 2>> range_;
  std::vector<float> voxels_;
};

}  // namespace isowave::core
