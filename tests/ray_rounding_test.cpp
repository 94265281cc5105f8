// reference/ray_rounding: what float32 rays are off by, at eyes near and far.

#include "reference/ray_rounding.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "tests/frame_scene.hpp"

namespace isowave::core {
namespace {

const test::TestVolume &sphere() {
  static const test::TestVolume volume({32, 32, 32}, test::sphere_field({32, 32, 32}), 16);
  return volume;
}

double largest_rounding(const Camera &camera) {
  const ImageSize size{48, 32};
  const auto hits = test::twin_hits(sphere(), camera, size, 0.3f);
  const auto distances = ray_rounding(sphere().info(), camera, size, hits);
  EXPECT_EQ(distances.size(), test::num_hits(hits));
  EXPECT_GT(distances.size(), 100u);
  return distances.empty() ? 0 : *std::max_element(distances.begin(), distances.end());
}

TEST(RayRounding, GrowsWithTheDistanceAsFloat32Does) {
  // A direction of float32 components is off by about 2^-24, so a ray by that times the way.
  for (const double distance : {50.0, 500.0, 3000.0}) {
    const glm::dvec3 centre(15.5);
    const glm::dvec3 aslant =
        glm::normalize(glm::dvec3(0.6, 0.5, 0.7));  // no component near 0 or a power of two
    const Camera camera{centre + distance * aslant, centre, {0, 1, 0}, 2500.0 / distance};
    const double largest = largest_rounding(camera);
    EXPECT_GT(largest, 0x1p-27 * distance);
    EXPECT_LT(largest, 0x1p-22 * distance);
  }
}

TEST(RayRounding, SeesAHitThatIsOffItsRay) {
  const ImageSize size{48, 32};
  const Camera camera = orbit_cameras(sphere().info(), 1).front();
  auto hits = test::twin_hits(sphere(), camera, size, 0.3f);
  for (HitRecord &hit : hits) hit.x += 0.25f;
  const auto distances = ray_rounding(sphere().info(), camera, size, hits);
  EXPECT_GT(*std::max_element(distances.begin(), distances.end()), 0.1);
  EXPECT_THROW(ray_rounding(sphere().info(), camera, {48, 31}, hits), std::invalid_argument);
}

}  // namespace
}  // namespace isowave::core
