#pragma once
// Values of a second volume, the field, at hits on the host.

#include <span>
#include <vector>

#include "core/frame/field_values.hpp"
#include "core/host/host_blocks.hpp"
#include "kernels_cl/portable/field_value.h"

namespace isowave::core {

/// The value of a field at a hit; NaN: it has none. Within HostRoom::run().
///
/// grid         of the field
/// decoded      the field's blocks
/// label_table  FieldReading::label_table
float value_at_hit(const FieldMap &map, const FrameParams &grid, const HostField &decoded,
                   const HitRecord &hit, const uint *label_table = nullptr);

class HostFieldValues {
 public:
  /// field   must outlive this
  /// is_own  it is the volume that is drawn
  /// levels  of the volume that is drawn
  /// room    must outlive this
  /// Throws  Error: as HostBlocks
  HostFieldValues(const CompressedVolume &field, bool is_own, std::span<const VolumeInfo> levels,
                  HostRoom &room, std::uint32_t num_threads);

  /// A frame begins.
  void begin_frame(const FrameRequest &request);
  /// values[i]: that of hits[i]. Within HostRoom::run().
  void operator()(std::span<const HitRecord> hits, float *values) const;
  void forget() { blocks_.forget(); }
  /// As known_range() of the field.
  std::optional<std::array<float, 2>> volume_range() const { return range_; }

 private:
  std::optional<std::array<float, 2>> range_;
  bool is_own_;
  FieldMap map_;
  FieldReading reading_;
  FrameParams grid_;
  HostBlocks blocks_;
  HostField decoded_;
};

}  // namespace isowave::core
