#pragma once
// Adaptive samples: one ray for each pixel, and more for pixels that differ from neighbours.

#include <cstdint>
#include <vector>

#include "core/frame/renderer.hpp"

namespace isowave::core {

/// Draws frames with FrameRequest::adaptive by a renderer that casts rays of some pixels. Whether
/// pixels differ is judged in a picture of the default appearance, so the pixels do not depend on
/// the request's colours. Other requests are handed on.
class AdaptiveRenderer : public RendererAround {
 public:
  using RendererAround::RendererAround;

  Abilities abilities() const override {
    Abilities abilities = inner().abilities();
    abilities.adaptive = abilities.pixel_rays;
    return abilities;
  }

  /// on_pass is called after each pass of the first rays, and then each time that further pixels
  /// have all rays. If it returns false, pixels keep their first rays.
  FrameStats render(const FrameRequest &request) override;
  /// All but the picture is of the first rays, as hits() is.
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;

 private:
  void refine(const FrameRequest &request, FrameStats &stats);

  FrameParams frame_{};                ///< of all rays of all pixels
  std::uint32_t samples_ = 1;          ///< of a refined pixel along each axis
  std::vector<std::uint32_t> pixels_;  ///< those that are refined in the last frame, ascending
  std::vector<HitRecord> hits_;        ///< [pixel][samples_][samples_]
};

}  // namespace isowave::core
