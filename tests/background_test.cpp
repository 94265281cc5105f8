// Backgrounds that go from one colour to another: a formula in double precision, the same bits by
// all renderers, and surfaces as before any other background.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/frame/timed_renderer.hpp"
#include "core/host/host_renderer.hpp"
#include "core/io/png.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/run_program.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;

constexpr float kIsovalue = 0.1f;
constexpr glm::vec3 kBottom{0.8f, 0.25f, 0.0f}, kTop{0.1f, 0.25f, 0.9f};

Appearance gradient(bool is_transparent = false) {
  return {.background = kBottom, .transparent = is_transparent, .background_top = kTop};
}

/// Display values of a row's background, 0 to 255.
glm::dvec3 expected_row(std::size_t row, std::size_t rows) {
  const double up = 1 - (double(row) + 0.5) / double(rows);
  return 255.0 * (glm::dvec3(kBottom) + up * (glm::dvec3(kTop) - glm::dvec3(kBottom)));
}

/// The share of a pixel's rays that hit.
double covered(const std::vector<HitRecord> &hits, ImageSize size, std::size_t pixel) {
  double count = 0;
  for (std::uint32_t ray = 0; ray < size.samples * size.samples; ++ray) {
    const std::size_t row = pixel / size.width * size.samples + ray / size.samples,
                      column = pixel % size.width * size.samples + ray % size.samples;
    count += std::isfinite(hits[row * size.ray_columns() + column].t);
  }
  return count / (size.samples * size.samples);
}

/// Rows have the formula's colours, up to the rounding of each; pixels that the surface covers
/// partly show as much of them.
///
/// black  the same frame over a black background
void expect_gradient(const Image8 &picture, const Image8 &black, const std::vector<HitRecord> &hits,
                     ImageSize size) {
  std::size_t num_open = 0, num_mixed = 0;
  ASSERT_EQ(picture.pixels.size(), 3 * size.num_pixels());
  for (std::size_t pixel = 0; pixel < size.num_pixels(); ++pixel) {
    const double share = covered(hits, size, pixel);
    const glm::dvec3 behind = expected_row(pixel / size.width, size.height);
    num_open += share == 0;
    num_mixed += share > 0 && share < 1;
    for (int channel = 0; channel < 3; ++channel) {
      const std::size_t at = 3 * pixel + std::size_t(channel);
      const double expected = black.pixels[at] + (1 - share) * behind[channel];
      // float32 rounds a colour by 1e-7; the black picture has been rounded too.
      ASSERT_NEAR(picture.pixels[at], expected, share == 0 ? 0.5001 : 1.0001)
          << fmt::format("pixel {}, channel {}", pixel, channel);
    }
  }
  EXPECT_GT(num_open, 30u);
  EXPECT_EQ(num_mixed > 20, size.samples > 1);
}

class BackgroundOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  TestVolume volume_{{19, 20, 21}, test::gyroid_field(7)};
  Camera camera_ = orbit_cameras(volume_.info(), 1)[0];
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, BackgroundOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(BackgroundOnDevice, SmallPicturesHaveTheRowsOfTheFormula) {
  const Appearance black{.background = glm::vec3(0)};
  for (const std::uint32_t samples : {1u, 2u, 3u}) {
    if (is_simulator(device_.info()) && samples == 3) continue;
    SCOPED_TRACE(fmt::format("{} x {} rays a pixel", samples, samples));
    const ImageSize size{31, 21, samples};  // not a multiple of four pixels
    const FrameRequest request{.camera = camera_, .isovalue = kIsovalue};
    TwinRenderer twin(volume_.compressed, size);
    twin.render(request);
    const Image8 picture = twin.shade(gradient());
    expect_gradient(picture, twin.shade(black), twin.hits(), size);

    DeviceRenderer on_device(device_, volume_.compressed, {.size = size});
    on_device.render(request);
    EXPECT_EQ(on_device.shade(gradient()).pixels, picture.pixels);
    HostRenderer on_host(volume_.compressed, {.largest = size});
    on_host.render(request);
    EXPECT_EQ(on_host.shade(gradient()).pixels, picture.pixels);
  }
}

