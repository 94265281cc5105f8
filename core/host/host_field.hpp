#pragma once
// Values of a second volume, the field, at hits on the host.

#include <span>
#include <vector>

#include "core/host/host_blocks.hpp"
#include "kernels_cl/portable/field_value.h"

namespace isowave::core {

/// The value of a field at a hit; NaN: it has none. Within HostRoom::run().
///
/// grid     of the field
/// decoded  the field's blocks
float value_at_hit(const FieldMap &map, const FrameParams &grid, const HostField &decoded,
                   const HitRecord &hit);

class HostFieldValues {
 public:
  /// field   must outlive this
  /// levels  of the volume that is drawn
  /// room    must outlive this
  /// Throws  Error: as HostBlocks
  HostFieldValues(const CompressedVolume &field, std::span<const VolumeInfo> levels, HostRoom &room,
                  std::uint32_t num_threads);

  /// values[i]: that of hits[i]. Within HostRoom::run().
  void operator()(std::span<const HitRecord> hits, bool on_caps, float *values) const;
  void forget() { blocks_.forget(); }
  /// As known_range() of the field.
  std::optional<std::array<float, 2>> volume_range() const { return range_; }

 private:
  std::optional<std::array<float, 2>> range_;
  FieldMap map_;
  FrameParams grid_;
  HostBlocks blocks_;
  HostField decoded_;
};

}  // namespace isowave::core
