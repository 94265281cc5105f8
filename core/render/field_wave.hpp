#pragma once
// A second volume on a device, the field, and the wave in which hits get its values.

#include <array>
#include <optional>
#include <span>

#include "core/render/block_store.hpp"
#include "core/render/wave.hpp"
#include "core/stages/field_values.hpp"
#include "core/stages/layers.hpp"

namespace isowave::core {

class FieldWave : public Wave {
 public:
  /// Uploads the field, unless it stays on the host.
  ///
  /// field   must outlive the wave if it stays on the host
  /// is_own  it is the volume that is drawn
  /// levels  of the volume that is drawn
  /// rays    must outlive the wave
  /// Throws  Error: not enough memory on the device
  /// Waits   yes
  FieldWave(ocl::Device &device, const CompressedVolume &field, bool is_own,
            std::span<const VolumeInfo> levels, const FieldPlan &plan, std::uint32_t group_size,
            Wavefront &rays);

  /// A frame begins, which has no values yet.
  ///
  /// Waits  if a frame before was stopped, or read something else of the field
  void begin_frame(const FrameRequest &request);
  /// The next waves are of the hits of a further layer; null: of all rays. layers must outlive the
  /// wave.
  void set_layer(Layers *layers) { layers_ = layers; }
  void begin() override;
  void enqueue_pass() override;
  BlockStore *own_blocks() override { return &blocks_; }
  LaterPasses *sum_in(FrameStats &stats) const override { return &stats.field; }

  /// Forgets all blocks of the field that are decoded.
  void clear() { blocks_.clear(); }
  /// As FieldValues::range().
  std::optional<std::array<float, 2>> range(std::size_t num_rays) {
    return values_.range(rays_, num_rays);
  }
  /// As known_range() of the field.
  std::optional<std::array<float, 2>> volume_range() const { return range_; }

 private:
  std::optional<std::array<float, 2>> range_;
  bool is_own_;
  BlockStore blocks_;
  FrameParams grid_;
  FieldMap map_;
  FieldValues values_;
  Wavefront &rays_;
  Layers *layers_ = nullptr;  ///< of set_layer()
  bool begins_ = false;       ///< the next pass is the first of all rays
};

}  // namespace isowave::core
