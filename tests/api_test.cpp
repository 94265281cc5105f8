// The front door: what users of the library include, and nothing else of core but what it is
// compared with.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <isowave/isowave.hpp>
#include <map>
#include <optional>
#include <thread>

#include "core/io/png.hpp"
#include "core/ocl/device.hpp"
#include "core/volume/pyramid.hpp"
#include "tests/api_support.hpp"
#include "tests/run_program.hpp"
#include "tests/test_devices.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using core::test::kSphereEdge;
using core::test::sphere;
using core::test::sphere_grid;
using testing::HasSubstr;
namespace test = core::test;

FrameRequest small_request(Renderer &renderer) {
  FrameRequest request;
  request.camera = renderer.camera(0.6f);
  request.isovalue = 0.6f;
  request.size = {64, 48, 1};
  request.want_depth = true;
  return request;
}

core::VolumeInfo level_info(std::uint32_t level) {
  const Grid grid = sphere_grid();
  core::VolumeInfo info;
  info.dims = {grid.dims[0], grid.dims[1], grid.dims[2]};
  info.spacing = {grid.spacing[0], grid.spacing[1], grid.spacing[2]};
  info.origin = {grid.origin[0], grid.origin[1], grid.origin[2]};
  for (; level != 0; --level) info = core::coarser_level(info);
  return info;
}

class ApiOnDevice : public testing::TestWithParam<core::ocl::DeviceInfo> {
 protected:
  static std::string selector() { return std::to_string(GetParam().index); }
};

TEST_P(ApiOnDevice, FramesAreThoseOfTheEngine) {
  const auto volume = sphere();
  Renderer renderer(open_device(selector()), volume, {.largest = {64, 48, 1}});
  FrameRequest request = small_request(renderer);
  request.want_hits = request.want_normals = request.want_positions = true;
  const Frame frame = renderer.render(request);
  EXPECT_EQ(frame.picture.size(), 3u * 64 * 48);
  ASSERT_EQ(frame.depth.size(), 64u * 48);
  EXPECT_EQ(frame.statistics.rays, 64u * 48);
  EXPECT_GT(frame.statistics.hits, 200u);
  std::uint64_t num_hits = 0;
  for (std::size_t i = 0; i < frame.depth.size(); ++i) {
    const Hit &hit = frame.hits[i];
    EXPECT_EQ(frame.depth[i], hit.t);
    const std::array<float, 3> normal = frame.normals[i];
    const float length = std::hypot(normal[0], normal[1], normal[2]);
    if (std::isinf(hit.t)) {
      EXPECT_EQ(length, 0);
      EXPECT_TRUE(std::isnan(frame.positions[i][0]));
      continue;
    }
    ++num_hits;
    EXPECT_NEAR(length, 1, 1e-6);
    // The field falls from the centre outwards; the world stretches y.
    const Vector3 centre = {5 + 0.5 * (kSphereEdge - 1), 6 + 1.0 * (kSphereEdge - 1),
                            7 + 0.5 * (kSphereEdge - 1)};
    Vector3 outwards{};
    double cosine = 0, norm = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double spacing = volume->grid().spacing[axis];
      const double world =
          volume->grid().origin[axis] + spacing * (double{hit.position[axis]} + hit.cell[axis]);
      EXPECT_FLOAT_EQ(static_cast<float>(frame.positions[i][axis]), static_cast<float>(world));
      outwards[axis] = (world - centre[axis]) / (spacing * spacing);
      norm += outwards[axis] * outwards[axis];
      cosine += outwards[axis] * double{normal[axis]};
    }
    EXPECT_GT(cosine / std::sqrt(norm), 0.98) << "pixel " << i;
  }
  EXPECT_EQ(frame.statistics.hits, num_hits);
  EXPECT_TRUE(frame.statistics.complete);
  EXPECT_EQ(renderer.render(request).depth, frame.depth);
  const test::TemporaryFolder folder;
  save_png(frame, folder / "a.png");
  const std::vector<std::uint8_t> png = encode_png(frame);
  EXPECT_EQ(test::read_file(folder / "a.png"), std::string(png.begin(), png.end()));
  Frame transparent;
  transparent.size = {2, 1, 1};
  const std::vector<std::uint8_t> rgba{10, 20, 30, 255, 40, 50, 60, 0};
  transparent.picture = Array<std::uint8_t>(rgba);
  save_png(transparent, folder / "b.png");
  const core::Image8 read = core::read_png(folder / "b.png");
  EXPECT_EQ(read.channels, 4);
  EXPECT_EQ(read.pixels, rgba);
}