TEST_P(BackgroundOnDevice, SmallPicturesOfOneColorAreTheOldOnes) {
  const ImageSize size{24, 17, 2};
  DeviceRenderer renderer(device_, volume_.compressed, {.size = size});
  renderer.render({camera_, kIsovalue});
  for (const glm::vec3 color : {glm::vec3(1), glm::vec3(0), glm::vec3(0.2f, 0.6f, 0.43f)}) {
    const Appearance uniform{.background = color},
        same{.background = color, .background_top = color};
    EXPECT_EQ(renderer.shade(same).pixels, renderer.shade(uniform).pixels);
  }
  const Image8 picture = renderer.shade(gradient(true));
  EXPECT_EQ(picture.channels, 4u);
  EXPECT_EQ(picture.pixels, renderer.shade({.transparent = true}).pixels)
      << "transparent pictures have no background";
}

/// Small pictures within a time, and pictures of passes, have all of the gradient.
TEST_P(BackgroundOnDevice, PicturesSoFar) {
  const ImageSize size{61, 43, 1};
  HostRenderer on_host(volume_.compressed, {.largest = size});
  DeviceRenderer on_device(device_, volume_.compressed,
                           {.size = size, .cache_slots = 60, .with_kept_picture = true});
  FrameRequest request{.camera = camera_, .isovalue = kIsovalue};
  on_host.render(request);
  const Image8 whole = on_host.shade(gradient());
  request.on_pass = [&](const PassStats &pass) {
    const Image8 so_far = on_device.shade(gradient());
    for (const std::size_t row : {0, 42}) {
      for (int channel = 0; channel < 3; ++channel) {
        EXPECT_NEAR(so_far.pixels[3 * 61 * row + std::size_t(channel)],
                    expected_row(row, 43)[channel], 0.5001)
            << "pass of " << pass.completed_percent << " %";
      }
    }
    return true;
  };
  on_device.render(request);
  EXPECT_EQ(on_device.shade(gradient()).pixels, whole.pixels);
  request.on_pass = {};
  TimedRenderer timed(on_device);
  EXPECT_FALSE(timed.render(within_ms(1e-6, request)).complete);
  const Image8 coarse = timed.shade(gradient());
  ASSERT_EQ(coarse.pixels.size(), whole.pixels.size());
  EXPECT_NE(coarse.pixels, whole.pixels);
  // Coarse hits are enlarged, and then shaded.
  for (const std::size_t row : {0, 42}) {
    for (int channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(coarse.pixels[3 * 61 * row + std::size_t(channel)],
                  expected_row(row, 43)[channel], 0.5001);
  }
}

TEST(CliBackground, IsAColorOrTwo) {
  const test::TemporaryFolder folder;
  const std::string command = "render generate:gyroid_8x8x8_uint8 -i 1e9 --size 6x40 -o " +
                              test::quoted(folder / "a.png") + " --background ";
  for (const std::string renderer : {"--reference", "--device host", "--device cpu"}) {
    const test::ProgramResult result =
        test::run_isowave(fmt::format("{}black,'#A05000' {}", command, renderer));
    ASSERT_EQ(result.status, 0) << result.err;
    const Image8 picture = read_png(folder / "a.png");
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
      constexpr std::array kUpper{0xA0, 0x50, 0};
      const std::size_t row = i / 18;
      const double up = 1 - (double(row) + 0.5) / 40;
      ASSERT_NEAR(picture.pixels[i], up * kUpper[i % 3], 0.5001) << renderer;
    }
  }
  for (const std::string colors : {"red,green,blue", "red,", ",red", "red,nocolor"}) {
    const test::ProgramResult result = test::run_isowave(command + colors);
    EXPECT_EQ(result.status, 1);
    EXPECT_TRUE(result.err.starts_with("isowave: --background")) << result.err;
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
  }
}

}  // namespace
}  // namespace isowave::core
