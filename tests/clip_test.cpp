// Clipping planes: their checks, and the arithmetic of a ray's interval
// (kernels_cl/portable/clip.h) against double precision.

#include "core/view/clip.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "core/base/error.hpp"
#include "core/view/frame.hpp"
#include "core/volume/pyramid.hpp"
#include "kernels_cl/portable/clip.h"
#include "reference/clip_oracle.hpp"
#include "reference/random.hpp"
#include "tests/clip_scene.hpp"
#include "tests/frame_scene.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{25, 20};

void expect_refused(const Clip &clip, const std::string &message) {
  EXPECT_THAT([&] { check_clip(clip); }, ThrowsMessage<Error>(HasSubstr(message)));
}

TEST(Clip, RefusesPlanesThatCannotBeDrawn) {
  expect_refused({std::vector<ClipPlane>(15)}, "15 clipping planes: up to 14");
  for (const glm::dvec3 &normal : {glm::dvec3(0), glm::dvec3(1e-200, 0, 0), glm::dvec3(0, 1e200, 0),
                                   glm::dvec3(NAN, 1, 0), glm::dvec3(0, 0, INFINITY)})
    expect_refused({{{{1, 0, 0}, 1}, {normal, 0}}}, "normal");
  expect_refused({{{{0, 0, 2}, NAN}}}, "offset is nan");
  expect_refused({{{{0, 0, 2}, -INFINITY}}}, "offset is -inf");
  EXPECT_NO_THROW(check_clip({}));
  EXPECT_NO_THROW(check_clip({std::vector<ClipPlane>(14)}));
  EXPECT_NO_THROW(check_clip({{{{1e-140, 0, 0}, 1e300}, {{0, 1e140, 0}, -1e300}}}));
}

TEST(Clip, BoxesStayByTheirSixPlanes) {
  const glm::dvec3 begin(-1, 2, 30), end(4, 3, 31);
  const auto planes = box_planes(begin, end);
  Random random(2);
  int num_kept = 0;
  for (int i = 0; i < 10000; ++i) {
    const auto [x, y, z] = random.in_box({-4, 1, 29}, {7, 4, 32});
    const glm::dvec3 p(x, y, z);
    const bool is_in =
        glm::all(glm::greaterThanEqual(p, begin)) && glm::all(glm::lessThanEqual(p, end));
    const bool stays = std::ranges::all_of(
        planes, [&](const ClipPlane &plane) { return glm::dot(plane.normal, p) >= plane.offset; });
    ASSERT_EQ(stays, is_in);
    num_kept += stays;
  }
  EXPECT_GT(num_kept, 100);
}

TEST(Clip, RefusesBoxesWithoutAnInside) {
  const auto refused = [](const glm::dvec3 &end, const char *message) {
    EXPECT_THAT([&] { box_planes({0, 0, 0}, end); }, ThrowsMessage<Error>(HasSubstr(message)));
  };
  refused({1, 0, 1}, "along y");
  refused({-1, 1, 1}, "along x");
  refused({1, 1, NAN}, "along z");
}

/// Runs a test for each grid, camera and some clips; t_scale is the frame's.
template <class Test>
void for_clips(std::uint64_t seed, int num_clips, Test test) {
  Random random(seed);
  for (const test::GridCase &grid : test::clipped_grids()) {
    SCOPED_TRACE(grid.name);
    for (const Camera &camera : test::clipping_cameras(grid.info)) {
      const FrameParams frame = make_frame_params(grid.info, camera, kSize, 0);
      for (int i = 0; i < num_clips; ++i) {
        const Clip clip = test::random_clip(grid.info, random);
        test(grid.info, camera, frame, clip, make_clip_params(grid.info, frame.view, camera, clip),
             random);
        if (testing::Test::HasFatalFailure()) return;
      }
    }
  }
}

