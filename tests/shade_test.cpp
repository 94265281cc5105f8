// Pictures of hit buffers: one colour for each pixel, of one ray or the mean of several.

#include "core/stages/shade.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// Mean colours of tiles of samples x samples pixels.
std::vector<double> mean_of_tiles(const Image8 &fine, std::uint32_t samples) {
  const std::uint32_t width = fine.width / samples, height = fine.height / samples;
  std::vector<double> mean(std::size_t{3} * width * height);
  for (std::size_t row = 0; row < fine.height; ++row) {
    for (std::size_t column = 0; column < fine.width; ++column) {
      const std::size_t pixel = column / samples + width * (row / samples);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        mean[3 * pixel + channel] +=
            double(fine.pixels[3 * (column + fine.width * row) + channel]) / (samples * samples);
      }
    }
  }
  return mean;
}

class ShadeOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  ShadeOnDevice()
      : volume_(test::grid_info({9, 10, 11}, {1, 2, 0.5}),
                test::sample({9, 10, 11}, test::gyroid_field(7)), 8),
        camera_(orbit_cameras(volume_.info(), 1)[0]) {}

  TestVolume volume_;
  Camera camera_;
  ocl::Device device_{GetParam().device};
};
INSTANTIATE_TEST_SUITE_P(Devices, ShadeOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(ShadeOnDevice, SmallPictureIsTheTwins) {
  constexpr ImageSize kSize{12, 8};
  DeviceRenderer renderer(device_, volume_.compressed, GetParam().with({.size = kSize}));
  renderer.render({camera_, 0.1f});
  const FrameParams frame = make_frame_params(volume_.info(), camera_, kSize, 0.1f);
  for (const Appearance &appearance :
       {Appearance{}, Appearance{{0.2f, 0.4f, 1.0f}, {0, 0, 0}, 0.0f, 1.0f, 2.0f}}) {
    const Image8 expected =
        shade_scalar(frame, make_shade_params(volume_.info(), appearance), renderer.hits());
    const Image8 got = renderer.shade(appearance);
    EXPECT_EQ(got.width, kSize.width);
    EXPECT_EQ(got.height, kSize.height);
    EXPECT_EQ(got.pixels, expected.pixels);
  }
}

/// The rays of several for each pixel are those of a picture with as many pixels; what a pixel
/// shows is their mean.
TEST_P(ShadeOnDevice, SmallPixelsOfSeveralRaysAreTheirMean) {
  for (const std::uint32_t samples : {2u, 3u}) {
    if (is_simulator(device_.info()) && samples != 2) continue;
    SCOPED_TRACE(fmt::format("{} x {} rays a pixel", samples, samples));
    const ImageSize size{7, 5, samples}, all_rays{7 * samples, 5 * samples};
    DeviceRenderer renderer(device_, volume_.compressed, GetParam().with({.size = size}));
    const FrameStats stats = renderer.render({camera_, 0.1f});
    const auto expected_hits = test::twin_hits(volume_, camera_, all_rays, 0.1f);
    test::expect_same_hits(renderer.hits(), expected_hits, all_rays.width);
    EXPECT_EQ(stats.rays_hit, test::num_hits(expected_hits));
    EXPECT_EQ(stats.passes.back().completed_percent, 100.0);
    EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
    // Bright, so that highlights reach white: a ray's colour ends there, not the sum's.
    const Appearance bright{{0.9f, 0.5f, 0.1f}, {0, 0, 1}, 0.3f, 0.9f, 1.0f};
    const Image8 got = renderer.shade(bright);
    const FrameParams frame = make_frame_params(volume_.info(), camera_, all_rays, 0.1f);
    const ShadeParams params = make_shade_params(volume_.info(), bright);
    const Image8 expected = shade_scalar(frame, params, expected_hits, samples);
    EXPECT_EQ(got.width, size.width);
    EXPECT_EQ(got.height, size.height);
    EXPECT_EQ(got.pixels, expected.pixels);
    const std::vector<double> mean =
        mean_of_tiles(shade_scalar(frame, params, expected_hits), samples);
    ASSERT_EQ(got.pixels.size(), mean.size());
    std::size_t num_mixed = 0;
    for (std::size_t i = 0; i < mean.size(); ++i) {
      EXPECT_NEAR(got.pixels[i], mean[i], 1.0) << "rounded once, and each ray once";
      num_mixed += mean[i] != std::floor(mean[i]);
    }
    EXPECT_GT(num_mixed, 20u);
  }
}

TEST_P(ShadeOnDevice, SizesMayChangeBetweenFrames) {
  DeviceRenderer renderer(device_, volume_.compressed, GetParam().with({.size = {20, 14, 4}}));
  for (const ImageSize size : {ImageSize{20, 14, 4}, {40, 28, 2}, {80, 56}, {9, 7, 8}, {5, 4, 3}}) {
    SCOPED_TRACE(
        fmt::format("{}x{}, {} x {} rays", size.width, size.height, size.samples, size.samples));
    renderer.render({camera_, 0.1f, size});
    const FrameParams frame = make_frame_params(volume_.info(), camera_, size, 0.1f);
    const auto hits = test::twin_hits(frame, volume_.voxels);
    test::expect_same_hits(renderer.hits(), hits, size.ray_columns());
    const Image8 got = renderer.shade();
    EXPECT_EQ(got.width, size.width);
    EXPECT_EQ(
        got.pixels,
        shade_scalar(frame, make_shade_params(volume_.info(), {}), hits, size.samples).pixels);
  }
  const auto draw = [&](ImageSize size) { renderer.render({camera_, 0.1f, size}); };
  EXPECT_THROW(draw({20, 14, 5}), Error) << "more rays";
  EXPECT_THROW(draw({1, 1, 0}), Error);
  EXPECT_THAT([&] { draw({1, 1, 9}); }, ThrowsMessage<Error>(HasSubstr("9 x 9 rays a pixel")));
}

TEST_P(ShadeOnDevice, NothingIsShownBeforeTheFirstFrame) {
  DeviceRenderer renderer(device_, volume_.compressed, GetParam().with({.size = {12, 8}}));
  EXPECT_THROW(renderer.render({camera_, NAN}), Error);
  EXPECT_THAT([&] { renderer.hits(); }, ThrowsMessage<Error>(HasSubstr("no frame")));
  EXPECT_THAT([&] { renderer.shade(); }, ThrowsMessage<Error>(HasSubstr("no frame")));
}

}  // namespace
}  // namespace isowave::core
