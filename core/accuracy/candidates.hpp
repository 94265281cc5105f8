#pragma once
// What both choices of detail (choose_detail.hpp, image_error.hpp) know of their candidates: the
// views that are looked at, and the blocks that frames decode.

#include <span>
#include <vector>

#include "core/view/camera.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

/// The views that detail is chosen for, spread evenly over a series: up to four of them; without a
/// series, the camera's.
std::vector<Camera> views_of(const Camera &camera, std::span<const Camera> series);

/// Blocks that frames decode for some hits: with levels of detail, and of the finest level alone.
struct HitBlocks {
  double with_levels = 0, finest = 0;

  double share() const { return finest == 0 ? 1.0 : with_levels / finest; }
};

/// Adds those of a frame. A pixel with a hit has its area divided by that of a block's face, times
/// two: surfaces are mostly oblique, and rays look at blocks beside them, too.
///
/// most    blocks that the rays of a pixel meet, at most
/// depth   [pixels] see HitRecord::t
/// finest  the finest level
/// frames  of all levels (make_level_frames())
/// height  of the picture [pixels]
void add_hit_blocks(std::span<const float> depth, const VolumeInfo &finest,
                    std::span<const FrameParams> frames, const Camera &camera, std::uint32_t height,
                    double most, HitBlocks &sum);

}  // namespace isowave::core
