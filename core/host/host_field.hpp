#pragma once
// Values of a field at hits on the host: of a second volume, or of the volume that is drawn.

#include <memory>
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
  /// drawn   if the field is the volume that is drawn, its finest level, whose blocks it shares; it
  ///         has its own from the first frame of fewer bit planes on. Null: it always has. Must
  ///         outlive this
  /// levels  of the volume that is drawn
  /// room    must outlive this
  /// Throws  Error: as HostBlocks
  HostFieldValues(const CompressedVolume &field, HostBlocks *drawn,
                  std::span<const VolumeInfo> levels, HostRoom &room, std::uint32_t num_threads);

  /// Memory of its own blocks in such a frame, without decoded ones.
  std::uint64_t own_bytes(const FrameRequest &request) const;
  /// A frame begins, whose levels and surfaces are open.
  ///
  /// Throws  Error: as HostBlocks
  void begin_frame(const FrameRequest &request);
  /// values[i]: that of hits[i]. Within HostRoom::run().
  void operator()(std::span<const HitRecord> hits, float *values) const;
  void forget() {
    if (own_) own_->forget();
  }
  /// As known_range() of the field.
  std::optional<std::array<float, 2>> volume_range() const { return range_; }

 private:
  bool shares_in(const FrameRequest &request) const;
  HostBlocks &own();

  const CompressedVolume &field_;
  HostBlocks *drawn_;  ///< null: the field is a second volume
  HostRoom &room_;
  std::uint32_t num_threads_;
  std::optional<std::array<float, 2>> range_;
  FieldMap map_;
  FieldReading reading_;
  FrameParams grid_;
  std::unique_ptr<HostBlocks> own_{};
  HostField decoded_{};  ///< of the frame at work
};

}  // namespace isowave::core