TEST(Clip, ParametersAreDistancesInTheWorld) {
  for_clips(
      3, 20,
      [](const VolumeInfo &info, const Camera &camera, const FrameParams &frame, const Clip &clip,
         const ClipParams &params, Random &random) {
        ASSERT_EQ(params.num_planes, clip.planes.size());
        ASSERT_EQ(params.with_caps, clip.caps ? 1u : 0u);
        ASSERT_EQ(params.t_scale, frame.view.t_scale);
        const glm::dvec3 forward = glm::normalize(camera.at - camera.eye),
                         right = glm::normalize(glm::cross(forward, camera.up)),
                         up = glm::cross(right, forward);
        const double scale = params.t_scale, size = test::size_of_grid(info);
        for (std::size_t i = 0; i < clip.planes.size(); ++i) {
          const auto &[normal, offset] = clip.planes[i];
          const PlaneParams &plane = params.planes[i];
          for (int k = 0; k < 5; ++k) {
            const auto [x, y, z] = random.in_box({-1, -1, -1}, {2, 2, 2});
            const glm::dvec3 point = test::place_in(info, {x, y, z}), from_eye = point - camera.eye,
                             index = glm::inverse(info.index_to_world()) * (point - info.origin);
            const double expected = (glm::dot(normal, point) - offset) / glm::length(normal);
            const double by_camera = scale * plane.eye + plane.fwd * glm::dot(from_eye, forward) +
                                     plane.right * glm::dot(from_eye, right) +
                                     plane.up * glm::dot(from_eye, up);
            const double by_voxel = scale * (plane.first_voxel + plane.grad_x * index.x +
                                             plane.grad_y * index.y + plane.grad_z * index.z);
            const double far = 4 * size + glm::length(info.origin);
            ASSERT_NEAR(by_camera, expected, 0x1p-23 * far);
            ASSERT_NEAR(by_voxel, expected, 0x1p-22 * far);
          }
        }
      });
}

TEST(Clip, PlanesOutOfFloatsReachStayFarAway) {
  const VolumeInfo info = test::grid_info({8, 8, 8}, glm::dvec3(1e-9));
  const Camera camera = test::clipping_cameras(info)[0];
  const FrameParams frame = make_frame_params(info, camera, kSize, 0);
  const ClipParams params = make_clip_params(
      info, frame.view, camera, {{{{1, 0, 0}, 1e300}, {{1, 0, 0}, -1e300}, {{0, 1, 0}, 0}}});
  EXPECT_EQ(params.planes[0].eye, -0x1p40f);
  EXPECT_EQ(params.planes[0].first_voxel, -0x1p40f);
  EXPECT_EQ(params.planes[1].eye, 0x1p40f);
  for (uint pixel = 0; pixel < 500; ++pixel) {
    ClipParams one = params;
    one.num_planes = 1;
    Ray ray = make_ray(&frame, pixel);
    clip_ray(&frame, &one, pixel, &ray);
    EXPECT_TRUE(!has_interval(&ray) || ray.begin_t > 0x1p30f);
    one.planes[0] = params.planes[1];
    ray = make_ray(&frame, pixel);
    clip_ray(&frame, &one, pixel, &ray);
    EXPECT_EQ(ray.begin_t, 0);
    EXPECT_GT(ray.end_t, 0x1p30f);
    EXPECT_EQ(ray.cut_by, ISO_NOT_CUT);
  }
}

