// core/paper/rasterise against its scalar twin, bit for bit, which asks every pixel about every
// triangle; the test of a ray and a triangle against the textbook's in double; no holes.

#include "core/paper/rasterise.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "kernels_cl/portable/raster.h"
#include "reference/raster_twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/surface_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::camera_along;
using test::expect_same_hits;
using test::num_hits;
using test::sample;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSmall{13, 9};
constexpr ImageSize kMedium{96, 64};

// ---- a ray and a triangle

/// Corners in view coordinates: forward, right, up.
struct TestTriangle {
  ViewTriangle corners;
  glm::dvec3 a, b, c;

  TestTriangle(const glm::vec3 &p, const glm::vec3 &q, const glm::vec3 &r) : a(p), b(q), c(r) {
    corners = {{p.x, q.x, r.x}, {p.y, q.y, r.y}, {p.z, q.z, r.z}};
  }
  bool is_met(float u, float v) const {
    TriangleHit hit;
    return ray_meets_triangle(u, v, &corners, &hit) != 0;
  }
};

/// t and the weights of b and c [Moeller and Trumbore 1997], in double.
glm::dvec3 meet_exactly(const TestTriangle &triangle, const glm::dvec3 &direction) {
  const glm::dvec3 ab = triangle.b - triangle.a, ac = triangle.c - triangle.a;
  const glm::dvec3 p = glm::cross(direction, ac), s = -triangle.a, q = glm::cross(s, ab);
  const double scale = 1 / glm::dot(ab, p);
  return {scale * glm::dot(ac, q), scale * glm::dot(s, p), scale * glm::dot(direction, q)};
}

