// Views of volumes: which way is up, what each side shows, and what fills a picture. The volumes'
// sides are unequal, and their axes point elsewhere than the world's.

#include "isowave/views.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/view/camera.hpp"
#include "isowave/host.hpp"
#include "tests/run_program.hpp"

namespace isowave {
namespace {

using core::axes_of;
using testing::HasSubstr;
namespace test = core::test;

constexpr ImageSize kLandscape{96, 48}, kPortrait{48, 96};

/// Index axes x, y, z lead along the world's -z, x and -y: a volume that lies on its side.
core::VolumeInfo lying(bool is_anatomical) {
  core::VolumeInfo info;
  info.dims = {41, 11, 21};
  info.spacing = {0.5, 3, 2};
  info.origin = {7, -5, 3};
  info.direction = glm::dmat3({0, 0, -1}, {1, 0, 0}, {0, -1, 0});
  info.is_anatomical = is_anatomical;
  return info;
}

Grid grid_of(const core::VolumeInfo &info) {
  Grid grid{.dims = {info.dims.x, info.dims.y, info.dims.z},
            .spacing = {info.spacing.x, info.spacing.y, info.spacing.z},
            .origin = {info.origin.x, info.origin.y, info.origin.z},
            .is_anatomical = info.is_anatomical};
  for (int a = 0; a < 3; ++a)
    grid.direction.at(std::size_t(a)) = {info.direction[a].x, info.direction[a].y,
                                         info.direction[a].z};
  return grid;
}

core::Camera view(const core::VolumeInfo &info, core::Side side,
                  const std::optional<glm::dvec3> &up = {}) {
  return camera_of_box(info, glm::dvec3(0), glm::dvec3(info.dims - 1u), 2, {side, up});
}

void expect_looks(const core::Camera &camera, const glm::dvec3 &forward, const glm::dvec3 &right) {
  const core::CameraAxes axes = axes_of(camera);
  EXPECT_LT(glm::distance(axes.forward, forward), 1e-12)
      << axes.forward.x << " " << axes.forward.y << " " << axes.forward.z;
  EXPECT_LT(glm::distance(axes.right, right), 1e-12)
      << axes.right.x << " " << axes.right.y << " " << axes.right.z;
}

/// The largest of |x| and |y| of the box's corners in the picture, 1 at its edges; and of |x|
/// alone.
std::array<double, 2> extent_of(const core::Camera &camera, const core::VolumeInfo &info,
                                double aspect) {
  const core::CameraAxes axes = axes_of(camera);
  std::array<double, 2> largest{};
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 index =
        glm::dvec3(corner & 1, corner >> 1 & 1, corner >> 2) * glm::dvec3(info.dims - 1u);
    const glm::dvec3 to = info.origin + info.index_to_world() * index - camera.eye;
    const double half = camera.parallel_height ? *camera.parallel_height / 2
                                               : glm::dot(to, axes.forward) *
                                                     std::tan(glm::radians(camera.fovy_deg) / 2);
    const double x = std::abs(glm::dot(to, axes.right)) / (half * aspect),
                 y = std::abs(glm::dot(to, axes.up)) / half;
    largest = {std::max({largest[0], x, y}), std::max(largest[1], x)};
  }
  return largest;
}

core::Camera core_of(const Camera &camera) {
  return {{camera.eye[0], camera.eye[1], camera.eye[2]},
          {camera.at[0], camera.at[1], camera.at[2]},
          {camera.up[0], camera.up[1], camera.up[2]},
          camera.fovy_degrees,
          camera.parallel_height};
}

TEST(Views, APatientIsUprightAndFacesTheEye) {
  // LPS: +x left, +y posterior, +z superior.
  const core::VolumeInfo info = lying(true);
  using core::Side;
  expect_looks(view(info, Side::kFront), {0, 1, 0}, {1, 0, 0});
  expect_looks(view(info, Side::kBack), {0, -1, 0}, {-1, 0, 0});
  expect_looks(view(info, Side::kLeft), {-1, 0, 0}, {0, 1, 0});  // the nose is at the left
  expect_looks(view(info, Side::kRight), {1, 0, 0}, {0, -1, 0});
  expect_looks(view(info, Side::kTop), {0, 0, -1}, {1, 0, 0});
  expect_looks(view(info, Side::kBottom), {0, 0, 1}, {1, 0, 0});
  const core::CameraAxes corner = axes_of(view(info, Side::kCorner));
  EXPECT_GT(corner.up.z, 0.9);
  EXPECT_GT(corner.forward.y, 0.8);
  EXPECT_EQ(up_of(grid_of(info)), (Vector3{0, 0, 1}));
}

TEST(Views, OfOtherVolumesYIsUp) {
  const core::VolumeInfo info = lying(false);
  using core::Side;
  expect_looks(view(info, Side::kFront), {0, 0, -1}, {1, 0, 0});
  expect_looks(view(info, Side::kBack), {0, 0, 1}, {-1, 0, 0});
  expect_looks(view(info, Side::kLeft), {1, 0, 0}, {0, 0, 1});
  expect_looks(view(info, Side::kRight), {-1, 0, 0}, {0, 0, -1});
  expect_looks(view(info, Side::kTop), {0, -1, 0}, {1, 0, 0});
  expect_looks(view(info, Side::kBottom), {0, 1, 0}, {1, 0, 0});
  const double third = std::sqrt(1.0 / 3);
  expect_looks(view(info, Side::kIso), {-third, -third, -third},
               {std::sqrt(0.5), 0, -std::sqrt(0.5)});
  EXPECT_EQ(up_of(grid_of(info)), (Vector3{0, 1, 0}));
}

TEST(Views, SidesTurnWithUp) {
  const core::VolumeInfo info = lying(false);
  using core::Side;
  expect_looks(view(info, Side::kFront, glm::dvec3(0, 0, 4)), {0, 1, 0}, {1, 0, 0});
  expect_looks(view(info, Side::kRight, glm::dvec3(0, 0, 1)), {-1, 0, 0}, {0, 1, 0});
  expect_looks(view(info, Side::kFront, glm::dvec3(1, 0, 0)), {0, 0, -1}, {0, -1, 0});
  expect_looks(view(info, Side::kFront, glm::dvec3(0, -1, 0)), {0, 0, -1}, {-1, 0, 0});
  expect_looks(view(lying(true), Side::kTop, glm::dvec3(0, -3, 0)), {0, 1, 0}, {1, 0, 0});
  const core::Orientation any = orientation_of(info, glm::dvec3(1, -2, 0.5));
  EXPECT_NEAR(glm::dot(any.right, any.up), 0, 1e-12);
  EXPECT_LT(glm::distance(glm::cross(any.up, any.front), any.right), 1e-12);
  EXPECT_THAT([&] { orientation_of(info, glm::dvec3(0)); },
              testing::ThrowsMessage<core::Error>(HasSubstr("give a direction")));
}

TEST(Views, TheBoxFillsPicturesOfAllShapes) {
  for (const bool is_anatomical : {false, true}) {
    const core::VolumeInfo info = lying(is_anatomical);
    for (const ImageSize size : {kLandscape, kPortrait, ImageSize{64, 64, 1}}) {
      const double aspect = double(size.width) / size.height;
      for (int side = 0; side < 8; ++side) {
        const Camera camera = box_camera(grid_of(info), {static_cast<Side>(side)}, size);
        EXPECT_NEAR(extent_of(core_of(camera), info, aspect)[0], 0.95, 1e-12) << side;
      }
    }
  }
}

TEST(Views, ATurntableKeepsTheBoxInAllPictures) {
  const core::VolumeInfo info = lying(true);
  for (const Side side : {Side::kCorner, Side::kTop, Side::kRight}) {
    double largest = 0;
    const auto cameras = box_turntable(grid_of(info), 7, {side}, kPortrait);
    for (const Camera &each : cameras) {
      const core::Camera camera = core_of(each);
      largest = std::max(largest, extent_of(camera, info, 0.5)[0]);
      EXPECT_NEAR(camera.eye.z, core_of(cameras[0]).eye.z, 1e-9) << "about superior";
    }
    EXPECT_NEAR(largest, 0.95, 1e-9);
    const core::CameraAxes first = axes_of(core_of(cameras[0])),
                           next = axes_of(core_of(cameras[1]));
    const double turn = std::acos(
        glm::dot(glm::normalize(glm::dvec2(first.right)), glm::normalize(glm::dvec2(next.right))));
    EXPECT_NEAR(turn, 2 * 3.14159265358979 / 7, 1e-9);
  }
}

TEST(Views, FittedCamerasLookAsBefore) {
  const core::VolumeInfo info = lying(false);
  for (const std::optional<double> &height : {std::optional<double>(), std::optional(3.0)}) {
    const Camera start{{1, 2, 30}, {4, -2, 5}, {0.2, 1, 0}, 35, height};
    const Camera camera = fitted(start, grid_of(info), kPortrait);
    const core::CameraAxes before = axes_of(core_of(start));
    expect_looks(core_of(camera), before.forward, before.right);
    EXPECT_NEAR(extent_of(core_of(camera), info, 0.5)[0], 0.95, 1e-12);
    EXPECT_EQ(camera.fovy_degrees, 35);
  }
}

TEST(Views, AZoomMagnifiesAndTheEyeStays) {
  const core::VolumeInfo info = lying(false);
  for (const double zoom : {3.0, 0.25}) {
    const Camera camera = box_camera(grid_of(info), {.zoom = zoom}, kLandscape);
    EXPECT_EQ(camera.eye, box_camera(grid_of(info), {}, kLandscape).eye);
    EXPECT_NEAR(extent_of(core_of(camera), info, 2)[0], 0.95 * zoom, 1e-9);
  }
  Camera parallel{.parallel_height = 6};
  EXPECT_EQ(zoomed(parallel, 3).parallel_height, 2);
  for (const double zoom : {0.0, -1.0, 1e-3, 2000.0, std::nan("")})
    EXPECT_THAT([&] { zoomed(parallel, zoom); },
                testing::ThrowsMessage<Error>(HasSubstr("give 0.01 to 1000")));
}

TEST(Views, CamerasAreSavedToTheLastBit) {
  const test::TemporaryFolder folder;
  std::vector<Camera> cameras = box_turntable(grid_of(lying(true)), 3, {.zoom = 1.7}, kPortrait);
  cameras[1].parallel_height = 0.1;
  save_cameras(cameras, folder / "c.json", kPortrait);
  const std::vector<Camera> again = read_cameras(folder / "c.json");
  ASSERT_EQ(again.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(core_of(again[i]), core_of(cameras[i]));
  EXPECT_EQ(core::read_camera_file(folder / "c.json").height, kPortrait.height);
  cameras[2].fovy_degrees = 1;
  EXPECT_THAT([&] { save_cameras(cameras, folder / "d.json"); },
              testing::ThrowsMessage<Error>(HasSubstr("one fovy_deg")));
  EXPECT_EQ(folder.num_files(), 1u);
}

/// A ball away from the middle of a volume of unequal sides.
std::vector<float> ball(double radius) {
  std::vector<float> voxels;
  for (int z = 0; z < 12; ++z)
    for (int y = 0; y < 20; ++y)
      for (int x = 0; x < 16; ++x)
        voxels.push_back(float(radius - std::hypot(x - 4, y - 14, z - 6)));
  return voxels;
}

TEST(Views, TheDefaultIsTheSameForAllStepsAndCompressions) {
  const Grid grid{.dims = {16, 20, 12}, .is_anatomical = true};
  const Camera expected = box_camera(grid, {}, kLandscape);
  std::vector<Vector3> eyes;
  for (const Compression &how : {Compression{}, Compression{.rate = 2}}) {
    for (const double radius : {1.5, 6.0}) {
      Renderer renderer = make_host_renderer(compress(ball(radius), grid, how));
      EXPECT_EQ(renderer.camera(kLandscape).eye, expected.eye);
      EXPECT_EQ(renderer.turntable({}, 1, kLandscape).at(0).eye, expected.eye);
      const Camera fits = renderer.camera(0.0, kLandscape);
      EXPECT_EQ(fits.up, expected.up);
      eyes.push_back(fits.eye);
    }
  }
  EXPECT_NE(eyes[0], eyes[1]) << "what the surface fills depends on it";
  EXPECT_NE(eyes[0], expected.eye);
}

TEST(Views, AFileKeepsThatItsWorldIsAPatients) {
  const test::TemporaryFolder folder;
  for (const bool is_anatomical : {true, false}) {
    const Grid grid{.dims = {16, 20, 12}, .is_anatomical = is_anatomical};
    compress(ball(3), grid, {.levels = 2})->save(folder / "v.zfp");
    const auto volume = open_volume(folder / "v.zfp");
    EXPECT_EQ(volume->grid().is_anatomical, is_anatomical);
    EXPECT_EQ(volume->level_grid(1).is_anatomical, is_anatomical);
  }
}

}  // namespace
}  // namespace isowave