/// Every kind of grid and camera, 100,000 rays and more: what clip_ray() leaves of a ray contains
/// what surely stays, and lies in what may stay.
TEST(Clip, IntervalsAreTheOracles) {
  std::uint64_t num_rays = 0, num_cut = 0, num_ended = 0, num_empty = 0;
  for_clips(
      4, 9,
      [&](const VolumeInfo &info, const Camera &camera, const FrameParams &frame, const Clip &clip,
          const ClipParams &params, Random &) {
        const std::vector<std::vector<float>> voxels{std::vector<float>(info.num_voxels(), 0.0f)};
        const ClipOracle oracle(info, camera, clip, {&frame, 1}, voxels);
        const double scale = frame.view.t_scale;
        const double reach = glm::length(camera.eye - test::place_in(info, glm::dvec3(0.5))) +
                             test::size_of_grid(info);
        for (uint pixel = 0; pixel < kSize.num_rays(); ++pixel) {
          Ray ray = make_ray(&frame, pixel);
          clip_ray(&frame, &params, pixel, &ray);
          const KeptPart kept = oracle.kept(exact_ray(make_ray(&frame, pixel)), scale);
          const double begin = scale * ray.begin_t, end = std::min(scale * ray.end_t, reach);
          if (begin < end) {
            ASSERT_GE(begin, kept.possibly.begin) << pixel;
            ASSERT_LE(end, kept.possibly.end) << pixel;
          }
          if (kept.surely.begin < std::min(kept.surely.end, reach)) {
            ASSERT_LE(begin, kept.surely.begin) << pixel;
            ASSERT_GE(end, std::min(kept.surely.end, reach)) << pixel;
            if (kept.possibly.begin > 0) {
              ASSERT_GE(ray.cut_by, 0) << pixel;
              ASSERT_NE(kept.begun_by >> ray.cut_by & 1u, 0u) << pixel;
            } else if (kept.surely.begin == 0) {
              ASSERT_EQ(ray.cut_by, ISO_NOT_CUT) << pixel;
            }
          }
          ++num_rays;
          num_cut += begin < end && ray.cut_by != ISO_NOT_CUT;
          num_ended += begin < end && end < reach;
          num_empty += !(begin < end);
        }
      });
  EXPECT_GT(num_rays, 100'000u);
  for (const std::uint64_t some : {num_cut, num_ended, num_empty}) EXPECT_GT(some, num_rays / 10);
}

TEST(Clip, IntervalsOfLevelsAreTheFinestOnesScaled) {
  std::uint64_t num_kept = 0;
  for_clips(5, 6,
            [&](const VolumeInfo &finest, const Camera &camera, const FrameParams &frame,
                const Clip &, const ClipParams &params, Random &) {
              if (finest.brick != BrickOf{}) return;
              VolumeInfo info = finest;
              for (int level = 1; level <= 2; ++level) {
                info = coarser_level(info);
                const FrameParams coarse = make_frame_params(info, camera, kSize, 0);
                for (uint pixel = 0; pixel < kSize.num_rays(); ++pixel) {
                  Ray ray = make_ray(&frame, pixel), coarse_ray = make_ray(&coarse, pixel);
                  clip_ray(&frame, &params, pixel, &ray);
                  clip_ray(&coarse, &params, pixel, &coarse_ray);
                  ASSERT_EQ(coarse_ray.begin_t, std::ldexp(ray.begin_t, -level)) << pixel;
                  ASSERT_EQ(coarse_ray.end_t, std::ldexp(ray.end_t, -level)) << pixel;
                  ASSERT_EQ(coarse_ray.cut_by, ray.cut_by) << pixel;
                  num_kept += has_interval(&ray);
                }
              }
            });
  EXPECT_GT(num_kept, 10'000u);
}

/// Planes across the x axis, of the ray of the middle pixel along it, from 0.
class ClipRay : public testing::Test {
 protected:
  /// A ray that is drawn from begin_t to end_t.
  Ray clipped(const std::vector<ClipPlane> &planes, float begin_t, float end_t) const {
    const ClipParams params = make_clip_params(info_, frame_.view, camera_, {planes});
    Ray ray = make_ray(&frame_, 4);
    ray.begin_t = begin_t;
    ray.end_t = end_t;
    clip_ray(&frame_, &params, 4, &ray);
    return ray;
  }
  void expect(const Ray &ray, float begin_t, float end_t, int cut_by) const {
    EXPECT_EQ(ray.begin_t, begin_t);
    EXPECT_EQ(ray.end_t, end_t);
    EXPECT_EQ(ray.cut_by, cut_by);
  }

  VolumeInfo info_ = test::grid_info({20, 20, 20});
  Camera camera_ = test::camera_along({0, 9, 9}, {1, 0, 0});
  FrameParams frame_ = make_frame_params(info_, camera_, {3, 3}, 0);
};

TEST_F(ClipRay, IsCutWithinItsBand) {
  const std::vector<ClipPlane> slab{{{1, 0, 0}, 3}, {{1, 0, 0}, 4}, {{-1, 0, 0}, -8}};
  expect(clipped(slab, 0, INFINITY), 4, 8, 1);
  expect(clipped(slab, 0, 6), 4, 6, 1);
  expect(clipped(slab, 4, 6), 4, 6, 1);
  expect(clipped(slab, 5, 6), 5, 6, ISO_NOT_CUT);  // it begins in the band before
  expect(clipped(slab, 5, INFINITY), 5, 8, ISO_NOT_CUT);
  const Ray ended_before = clipped(slab, 9, 12), begins_behind = clipped(slab, 1, 2);
  EXPECT_FALSE(has_interval(&ended_before));
  EXPECT_FALSE(has_interval(&begins_behind));
}

TEST_F(ClipRay, AlongAPlaneIsKeptOrNot) {
  expect(clipped({{{0, 1, 0}, 8}}, 0, INFINITY), 0, INFINITY, ISO_NOT_CUT);
  const Ray removed = clipped({{{0, 1, 0}, 10}}, 0, INFINITY);
  EXPECT_FALSE(has_interval(&removed));
}

TEST_F(ClipRay, StartsAtTheEyeIfThatStays) {
  expect(clipped({{{1, 0, 0}, -3}, {{0, 1, 0}, 0}}, 0, INFINITY), 0, INFINITY, ISO_NOT_CUT);
  const Ray behind = clipped({{{-1, 0, 0}, 3}}, 0, INFINITY);
  EXPECT_FALSE(has_interval(&behind));
}

/// Just before t, a given ray is within all half spaces, and just behind it is not.
void expect_left_at(const ClipParams &params, const GivenRay &given, float voxel, float t) {
  EXPECT_FALSE(is_clipped(&params, given, voxel, t - 0.001f)) << t;
  EXPECT_TRUE(is_clipped(&params, given, voxel, t + 0.001f)) << t;
}

TEST(IsClipped, AGivenRayBehindAPlane) {
  VolumeInfo info = test::grid_info({20, 20, 20}, {2, 1, 1});
  info.origin = {100, 0, 0};
  const Camera camera = test::camera_along({90, 3, 3}, {1, 0, 0});
  const FrameParams frame = make_frame_params(info, camera, {3, 3}, 0);
  const ClipParams params = make_clip_params(
      info, frame.view, camera, {{{{-1, 0, 0}, -120}, {{0, -2, 0}, -16}, {{0, 0, 1}, -4}}});
  // x up to 120: voxel 10; y up to 8; z from -4 on.
  expect_left_at(params, {4, 2, 2, 1, 0, 0, 0}, 1, 6);
  expect_left_at(params, {4, 2, 2, 1, 2, 0, 0}, 1, 3);
  expect_left_at(params, {4, 2, 2, 0, 0, -1, 0}, 1, 6);
  EXPECT_FALSE(is_clipped(&params, {4, 2, 2, -1, -1, 1, 0}, 1, 1e6f));
  EXPECT_FALSE(is_clipped(&params, {4, 2, 2, 0, 0, 1, 0}, 1, 1e6f));
  // The same rays at level 2, in voxels of 4.
  expect_left_at(params, {1, 0.5f, 0.5f, 1, 0, 0, 2}, 4, 1.5f);
  expect_left_at(params, {1, 0.5f, 0.5f, 0.25f, 0.5f, 0, 2}, 4, 3);
  const ClipParams none = make_clip_params(info, frame.view, camera, {});
  EXPECT_FALSE(is_clipped(&none, {4, 2, 2, 1, 0, 0, 0}, 1, 1e6f));
}

TEST(Entering, ARayThatBeginsBehindPlanes) {
  const VolumeInfo info = test::grid_info({20, 20, 20});
  const Camera camera = test::camera_along({-10, 3, 3}, {1, 0, 0});
  const FrameParams frame = make_frame_params(info, camera, {3, 3}, 0);
  const ClipParams params = make_clip_params(info, frame.view, camera,
                                             {{{{1, 0, 0}, 8}, {{-1, 0, 0}, -12}, {{0, 2, 0}, 2}}});
  // What is left: x from 8 to 12, y from 1 on.
  const auto entered = [&](const GivenRay &given, float voxel = 1) {
    const RayEntrance at = entrance_of(&params, given, voxel);
    GivenRay ray = entering(&params, given, at);
    EXPECT_EQ(level_of_given(ray), given.level);
    EXPECT_EQ(cut_of_given(ray), at.plane);
    EXPECT_EQ(at.plane == ISO_NOT_CUT, at.begin == 0);
    ray.level = given.level;
    return ray;
  };
  const GivenRay within{9, 2, 2, 1, -1, 0.5f, 0};
  const GivenRay same = entered(within);
  EXPECT_EQ(std::memcmp(&same, &within, sizeof(within)), 0);
  const GivenRay from_x = entered({4, 2, 2, 2, 0, 1, 0});
  EXPECT_FLOAT_EQ(from_x.o_x, 8);
  EXPECT_FLOAT_EQ(from_x.o_z, 4);
  expect_left_at(params, from_x, 1, 2);
  EXPECT_EQ(entrance_of(&params, {4, 2, 2, 2, 0, 1, 0}, 1).plane, 0);
  ClipParams open = params;
  open.with_caps = 0;
  EXPECT_EQ(entering(&open, within, {1, 2}).level, within.level) << "there is no cap";
  const GivenRay from_both = entered({7, -2, 2, 1, 1, 0, 0});
  EXPECT_FLOAT_EQ(from_both.o_x, 10);
  EXPECT_FLOAT_EQ(from_both.o_y, 1);
  // In voxels of 4.
  EXPECT_FLOAT_EQ(entered({1, 0.5f, 0.5f, 0.5f, 0, 0, 2}, 4).o_x, 2);
  // These never are within all planes.
  for (const GivenRay &never : {GivenRay{4, 2, 2, -1, 0, 0, 0}, GivenRay{4, 2, 2, 0, 1, 0, 0},
                                GivenRay{4, -20, 2, 1, 1, 0, 0}, GivenRay{14, 2, 2, 1, 0, 0, 0}}) {
    for (const float t : {0.01f, 1.0f, 100.0f})
      EXPECT_TRUE(is_clipped(&params, entered(never), 1, t)) << never.o_x << " at " << t;
  }
}

}  // namespace
}  // namespace isowave::core
