#pragma once
// The scalar twin as a renderer: what programs ask for with --reference.

#include <optional>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "reference/twin.hpp"

namespace isowave::core {

class TwinRenderer : public Renderer {
 public:
  /// volume: must outlive the renderer
  TwinRenderer(const CompressedVolume &volume, ImageSize largest, Solver solver = kDefaultSolver)
      : volume_(volume), largest_(largest), solver_(solver) {}

  Abilities abilities() const override;
  std::vector<VolumeInfo> levels() const override;

  /// Has one pass, after which on_pass is called. Decodes the volume, unless the frame before had
  /// the same detail.
  FrameStats render(const FrameRequest &request) override;
  /// Throws  Error: the twin casts no rays of any origin
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override;
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {}) override;

  ImageSize size() const override { return size_; }
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;
  std::vector<HitRecord> hits() override;
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
  OpenCounts open_;
  HostMemory memory_;
};

}  // namespace isowave::core
