// The twin against closed forms: fields whose crossings are known exactly, and the rule of the
// half-open sign. What the twin gets right here, every device gets right that equals it
// (render_test.cpp).

#include "reference/scalar_renderer.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numbers>
#include <optional>

#include "core/base/error.hpp"
#include "core/stages/shade.hpp"
#include "tests/frame_scene.hpp"
#include "tests/ray_oracle.hpp"

namespace isowave::core {
namespace {

using test::camera_along;
using test::ExactField;
using test::expect_first_changes;
using test::grid_info;
using test::num_hits;
using test::sample;

constexpr ImageSize kSize{64, 48};

std::vector<HitRecord> draw(const VolumeInfo &info, const std::vector<float> &voxels,
                            const Camera &camera, ImageSize size = kSize, float isovalue = 0.0f) {
  return render_scalar(make_frame_params(info, camera, size, isovalue), voxels);
}

/// Draws an exact field and compares every pixel. Returns the number of hits.
std::size_t check(const ExactField &field, const VolumeInfo &info, const Camera &camera,
                  ImageSize size = kSize, double max_ambiguous = 0.02) {
  return expect_first_changes(draw(info, sample(info.dims, field.value), camera, size), field, info,
                              camera, size, max_ambiguous);
}

const ExactField kPlane = test::plane_field({0.5, -1.25, 2.0}, 9.0625);
const ExactField kSaddle = test::saddle_field({6.5, 4.25, 7.75}, 1.5);
const ExactField kThreePlanes = test::three_planes_field({5.25, 6.5, 4.75});

// ---- closed forms

TEST(ScalarRenderer, PlaneFromAllSides) {
  const VolumeInfo info = grid_info({14, 11, 13});
  for (const Camera &camera : orbit_cameras(info, 7)) EXPECT_GT(check(kPlane, info, camera), 300u);
}

TEST(ScalarRenderer, SaddleFromAllSides) {
  const VolumeInfo info = grid_info({14, 11, 13});
  for (const Camera &camera : orbit_cameras(info, 7)) EXPECT_GT(check(kSaddle, info, camera), 500u);
}

TEST(ScalarRenderer, ThreeRootsInOneCell) {
  const VolumeInfo info = grid_info({12, 13, 11});
  for (const Camera &camera : orbit_cameras(info, 7))
    EXPECT_GT(check(kThreePlanes, info, camera), 500u);
}

TEST(ScalarRenderer, OneCell) {
  const VolumeInfo info = grid_info({2, 2, 2});
  const ExactField fields[] = {test::plane_field({1, 2, -1}, 0.75),
                               test::saddle_field({0.5, 0.25, 0.5}, 0.5),
                               test::three_planes_field({0.25, 0.5, 0.625})};
  for (const ExactField &field : fields) {
    for (const Camera &camera : orbit_cameras(info, 5)) EXPECT_GT(check(field, info, camera), 100u);
  }
}

TEST(ScalarRenderer, EyeInsideOnVoxelsAndOnPlanes) {
  const VolumeInfo info = grid_info({14, 11, 13});
  const glm::dvec3 eyes[] = {{3.3, 4.4, 5.5}, {4, 5, 6},   {4, 5.25, 6.5}, {4.5, 5, 6.5},
                             {0, 0, 0},       {13, 10, 2}, {0, 4.5, 5.5},  {8, 8, 12}};
  const glm::dvec3 directions[] = {
      {1, 0.2, 0.3}, {-0.4, 0.3, -1}, {0, 0, 1}, {-1, 0, 0}, {0.01, -1, 0}};
  for (const glm::dvec3 &eye : eyes) {
    for (const glm::dvec3 &direction : directions) {
      SCOPED_TRACE(fmt::format("eye {} {} {}, direction {} {} {}", eye.x, eye.y, eye.z, direction.x,
                               direction.y, direction.z));
      const glm::dvec3 up = direction.y == -1 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
      // Odd sizes: the middle column and row run exactly in cell planes and along axes.
      const Camera camera = camera_along(eye, direction, up, 100.0);
      for (const ExactField &field : {kPlane, kSaddle, kThreePlanes})
        check(field, info, camera, {31, 25}, 0.05);
    }
  }
}

TEST(ScalarRenderer, FarCamera) {
  const VolumeInfo info = grid_info({40, 40, 40});
  const glm::dvec3 direction = glm::normalize(glm::dvec3(1.0, 0.7, -1.3)), centre(19.5);
  for (const double distance : {3000.0, 100000.0}) {
    SCOPED_TRACE(distance);
    Camera camera = camera_along(centre - distance * direction, direction);
    camera.fovy_deg = glm::degrees(2 * std::atan(20.0 / distance));
    const double ambiguous = distance > 3000.0 ? 0.05 : 0.02;  // edges blur as the eye goes away
    for (const ExactField &field : {test::plane_field({0.5, -1.25, 2.0}, 20.0625),
                                    test::saddle_field({19.5, 18.25, 20.75}, 16.5)}) {
      const auto hits = draw(info, sample(info.dims, field.value), camera);
      EXPECT_GT(expect_first_changes(hits, field, info, camera, kSize, ambiguous), 500u);
    }
  }
}

TEST(ScalarRenderer, AnisotropicSpacing) {
  for (const glm::dvec3 &spacing :
       {glm::dvec3(1, 1, 1000), glm::dvec3(1e-3, 2e-3, 0.5), glm::dvec3(1e6)}) {
    VolumeInfo info = grid_info({14, 11, 13}, spacing);
    info.origin = {16.0 * spacing.x, -8.0 * spacing.y, 4.0 * spacing.z};
    for (const Camera &camera : orbit_cameras(info, 5)) {
      for (const ExactField &field : {kPlane, kSaddle, kThreePlanes}) check(field, info, camera);
    }
  }
}

TEST(ScalarRenderer, HitRecordsNameTheirPlace) {
  const VolumeInfo info = grid_info({14, 11, 13}, {1.0, 2.0, 0.5});
  const Camera camera = orbit_cameras(info, 1)[0];
  const auto hits = draw(info, sample(info.dims, kSaddle.value), camera);
  const std::uint32_t blocks_x = 4, blocks_y = 3;
  EXPECT_GT(num_hits(hits), 500u);
  for (std::uint32_t pixel = 0; pixel < hits.size(); ++pixel) {
    const HitRecord &hit = hits[pixel];
    if (!std::isfinite(hit.t)) continue;
    ASSERT_LT(hit.cell, 64u);
    const glm::dvec3 cell(4 * (hit.block_id % blocks_x) + hit.cell % 4,
                          4 * (hit.block_id / blocks_x % blocks_y) + hit.cell / 4 % 4,
                          4 * (hit.block_id / blocks_x / blocks_y) + hit.cell / 16);
    const glm::dvec3 position = cell + glm::dvec3(hit.x, hit.y, hit.z);
    const test::OracleRay ray =
        test::oracle_ray(camera, kSize, pixel % kSize.width, pixel / kSize.width);
    const glm::dvec3 expected = (ray.eye + double(hit.t) * ray.direction) / info.spacing;
    const glm::dvec3 gradient = kSaddle.gradient(position);
    for (int axis = 0; axis < 3; ++axis) {
      const float *local = &hit.x, *slope = &hit.grad_x;
      ASSERT_GE(local[axis], 0.0f);
      ASSERT_LE(local[axis], 1.0f);
      ASSERT_NEAR(position[axis], expected[axis], 1e-4) << "pixel " << pixel;
      ASSERT_NEAR(slope[axis], gradient[axis], 1e-5) << "pixel " << pixel;
    }
  }
}

/// Trilinear interpolation of |p - c| is off by at most (h^2 / 8) (f_xx + f_yy + f_zz) = (1/8)(2 /
/// r), r the smallest distance in the cell; along a ray that meets the sphere at cosine k that
/// moves the hit by 1/k times as much.
TEST(ScalarRenderer, SphereIsSecondOrder) {
  double previous = 0.0;
  for (const std::uint32_t n : {17u, 33u, 65u, 129u}) {
    const VolumeInfo info = grid_info({n, n, n}, glm::dvec3(1.0 / (n - 1)));
    const double radius = 0.375;
    const glm::dvec3 centre(0.5);
    const auto voxels = sample(
        info.dims, [&](const glm::dvec3 &p) { return glm::length(p * info.spacing - centre); });
    const Camera camera = orbit_cameras(info, 1)[0];
    const auto hits = draw(info, voxels, camera, kSize, float(radius));
    double worst = 0.0;
    for (std::uint32_t pixel = 0; pixel < hits.size(); ++pixel) {
      const test::OracleRay ray =
          test::oracle_ray(camera, kSize, pixel % kSize.width, pixel / kSize.width);
      const double b = glm::dot(centre - ray.eye, ray.direction);
      const double off = glm::length(centre - ray.eye - b * ray.direction);
      if (off > 0.8 * radius) continue;  // cosine at least 0.6
      ASSERT_TRUE(std::isfinite(hits[pixel].t)) << "pixel " << pixel;
      worst =
          std::max(worst, std::abs(hits[pixel].t - (b - std::sqrt(radius * radius - off * off))));
    }
    const double h = info.spacing.x;
    EXPECT_LE(worst, h * h / 8 * 2 / (radius - 2 * h) / 0.6 * 1.1) << n;
    if (n > 17) {
      EXPECT_GT(previous / worst, 3.0) << "from " << n / 2 + 1 << " to " << n;
    }
    previous = worst;
  }
}

// ---- the half-open sign, on fields of z alone: linear in every cell, so that hits are exact

/// First hit of the one ray from z_eye along +z or -z through values[z]; nothing: no hit.
std::optional<double> hit_z(const std::vector<float> &values, float isovalue, double z_eye,
                            double direction = 1.0) {
  const VolumeInfo info = grid_info({6, 7, std::uint32_t(values.size())});
  const Camera camera = camera_along({2.25, 3.5, z_eye}, {0, 0, direction});
  const auto hits =
      draw(info, sample(info.dims, [&](const glm::dvec3 &p) { return values[std::size_t(p.z)]; }),
           camera, {1, 1}, isovalue);
  if (!std::isfinite(hits[0].t)) return std::nullopt;
  return z_eye + direction * hits[0].t;
}

void expect_z(std::optional<double> z, double expected) {
  ASSERT_TRUE(z.has_value()) << "expected a hit at " << expected;
  EXPECT_NEAR(*z, expected, 1e-6);
}

TEST(ScalarRenderer, IsovalueIsExactlyAVoxel) {
  expect_z(hit_z({0, 1, 2}, 1, -1), 1);
  expect_z(hit_z({2, 1, 0}, 1, -1), 1);
  expect_z(hit_z({0, 1, 2}, 1, 4, -1), 1);
  expect_z(hit_z({0, 0, 0, 0, 1, 2, 3, 4}, 1, -1), 4);  // on the border of two blocks
  expect_z(hit_z({0, 0, 0, 0, 1, 0, 0, 0, 0}, 1, 10, -1),
           4);  // a touch from outside is inside there
  expect_z(hit_z({0, 1, 0}, 1, -1), 1);
  EXPECT_FALSE(hit_z({2, 1, 2}, 1, -1));  // a touch from inside never leaves
  EXPECT_FALSE(hit_z({2, 2, 2, 2, 1, 2, 2}, 1, -1));
  EXPECT_FALSE(hit_z({1, 1, 1}, 1, -1));  // inside from end to end
  expect_z(hit_z({1, 1, 0}, 1, -1), 1);
  expect_z(hit_z({0, 0, 1}, 1, -1), 2);  // at the last voxel
  expect_z(hit_z({1, 0, 0}, 1, -1), 0);  // inside at the first voxel only
}

TEST(ScalarRenderer, PlateausAreInside) {
  const std::vector<float> plateau{0, 0, 1, 1, 1, 1, 0, 0, 0};
  expect_z(hit_z(plateau, 1, -1), 2);
  expect_z(hit_z(plateau, 1, 12, -1), 5);
  expect_z(hit_z(plateau, 1, 3), 5);      // starts on it: the exit is the hit
  expect_z(hit_z(plateau, 1, 3, -1), 2);  // and so backwards
  expect_z(hit_z(plateau, 0.5f, -1), 1.5);
  EXPECT_FALSE(hit_z(plateau, 0, -1));  // all of it is at or above 0
}

TEST(ScalarRenderer, StartingInsideIsNoHit) {
  const std::vector<float> hill{0, 2, 4, 4, 4, 4, 2, 0, 2, 4};
  expect_z(hit_z(hill, 3, -1), 1.5);
  expect_z(hit_z(hill, 3, 3.25), 5.5);      // inside: first exit
  expect_z(hit_z(hill, 3, 1.75), 5.5);      // just behind the entry
  expect_z(hit_z(hill, 3, 6.5), 8.5);       // outside again: next entry
  expect_z(hit_z(hill, 3, 6.5, -1), 5.5);   // outside, backwards
  expect_z(hit_z(hill, 3, 12, -1), 8.5);    // enters the volume inside
  EXPECT_FALSE(hit_z(hill, 3, 8.75));       // inside to the end
  EXPECT_FALSE(hit_z(hill, 5, -1));         // above all
  EXPECT_FALSE(hit_z(hill, -1, -1));        // below all
  EXPECT_FALSE(hit_z(hill, 3, 12));         // the volume is behind the eye
  EXPECT_FALSE(hit_z(hill, INFINITY, -1));  //
  EXPECT_FALSE(hit_z(hill, -INFINITY, -1));
}

/// Along the diagonal of x (1 - y) the field is s - s^2, whose top is 1/4 at s = 1/2.
TEST(ScalarRenderer, Tangents) {
  const VolumeInfo info = grid_info({2, 2, 2});
  const Camera camera = camera_along({-1, -1, 0.5}, {1, 1, 0}, {0, 0, 1});
  const auto diagonal_hit = [&](double sign, double offset, float isovalue) {
    const auto voxels =
        sample(info.dims, [&](const glm::dvec3 &p) { return sign * p.x * (1 - p.y) + offset; });
    return draw(info, voxels, camera, {1, 1}, isovalue)[0];
  };
  EXPECT_EQ(diagonal_hit(1, 0, 0.25001f).t, INFINITY);
  EXPECT_NEAR(diagonal_hit(1, 0, 0.25f).x, 0.5, 1e-3);  // a touch from outside: inside at one point
  const HitRecord below = diagonal_hit(1, 0, 0.24f);
  EXPECT_NEAR(below.x, 0.4, 1e-6);
  EXPECT_NEAR(below.t, 1.4 * std::numbers::sqrt2, 1e-5);
  EXPECT_EQ(diagonal_hit(-1, 1, 0.7499f).t, INFINITY);
  const HitRecord touch =
      diagonal_hit(-1, 1, 0.75f);  // from inside: never outside, but for the last bit
  EXPECT_TRUE(touch.t == INFINITY || std::abs(touch.x - 0.5) < 1e-3) << touch.x;
  EXPECT_NEAR(diagonal_hit(-1, 1, 0.76f).x, 0.4, 1e-6);
}

// ---- rays on the box

TEST(ScalarRenderer, RaysAlongEdgesAndFacesAndThroughCorners) {
  const VolumeInfo info = grid_info({6, 5, 7});
  const auto plane = test::plane_field({1, 1, 1}, 2.5);
  const auto voxels = sample(info.dims, plane.value);
  const auto t_of = [&](const glm::dvec3 &eye, const glm::dvec3 &direction) {
    const glm::dvec3 up =
        direction.x == 0 && direction.z == 0 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    return double(draw(info, voxels, camera_along(eye, direction, up), {1, 1})[0].t);
  };
  EXPECT_NEAR(t_of({-1, 0, 0}, {1, 0, 0}), 3.5, 1e-6);  // along an edge of the box
  EXPECT_NEAR(t_of({0, -1, 0}, {0, 1, 0}), 3.5, 1e-6);
  EXPECT_NEAR(t_of({0, 0, -1}, {0, 0, 1}), 3.5, 1e-6);
  EXPECT_NEAR(t_of({8, 0, 0}, {-1, 0, 0}), 5.5, 1e-6);
  EXPECT_NEAR(t_of({-1, 1, 0}, {1, 0, 0}), 2.5,
              1e-6);  // along an edge of cells, in a face of the box
  EXPECT_NEAR(t_of({-1, 1, 1}, {1, 0, 0}), 1.5, 1e-6);  // along an edge of cells
  EXPECT_NEAR(t_of({-1, 0.5, 0}, {1, 0, 0}), 3.0, 1e-6);
  EXPECT_NEAR(t_of({-1, -1, -1}, {1, 1, 1}), (1 + 2.5 / 3) * std::sqrt(3.0),
              2e-6);                                                            // corner to corner
  EXPECT_NEAR(t_of({-1, -1, 0}, {1, 1, 0}), 2.25 * std::numbers::sqrt2, 1e-6);  // a face's diagonal
  EXPECT_NEAR(t_of({2, -1, -1}, {0, 1, 1}), 1.25 * std::numbers::sqrt2, 1e-6);  // through an edge
  EXPECT_EQ(t_of({-1, 1, 0}, {1, -1, 0}), INFINITY);     // touches the box in one edge only
  EXPECT_EQ(t_of({-1, -1e-6, 0}, {1, 0, 0}), INFINITY);  // runs just beside the box

  const auto high = test::plane_field({1, 1, 1}, 12.5);  // near the last corner, (5, 4, 6)
  const auto high_voxels = sample(info.dims, high.value);
  const auto high_t = [&](const glm::dvec3 &eye, const glm::dvec3 &direction) {
    return double(
        draw(info, high_voxels, camera_along(eye, direction, {0.1, 0.9, 0.2}), {1, 1})[0].t);
  };
  EXPECT_NEAR(high_t({-1, 4, 6}, {1, 0, 0}), 3.5, 1e-6);  // along the last planes
  EXPECT_NEAR(high_t({5, 4, -1}, {0, 0, 1}), 4.5, 1e-6);
  EXPECT_NEAR(high_t({7, 4, 6}, {-1, 0, 0}), 4.5, 1e-6);
  EXPECT_NEAR(high_t({6, 5, 7}, {-1, -1, -1}), (1 + 2.5 / 3) * std::sqrt(3.0), 2e-6);
}

// ---- grids whose axes are not the world's

TEST(ScalarRenderer, AFlippedVolumeShowsTheMirroredData) {
  const glm::uvec3 dims(12, 9, 10);
  const VolumeInfo plain = grid_info(dims, {1.0, 1.5, 0.75});
  const auto field = [](const glm::dvec3 &p) {
    return glm::length(p - glm::dvec3(4.3, 3.6, 5.2)) + 0.3 * p.x - 3.1;  // no symmetry
  };
  const auto plain_voxels = sample(dims, field);
  for (int flips = 1; flips < 8; ++flips) {
    SCOPED_TRACE(flips);
    VolumeInfo flipped = plain;
    glm::dvec3 last(dims - 1u), mask(0.0);
    for (int axis = 0; axis < 3; ++axis) {
      if ((flips >> axis & 1) == 0) continue;
      flipped.direction[axis] *= -1.0;
      flipped.origin[axis] += plain.spacing[axis] * last[axis];
      mask[axis] = 1.0;
    }
    const auto mirrored =
        sample(dims, [&](const glm::dvec3 &p) { return field(glm::mix(p, last - p, mask)); });
    for (const Camera &camera : orbit_cameras(plain, 3)) {
      const FrameParams plain_frame = make_frame_params(plain, camera, kSize, 0.0f);
      const FrameParams flipped_frame = make_frame_params(flipped, camera, kSize, 0.0f);
      const auto expected = render_scalar(plain_frame, plain_voxels);
      const auto got = render_scalar(flipped_frame, mirrored);
      std::size_t num_mask_differs = 0;
      for (std::size_t i = 0; i < got.size(); ++i) {
        if (std::isfinite(got[i].t) != std::isfinite(expected[i].t)) {
          ++num_mask_differs;
        } else if (std::isfinite(got[i].t)) {
          ASSERT_NEAR(got[i].t, expected[i].t, 1e-3) << "pixel " << i;
        }
      }
      EXPECT_GT(num_hits(expected), 90u);
      EXPECT_LE(num_mask_differs, 2u) << "beyond a silhouette's rounding";
      // Normals come out in world space: the shaded pictures agree but for rounding.
      const Image8 a = shade_scalar(plain_frame, make_shade_params(plain, {}), expected);
      const Image8 b = shade_scalar(flipped_frame, make_shade_params(flipped, {}), got);
      std::size_t num_bytes_differ = 0;
      for (std::size_t i = 0; i < a.pixels.size(); ++i)
        num_bytes_differ += std::abs(a.pixels[i] - b.pixels[i]) > 2;
      EXPECT_LE(num_bytes_differ, 30u);
    }
  }
}

// ---- no holes

TEST(ScalarRenderer, AClosedSphereIsHitByEveryRayFromInside) {
  const glm::uvec3 dims(33, 33, 33);
  const VolumeInfo info = grid_info(dims);
  const double radius = 13.3;
  std::mt19937 random(20231107);
  const auto uniform = [&] { return double(random()) * 0x1p-32 * 2 - 1; };
  std::vector<Camera> cameras;
  for (const glm::dvec3 &eye : {glm::dvec3(16), glm::dvec3(15.5, 17, 13.25)}) {
    for (int side = 0; side < 6;
         ++side) {  // six faces of a cube: all directions, axes and diagonals exact
      glm::dvec3 direction(0.0);
      direction[side % 3] = side < 3 ? 1.0 : -1.0;
      cameras.push_back(camera_along(
          eye, direction, side % 3 == 1 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0), 90.0));
    }
  }
  for (int i = 0; i < 12; ++i) {
    cameras.push_back(
        camera_along(glm::dvec3(16) + 5.0 * glm::dvec3(uniform(), uniform(), uniform()),
                     {uniform(), uniform(), uniform()}, {0.3, 1.0, -0.2}, 120.0));
  }
  for (const double sign : {1.0, -1.0}) {  // inside and outside change places
    const auto voxels = sample(dims, [&](const glm::dvec3 &p) {
      return sign * (glm::length(p - glm::dvec3(16)) - radius);
    });
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const auto hits = draw(info, voxels, cameras[i], {145, 145});
      EXPECT_EQ(num_hits(hits), hits.size()) << "camera " << i << ", seed 20231107";
    }
  }
}

