#pragma once
// Pictures of how two images differ, pixel by pixel.

#include "core/io/npy.hpp"
#include "core/io/png.hpp"

namespace isowave::core {

/// How two depth images differ, as a picture.
struct DepthDifference {
  Image8 picture;
  /// |A-B| of the strongest colours [world units]: their 99th percentile, or the largest if that is
  /// 0.
  double full = 0;
};

/// Where both are hit, the map coolwarm: blue if B is nearer, grey if both are as far, red if B is
/// farther. Orange: only A is hit. Black: only B is. White: none is.
///
/// Throws  Error: the images differ in size
DepthDifference depth_difference(const FloatImage &a, const FloatImage &b);

/// FLIP's error of each pixel in the map magma: from black, the same, to light yellow, 1.
///
/// Throws  Error: the images differ in size
Image8 picture_difference(const Image8 &a, const Image8 &b);

}  // namespace isowave::core
