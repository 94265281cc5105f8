// Frame constants: which pixels may see the active blocks.

#include "core/view/frame.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "kernels_cl/portable/grid_dda.h"
#include "tests/ray_cases.hpp"
#include "tests/stage_support.hpp"

namespace isowave::core {
namespace {

/// Columns and rows of pixels; end is behind the last.
struct PixelRange {
  uint begin_x = ~0u, begin_y = ~0u, end_x = 0, end_y = 0;

  void add(uint x, uint y) {
    begin_x = std::min(begin_x, x);
    begin_y = std::min(begin_y, y);
    end_x = std::max(end_x, x + 1);
    end_y = std::max(end_y, y + 1);
  }
  bool empty() const { return end_x == 0; }
};

/// The range of the pixels whose rays meet the active box.
PixelRange seen_range(const FrameParams &frame) {
  const LastPlanes last = last_planes(&frame);
  const LastPlanes begin = {4 * frame.surface.active_begin_x, 4 * frame.surface.active_begin_y,
                            4 * frame.surface.active_begin_z};
  const LastPlanes end = {std::min(4 * frame.surface.active_end_x, last.x),
                          std::min(4 * frame.surface.active_end_y, last.y),
                          std::min(4 * frame.surface.active_end_z, last.z)};
  PixelRange seen;
  for (uint pixel = 0; pixel < frame.view.width * frame.view.height; ++pixel) {
    const Ray ray = make_ray(&frame, pixel);
    RayEvent enter;
    if (box_entry(&ray, begin, end, &enter))
      seen.add(pixel % frame.view.width, pixel / frame.view.width);
  }
  return seen;
}

void expect_encloses(const FrameParams &frame, const PixelRange &seen) {
  if (seen.empty()) return;
  EXPECT_LE(frame.screen.begin_x, seen.begin_x);
  EXPECT_LE(frame.screen.begin_y, seen.begin_y);
  EXPECT_GE(frame.screen.end_x, seen.end_x);
  EXPECT_GE(frame.screen.end_y, seen.end_y);
}

/// Boxes of a block, of a slab, of all, at random places.
void choose_active_box(FrameParams &frame, Random &random) {
  const auto choose = [&random](uint dim, int &begin, int &end) {
    const uint blocks = num_owning_blocks(dim);
    begin = static_cast<int>(random() % blocks);
    const uint size = 1 + random() % (random() % 2 == 0 ? 1 : blocks);
    end = std::min(begin + static_cast<int>(size), static_cast<int>(blocks));
  };
  choose(frame.grid.dims_x, frame.surface.active_begin_x, frame.surface.active_end_x);
  choose(frame.grid.dims_y, frame.surface.active_begin_y, frame.surface.active_end_y);
  choose(frame.grid.dims_z, frame.surface.active_begin_z, frame.surface.active_end_z);
}

TEST(Frame, ScreenBoxHasEveryPixelThatMeetsTheActiveBox) {
  Random random(21);
  for (const glm::uvec3 dims : {glm::uvec3(33, 21, 44), glm::uvec3(6, 61, 2)}) {
    for (const CameraCase &c : camera_cases(dims)) {
      SCOPED_TRACE(c.name);
      for (const ImageSize size : {ImageSize{131, 97}, ImageSize{1, 1}}) {
        FrameParams frame = case_frame(dims, c, size);
        expect_encloses(frame, seen_range(frame));
        for (int i = 0; i < 20; ++i) {
          choose_active_box(frame, random);
          frame.screen = make_screen_box(frame);
          EXPECT_EQ(frame.screen.begin_x % 8, 0u);
          EXPECT_EQ(frame.screen.begin_y % 4, 0u);
          EXPECT_LE(frame.screen.end_x, size.width);
          EXPECT_LE(frame.screen.end_y, size.height);
          expect_encloses(frame, seen_range(frame));
        }
      }
    }
  }
}

/// One block, from so far away that rounding turns rays by several pixels: more than the border of
/// one that is there anyway.
TEST(Frame, ScreenBoxAllowsForRoundedDirections) {
  VolumeInfo info;
  info.dims = glm::uvec3(64);
  for (int i = 0; i < 40; ++i) {
    const glm::dvec3 to(1 + 0.01 * i, 0.7 - 0.02 * i, 1.3), block(34);
    const Camera camera{block - 5e6 * glm::normalize(to), block, {0, 1, 0}, 0.0002};
    FrameParams frame = make_frame_params(info, camera, {360, 360}, 0);
    frame.surface.active_begin_x = frame.surface.active_begin_y = frame.surface.active_begin_z = 8;
    frame.surface.active_end_x = frame.surface.active_end_y = frame.surface.active_end_z = 9;
    frame.screen = make_screen_box(frame);
    expect_encloses(frame, seen_range(frame));
  }
}

/// Two pixels about the box's corners (one, and up to a whole one), a tenth of one for rounded
/// directions, and whole tiles.
TEST(Frame, ScreenBoxIsTight) {
  VolumeInfo info;  // of spacing 1: the camera's basis is orthonormal in index space, too
  info.dims = glm::uvec3(64);
  Random random(5);
  for (const Camera &camera : orbit_cameras(info, 7)) {
    FrameParams frame = make_frame_params(info, camera, {320, 180}, 0);
    const glm::dvec3 fwd = glm::normalize(camera.at - camera.eye);
    const glm::dvec3 right = glm::normalize(glm::cross(fwd, camera.up)),
                     up = glm::cross(right, fwd);
    for (int i = 0; i < 20; ++i) {
      choose_active_box(frame, random);
      frame.screen = make_screen_box(frame);
      glm::dvec2 least(1e9), most(-1e9);
      for (int corner = 0; corner < 8; ++corner) {
        const glm::dvec3 at(
            (corner & 1) != 0 ? 4 * frame.surface.active_end_x : 4 * frame.surface.active_begin_x,
            (corner & 2) != 0 ? 4 * frame.surface.active_end_y : 4 * frame.surface.active_begin_y,
            (corner & 4) != 0 ? 4 * frame.surface.active_end_z : 4 * frame.surface.active_begin_z);
        const glm::dvec3 to = glm::min(at, 63.0) - camera.eye;
        const glm::dvec2 uv =
            glm::dvec2(glm::dot(to, right), -glm::dot(to, up)) / glm::dot(to, fwd);
        const glm::dvec2 pixel = 0.5 * (uv / double{frame.view.pixel_scale} + glm::dvec2(319, 179));
        least = glm::min(least, pixel);
        most = glm::max(most, pixel);
      }
      EXPECT_GT(frame.screen.begin_x + 8.0, std::max(least.x, 0.0) - 2);
      EXPECT_GT(frame.screen.begin_y + 4.0, std::max(least.y, 0.0) - 2);
      EXPECT_LT(frame.screen.end_x - 1.0, std::min(most.x, 319.0) + 2.1);
      EXPECT_LT(frame.screen.end_y - 1.0, std::min(most.y, 179.0) + 2.1);
    }
  }
}

TEST(Frame, ScreenBoxIsEmptyWhereNothingIsSeen) {
  const glm::uvec3 dims(64);
  FrameParams frame = case_frame(dims, {"away", {{-5, -5, -5}, {40, 40, 40}, {0, 1, 0}, 60}});
  EXPECT_LT(frame.screen.begin_x, frame.screen.end_x);
  frame.surface.active_end_x = frame.surface.active_end_y = frame.surface.active_end_z =
      0;  // no active block
  frame.screen = make_screen_box(frame);
  EXPECT_EQ(frame.screen.begin_x, frame.screen.end_x);
  EXPECT_EQ(frame.screen.begin_y, frame.screen.end_y);
  frame = case_frame(dims, {"beside", {{-200, 32, -10}, {-200, 32, 400}, {0, 1, 0}, 20}});
  EXPECT_EQ(frame.screen.end_x, 0u);
}

}  // namespace
}  // namespace isowave::core
