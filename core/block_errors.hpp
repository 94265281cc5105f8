#pragma once
// What compression has done to each block.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "kernels_cl/block_bound.h"

namespace isowave {

/// The smallest float32 that is not below.
inline float rounded_up(double error) {
  const float nearest = static_cast<float>(error);
  return double{nearest} < error ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
}

/// Largest |decoded - source| of a block's voxels, at each place (bound_place()).
struct BlockError {
  std::array<double, ISO_BOUND_PLACES> at_place{};

  /// voxel: x + 4 y + 16 z.
  void add(std::uint32_t voxel, double error) {
    double &largest = at_place[bound_place(voxel)];
    largest = std::max(largest, error);
  }
  double largest() const { return std::ranges::max(at_place); }
  /// Of which no place's share (bound_share()) is exceeded.
  double bound_by_place() const {
    double bound = 0;
    for (std::uint32_t place = 0; place < at_place.size(); ++place)
      bound = std::max(bound, at_place[place] / double{bound_share(place)});
    return bound;
  }
};

/// Errors of blocks, a few at a time, in order.
class BlockErrors {
 public:
  /// keep: bound_by_place() of each block, in 4 bytes; else only the largest of all.
  explicit BlockErrors(bool keep) : keep_(keep) {}

  /// Zeros for the next blocks, to be filled in before end().
  std::span<BlockError> begin(std::size_t num_blocks) {
    some_.assign(num_blocks, {});
    return some_;
  }
  std::span<BlockError> some() { return some_; }
  void end() {
    for (const BlockError &error : some_) {
      max_ = std::max(max_, error.largest());
      if (keep_) kept_.push_back(rounded_up(error.bound_by_place()));
    }
  }

  double max() const { return max_; }
  std::vector<float> take() { return std::move(kept_); }

 private:
  bool keep_;
  double max_ = 0;
  std::vector<BlockError> some_;
  std::vector<float> kept_;
};

}  // namespace isowave
