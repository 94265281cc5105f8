// Pictures without a background: the same bits by all renderers, an alpha that counts rays, and
// over any background the picture that is drawn with it.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/frame/timed_renderer.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;

constexpr float kIsovalue = 0.1f;
/// Bright, so that highlights reach white; the background is never seen.
constexpr Appearance kTransparent{.surface = {0.9f, 0.5f, 0.1f},
                                  .background = {0.1f, 0.3f, 0.9f},
                                  .ambient = 0.3f,
                                  .diffuse = 0.9f,
                                  .transparent = true};

Appearance over(const glm::vec3 &background) {
  Appearance appearance = kTransparent;
  appearance.background = background;
  appearance.transparent = false;
  return appearance;
}

/// The number of rays of a pixel that hit, one by one.
std::uint32_t covered_rays(const std::vector<HitRecord> &hits, ImageSize size, std::size_t pixel) {
  std::uint32_t covered = 0;
  for (std::uint32_t y = 0; y < size.samples; ++y) {
    for (std::uint32_t x = 0; x < size.samples; ++x) {
      const std::size_t row = pixel / size.width * size.samples + y,
                        column = pixel % size.width * size.samples + x;
      covered += std::isfinite(hits[row * size.ray_columns() + column].t);
    }
  }
  return covered;
}

class TransparentOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  RendererOptions options(ImageSize size) const {
    return {.size = size, .with_kept_picture = true, .with_given_rays = true};
  }

  TestVolume volume_{{19, 20, 21}, test::gyroid_field(7)};
  Camera camera_ = orbit_cameras(volume_.info(), 1)[0];
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, TransparentOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(TransparentOnDevice, SmallPicturesCountTheRaysThatHit) {
  for (const std::uint32_t samples : {1u, 2u, 3u}) {
    if (is_simulator(device_.info()) && samples == 3) continue;
    SCOPED_TRACE(fmt::format("{} x {} rays a pixel", samples, samples));
    const ImageSize size{31, 21, samples};  // not a multiple of four pixels
    const FrameRequest request{.camera = camera_, .isovalue = kIsovalue, .ambient_rays = 1};
    TwinRenderer twin(volume_.compressed, size);
    twin.render(request);
    const Image8 picture = twin.shade(kTransparent);
    {
      DeviceRenderer on_device(device_, volume_.compressed, options(size));
      on_device.render(request);
      EXPECT_EQ(on_device.shade(kTransparent).pixels, picture.pixels);
      EXPECT_EQ(on_device.shade(kTransparent).channels, 4u);
    }
    HostRenderer on_host(volume_.compressed, {.largest = size});
    on_host.render(request);
    EXPECT_EQ(on_host.shade(kTransparent).pixels, picture.pixels);

    ASSERT_EQ(picture.channels, 4u);
    ASSERT_EQ(picture.pixels.size(), 4 * size.num_pixels());
    const std::vector<HitRecord> hits = twin.hits();
    const std::uint32_t all = samples * samples;
    std::size_t num_covered = 0, num_mixed = 0;
    for (std::size_t pixel = 0; pixel < size.num_pixels(); ++pixel) {
      const std::uint32_t covered = covered_rays(hits, size, pixel);
      const std::uint8_t *rgba = &picture.pixels[4 * pixel];
      ASSERT_EQ(rgba[3], std::lround(255.0 * covered / all)) << "pixel " << pixel;
      if (covered == 0) {
        ASSERT_EQ(rgba[0] | rgba[1] | rgba[2], 0) << "pixel " << pixel;
      }
      num_covered += covered == all;
      num_mixed += covered != 0 && covered != all;
    }
    EXPECT_GT(num_covered, 50u);
    EXPECT_EQ(num_mixed > 20, samples > 1);
  }
}

