#include "core/accuracy/candidates.hpp"

#include <algorithm>
#include <cmath>

#include "core/view/detail.hpp"

namespace isowave::core {

std::vector<Camera> views_of(const Camera &camera, std::span<const Camera> series) {
  constexpr std::size_t kSomeViews = 4;
  if (series.empty()) return {camera};
  std::vector<Camera> views;
  const std::size_t num_views = std::min(series.size(), kSomeViews);
  for (std::size_t i = 0; i < num_views; ++i)
    views.push_back(series[i * series.size() / num_views]);
  return views;
}

void add_hit_blocks(std::span<const float> depth, const VolumeInfo &finest,
                    std::span<const FrameParams> frames, const Camera &camera, std::uint32_t height,
                    double most, HitBlocks &sum) {
  const double side = 4 * std::cbrt(std::abs(glm::determinant(finest.index_to_world())));
  for (const float t : depth) {
    if (std::isinf(t)) continue;
    int level = 0;
    for (std::size_t i = 1; i < frames.size(); ++i) {
      if (draws(frames[i]) && frames[i].band.begin_t * frames[i].view.t_scale <= t)
        level = static_cast<int>(i);
    }
    const double sides = pixel_size_at(camera, height, double{t}) / side;
    const double blocks = 2 * sides * sides;
    sum.finest += std::min(blocks, most);
    sum.with_levels += std::min(std::ldexp(blocks, -2 * level), most);  // a quarter of each level
  }
}

}  // namespace isowave::core
