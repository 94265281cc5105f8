#pragma once
// The scalar twin as a renderer: what programs ask for with --reference.

#include <optional>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "reference/field_twin.hpp"
#include "reference/twin.hpp"

namespace isowave::core {

class TwinRenderer : public Renderer {
 public:
  /// volume: must outlive the renderer
  /// field: for FrameRequest::field_values; null: none
  TwinRenderer(const CompressedVolume &volume, ImageSize largest, Solver solver = kDefaultSolver,
               const CompressedVolume *field = nullptr)
      : volume_(volume), largest_(largest), solver_(solver) {
    if (field != nullptr) field_.emplace(*field);
  }

  Abilities abilities() const override;
  std::vector<VolumeInfo> levels() const override;

  /// Has one pass, after which on_pass is called. Decodes the volume, unless the frame before had
  /// the same detail.
  FrameStats render(const FrameRequest &request) override;
  /// Throws  Error: the twin casts no rays of any origin
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override;
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {},
                const Viewpoint &from = {}) override;

  ImageSize size() const override { return size_; }
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;
  std::vector<HitRecord> hits() override;
  bool has_field_values() const override { return !field_values_.empty(); }
  /// The light that the last frame's rays have found.
  const OpenCounts &open() const { return open_; }
  std::optional<std::array<float, 2>> field_range() override;
  /// [height * width] Values of the field, if the last frame had FrameRequest::field_values.
  const std::vector<float> &field_values() const { return field_values_; }
  void clear_cache() override { twin_.reset(); }
  std::uint64_t memory_bytes() const override { return 0; }

 private:
  /// The settings that the twin's voxels depend on.
  struct Decoded {
    double voxel_pixels = 0, voxel_error = 0;
    FieldBound bound = FieldBound::kNone;
    bool operator==(const Decoded &) const = default;
  };

  const CompressedVolume &volume_;
  ImageSize largest_;
  Solver solver_;
  Decoded decoded_;
  std::optional<Twin> twin_;
  ImageSize size_;
  FrameParams frame_{};
  std::vector<HitRecord> hits_;
  std::vector<RayColor> colors_;  ///< of a frame of several or translucent surfaces
  OpenCounts open_;
  std::optional<FieldTwin> field_;
  std::vector<float> field_values_;
  HostMemory memory_;
};

}  // namespace isowave::core
