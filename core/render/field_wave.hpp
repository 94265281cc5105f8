#pragma once
// The wave in which hits get values of a field: of a second volume, which has blocks of its own, or
// of the volume that is drawn.

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
  /// Uploads the field, unless it stays on the host, or shares the drawn volume's blocks.
  ///
  /// field   must outlive the wave if it stays on the host
  /// is_own  it is the volume that is drawn
  /// drawn   blocks of the volume that is drawn; must outlive the wave
  /// levels  of that volume
  /// rays    must outlive the wave
  /// Throws  Error: not enough memory on the device
  /// Waits   yes
  FieldWave(const CompressedVolume &field, bool is_own, BlockStore &drawn,
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
  BlockStore *own_blocks() override { return own_ ? &*own_ : nullptr; }
  LaterPasses *sum_in(FrameStats &stats) const override { return &stats.field; }

  /// Forgets decoded blocks of its own.
  void clear() {
    if (own_) own_->clear();
  }
  /// As FieldValues::range().
  std::optional<std::array<float, 2>> range(std::size_t num_rays) {
    return values_.range(rays_, num_rays);
  }
  /// As known_range() of the field.
  std::optional<std::array<float, 2>> volume_range() const { return range_; }

 private:
  std::optional<std::array<float, 2>> range_;
  bool is_own_;
  std::optional<BlockStore> own_;  ///< unless it shares those of the drawn volume
  BlockStore &blocks_;
  FrameParams grid_;
  FieldMap map_;
  FieldValues values_;
  Wavefront &rays_;
  Layers *layers_ = nullptr;  ///< of set_layer()
  bool begins_ = false;       ///< the next pass is the first of all rays
};

}  // namespace isowave::core
