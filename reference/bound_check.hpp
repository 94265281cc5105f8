#pragma once
// The bounds of a frame's error (core/accuracy/certify.hpp) against an oracle of the volume before
// compression.

#include <cstdint>
#include <span>
#include <vector>

#include "kernels_cl/portable/shared_types.h"
#include "reference/hit_oracle.hpp"

namespace isowave::core {

struct BoundTally {
  std::uint64_t hits = 0;       ///< pixels with a hit within a finite bound
  std::uint64_t misses = 0;     ///< pixels that miss for certain
  std::uint64_t uncertain = 0;  ///< pixels without a bound
  std::uint64_t exceeded =
      0;  ///< pixels that are farther off than their bound, or hit or miss though it says otherwise
  std::vector<double> slack;  ///< bound / error of each of `hits`
};

/// truth: of the volume before compression. frame: which was drawn, at the finest level. drawn,
/// bounds [height * width]: its hits, and Certificate::bounds. With as many threads as there are
/// cores.
///
/// Throws  std::invalid_argument: sizes do not fit
BoundTally judge_bounds(const HitOracle &truth, const FrameParams &frame,
                        std::span<const HitRecord> drawn, std::span<const float> bounds);

}  // namespace isowave::core