TEST_P(ApiOnDevice, PicturesWithoutABackground) {
  Renderer renderer(open_device(selector()), sphere(), {.largest = {64, 48, 1}, .cache_blocks = 8});
  FrameRequest request = small_request(renderer);
  const Frame opaque = renderer.render(request);
  request.appearance.transparent = true;
  std::vector<std::uint8_t> last;
  request.on_pass = [&](const Progress &progress) {
    last = progress.picture();
    return true;
  };
  const Frame frame = renderer.render(request);
  EXPECT_EQ(last, frame.picture);
  ASSERT_EQ(frame.picture.size(), 4u * 64 * 48);
  for (std::size_t i = 0; i < frame.depth.size(); ++i) {
    const bool is_hit = std::isfinite(frame.depth[i]);
    ASSERT_EQ(frame.picture[4 * i + 3], is_hit ? 255 : 0) << "pixel " << i;
    for (std::size_t channel = 0; channel < 3; ++channel)
      ASSERT_EQ(frame.picture[4 * i + channel], is_hit ? opaque.picture[3 * i + channel] : 0);
  }
  const test::TemporaryFolder folder;
  save_png(frame, folder / "a.png");
  const core::Image8 read = core::read_png(folder / "a.png");
  EXPECT_EQ(read.channels, 4);
  EXPECT_EQ(read.pixels, std::vector<std::uint8_t>(frame.picture));
}

/// Where coarse levels draw, hits are at the depth that is said, too.
TEST_P(ApiOnDevice, PositionsOfLevelsAreInTheWorld) {
  Renderer renderer(open_device(selector()), sphere({.rate = 16, .levels = 2}),
                    {.largest = {64, 48, 1}, .with_levels = true});
  FrameRequest request = small_request(renderer);
  request.voxel_pixels = 1000;
  request.want_positions = request.want_hits = true;
  const Frame frame = renderer.render(request);
  EXPECT_GT(frame.statistics.hits, 100u);
  for (std::size_t i = 0; i < frame.depth.size(); ++i) {
    if (std::isinf(frame.depth[i])) continue;
    EXPECT_EQ(frame.hits[i].level, 1u);
    double squares = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double away = double{frame.positions[i][axis]} - request.camera.eye[axis];
      squares += away * away;
    }
    // Both are float32 numbers of a few tens of units.
    EXPECT_NEAR(std::sqrt(squares), frame.depth[i], 1e-4);
  }
}

/// From as near as it may: the box of the surface's blocks is in the picture, and fills it.
TEST_P(ApiOnDevice, SurfacesFillThePicture) {
  for (const float isovalue : {0.3f, 0.6f, 0.9f, 5.0f}) {
    Renderer renderer(open_device(selector()), sphere(), {.largest = {640, 48, 1}});
    FrameRequest request = small_request(renderer);
    request.isovalue = isovalue;
    request.camera = renderer.camera(isovalue, request.size);
    const Frame frame = renderer.render(request);
    if (isovalue > 1) {
      EXPECT_EQ(frame.statistics.hits, 0u) << "no surface";
      continue;
    }
    std::size_t at_border = 0;
    std::uint32_t first_row = 48, last_row = 0;
    for (std::uint32_t i = 0; i < 64 * 48; ++i) {
      if (std::isinf(frame.depth[i])) continue;
      const std::uint32_t row = i / 64, column = i % 64;
      at_border += row == 0 || row == 47 || column == 0 || column == 63;
      first_row = std::min(first_row, row);
      last_row = std::max(last_row, row);
    }
    EXPECT_EQ(at_border, 0u) << isovalue;
    EXPECT_GT(last_row - first_row, isovalue < 0.8f ? 16u : 8u) << isovalue;
  }
}

