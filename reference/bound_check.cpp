#include "reference/bound_check.hpp"

#include <cmath>
#include <stdexcept>

#include "core/base/parallel_for.hpp"
#include "kernels_cl/portable/grid_dda.h"
#include "reference/accuracy.hpp"

namespace isowave::core {

namespace {

void judge_bound(const HitOracle &truth, const FrameParams &frame, std::uint32_t pixel,
                 const HitRecord &drawn, double bound, BoundTally &tally) {
  if (std::isinf(bound)) {
    ++tally.uncertain;
    return;
  }
  const OracleHit hit = truth.first_hit(exact_ray(make_ray(&frame, pixel)));
  const bool says_hit = bound > 0;
  ++(says_hit ? tally.hits : tally.misses);
  if (hit.hit != says_hit || std::isfinite(drawn.t) != says_hit) {
    ++tally.exceeded;
    return;
  }
  if (!says_hit) return;
  const double t = double{drawn.t};
  const double pixel_size = 2 * double{frame.view.pixel_scale} *
                            (frame.view.is_parallel != 0 ? double{frame.view.t_scale} : t);
  const double error = std::abs(t - hit.t * double{frame.view.t_scale}) / pixel_size;
  tally.exceeded += error > bound;
  tally.slack.push_back(bound / error);
}

}  // namespace

BoundTally judge_bounds(const HitOracle &truth, const FrameParams &frame,
                        std::span<const HitRecord> drawn, std::span<const float> bounds) {
  if (drawn.size() != std::size_t{frame.view.width} * frame.view.height ||
      bounds.size() != drawn.size())
    throw std::invalid_argument("judge_bounds: hits and bounds do not fit the frame");
  std::vector<BoundTally> tallies(thread_count(0));
  parallel_for(frame.view.height, 0, [&](std::uint64_t row, std::uint32_t thread) {
    for (std::uint32_t column = 0; column < frame.view.width; ++column) {
      const auto pixel = static_cast<std::uint32_t>(row * frame.view.width + column);
      judge_bound(truth, frame, pixel, drawn[pixel], double{bounds[pixel]}, tallies[thread]);
    }
  });
  BoundTally sum;
  for (const BoundTally &tally : tallies) {
    sum.hits += tally.hits;
    sum.misses += tally.misses;
    sum.uncertain += tally.uncertain;
    sum.exceeded += tally.exceeded;
    sum.slack.insert(sum.slack.end(), tally.slack.begin(), tally.slack.end());
  }
  return sum;
}

}  // namespace isowave::core
