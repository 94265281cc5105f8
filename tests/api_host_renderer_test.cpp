// What users of the library draw on the host: what it refuses, and how it is watched and stopped.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <isowave/isowave.hpp>
#include <stdexcept>
#include <thread>

#include "tests/api_support.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using core::test::public_volume;
using testing::HasSubstr;

/// All that devices draw.
TEST(ApiHostRenderer, DrawsWithinErrorsAndTimes) {
  Renderer renderer = make_host_renderer(public_volume());
  const FrameRequest plain{.camera = renderer.camera(10), .isovalue = 10, .size = {64, 48}};
  const std::vector<std::uint8_t> picture = renderer.render(plain).picture;
  const auto frame_of = [&](const auto &change) {
    FrameRequest request = plain;
    change(request);
    EXPECT_TRUE(renderer.can_draw(request));
    return renderer.render(request);
  };
  EXPECT_NE(frame_of([](FrameRequest &r) { r.voxel_pixels = 2; }).picture, picture);
  EXPECT_NE(frame_of([](FrameRequest &r) { r.voxel_error = 20; }).picture, picture);
  EXPECT_NE(frame_of([](FrameRequest &r) { r.bound = FieldBound::kLower; }).picture, picture);
  EXPECT_EQ(frame_of([](FrameRequest &r) { r.want_bounds = true; }).bounds.size(), 64u * 48u);
  EXPECT_TRUE(frame_of([](FrameRequest &r) { r.max_surface_error = 2; }).detail.has_value());
  const Frame within = frame_of([](FrameRequest &r) {
    r.size.samples = 8;
    r.max_image_error = 0.02;
    r.want_depth = true;
    r.want_bounds = true;
  });
  const std::uint32_t samples = within.detail.value().image.value().samples;
  EXPECT_GT(samples, 1u);
  EXPECT_LT(samples, 8u);
  EXPECT_EQ(within.size.samples, samples);
  EXPECT_EQ(within.rows, 48 * samples);
  EXPECT_EQ(within.depth.size(), 64u * 48u * samples * samples);
  EXPECT_EQ(within.bounds.size(), within.depth.size());
  const Frame same = frame_of([&](FrameRequest &r) {
    r.size.samples = samples;
    r.voxel_pixels = within.detail->voxel_pixels;
    r.want_depth = true;
  });
  EXPECT_EQ(within.picture, same.picture);
  EXPECT_EQ(within.depth, same.depth);
  EXPECT_EQ(frame_of([](FrameRequest &r) { r.time_budget_ms = 1e9; }).picture, picture);
}

TEST(ApiHostRenderer, RefusesBadRequestsInOneLine) {
  Renderer renderer = make_host_renderer(public_volume());
  const FrameRequest good{.camera = renderer.camera(10), .isovalue = 10, .size = {64, 48}};
  EXPECT_TRUE(renderer.can_draw(good));
  const std::vector<std::uint8_t> picture = renderer.render(good).picture;
  const auto expect_error = [&](const char *text, const auto &change) {
    FrameRequest bad = good;
    change(bad);
    EXPECT_THAT(error_of([&] { renderer.render(bad); }), HasSubstr(text));
    EXPECT_FALSE(renderer.can_draw(bad)) << text;
    EXPECT_EQ(renderer.render(good).picture, picture) << text;
  };
  expect_error("0 pixels", [](FrameRequest &r) { r.max_surface_error = 0; });
  expect_error("up to 1", [](FrameRequest &r) { r.max_image_error = 2; });
  expect_error("in -1 ms", [](FrameRequest &r) { r.time_budget_ms = -1; });
  EXPECT_THAT(error_of([] { make_host_renderer(nullptr); }), HasSubstr("needs a volume"));
  EXPECT_THAT(error_of([] { make_host_renderer(public_volume(), {.memory_limit = 1000}); }),
              HasSubstr("raise the limit"));
}