TEST_P(ApiOnDevice, RequestsThatFailLeaveTheRendererAsItWas) {
  Renderer renderer(open_device(selector()), sphere(), {.largest = {64, 48, 1}});
  const FrameRequest good = small_request(renderer);
  const std::vector<float> depth = renderer.render(good).depth;
  const auto expect_error = [&](const char *text, const auto &change) {
    FrameRequest bad = good;
    change(bad);
    EXPECT_THAT(error_of([&] { renderer.render(bad); }), HasSubstr(text));
    EXPECT_EQ(renderer.render(good).depth, depth) << text;
  };
  expect_error("NaN", [](FrameRequest &r) { r.isovalue = std::nanf(""); });
  expect_error("eye", [](FrameRequest &r) { r.camera.eye = r.camera.at; });
  expect_error("rays", [](FrameRequest &r) { r.size = {65, 48, 1}; });
  expect_error("rays a pixel", [](FrameRequest &r) { r.size.samples = 0; });
  expect_error("level", [](FrameRequest &r) { r.voxel_pixels = 1; });
  expect_error("bounds", [](FrameRequest &r) { r.bound = FieldBound::kLower; });
  expect_error("with_bounds", [](FrameRequest &r) { r.want_bounds = true; });
  expect_error("with_bounds", [](FrameRequest &r) { r.max_surface_error = 1; });
  expect_error("with_time_budget", [](FrameRequest &r) { r.time_budget_ms = 100; });
  expect_error("my own", [](FrameRequest &r) {
    r.on_pass = [](const Progress &) -> bool { throw std::runtime_error("my own"); };
  });
}

TEST_P(ApiOnDevice, FramesKeepErrorsAndTimes) {
  Renderer renderer(
      open_device(selector()), sphere({.tolerance = 0.001, .levels = 2}),
      {.largest = {64, 48, 1}, .with_levels = true, .with_bounds = true, .with_time_budget = true});
  FrameRequest request = small_request(renderer);
  request.max_surface_error = 0.5;
  request.want_bounds = true;
  const Frame bounded = renderer.render(request);
  ASSERT_TRUE(bounded.detail);
  EXPECT_TRUE(bounded.detail->reachable);
  ASSERT_EQ(bounded.bounds.size(), bounded.depth.size());
  EXPECT_FALSE(bounded.statistics.errors_are_stated);
  request.want_bounds = false;
  request.by = Evidence::kSample;
  const Frame sampled = renderer.render(request);
  ASSERT_TRUE(sampled.detail && sampled.detail->sample);
  EXPECT_GE(sampled.detail->sample->lowest, 0.99);
  EXPECT_FALSE(bounded.detail->sample);
  request.by = Evidence::kProof;
  request.max_surface_error.reset();
  request.max_image_error = 0.5;
  EXPECT_THAT(error_of([&] { renderer.render(request); }), HasSubstr("65536 rays"));
  request.max_image_error.reset();
  const std::vector<float> depth = renderer.render(request).depth;
  request.time_budget_ms = 1e6;
  const Frame timed = renderer.render(request);
  EXPECT_TRUE(timed.statistics.complete);
  EXPECT_EQ(timed.depth, depth);
  request.isovalue += 0.01;  // the first picture of an isovalue is small
  request.on_pass = [&](const Progress &progress) {
    EXPECT_EQ(progress.picture().size(), 3u * progress.size().width * progress.size().height);
    EXPECT_LT(progress.size().width, 64u);
    return false;
  };
  const Frame stopped = renderer.render(request);
  EXPECT_TRUE(stopped.statistics.cancelled);
  EXPECT_FALSE(stopped.statistics.complete);
  EXPECT_EQ(stopped.picture.size(), 3u * 64 * 48);
}