/// With a share a of the rays that hit, of mean colour c, and a background b, an opaque pixel is
/// a c + (1 - a) b, rounded by up to 1/2. Laid over b, the transparent one has two more errors:
/// c is rounded by up to 1/2, which a lessens, and a by up to 1/2 of 255, which moves the colour
/// from b towards c. So they differ by at most (1 + a + |c - b| / 255) / 2 levels: by one, unless
/// nearly all rays hit and surface and background are as unlike as black and white.
TEST_P(TransparentOnDevice, SmallPicturesLieOverAnyBackground) {
  for (const std::uint32_t samples : {1u, 2u, 3u}) {
    if (is_simulator(device_.info()) && samples != 2) continue;
    const ImageSize size{31, 21, samples};
    DeviceRenderer renderer(device_, volume_.compressed, options(size));
    renderer.render({camera_, kIsovalue});
    const Image8 picture = renderer.shade(kTransparent);
    ASSERT_EQ(picture.channels, 4u);
    for (const glm::vec3 background : {glm::vec3(1), glm::vec3(0), glm::vec3(0.2f, 0.6f, 0.4f)}) {
      const Image8 opaque = renderer.shade(over(background));
      ASSERT_EQ(opaque.channels, 3u);
      for (std::size_t pixel = 0; pixel < size.num_pixels(); ++pixel) {
        const double alpha = picture.pixels[4 * pixel + 3] / 255.0;
        for (int channel = 0; channel < 3; ++channel) {
          const double color = picture.pixels[4 * pixel + std::size_t(channel)],
                       behind = 255.0 * double{background[channel]},
                       laid_over = alpha * color + (1 - alpha) * behind;
          ASSERT_NEAR(laid_over, opaque.pixels[3 * pixel + std::size_t(channel)],
                      (1.01 + alpha + std::abs(color - behind) / 255) / 2)
              << fmt::format("pixel {}, channel {}, samples {}", pixel, channel, samples);
        }
      }
    }
  }
}

/// Only the picture depends on it, and only when it is asked for.
TEST_P(TransparentOnDevice, SmallPicturesFollowFromTheSameFrame) {
  const ImageSize size{24, 17, 2};
  DeviceRenderer renderer(device_, volume_.compressed, options(size));
  renderer.render({camera_, kIsovalue});
  const Image8 opaque = renderer.shade(over({0, 0, 1}));
  const Image8 picture = renderer.shade(kTransparent);
  EXPECT_EQ(renderer.shade(over({0, 0, 1})).pixels, opaque.pixels);
  const std::vector<HitRecord> hits = renderer.hits();
  std::size_t num_covered = 0;
  for (std::size_t pixel = 0; pixel < size.num_pixels(); ++pixel) {
    if (covered_rays(hits, size, pixel) != 4) continue;
    ++num_covered;
    EXPECT_TRUE(std::equal(&opaque.pixels[3 * pixel], &opaque.pixels[3 * pixel] + 3,
                           &picture.pixels[4 * pixel]))
        << "a pixel that the surface covers, " << pixel;
  }
  EXPECT_GT(num_covered, 50u);
  Appearance other = kTransparent;
  other.background = {1, 0, 0};
  EXPECT_EQ(renderer.shade(other).pixels, picture.pixels);
  EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
}

std::size_t num_seen(const Image8 &picture) {
  std::size_t seen = 0;
  for (std::size_t i = 3; i < picture.pixels.size(); i += 4) seen += picture.pixels[i] != 0;
  return seen;
}

/// Pass by pass, rays that are not finished are transparent; and within a time, a kept picture
/// takes their place.
TEST_P(TransparentOnDevice, PicturesSoFar) {
  const ImageSize size{61, 43, 2};
  RendererOptions few_slots = options(size);
  few_slots.cache_slots = 60;
  DeviceRenderer on_device(device_, volume_.compressed, few_slots);
  // With many threads, a band would be the whole picture.
  HostRenderer on_host(volume_.compressed, {.num_threads = 1, .largest = size});
  FrameRequest request{.camera = camera_, .isovalue = kIsovalue};
  on_host.render(request);
  const Image8 whole = on_host.shade(kTransparent);
  for (Renderer *renderer :
       {static_cast<Renderer *>(&on_device), static_cast<Renderer *>(&on_host)}) {
    std::vector<std::size_t> seen;
    Image8 last;
    request.on_pass = [&](const PassStats &) {
      last = renderer->shade(kTransparent);
      EXPECT_EQ(last.channels, 4u);
      seen.push_back(num_seen(last));
      return true;
    };
    renderer->render(request);
    EXPECT_GT(seen.size(), 1u);
    EXPECT_LT(seen.front(), num_seen(whole));
    EXPECT_TRUE(std::ranges::is_sorted(seen));
    EXPECT_EQ(last.pixels, whole.pixels);
    request.on_pass = {};
    TimedRenderer timed(*renderer);
    EXPECT_FALSE(timed.render(within_ms(1e-6, request)).complete);
    const Image8 coarse = timed.shade(kTransparent);
    EXPECT_EQ(coarse.pixels.size(), whole.pixels.size());
    EXPECT_NE(coarse.pixels, whole.pixels);
    EXPECT_GT(num_seen(coarse), num_seen(whole) / 2);
    EXPECT_TRUE(timed.render(within_ms(1e9, request)).complete);
    EXPECT_EQ(timed.shade(kTransparent).pixels, whole.pixels);
  }
}

}  // namespace
}  // namespace isowave::core
