// The oracle of clipped frames against closed forms.

#include "reference/clip_oracle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "reference/random.hpp"
#include "tests/clip_scene.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"

namespace isowave::core {
namespace {

using test::VoxelFunction;

/// Rays from an eye in the oracle's volume, of spacing 1, so that t is in voxels.
class Scene {
 public:
  Scene(const glm::uvec3 &dims, const VoxelFunction &field, float isovalue, const glm::dvec3 &eye)
      : info_(test::grid_info(dims)), voxels_{test::sample(dims, field)}, eye_(eye) {
    frames_ = {make_frame_params(info_, camera(), {4, 4}, isovalue)};
    EXPECT_EQ(frames_[0].view.t_scale, 1);
  }

  ClipTruth first(const Clip &clip, const glm::dvec3 &direction) const {
    const glm::dvec3 d = glm::normalize(direction);
    const OracleRay ray{{eye_.x, eye_.y, eye_.z}, {d.x, d.y, d.z}};
    return ClipOracle(info_, camera(), clip, frames_, voxels_).first_hit({&ray, 1});
  }

  void expect(ClipTruth::Kind kind, double t, const Clip &clip,
              const glm::dvec3 &direction = {1, 0, 0}) const {
    const ClipTruth truth = first(clip, direction);
    EXPECT_EQ(truth.kind, kind);
    EXPECT_LE(truth.begin, t + 1e-12);
    EXPECT_GE(truth.end, t - 1e-12);
    EXPECT_LT(truth.end - truth.begin, 1e-4);
  }
  void expect_none(const Clip &clip, const glm::dvec3 &direction = {1, 0, 0}) const {
    EXPECT_EQ(first(clip, direction).kind, ClipTruth::kNone);
  }

 private:
  Camera camera() const { return test::camera_along(eye_, {1, 0, 0}); }

