// The judge of pictures: its oracle against the one that Embree walks, its pictures against closed
// forms and the host renderer's.

#include "reference/truth_picture.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/accuracy/flip.hpp"
#include "core/host/host_renderer.hpp"
#include "reference/cell_oracle.hpp"
#include "tests/frame_scene.hpp"

namespace isowave::core {
namespace {

using test::sample;
using test::TestVolume;
using Dims = std::array<std::uint32_t, 3>;

/// Random rays, some along an axis or in a plane of voxels, some from within.
OracleRay random_ray(std::mt19937 &random, const Dims &dims) {
  std::uniform_real_distribution<double> uniform;
  std::uniform_int_distribution<int> kind(0, 5);
  OracleRay ray;
  const bool starts_within = kind(random) == 0, on_planes = kind(random) == 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double last = dims[axis] - 1.0;
    ray.origin[axis] =
        starts_within ? uniform(random) * last : (2 * uniform(random) - 0.5) * 3 * last;
    double target = uniform(random) * last;
    if (on_planes && axis != 0) {
      ray.origin[axis] = std::round(ray.origin[axis]);
      target = kind(random) < 3 ? ray.origin[axis] : std::round(target);
    }
    ray.direction[axis] = target - ray.origin[axis];
  }
  return ray;
}

TEST(GridOracle, AgreesWithTheCellOracle) {
  std::mt19937 random(44);
  int hits = 0;
  for (const Dims &dims : {Dims{33, 17, 25}, Dims{2, 9, 31}, Dims{10, 2, 2}}) {
    const auto voxels = sample({dims[0], dims[1], dims[2]}, test::noise_field(3));
    for (const float isovalue : {0.5f, 0.8f}) {
      const CellOracle expected(voxels, dims, isovalue);
      const GridOracle grid(voxels, dims, isovalue);
      for (int i = 0; i < 4000; ++i) {
        const OracleRay ray = random_ray(random, dims);
        const OracleHit a = expected.first_hit(ray), b = grid.first_hit(ray);
        ASSERT_EQ(a.hit, b.hit) << i;
        if (!a.hit) continue;
        ++hits;
        ASSERT_NEAR(a.t, b.t, 1e-12) << i;
      }
    }
  }
  EXPECT_GT(hits, 4000);
}

TEST(TruthPicture, LightsAWallAsTheFormulaSays) {
  const VolumeInfo info = test::grid_info({17, 17, 17});
  const auto voxels = sample(info.dims, [](const glm::dvec3 &p) { return p.z; });
  const GridOracle oracle(voxels, {17, 17, 17}, 8.0f);
  const Camera camera{{8, 8, 30}, {8, 8, 0}, {0, 1, 0}, 20};
  const Appearance look;
  const Image8 image = truth_picture(oracle, info, camera, {9, 9, 4}, Sky::kOpen, look);
  // In the middle, the wall faces the viewer, and slopes neither up nor down.
  const double light =
      double{look.ambient} + double{look.diffuse} + double{look.above} / std::sqrt(2.0);
  const std::size_t middle = 3 * (9 * 4 + 4);
  for (int channel = 0; channel < 3; ++channel) {
    const double color =
        std::min(1.0, double{look.surface[channel]} * light + double{look.specular});
    EXPECT_NEAR(image.pixels[middle + std::size_t(channel)], 255 * color, 1.5) << channel;
  }
}

TEST(TruthPicture, CountsTheShareOfAPixelThatIsCovered) {
  const VolumeInfo info = test::grid_info({9, 9, 9});
  // A wall that ends at x = 4: from there on, all is outside.
  const auto voxels =
      sample(info.dims, [](const glm::dvec3 &p) { return p.x <= 4 && p.z <= 4 ? 100.0 : 0.0; });
  const GridOracle oracle(voxels, {9, 9, 9}, 1.0f);
  Camera camera{{4, 4, 20}, {4, 4, 0}, {0, 1, 0}};
  camera.parallel_height = 1;
  Appearance look;
  look.ambient = 1;
  look.diffuse = look.specular = look.above = 0;
  look.surface = glm::vec3(0);
  const Image8 image = truth_picture(oracle, info, camera, {4, 1, 8}, Sky::kOpen, look);
  // The wall ends at x = 4.99. The picture is 4 wide, from x = 2 to 6.
  EXPECT_EQ(image.pixels[0], 0);
  EXPECT_EQ(image.pixels[3], 0);
  EXPECT_EQ(image.pixels[6], 0);
  EXPECT_EQ(image.pixels[9], 255);
}

/// Largest difference of a channel that all but a share of the channels keep.
int difference(const Image8 &a, const Image8 &b, double share) {
  std::vector<int> differences;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    differences.push_back(std::abs(int{a.pixels[i]} - int{b.pixels[i]}));
  std::ranges::sort(differences);
  return differences[static_cast<std::size_t>((1 - share) * double(differences.size() - 1))];
}

TEST(TruthPicture, IsThePictureOfManyRays) {
  VolumeInfo info = test::grid_info({33, 29, 25}, {1.0, 1.25, 2.0});
  info.origin = {-3, 40, 7};
  const auto voxels = sample(info.dims, [](const glm::dvec3 &p) {
    return 10 - glm::length(p - glm::dvec3(16, 14, 12)) + 2 * std::sin(p.x) * std::cos(0.7 * p.y);
  });
  const TestVolume volume(info, voxels, {.tolerance = {}, .exact = true});
  ASSERT_EQ(volume.voxels, voxels);
  const GridOracle oracle(voxels, {33, 29, 25}, 1.5f);
  HostRenderer renderer(volume.compressed);
  for (Camera camera : orbit_cameras(info, 3)) {
    for (const bool parallel : {false, true}) {
      if (parallel) camera = in_parallel(camera);
      const ImageSize size{96, 64, 8};
      renderer.render({.camera = camera, .isovalue = 1.5f, .size = size});
      const Image8 drawn = renderer.shade(), truth = truth_picture(oracle, info, camera, size);
      EXPECT_LE(difference(truth, drawn, 0.002), 1);
      EXPECT_LT(Flip(truth).error(drawn), 0.001);
      renderer.render({.camera = camera, .isovalue = 1.5f, .size = ImageSize{96, 64, 1}});
      EXPECT_GT(Flip(truth).error(renderer.shade()), 0.005) << "one ray a pixel has jagged edges";
    }
  }
}

TEST(TruthPicture, DarkensWhatSeesLittleOfTheSky) {
  const VolumeInfo info = test::grid_info({33, 33, 33});
  // A wall with a deep shaft, of which the picture shows the floor.
  const auto voxels = sample(info.dims, [](const glm::dvec3 &p) {
    const bool in_shaft = std::abs(p.x - 16) < 3.5 && std::abs(p.y - 16) < 3.5;
    return p.z < (in_shaft ? 6 : 28) ? 100.0 : 0.0;
  });
  const TestVolume volume(info, voxels, {.tolerance = {}, .exact = true});
  const GridOracle oracle(voxels, {33, 33, 33}, 50.0f);
  const Camera camera{{16, 16, 60}, {16, 16, 0}, {0, 1, 0}, 8};
  const ImageSize size{32, 32, 8};
  const Image8 open = truth_picture(oracle, info, camera, size),
               seen = truth_picture(oracle, info, camera, size, Sky::kSeen);
  const std::size_t middle = 3 * (32 * 16 + 16);
  EXPECT_LT(seen.pixels[middle], open.pixels[middle] - 40);
  HostRenderer renderer(volume.compressed);
  renderer.render({.camera = camera, .isovalue = 50, .size = size, .ambient_rays = 64});
  const Image8 drawn = renderer.shade();
  EXPECT_LT(Flip(seen).error(drawn), 0.02);
  EXPECT_GT(Flip(open).error(drawn), 0.05);
}

}  // namespace
}  // namespace isowave::core
