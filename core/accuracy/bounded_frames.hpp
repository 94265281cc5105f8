#pragma once
// What certify() and choose_detail() draw: frames of a whole volume, by one renderer, or by a team,
// of which each rank has a brick. Both ask for the same frames, and find the same.

#include <utility>
#include <vector>

#include "core/base/team.hpp"
#include "core/bricks/brick_renderer.hpp"
#include "core/render/renderer.hpp"
#include "core/view/detail.hpp"

namespace isowave::core {

/// All ranks of a team make the same calls in the same order.
class BoundedFrames {
 public:
  virtual ~BoundedFrames() = default;
  BoundedFrames(const BoundedFrames &) = delete;
  BoundedFrames &operator=(const BoundedFrames &) = delete;

  /// Throws  Error, at all ranks: as Renderer::render()
  virtual FrameStats draw(const FrameRequest &request) = 0;
  /// Of the last frame's rays, at rank 0.
  virtual std::vector<float> depth() = 0;

  virtual Team &team() = 0;
  /// This rank's.
  virtual const Renderer &renderer() const = 0;
  /// What this rank's renderer was made for. What is said of its voxels holds for the whole.
  const CompressedVolume &volume() const { return volume_; }
  /// Grids of the whole volume's levels of detail that may be drawn, the finest first.
  const std::vector<VolumeInfo> &levels() const { return levels_; }
  double rate() const { return rate_; }  ///< of the whole volume [bits per voxel]

 protected:
  BoundedFrames(const CompressedVolume &volume, std::vector<VolumeInfo> levels, double rate)
      : volume_(volume), levels_(std::move(levels)), rate_(rate) {}

 private:
  const CompressedVolume &volume_;
  std::vector<VolumeInfo> levels_;
  double rate_;
};

/// By one renderer of the whole volume.
class FramesOfOne : public BoundedFrames {
 public:
  /// Both must outlive this. volume: what the renderer was made for.
  FramesOfOne(Renderer &renderer, const CompressedVolume &volume)
      : BoundedFrames(volume, level_infos(volume, renderer.options().with_levels), volume.rate()),
        renderer_(renderer) {}

  FrameStats draw(const FrameRequest &request) override { return renderer_.render(request); }
  std::vector<float> depth() override { return depth_of(renderer_.hits()); }
  Team &team() override { return alone_; }
  const Renderer &renderer() const override { return renderer_; }

 private:
  Renderer &renderer_;
  TeamOfOne alone_;
};

/// By a team.
class FramesOfTeam : public BoundedFrames {
 public:
  /// Both must outlive this.
  ///
  /// brick  what this rank's renderer was made for, after agree_on_voxels()
  /// rate   which that returned
  FramesOfTeam(BrickRenderer &renderer, const CompressedVolume &brick, double rate)
      : BoundedFrames(brick, renderer.whole_levels(), rate), renderer_(renderer) {}

  FrameStats draw(const FrameRequest &request) override {
    renderer_.check_levels(request);
    return renderer_.render(request);
  }
  std::vector<float> depth() override { return renderer_.depth(); }
  Team &team() override { return renderer_.team(); }
  const Renderer &renderer() const override { return renderer_.renderer(); }

 private:
  BrickRenderer &renderer_;
};

}  // namespace isowave::core