TEST(RayTriangle, IsTheTextbooks) {
  Random random(1);
  std::uniform_real_distribution<float> place(-1, 1);
  const auto vector = [&] { return glm::vec3(place(random), place(random), place(random)); };
  std::size_t num_met = 0, num_close = 0;
  for (int i = 0; i < 200'000; ++i) {
    const glm::vec3 middle = glm::vec3(8 * place(random), 0, 0) + 2.0f * vector();
    const float u = place(random), v = place(random);
    const TestTriangle triangle(middle + 4.0f * vector(), middle + 4.0f * vector(),
                                middle + 4.0f * vector());
    TriangleHit hit;
    const bool met = ray_meets_triangle(u, v, &triangle.corners, &hit) != 0;
    const glm::dvec3 direction(1, u, v), exact = meet_exactly(triangle, direction);
    // Seen along the ray, corners, whose coordinates are below 14, are off by 2^-24 of at most
    // twice as much. Weights change by that over the least height of the triangle that is seen: its
    // doubled area over its longest edge.
    const glm::dvec3 ab = triangle.b - triangle.a, ac = triangle.c - triangle.a;
    const double area = std::abs(glm::dot(glm::cross(ab, ac), direction));
    const double longest = std::max({glm::length(ab), glm::length(ac), glm::length(ab - ac)});
    const double off = 2 * 28 * 0x1p-24 * 2 * longest / area + 0x1p-20;
    const double least = std::min({exact.y, exact.z, 1 - exact.y - exact.z});
    if (std::abs(least) < off || std::abs(exact.x) < 0.01 || off > 0.1) {
      ++num_close;  // too near to an edge to be judged
      continue;
    }
    ASSERT_EQ(met, least > 0 && exact.x > 0) << "case " << i;
    if (!met) continue;
    ++num_met;
    // That of a point of the triangle whose weights are off by as much.
    ASSERT_NEAR(hit.forward, exact.x, 3 * off * longest + 14 * 0x1p-20) << "case " << i;
    ASSERT_NEAR(hit.b, exact.y, off);
    ASSERT_NEAR(hit.c, exact.z, off);
  }
  EXPECT_GT(num_met, 5'000u);
  EXPECT_LT(num_close, 4'000u);
}

/// The ray goes right through a corner, or an edge: all that share it are met.
TEST(RayTriangle, CornersAndEdgesBelongToAll) {
  const glm::vec3 top(5, 0, 0);
  std::vector<glm::vec3> around;
  for (int i = 0; i < 7; ++i)
    around.emplace_back(6 + 0.1f * float(i), std::sin(0.9f * float(i)), std::cos(0.9f * float(i)));
  for (std::size_t i = 0; i < around.size(); ++i) {
    const glm::vec3 &next = around[(i + 1) % around.size()];
    TriangleHit hit;
    const TestTriangle fan(top, around[i], next);
    ASSERT_TRUE(ray_meets_triangle(0, 0, &fan.corners, &hit));
    EXPECT_EQ(hit.forward, 5);
    // An edge from both sides, whichever way round.
    const glm::vec3 middle = 0.5f * (top + around[i]);
    const float u = middle.y / middle.x, v = middle.z / middle.x;
    const glm::vec3 aside = glm::cross(around[i] - top, glm::vec3(1, 0, 0));
    EXPECT_TRUE(TestTriangle(top, around[i], top + aside).is_met(u, v) ||
                TestTriangle(around[i], top, top - aside).is_met(u, v));
  }
}

TEST(RayTriangle, NothingBehindNorOnEdgeIsMet) {
  EXPECT_TRUE(TestTriangle({2, -1, -1}, {2, 1, -1}, {2, 0, 2}).is_met(0, 0));
  EXPECT_FALSE(TestTriangle({-2, -1, -1}, {-2, 1, -1}, {-2, 0, 2}).is_met(0, 0));
  EXPECT_FALSE(TestTriangle({2, 0, -1}, {2, 0, 1}, {4, 0, 0}).is_met(0, 0)) << "on edge";
  EXPECT_FALSE(TestTriangle({2, 0, 0}, {2, 0, 0}, {2, 0, 0}).is_met(0, 0)) << "a point";
}

/// Signs are right where float32 alone cannot tell.
TEST(RayTriangle, SidesAreExact) {
  const float a = 1 + 0x1p-23f, b = 1 - 0x1p-23f;
  EXPECT_GT(side_of_edge(1, 1, a, b), 0) << "1 - (1 - 2^-46)";
  EXPECT_LT(side_of_edge(a, b, 1, 1), 0);
  EXPECT_EQ(side_of_edge(a, b, b, a), 0);
}

// ---- pictures

struct Mesh {
  VolumeInfo info;
  float isovalue;
  std::vector<BlockVertex> vertices;

  Mesh(const glm::uvec3 &dims, const std::vector<float> &voxels, float iso,
       const glm::dvec3 &spacing = glm::dvec3(1))
      : info(test::grid_info(dims, spacing)),
        isovalue(iso),
        vertices(triangles_scalar(dims, voxels, iso)) {}
  Mesh(const glm::uvec3 &dims, const test::VoxelFunction &field, float iso)
      : Mesh(dims, sample(dims, field), iso) {}

  uint num_triangles() const { return static_cast<uint>(vertices.size() / 3); }
};

/// Positive inside a sphere around the middle voxel; the surface at 0 is closed.
test::VoxelFunction ball(double middle, double radius) {
  return [=](const glm::dvec3 &p) { return radius - glm::length(p - middle); };
}

class RasteriseOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Draws triangles in parts that end at `cuts`.
  std::vector<HitRecord> draw(const FrameParams &frame, const std::vector<BlockVertex> &vertices,
                              std::vector<std::size_t> cuts = {}) {
    const std::uint64_t num_rays = std::uint64_t{frame.view.width} * frame.view.height;
    Wavefront rays(device_, {.num_rays = num_rays, .with_pairs = false, .with_walks = false});
    Rasterise rasterise(device_, num_rays);
    rays.frame = frame;
    rasterise.clear(rays);
    cuts.push_back(vertices.size() / 3);
    std::size_t begin = 0;
    for (const std::size_t end : cuts) {
      const ocl::Buffer<BlockVertex> part(
          device_, "part", std::span(vertices).subspan(3 * begin, 3 * (end - begin)));
      rasterise(part, static_cast<uint>(end - begin), rays);
      begin = end;
    }
    return rays.hits.read();
  }

  /// Returns how many hits there are.
  std::uint64_t check(const Mesh &mesh, const Camera &camera, ImageSize size) {
    const FrameParams frame = make_frame_params(mesh.info, camera, size, mesh.isovalue);
    const std::vector<HitRecord> expected = rasterise_scalar(frame, mesh.vertices);
    expect_same_hits(draw(frame, mesh.vertices), expected, size.width);
    return num_hits(expected);
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, RasteriseOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(RasteriseOnDevice, SmallNoiseFromOutsideAndInside) {
  const Mesh mesh({7, 6, 9}, test::noise_field(3), 0.3f);
  EXPECT_GT(check(mesh, orbit_cameras(mesh.info, 1)[0], kSmall), 20u);
  EXPECT_GT(check(mesh, camera_along({3, 2.5, 4.25}, {1, 0.25, -0.5}), kSmall), 20u);
}

TEST_P(RasteriseOnDevice, SmallPartsMakeTheSamePicture) {
  const Mesh mesh({5, 6, 5}, test::noise_field(4), 0.1f);
  const FrameParams frame =
      make_frame_params(mesh.info, orbit_cameras(mesh.info, 1)[0], kSmall, mesh.isovalue);
  const std::vector<HitRecord> whole = draw(frame, mesh.vertices);
  EXPECT_GT(num_hits(whole), 20u);
  expect_same_hits(draw(frame, mesh.vertices, {0, 1, mesh.num_triangles() / 2}), whole,
                   kSmall.width);
}

TEST_P(RasteriseOnDevice, SmallNothing) {
  const Mesh mesh({4, 4, 4}, test::noise_field(3), 5.0f);
  ASSERT_TRUE(mesh.vertices.empty());
  EXPECT_EQ(check(mesh, orbit_cameras(mesh.info, 1)[0], kSmall), 0u);
  const Mesh some({4, 4, 4}, test::noise_field(3), 0.1f);
  const Camera camera = orbit_cameras(some.info, 1)[0];
  EXPECT_EQ(check(some, camera_along(camera.eye, camera.eye - camera.at), kSmall), 0u) << "behind";
}

TEST_P(RasteriseOnDevice, SmallMisuse) {
  Wavefront rays(device_, {.num_rays = 4, .with_pairs = false, .with_walks = false});
  Rasterise rasterise(device_, 4);
  const ocl::Buffer<BlockVertex> two(device_, "two", 8);
  EXPECT_THAT([&] { rasterise(two, 3, rays); },
              ThrowsMessage<std::invalid_argument>(HasSubstr("3 triangles of 'two', which has 8")));
}

/// Triangles larger than what a work-item, and than what a work-group draws alone.
TEST_P(RasteriseOnDevice, LargeTriangles) {
  for (uint seed = 0; seed < 4; ++seed) {
    const Mesh mesh({2, 3, 2}, test::noise_field(seed), 0.05f);
    for (const Camera &camera : orbit_cameras(mesh.info, 2))
      EXPECT_GT(check(mesh, camera, {160, 120}), 1000u);
    check(mesh, camera_along({0.5, 0.75, 0.5}, {0.3, 0.2, 1}), {160, 120});
  }
}

/// More of them than the list of those has room for.
TEST_P(RasteriseOnDevice, ManyLargeTriangles) {
  if (is_llvmpipe(GetParam()) || is_simulator(GetParam())) GTEST_SKIP() << "takes minutes there";
  const Mesh one({2, 2, 2}, std::vector<float>{1, -1, -1, -1, -1, -1, -1, -1}, 0);
  ASSERT_EQ(one.num_triangles(), 1u);
  std::vector<BlockVertex> many;
  for (int i = 0; i < 5000; ++i) many.insert(many.end(), one.vertices.begin(), one.vertices.end());
  const FrameParams frame = make_frame_params(one.info, camera_along({0.3, 0.3, 0.3}, {-1, -1, -1}),
                                              {96, 96}, one.isovalue);
  const std::vector<HitRecord> hits = draw(frame, many);
  expect_same_hits(hits, draw(frame, one.vertices), 96);
  EXPECT_GT(num_hits(hits), 4096u);
}

TEST_P(RasteriseOnDevice, AnyVolumeAndView) {
  for (uint seed = 0; seed < (is_llvmpipe(GetParam()) ? 3u : 9u); ++seed) {
    Random random(seed);
    std::uniform_real_distribution<double> part(0, 1);
    const glm::uvec3 dims(2 + random() % 10, 2 + random() % 10, 2 + random() % 10);
    const auto vector = [&] { return glm::dvec3(part(random), part(random), part(random)); };
    const glm::dvec3 spacing = seed % 3 == 0 ? 0.1 + 5.0 * vector() : glm::dvec3(1);
    const Mesh mesh(dims, coarse_noise(dims, seed), seed % 2 == 0 ? 1.0f : 0.4f, spacing);
    const glm::dvec3 extent = spacing * glm::dvec3(dims - 1u);
    const Camera inside = camera_along(extent * vector(), vector() - 0.5, {0, 1, 0},
                                       10 + 120 * part(random)),
                 beside = camera_along(extent * (3.0 * vector() - 1.0), extent * (vector() - 0.5),
                                       {1, 0, 0}, 5 + 60 * part(random));
    SCOPED_TRACE(fmt::format("seed {}, {}x{}x{}", seed, dims.x, dims.y, dims.z));
    check(mesh, orbit_cameras(mesh.info, 1)[0], kMedium);
    check(mesh, inside, kMedium);
    check(mesh, beside, kMedium);
  }
}

/// From within a closed surface, every ray hits it: also those that go right through vertices and
/// along edges, of which a middle on a voxel and odd pictures have many.
TEST_P(RasteriseOnDevice, AClosedSurfaceHasNoHole) {
  const double middle = 12, radius = 8.25;
  const Mesh mesh(glm::uvec3(25), ball(middle, radius), 0);
  const std::uint32_t edge = is_llvmpipe(GetParam()) ? 65 : 257;
  for (const glm::dvec3 &eye : {glm::dvec3(middle), glm::dvec3(12.25, 11.5, 12.125)}) {
    for (int face = 0; face < 6; ++face) {
      glm::dvec3 along(0), up(0);
      along[face / 2] = face % 2 == 0 ? 1 : -1;
      up[(face / 2 + 1) % 3] = 1;
      const FrameParams frame = make_frame_params(mesh.info, camera_along(eye, along, up, 90.5),
                                                  {edge, edge}, mesh.isovalue);
      for (const HitRecord &hit : draw(frame, mesh.vertices)) {
        ASSERT_TRUE(std::isfinite(hit.t)) << "a hole";
        // A plane triangle in a cell is below the sphere by at most (sqrt(3) / 2)^2 / 2 r; the
        // distances that the field is made of bend by 1 / r, which moves its vertices by at most
        // 1 / 8 r; and half a step along each axis.
        const double sag = (0.375 + 0.125) / radius + 0.0035;
        const glm::dvec3 at(4u * (hit.block_id % 7) + hit.cell % 4 + double(hit.x),
                            4u * (hit.block_id / 7 % 7) + hit.cell / 4 % 4 + double(hit.y),
                            4u * (hit.block_id / 49) + hit.cell / 16 + double(hit.z));
        ASSERT_NEAR(glm::length(at - middle), radius, sag);
        ASSERT_NEAR(glm::length(at - eye), hit.t, 1e-4) << "float32, 10 voxels";
        ASSERT_LT(glm::dot(glm::dvec3(hit.grad_x, hit.grad_y, hit.grad_z), at - middle), 0)
            << "towards larger values";
      }
    }
  }
}

}  // namespace
}  // namespace isowave::core