TEST(ApiHostRenderer, TurntablesBeginWhereTheCameraLooksFrom) {
  Renderer renderer = make_host_renderer(public_volume());
  const Camera one = renderer.camera(10, ImageSize{64, 48});
  const auto views = [&](std::uint32_t count) {
    return renderer.turntable({{.isovalue = 10}}, count, ImageSize{64, 48});
  };
  EXPECT_EQ(views(1).at(0).eye, one.eye);
  const std::vector<Camera> four = views(4);
  ASSERT_EQ(four.size(), 4u);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(four[k].at, one.at);
    EXPECT_EQ(four[k].up, one.up);
    const Vector3 &eye = four[k].eye, &next = four[(k + 1) % 4].eye;
    EXPECT_NEAR(next[0] - one.at[0], eye[2] - one.at[2], 1e-9);
    EXPECT_NEAR(next[2] - one.at[2], one.at[0] - eye[0], 1e-9);
  }
  const double farther =
      (four[0].eye[1] - one.at[1]) / (one.eye[1] - one.at[1]);  // on the same line of sight
  EXPECT_GE(farther, 1 - 1e-12);
  for (const std::size_t axis : {0, 2})
    EXPECT_NEAR(four[0].eye[axis] - one.at[axis], farther * (one.eye[axis] - one.at[axis]), 1e-9);
  EXPECT_THAT(error_of([&] { views(0); }), HasSubstr("a turntable of 0 views"));
  EXPECT_THAT(error_of([&] { views(100'001); }), HasSubstr("give 1 to 100000"));
}

TEST(ApiHostRenderer, CastRaysInTheWorld) {
  Grid grid{.dims = {21, 21, 21}, .spacing = {1, 2, 3}, .origin = {5, 6, 7}};
  std::vector<float> voxels;
  for (int i = 0; i < 21 * 21 * 21; ++i) voxels.push_back(static_cast<float>(i / 441));  // z
  Renderer renderer = make_host_renderer(compress(voxels, grid, {.tolerance = 1e-4}));
  // The surface is the plane z = 7 + 3 * 10.5.
  const std::vector<Ray> rays = {{{10, 20, 0}, {0, 0, 1}},
                                 {{10, 20, 0}, {0, 0, 10}},
                                 {{10, 20, 100}, {0.25, 0.25, -2}},
                                 {{10, 20, 0}, {0, 0, -1}},
                                 {{100, 20, 0}, {0, 0, 1}}};
  const Frame hits = renderer.cast_rays(rays, 10.5f);
  ASSERT_EQ(hits.rows, 1u);
  ASSERT_EQ(hits.columns, 5u);
  for (std::size_t i = 0; i < 3; ++i) {
    const double t = (38.5 - rays[i].origin[2]) / rays[i].direction[2];
    EXPECT_NEAR(hits.depth[i], t, 1e-3 * t);
    EXPECT_NEAR(hits.positions[i][2], 38.5, 1e-3);
    EXPECT_NEAR(hits.positions[i][0], rays[i].origin[0] + t * rays[i].direction[0], 1e-3);
    EXPECT_NEAR(hits.normals[i][2], -1, 1e-3);
    EXPECT_EQ(hits.hits[i].cell[2], 10u);
  }
  for (std::size_t i = 3; i < 5; ++i) {
    EXPECT_TRUE(std::isinf(hits.depth[i]));
    EXPECT_TRUE(std::isnan(hits.positions[i][0]));
  }
  EXPECT_THAT(error_of([&] { renderer.cast_rays(std::vector<Ray>(1), 1); }),
              HasSubstr("direction"));
}

TEST(ApiHostRenderer, FramesCanBeWatchedAndStopped) {
  Renderer renderer = make_host_renderer(public_volume(), {.num_threads = 1});
  FrameRequest request{.camera = renderer.camera(10), .isovalue = 10, .size = {128, 96}};
  const Frame whole = renderer.render(request);
  EXPECT_EQ(whole.statistics.passes, 1u);
  std::vector<std::uint8_t> last;
  std::uint32_t passes = 0;
  request.on_pass = [&](const Progress &progress) {
    EXPECT_EQ(progress.passes(), ++passes);
    last = progress.picture();
    return true;
  };
  EXPECT_EQ(renderer.render(request).picture, whole.picture);
  EXPECT_EQ(last, whole.picture);
  EXPECT_EQ(passes, 6u);
  request.on_pass = [](const Progress &progress) { return progress.completed_percent() < 50; };
  const Frame stopped = renderer.render(request);
  EXPECT_TRUE(stopped.statistics.cancelled);
  EXPECT_FALSE(stopped.statistics.complete);
  EXPECT_EQ(stopped.statistics.passes, 3u);
  EXPECT_NE(stopped.picture, whole.picture);
  const std::size_t half = whole.picture.size() / 2;
  EXPECT_TRUE(std::equal(whole.picture.begin(), whole.picture.begin() + std::ptrdiff_t(half),
                         stopped.picture.begin()));
}

/// One thread reports after each tile: half of the tiles are the camera's, a quarter of the work.
TEST(ApiHostRenderer, FramesSayHowMuchIsDone) {
  Renderer renderer = make_host_renderer(public_volume(), {.num_threads = 1});
  FrameRequest request{
      .camera = renderer.camera(10), .isovalue = 10, .size = {128, 96}, .ambient_rays = 3};
  const Frame expected = renderer.render(request);
  std::vector<double> told;
  request.on_progress = [&](double percent) { told.push_back(percent); };
  const Frame frame = renderer.render(request);
  EXPECT_EQ(frame.picture, expected.picture);
  EXPECT_EQ(frame.statistics.passes, expected.statistics.passes);
  ASSERT_GT(told.size(), 8u);
  EXPECT_TRUE(std::ranges::is_sorted(told));
  EXPECT_EQ(told.back(), 100);
  const auto of_camera = std::ranges::count_if(told, [](double percent) { return percent <= 25; });
  EXPECT_EQ(2u * static_cast<std::size_t>(of_camera), told.size());

  told.clear();
  request.surfaces = {{.isovalue = 10, .opacity = 0.5}, {.isovalue = 60}};
  renderer.render(request);
  EXPECT_TRUE(std::ranges::is_sorted(told));
  EXPECT_EQ(told.back(), 100);

  told.clear();
  request.surfaces.clear();
  request.time_budget_ms = 1e6;
  renderer.render(request);
  EXPECT_TRUE(told.empty()) << "a step would be told of as the whole";

  request.time_budget_ms.reset();
  request.on_progress = [](double) { throw std::runtime_error("my own"); };
  EXPECT_THAT(error_of([&] { renderer.render(request); }), HasSubstr("my own"));
}

TEST(ApiHostRenderer, ThreadsShareARenderer) {
  Renderer renderer = make_host_renderer(public_volume());
  std::vector<FrameRequest> requests;
  std::vector<std::vector<float>> depths;
  for (const float isovalue : {10.0f, 60.0f}) {
    requests.push_back({.camera = renderer.camera(isovalue),
                        .isovalue = isovalue,
                        .size = {64, 48},
                        .want_depth = true});
    depths.push_back(renderer.render(requests.back()).depth);
  }
  EXPECT_NE(depths[0], depths[1]);
  std::atomic<int> num_equal = 0;
  std::vector<std::jthread> threads;
  for (std::size_t i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      for (int frame = 0; frame < 5; ++frame)
        num_equal += renderer.render(requests[i % 2]).depth == depths[i % 2];
    });
  }
  threads.clear();
  EXPECT_EQ(num_equal, 20);
}

}  // namespace
}  // namespace isowave
