#pragma once
// Frames within an error: chooses how coarse a frame may be drawn, and draws it so.

#include "core/accuracy/choose_detail.hpp"
#include "core/frame/renderer.hpp"

namespace isowave::core {

/// Draws frames with a largest surface error (choose_detail()): by proof if the other renderer has
/// bounds, by sample if hits name their cells. Other requests are handed on.
class BoundedRenderer : public RendererAround {
 public:
  /// volume  that this process's renderer was made for; must outlive this
  /// rate    of the whole volume [bits per voxel]
  BoundedRenderer(Renderer &inner, const CompressedVolume &volume, double rate)
      : RendererAround(inner), volume_(volume), rate_(rate) {}
  BoundedRenderer(std::unique_ptr<Renderer> inner, const CompressedVolume &volume, double rate)
      : RendererAround(std::move(inner)), volume_(volume), rate_(rate) {}

  Abilities abilities() const override {
    Abilities abilities = inner().abilities();
    abilities.surface_error = abilities.bounds;
    abilities.sampled_error = abilities.cells;
    return abilities;
  }

  /// Returns  with FrameStats::detail, if the request has a largest error
  FrameStats render(const FrameRequest &request) override {
    if (!request.max_surface_error) return inner().render(request);
    check(request, abilities());
    FrameRequest chosen = request;
    chosen.max_surface_error.reset();
    chosen.by = Evidence::kProof;
    DetailChoice choice =
        choose_detail(inner(), volume_, rate_, chosen, *request.max_surface_error, request.by);
    FrameStats stats = inner().render(with_detail(std::move(chosen), choice.detail));
    stats.detail = std::move(choice);
    return stats;
  }

 private:
  const CompressedVolume &volume_;
  double rate_;
};

}  // namespace isowave::core