TEST_P(ApiOnDevice, SmallFramesSayHowMuchIsDone) {
  const RendererOptions options{.largest = {64, 48, 1}, .with_rays = true, .with_surfaces = 2};
  Renderer renderer(open_device(selector()), sphere(), options);
  FrameRequest request = small_request(renderer);
  request.ambient_rays = 3;
  for (const bool is_layered : {false, true}) {
    if (is_layered) {
      request.surfaces = {{.isovalue = request.isovalue, .opacity = 0.5},
                          {.isovalue = request.isovalue + 1}};
    }
    request.on_progress = {};
    const Frame expected = renderer.render(request);
    std::vector<double> told;
    request.on_progress = [&](double percent) { told.push_back(percent); };
    EXPECT_EQ(renderer.render(request).picture, expected.picture);
    ASSERT_GE(told.size(), 5u) << "hits, normals, three rounds of ambient rays";
    EXPECT_TRUE(std::ranges::is_sorted(told));
    EXPECT_LE(told.front(), 50);
    EXPECT_GT(told.back(), 90);
    EXPECT_LE(told.back(), 100);
    EXPECT_TRUE(is_layered || told.back() == 100) << told.back();
  }
}

/// Level, cell and position are a point at distance t; also where several levels draw.
TEST_P(ApiOnDevice, HitsOfLevelsSayWhereTheyAre) {
  const auto volume = sphere({.tolerance = 0.001, .levels = 3});
  Renderer renderer(open_device(selector()), volume, {.largest = {64, 48, 1}, .with_levels = true});
  FrameRequest request = small_request(renderer);
  request.want_hits = true;
  std::map<std::uint32_t, std::size_t> hits_of;  // levels
  for (const double voxel_pixels : {0.0, 6.0, 1000.0}) {
    request.voxel_pixels = voxel_pixels;
    for (const Hit &hit : renderer.render(request).hits) {
      if (std::isinf(hit.t)) continue;
      ++hits_of[hit.level];
      double sum = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const core::VolumeInfo info = level_info(hit.level);
        const auto i = static_cast<int>(axis);
        ASSERT_LT(hit.cell[axis] + 1, info.dims[i]);
        const double at =
            info.origin[i] + info.spacing[i] * (double{hit.position[axis]} + hit.cell[axis]);
        sum += (at - request.camera.eye[axis]) * (at - request.camera.eye[axis]);
      }
      ASSERT_NEAR(std::sqrt(sum), hit.t, 1e-4 * double{hit.t});
    }
  }
  EXPECT_EQ(hits_of.size(), 3u) << "a level has no hits";
}

TEST_P(ApiOnDevice, FramesCanBeWatchedAndStopped) {
  Renderer renderer(open_device(selector()), sphere(), {.largest = {64, 48, 1}, .cache_blocks = 8});
  FrameRequest request = small_request(renderer);
  const std::vector<std::uint8_t> picture = renderer.render(request).picture;
  std::uint32_t passes = 0;
  std::vector<std::uint8_t> last;
  request.on_pass = [&](const Progress &progress) {
    EXPECT_EQ(progress.passes(), ++passes);
    last = progress.picture();
    return true;
  };
  const Frame watched = renderer.render(request);
  EXPECT_EQ(watched.statistics.passes, passes);
  EXPECT_GT(passes, 2u);
  EXPECT_EQ(last, picture);
  request.on_pass = [](const Progress &progress) { return progress.passes() < 2; };
  const Frame stopped = renderer.render(request);
  EXPECT_TRUE(stopped.statistics.cancelled);
  EXPECT_FALSE(stopped.statistics.complete);
  EXPECT_NE(stopped.picture, picture);
  request.on_pass = {};
  EXPECT_EQ(renderer.render(request).picture, picture);
}

TEST_P(ApiOnDevice, ThreadsLookAtAFrameInTurns) {
  const std::shared_ptr<Device> device = open_device(selector());
  Renderer renderer(device, sphere(), {.largest = {64, 48, 1}, .cache_blocks = 8});
  FrameRequest request = small_request(renderer);
  request.on_pass = [&](const Progress &progress) {
    const std::vector<std::uint8_t> picture = progress.picture();
    std::vector<std::jthread> threads;
    for (int i = 0; i < 3; ++i)
      threads.emplace_back([&] { EXPECT_EQ(progress.picture(), picture); });
    threads.clear();
    return true;
  };
  const Frame watched = renderer.render(request);
  request.on_pass = {};
  EXPECT_EQ(renderer.render(request).depth, watched.depth);
}

