#pragma once
// The errors that compression has made in each block.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "kernels_cl/portable/block_bound.h"

namespace isowave::core {

/// The smallest float32 that is not below.
inline float rounded_up(double error) {
  const float nearest = static_cast<float>(error);
  return double{nearest} < error ? std::nextafter(nearest, std::numeric_limits<float>::infinity())
                                 : nearest;
}

/// error + lost, rounded up: decoded voxels are off by `error` from what was compressed, and that
/// by `lost` from the source (Chunk::lost).
inline double with_lost(double error, float lost) {
  const double least = std::min(error, double{lost}), largest = std::max(error, double{lost});
  const double sum = largest + least;
  const bool is_below = sum - largest < least;  // the difference is exact
  return is_below ? std::nextafter(sum, std::numeric_limits<double>::infinity()) : sum;
}

/// Largest |decoded - source| of a block's voxels, at each place (bound_place()).
struct BlockError {
  std::array<double, ISO_BOUND_PLACES> at_place{};

  /// voxel: x + 4 y + 16 z.
  void add(std::uint32_t voxel, double error) {
    double &largest = at_place[bound_place(voxel)];
    largest = std::max(largest, error);
  }
  void add_lost(float lost) {
    for (double &largest : at_place) largest = with_lost(largest, lost);
  }
  double largest() const { return std::ranges::max(at_place); }
  /// The smallest bound for the whole block such that every voxel stays within its share of it
  /// (bound_share()).
  double bound_by_place() const {
    double bound = 0;
    for (std::uint32_t place = 0; place < at_place.size(); ++place)
      bound = std::max(bound, at_place[place] / double{bound_share(place)});
    return bound;
  }
};

/// Errors of blocks against their source, a few at a time, in order.
class BlockErrors {
 public:
  /// keep: bound_by_place() of each block, in 4 bytes; else only the largest of all.
  explicit BlockErrors(bool keep) : keep_(keep) {}

  /// Adds the errors that the next blocks had before they were compressed (Chunk::lost). Call it
  /// before their end().
  void add_lost(std::span<const float> lost) {
    lost_.insert(lost_.end(), lost.begin(), lost.end());
  }
  /// Zeros for the next blocks, to be filled in with how far they are off from what was compressed
  /// before end().
  std::span<BlockError> begin(std::size_t num_blocks) {
    some_.assign(num_blocks, {});
    return some_;
  }
  std::span<BlockError> some() { return some_; }
  void end() {
    const std::size_t num_lost = std::min(lost_.size(), some_.size());
    for (std::size_t i = 0; i < num_lost; ++i) some_[i].add_lost(lost_[i]);
    lost_.erase(lost_.begin(), lost_.begin() + std::ptrdiff_t(num_lost));
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
  std::vector<float> lost_;  ///< of the blocks that are to come
  std::vector<BlockError> some_;
  std::vector<float> kept_;
};

}  // namespace isowave::core