/// 2^k of a field and its isovalue has the same surface. Scaling by a power of two is exact, so
/// every bit of the hits must stay (but for the gradient's exponent), as long as float32 can hold
/// the values.
TEST(ScalarRenderer, PowersOfTwoOfTheFieldDrawTheSamePicture) {
  const glm::uvec3 dims(14, 13, 12);
  const VolumeInfo info = grid_info(dims);
  const auto voxels = sample(dims, test::noise_field(7));
  const Camera camera = orbit_cameras(info, 1)[0];
  const auto expected = draw(info, voxels, camera, kSize, 0.25f);
  EXPECT_GT(num_hits(expected), 500u);
  for (const int k : {-90, -70, -40, 40, 66, 120}) {
    const float scale = std::ldexp(1.0f, k);
    std::vector<float> scaled = voxels;
    for (float &voxel : scaled) voxel *= scale;
    auto hits = draw(info, scaled, camera, kSize, 0.25f * scale);
    for (HitRecord &hit : hits) {
      hit.grad_x /= scale;
      hit.grad_y /= scale;
      hit.grad_z /= scale;
    }
    SCOPED_TRACE(fmt::format("times 2^{}", k));
    test::expect_same_hits(hits, expected, kSize.width);
  }
}

TEST(ScalarRenderer, ThreadsAndBadInput) {
  const glm::uvec3 dims(9, 10, 11);
  const auto voxels = sample(dims, test::gyroid_field(7));
  const FrameParams frame =
      make_frame_params(grid_info(dims), orbit_cameras(grid_info(dims), 1)[0], kSize, 0.1f);
  const auto expected = render_scalar(frame, voxels, kDefaultSolver, 1);
  for (const unsigned threads : {2u, 5u, 100u})
    test::expect_same_hits(render_scalar(frame, voxels, kDefaultSolver, threads), expected,
                           kSize.width);
  EXPECT_THROW(render_scalar(frame, std::span(voxels).first(voxels.size() - 1)),
               std::invalid_argument);
}

}  // namespace
}  // namespace isowave::core
