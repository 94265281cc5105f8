#pragma once
// How different two pictures look to somebody who flips between them: LDR-FLIP (core/README.md
// [13]).

#include <memory>
#include <vector>

#include "core/io/png.hpp"

namespace isowave::core {

/// A 0.7 m wide screen of 3840 pixels, seen from 0.7 m.
inline constexpr double kPixelsPerDegree = 67.0206;

/// The reference that pictures are compared with.
class Flip {
 public:
  explicit Flip(const Image8 &reference, double pixels_per_degree = kPixelsPerDegree);
  ~Flip();
  Flip(Flip &&) noexcept;

  /// Mean over all pixels of FLIP's error, 0 (the same) to 1. RGB; a fourth channel is left out.
  ///
  /// Throws  Error: the images differ in size
  double error(const Image8 &test) const;
  /// The error of each pixel [height][width].
  std::vector<double> errors(const Image8 &test) const;

 private:
  struct View;
  static View view_of(const Image8 &image, double pixels_per_degree);

  double pixels_per_degree_;
  std::unique_ptr<const View> reference_;
};

}  // namespace isowave::core