  VolumeInfo info_;
  std::vector<std::vector<float>> voxels_;
  glm::dvec3 eye_;
  std::vector<FrameParams> frames_;
};

ClipPlane from_x(double x) {
  return {{1, 0, 0}, x};
}
ClipPlane up_to_x(double x) {
  return {{-2, 0, 0}, -2 * x};
}

/// The field is x; inside from 3.25 on.
Scene ramp(const glm::dvec3 &eye = {-2, 3.5, 1.5}) {
  return {{9, 7, 5}, [](const glm::dvec3 &p) { return p.x; }, 3.25f, eye};
}

TEST(ClipOracle, CutsARamp) {
  const Scene scene = ramp();
  scene.expect(ClipTruth::kHit, 5.25, {});
  scene.expect(ClipTruth::kHit, 5.25, {{from_x(1.1)}});
  scene.expect(ClipTruth::kHit, 5.25, {{from_x(-50), up_to_x(50)}});  // planes that miss
  scene.expect(ClipTruth::kCap, 7.1, {{from_x(5.1)}});
  scene.expect(ClipTruth::kCap, 7.1, {{from_x(5.1), from_x(4.9)}});
  scene.expect_none({{from_x(5.1)}, false});
  scene.expect_none({{up_to_x(3.1)}});
  scene.expect_none({{from_x(8.5)}});                // behind the volume
  scene.expect_none({{from_x(5.1), up_to_x(4.9)}});  // nothing is in both
  scene.expect(ClipTruth::kHit, 5.25, {{from_x(3.1), up_to_x(4)}});
  scene.expect(ClipTruth::kCap, 6, {{from_x(4), up_to_x(4.001)}});
}

TEST(ClipOracle, LooksOutThroughTheSurface) {
  const Scene scene = ramp({20, 3.5, 1.5});
  const glm::dvec3 back(-1, 0, 0);
  scene.expect(ClipTruth::kHit, 16.75, {}, back);  // the domain's face has no cap
  scene.expect(ClipTruth::kHit, 16.75, {{up_to_x(9)}}, back);
  scene.expect(ClipTruth::kCap, 14, {{up_to_x(6)}}, back);
  scene.expect(ClipTruth::kHit, 16.75, {{up_to_x(6)}, false}, back);
  scene.expect(ClipTruth::kCap, 14, {{up_to_x(6), from_x(5)}}, back);
  scene.expect_none({{up_to_x(6), from_x(5)}, false}, back);
}

TEST(ClipOracle, StartsAtAnEyeInThePartThatStays) {
  const Scene inside = ramp({6, 3.5, 1.5}), outside = ramp({1, 3.5, 1.5});
  inside.expect_none({{up_to_x(7)}});
  inside.expect(ClipTruth::kHit, 2.75, {{up_to_x(7)}}, {-1, 0, 0});
  inside.expect(ClipTruth::kCap, 1, {{from_x(7)}});
  inside.expect(ClipTruth::kCap, 1, {{up_to_x(5)}}, {-1, 0, 0});
  inside.expect_none({{from_x(7)}}, {-1, 0, 0});
  outside.expect(ClipTruth::kHit, 2.25, {{up_to_x(7)}});
  outside.expect(ClipTruth::kCap, 4.5, {{from_x(5.5)}});
}

TEST(ClipOracle, LeavesOpenWhatFloat32MayDecideEitherWay) {
  const Scene scene = ramp();
  const auto kind = [&](const Clip &clip, const glm::dvec3 &direction = {1, 0, 0}) {
    return scene.first(clip, direction).kind;
  };
  EXPECT_EQ(kind({{from_x(3.25)}}), ClipTruth::kUndecided);
  EXPECT_EQ(kind({{up_to_x(3.25)}}), ClipTruth::kUndecided);
  EXPECT_EQ(kind({{from_x(5), up_to_x(5)}}), ClipTruth::kUndecided);
  EXPECT_EQ(kind({{from_x(1), up_to_x(1)}}), ClipTruth::kNone);  // nothing is inside there
  EXPECT_EQ(kind({{from_x(3.2501)}}), ClipTruth::kCap);
  EXPECT_EQ(kind({{from_x(3.2499)}}), ClipTruth::kHit);
  // Along the plane.
  EXPECT_EQ(kind({{{{0, 1, 0}, 3.5}}}), ClipTruth::kUndecided);
  EXPECT_EQ(kind({{{{0, 1, 0}, 3.4}}}), ClipTruth::kHit);
  EXPECT_EQ(kind({{{{0, 1, 0}, 3.6}}}), ClipTruth::kNone);
  // The domain's face.
  EXPECT_EQ(ramp({20, 3.5, 1.5}).first({{up_to_x(8)}}, {-1, 0, 0}).kind, ClipTruth::kUndecided);
}

TEST(ClipOracle, CutsASphere) {
  // On the lattice lines through the middle, the field is exact.
  const Scene scene({17, 17, 17},
                    [](const glm::dvec3 &p) { return 5 - glm::length(p - glm::dvec3(8)); }, 0,
                    {-4, 8, 8});
  scene.expect(ClipTruth::kHit, 7, {});
  scene.expect(ClipTruth::kCap, 12, {{from_x(8)}});
  scene.expect(ClipTruth::kHit, 17, {{from_x(8)}, false});
  scene.expect(ClipTruth::kCap, 11.5, {{{{2, 2, 0}, 31}}});  // x + y >= 15.5
  scene.expect_none({{{{2, 2, 0}, 43}}});
  const Clip box{.planes = {from_x(6.5),
                            up_to_x(9.5),
                            {{0, 1, 0}, 7},
                            {{0, -1, 0}, -9},
                            {{0, 0, 1}, 7},
                            {{0, 0, -1}, -9}}};
  scene.expect(ClipTruth::kCap, 10.5, box);
  scene.expect_none({box.planes, false});
  EXPECT_EQ(scene.first(box, {1, 0, 0}).begun_by, 1u);
}

TEST(ClipOracle, CellsWithoutDataHaveNoCap) {
  for (const bool has_data : {true, false}) {
    const Scene scene(
        {9, 7, 5},
        [&](const glm::dvec3 &p) { return p.x == 5 && !has_data ? double(test::kNone) : p.x; },
        3.25f, {-2, 3.5, 1.5});
    scene.expect(ClipTruth::kHit, 5.25, {{from_x(1)}});
    scene.expect(ClipTruth::kCap, 5.5, {{from_x(3.5)}});
    scene.expect(ClipTruth::kCap, 8.5, {{from_x(6.5)}});
    if (has_data) {
      scene.expect(ClipTruth::kCap, 7.5, {{from_x(5.5)}});
    } else {
      scene.expect_none({{from_x(5.5)}});
    }
  }
}

TEST(ClipOracle, CapsHaveThePlanesGradient) {
  VolumeInfo info = test::grid_info({9, 7, 5}, {2, 3, 0.5});
  const std::vector<std::vector<float>> voxels{std::vector<float>(9 * 7 * 5, 0.0f)};
  const Camera camera = test::camera_along({-9, 2, 3}, {1, 0.2, 0.1});
  const std::vector<FrameParams> frames{make_frame_params(info, camera, {4, 4}, 1)};
  const double scale = frames[0].view.t_scale;
  const ClipOracle oracle(info, camera, {{{{0, 5, 0}, 2}, {{3, 0, 4}, 2}}}, frames, voxels);
  EXPECT_EQ(oracle.cap_gradient(0), (std::array<double, 3>{0, 3 / scale, 0}));
  const auto [x, y, z] = oracle.cap_gradient(1);
  EXPECT_NEAR(x, 0.6 * 2 / scale, 1e-12);
  EXPECT_NEAR(y, 0, 1e-12);
  EXPECT_NEAR(z, 0.8 * 0.5 / scale, 1e-12);
}

/// What stays of rays, place by place: points in world space and their sides of each plane.
TEST(ClipOracle, KeepsThePointsInAllHalfSpaces) {
  Random random(1);
  std::uint64_t num_kept = 0, num_open = 0, num_points = 0;
  for (const test::GridCase &grid : test::clipped_grids()) {
    SCOPED_TRACE(grid.name);
    for (const Camera &camera : test::clipping_cameras(grid.info)) {
      const FrameParams frame = make_frame_params(grid.info, camera, {16, 16}, 0);
      const std::vector<std::vector<float>> voxels{
          std::vector<float>(grid.info.num_voxels(), 0.0f)};
      const glm::dmat3 to_world = grid.info.index_to_world();
      for (int i = 0; i < 40; ++i) {
        const Clip clip = test::random_clip(grid.info, random);
        const ClipOracle oracle(grid.info, camera, clip, {&frame, 1}, voxels);
        for (std::uint32_t pixel = random.below(9); pixel < 256; pixel += 9) {
          const OracleRay ray = exact_ray(make_ray(&frame, pixel));
          const KeptPart kept = oracle.kept(ray, frame.view.t_scale);
          for (int k = 0; k < 20; ++k) {
            const double t = test::random_distance(grid.info, camera, random),
                         along = t / frame.view.t_scale;
            glm::dvec3 index;
            for (int axis = 0; axis < 3; ++axis)
              index[axis] =
                  ray.origin[std::size_t(axis)] + along * ray.direction[std::size_t(axis)];
            const glm::dvec3 point = grid.info.origin + to_world * index;
            bool is_kept = true;
            for (const auto &[normal, offset] : clip.planes)
              is_kept &= glm::dot(normal, point) >= offset;
            const auto is_in = [t](const RayPart &part) {
              return t >= part.begin && t <= part.end;
            };
            ASSERT_LE(is_in(kept.surely), is_kept);
            ASSERT_LE(is_kept, is_in(kept.possibly));
            num_kept += is_kept;
            num_open += is_in(kept.surely) != is_in(kept.possibly);
            ++num_points;
          }
        }
      }
    }
  }
  EXPECT_GT(num_kept, num_points / 20);
  EXPECT_LT(num_open, num_points / 2000);
  RecordProperty("points", std::to_string(num_points));
  RecordProperty("open", std::to_string(num_open));
}

}  // namespace
}  // namespace isowave::core