TEST_P(ApiOnDevice, WhatIsAtWorkIsNotUsedInItsOnPass) {
  const std::shared_ptr<Device> device = open_device(selector());
  Renderer renderer(device, sphere(), {.largest = {64, 48, 1}});
  Renderer host = make_host_renderer(renderer.volume());
  FrameRequest request = small_request(renderer);
  std::optional<Renderer> other(std::in_place, device, sphere(),
                                RendererOptions{.largest = {8, 8, 1}});
  int num_calls = 0;
  request.on_pass = [&](const Progress &) {
    ++num_calls;
    for (const auto &call : std::vector<std::function<void()>>{
             [&] { renderer.camera(0.6f); }, [&] { renderer.render(request); },
             [&] {
               Renderer(device, sphere(), {.largest = {8, 8, 1}});
             },
             [&] { extract(device, sphere(), 0.6f); }})
      EXPECT_THAT(error_of(call), HasSubstr("at work"));
    other.reset();  // buffers of others may go
    EXPECT_GT(device->memory_in_use(), 0u);
    return false;
  };
  renderer.render(request);
  EXPECT_EQ(num_calls, 1);
  request.on_pass = [&](const Progress &) {
    ++num_calls;
    EXPECT_THAT(error_of([&] { host.camera(0.6f); }), HasSubstr("at work"));
    EXPECT_THAT(error_of([&] { host.render(request); }), HasSubstr("at work"));
    return false;
  };
  host.render(request);
  EXPECT_EQ(num_calls, 2);
}

/// In a forked process, in which no more than this is done.
int status_in_fork(const std::function<bool()> &is_right) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(60);  // a hang ends it
    ::_exit(is_right() ? 0 : 1);
  }
  int status = -1;
  ::waitpid(child, &status, 0);
  return status;
}

TEST_P(ApiOnDevice, ForkedProcessesGetAnError) {
  const std::shared_ptr<Device> device = open_device(selector());
  auto renderer =
      std::make_unique<Renderer>(device, sphere(), RendererOptions{.largest = {64, 48, 1}});
  const FrameRequest request = small_request(*renderer);
  renderer->render(request);
  const auto refuses = [](const auto &call) {
    return error_of(call).find("forked") != std::string::npos;
  };
  EXPECT_EQ(status_in_fork([&] { return refuses([&] { renderer->render(request); }); }), 0);
  EXPECT_EQ(status_in_fork([&] { return refuses([&] { renderer->camera(0.6f); }); }), 0);
  EXPECT_EQ(status_in_fork([&] { return refuses([] { open_device(); }); }), 0);
  EXPECT_EQ(status_in_fork([&] { return refuses([] { list_devices(); }); }), 0);
  EXPECT_EQ(status_in_fork([&] {
              return refuses([&] { extract(renderer->device(), renderer->volume(), 0.6f); });
            }),
            0);
  EXPECT_EQ(status_in_fork([&] {
              renderer.reset();
              return true;
            }),
            0);
  const std::vector<float> voxels = sphere()->decode();
  EXPECT_EQ(status_in_fork([&] { return sphere()->decode() == voxels; }), 0) << "of the host";
}

TEST_P(ApiOnDevice, HitsBeyondFloat32AreAnError) {
  const std::shared_ptr<Device> device = open_device(selector());
  Renderer renderer(device, sphere(), {.largest = {64, 48, 1}, .with_rays = true});
  Renderer host = make_host_renderer(renderer.volume());
  const auto ray = [](double length) { return Ray{{15, 26, 0}, {0, 0, length}}; };
  const std::vector<Ray> near{ray(1e-36), ray(1e-36)}, far{ray(1), ray(1e-39)};
  const Frame frame = renderer.cast_rays(near, 0.6f);
  EXPECT_EQ(host.cast_rays(near, 0.6f).depth, frame.depth);
  EXPECT_TRUE(std::isfinite(frame.depth[0])) << frame.depth[0];
  EXPECT_THAT(error_of([&] { renderer.cast_rays(far, 0.6f); }), HasSubstr("ray 1 "));
  EXPECT_THAT(error_of([&] { host.cast_rays(far, 0.6f); }), HasSubstr("ray 1 "));
  EXPECT_EQ(host.cast_rays({}, 0.6f).columns, 0u);
  EXPECT_EQ(renderer.cast_rays({}, 0.6f).columns, 0u);
}

