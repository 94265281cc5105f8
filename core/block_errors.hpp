#pragma once
// What compression has done to each block.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace isowave {

/// Largest errors of blocks, a few at a time, in order.
class BlockErrors {
 public:
  /// keep: all of them, 4 bytes each; else only the largest of all.
  explicit BlockErrors(bool keep) : keep_(keep) {}

  /// Zeros for the next blocks, to be filled in before end().
  std::span<double> begin(std::size_t num_blocks) {
    some_.assign(num_blocks, 0.0);
    return some_;
  }
  std::span<double> some() { return some_; }
  void end() {
    for (const double error : some_) {
      max_ = std::max(max_, error);
      if (keep_) kept_.push_back(rounded_up(error));
    }
  }

  double max() const { return max_; }
  std::vector<float> take() { return std::move(kept_); }

  static float rounded_up(double error) {
    const float nearest = static_cast<float>(error);
    return double{nearest} < error ? std::nextafter(nearest, std::numeric_limits<float>::infinity())
                                   : nearest;
  }

 private:
  bool keep_;
  double max_ = 0;
  std::vector<double> some_;
  std::vector<float> kept_;
};

}  // namespace isowave
