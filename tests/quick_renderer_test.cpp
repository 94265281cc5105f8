// Pictures before a device's renderer is ready: who draws, the bits, and what goes wrong.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <future>
#include <isowave/isowave.hpp>
#include <mutex>

#include "core/api/device_implementation.hpp"
#include "tests/api_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using testing::HasSubstr;

constexpr ImageSize kSize{128, 96};

/// The renderer of a device cannot be made while others have the device.
class QuickRendererOnDevice : public testing::TestWithParam<core::ocl::DeviceInfo> {
 protected:
  std::unique_lock<Turns> busy_device() const {
    return std::unique_lock(device_->implementation().mutex);
  }
  /// A renderer of one thread on the host, so that its frames have several bands.
  Renderer make(const RendererOptions &options = {.largest = kSize, .with_levels = true}) const {
    return make_quick_renderer(device_, volume_, options, {.num_threads = 1});
  }
  FrameRequest request() const {
    return {.camera = make_host_renderer(volume_).camera(10, kSize),
            .isovalue = 10,
            .size = kSize,
            .want_depth = true};
  }

  std::shared_ptr<Device> device_ = open_device(std::to_string(GetParam().index));
  std::shared_ptr<const Volume> volume_ =
      open_volume(ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz", {.rate = 8, .levels = 0});
};
INSTANTIATE_TEST_SUITE_P(Devices, QuickRendererOnDevice,
                         testing::ValuesIn(core::devices_under_test()), core::device_test_name);

TEST_P(QuickRendererOnDevice, TheHostDrawsUntilTheDeviceIsReady) {
  std::unique_lock busy = busy_device();
  Renderer renderer = make();
  const FrameRequest wanted = request();
  EXPECT_EQ(renderer.camera(10).eye, wanted.camera.eye);
  const Frame first = renderer.render(wanted);
  EXPECT_FALSE(renderer.ready());
  EXPECT_GT(first.statistics.hits, 1000u);
  busy.unlock();
  renderer.wait();
  EXPECT_TRUE(renderer.ready());
  EXPECT_EQ(renderer.camera(10).eye, wanted.camera.eye);
  const Frame second = renderer.render(wanted);
  EXPECT_GT(second.statistics.decoded_blocks, 0u) << "the host draws it";
  EXPECT_EQ(second.picture, first.picture);
  EXPECT_EQ(second.depth, first.depth);
}

TEST_P(QuickRendererOnDevice, AFrameAtWorkIsBegunAnewByTheDevice) {
  std::unique_lock busy = busy_device();
  Renderer renderer = make();
  FrameRequest wanted = request();
  std::vector<std::uint32_t> passes;
  wanted.on_pass = [&](const Progress &progress) {
    passes.push_back(progress.passes());
    if (passes.size() == 2) {
      busy.unlock();
      renderer.wait();
    }
    return true;
  };
  const Frame frame = renderer.render(wanted);
  EXPECT_GT(frame.statistics.decoded_blocks, 0u) << "the host draws it";
  EXPECT_FALSE(frame.statistics.cancelled);
  ASSERT_GE(passes.size(), 3u);
  EXPECT_EQ(passes[1], 2u);
  EXPECT_EQ(passes[2], 1u);
  wanted.on_pass = {};
  EXPECT_EQ(frame.depth, renderer.render(wanted).depth);
}

/// The host would choose among levels of detail that the device cannot draw.
TEST_P(QuickRendererOnDevice, ErrorsOfPicturesAreKeptAlike) {
  FrameRequest wanted = request();
  wanted.size.samples = 4;
  wanted.max_image_error = 0.04;
  for (const bool with_levels : {true, false}) {
    const RendererOptions options{.largest = {128, 96, 4}, .with_levels = with_levels};
    const Frame expected = Renderer(device_, volume_, options).render(wanted);
    EXPECT_EQ(expected.detail->voxel_pixels > 0, with_levels);
    std::unique_lock busy = busy_device();
    Renderer renderer = make(options);
    EXPECT_EQ(renderer.ready_for(wanted), with_levels);
    if (with_levels) {
      EXPECT_EQ(renderer.render(wanted).picture, expected.picture);
      EXPECT_FALSE(renderer.ready());
    }
    busy.unlock();
    EXPECT_EQ(renderer.render(wanted).picture, expected.picture);
  }
}

TEST_P(QuickRendererOnDevice, TheHostDrawsAllThatTheDeviceCan) {
  FrameRequest detail = request(), bounds = request();
  detail.voxel_pixels = 2;
  detail.voxel_error = 4;
  bounds.want_bounds = true;
  const std::vector<float> expected =
      Renderer(device_, volume_, {.largest = kSize, .with_levels = true}).render(detail).depth;
  std::unique_lock busy = busy_device();
  Renderer renderer = make();
  EXPECT_TRUE(renderer.ready_for(request()));
  EXPECT_TRUE(renderer.ready_for(detail));
  const auto what_it_can = [&] {
    return std::array{renderer.can_draw(detail), renderer.can_draw(bounds)};
  };
  EXPECT_EQ(what_it_can(), (std::array{true, false})) << "before it is ready";
  EXPECT_EQ(renderer.render(detail).depth, expected);
  EXPECT_FALSE(renderer.ready());
  busy.unlock();
  renderer.wait();
  EXPECT_EQ(renderer.render(detail).depth, expected);
  EXPECT_EQ(what_it_can(), (std::array{true, false}));
}

/// Both renderers find bounds, whichever draws.
TEST_P(QuickRendererOnDevice, BoundsDoNotWaitForTheDevice) {
  const auto volume = core::test::public_volume();
  for (const bool with_levels : {false, true}) {
    FrameRequest wanted = request();
    wanted.voxel_pixels = with_levels ? 2 : 0;
    wanted.want_bounds = true;
    std::unique_lock busy = busy_device();
    Renderer renderer = make_quick_renderer(device_, volume,
                                            {.largest = kSize,
                                             .with_levels = with_levels,
                                             .with_bounds = true,
                                             .with_time_budget = true});
    EXPECT_TRUE(renderer.ready_for(wanted));
    const Frame frame = renderer.render(wanted);
    EXPECT_FALSE(renderer.ready());
    busy.unlock();
    renderer.wait();
    EXPECT_EQ(renderer.render(wanted).bounds, frame.bounds);
    EXPECT_EQ(frame.bounds.size(), kSize.width * kSize.height);
  }
}

TEST_P(QuickRendererOnDevice, ErrorsOfTheDeviceComeWithTheNextFrame) {
  std::unique_lock busy = busy_device();
  Renderer renderer = make();
  const FrameRequest wanted = request();
  EXPECT_NO_THROW(renderer.render(wanted));
  renderer.give_up();
  busy.unlock();
  EXPECT_THAT(error_of([&] { renderer.wait(); }), HasSubstr("no longer wanted"));
  EXPECT_TRUE(renderer.ready());
  EXPECT_THAT(error_of([&] { renderer.render(wanted); }), HasSubstr("no longer wanted"));
  EXPECT_THAT(error_of([&] { renderer.camera(10); }), HasSubstr("no longer wanted"));
}

TEST_P(QuickRendererOnDevice, TheHostDrawsNothingThatTheDeviceWouldRefuse) {
  EXPECT_THAT(error_of([&] { make({.largest = kSize, .memory_budget = 1000}); }),
              HasSubstr("1000"));
  EXPECT_THAT(error_of([&] { make_quick_renderer(nullptr, volume_); }),
              HasSubstr("needs a device"));
}

/// Others may use the device while the host draws.
TEST_P(QuickRendererOnDevice, HasTheDevicesTurnOnlyWhileTheDeviceDraws) {
  const Turns &turns = device_->implementation().mutex;
  std::unique_lock busy = busy_device();
  Renderer renderer = make();
  FrameRequest wanted = request();
  bool is_mine = false;
  wanted.on_pass = [&](const Progress &) {
    is_mine = turns.is_mine();
    EXPECT_THAT(error_of([&] { renderer.camera(10); }), HasSubstr("at work"));
    return true;
  };
  std::async(std::launch::async, [&] { renderer.render(wanted); }).get();
  EXPECT_FALSE(is_mine);
  busy.unlock();
  renderer.wait();
  renderer.render(wanted);
  EXPECT_TRUE(is_mine);
  EXPECT_FALSE(turns.is_mine());
}

/// Whether it has begun to compile or not.
TEST_P(QuickRendererOnDevice, LeavesNothingBehind) {
  for (int i = 0; i < 3; ++i) {
    const Renderer renderer = make();
  }
  EXPECT_EQ(device_->memory_in_use(), 0u);
  FrameRequest wanted = request();
  Renderer first = make(), second = std::move(first);
  first = make({.largest = kSize, .cache_blocks = 64});
  EXPECT_EQ(first.render(wanted).depth, second.render(wanted).depth);
}

}  // namespace
}  // namespace isowave