TEST_P(ApiOnDevice, RenderersKeepWhatTheyNeed) {
  std::optional<Renderer> renderer;
  {
    const auto device = open_device(selector());
    renderer.emplace(device, sphere(), RendererOptions{.largest = {64, 48, 1}});
  }
  const FrameRequest request = small_request(*renderer);
  const std::vector<float> depth = renderer->render(request).depth;
  const auto device = renderer->device();
  const std::uint64_t held = device->memory_in_use();
  EXPECT_GE(held, renderer->memory_bytes());
  Renderer moved = std::move(*renderer);
  renderer.reset();
  EXPECT_EQ(moved.render(request).depth, depth);
  moved = Renderer(device, sphere(), {.largest = {64, 48, 1}, .cache_blocks = 64});
  EXPECT_EQ(moved.render(request).depth, depth);
  EXPECT_LT(device->memory_in_use(), held);
}

TEST_P(ApiOnDevice, BudgetsThatDoNotSufficeAreAnError) {
  const auto device = open_device(selector());
  EXPECT_THAT(error_of([&] { Renderer(device, sphere(), {.memory_budget = 1000}); }),
              HasSubstr("1000"));
  EXPECT_EQ(device->memory_in_use(), 0u);
  EXPECT_THAT(error_of([&] { Renderer(nullptr, sphere()); }), HasSubstr("device"));
  EXPECT_THAT(error_of([&] {
                Renderer(device, sphere(), {.largest = {0, 48, 1}});
              }),
              HasSubstr("0 x 48"));
}

/// Renders from `num_threads` threads at once, each with a renderer of its own.
void expect_same_frames(const std::function<std::shared_ptr<Device>()> &device, int num_threads) {
  const auto volume = sphere();
  Renderer alone(device(), volume, {.largest = {64, 48, 1}});
  const FrameRequest request = small_request(alone);
  const std::vector<float> depth = alone.render(request).depth;
  std::atomic<int> num_equal = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < num_threads; ++i) {
    threads.emplace_back([&] {
      Renderer renderer(device(), volume, {.largest = {64, 48, 1}, .cache_blocks = 64});
      for (int frame = 0; frame < 3; ++frame) num_equal += renderer.render(request).depth == depth;
    });
  }
  threads.clear();
  EXPECT_EQ(num_equal, 3 * num_threads);
}

TEST_P(ApiOnDevice, ThreadsShareADevice) {
  const auto device = open_device(selector());
  expect_same_frames([&] { return device; }, 4);
}

TEST_P(ApiOnDevice, ThreadsHaveDevicesOfTheirOwn) {
  expect_same_frames([] { return open_device(selector()); }, 3);
}

TEST_P(ApiOnDevice, ThreadsShareARenderer) {
  Renderer renderer(open_device(selector()), sphere(), {.largest = {64, 48, 1}});
  FrameRequest near = small_request(renderer), far = near;
  for (double &x : far.camera.eye) x *= 2;
  const std::vector<float> near_depth = renderer.render(near).depth;
  const std::vector<float> far_depth = renderer.render(far).depth;
  EXPECT_NE(near_depth, far_depth);
  std::atomic<int> num_equal = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      for (int frame = 0; frame < 5; ++frame)
        num_equal +=
            renderer.render(i % 2 == 0 ? near : far).depth == (i % 2 == 0 ? near_depth : far_depth);
    });
  }
  threads.clear();
  EXPECT_EQ(num_equal, 20);
}

INSTANTIATE_TEST_SUITE_P(Devices, ApiOnDevice, testing::ValuesIn(core::devices_under_test()),
                         core::device_test_name);

}  // namespace
}  // namespace isowave
