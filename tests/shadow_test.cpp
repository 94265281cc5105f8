// A light of the scene and its shadows: whole frames of devices and the host against the twin, and
// the twin's against geometry.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <span>

#include "core/base/error.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;
using testing::HasSubstr;

constexpr float kIsovalue = 0.2f;
constexpr ImageSize kFrame{31, 23};

TEST(LightDirections, GoToTheLightOrAroundIt) {
  const glm::dvec3 light = glm::normalize(glm::dvec3(1, -2, 0.5));
  for (const std::uint32_t num_shadow : {1u, 2u, 9u}) {
    const LightRays rays{.num_ambient = 3, .num_shadow = num_shadow, .light = light, .angle = 20};
    const auto directions = make_light_directions(rays);
    ASSERT_EQ(directions.size(), (3 + num_shadow) * ISO_AMBIENT_PATTERNS);
    glm::dvec3 sum(0);
    double widest = 0;
    for (std::size_t i = std::size_t{3} * ISO_AMBIENT_PATTERNS; i < directions.size(); ++i) {
      const glm::dvec3 d(directions[i].x, directions[i].y, directions[i].z);
      EXPECT_NEAR(glm::length(d), 1, 1e-6);
      widest = std::max(widest, glm::degrees(std::acos(std::min(1.0, glm::dot(d, light)))));
      sum += d;
    }
    EXPECT_NEAR(glm::dot(glm::normalize(sum), light), 1, 1e-3) << "they surround it";
    EXPECT_LE(widest, 20.001);
    EXPECT_EQ(widest > 15, num_shadow > 1);
  }
}

/// A ball above a wall. The light is straight behind the ball, and is at an angle to the rays.
TEST(ShadowTwin, FallWhereGeometrySays) {
  const glm::dvec3 middle(20, 20, 22);
  constexpr double kRadius = 6, kWall = 5.25;
  const TestVolume volume(
      glm::uvec3(41),
      [&](const glm::dvec3 &v) {
        return 0.5 + 0.02 * std::max(kRadius - glm::length(v - middle), kWall - v.z);
      },
      28);
  const Camera camera{
      .eye = {20, 20, 200}, .at = {20, 20, 0}, .up = {0, 1, 0}, .parallel_height = 40};
  const ImageSize size{80, 80};
  const glm::dvec3 light = glm::normalize(glm::dvec3(0.3, 0.1, 1));
  TwinRenderer twin(volume.compressed, size);
  FrameRequest request{.camera = camera, .isovalue = 0.5f, .shadow_rays = 1};
  request.light.towards_light = light;
  twin.render(request);
  const std::vector<HitRecord> hits = twin.hits();
  const Image8 shadowed = twin.shade(request.light);
  request.shadow_rays = 0;
  twin.render(request);
  const Image8 plain = twin.shade(request.light);
  int num_dark = 0, num_lit = 0;
  for (std::uint32_t y = 0; y < size.height; ++y) {
    for (std::uint32_t x = 0; x < size.width; ++x) {
      const std::size_t pixel = x + std::size_t{size.width} * y;
      const glm::dvec3 at(0.5 * (x + 0.5), 40 - 0.5 * (y + 0.5), kWall);
      if (std::abs(hits[pixel].t - (200 - kWall)) > 0.1) continue;  // the ball
      // The distance of the ray to the light from the ball's middle.
      const glm::dvec3 to_ball = middle - at;
      const double apart = glm::length(to_ball - glm::dot(to_ball, light) * light);
      if (std::abs(apart - kRadius) < 0.5) continue;
      const bool is_dark = shadowed.pixels[3 * pixel] < plain.pixels[3 * pixel];
      ASSERT_EQ(is_dark, apart < kRadius) << x << " " << y;
      ++(is_dark ? num_dark : num_lit);
    }
  }
  EXPECT_GT(num_dark, 100);
  EXPECT_GT(num_lit, 1000);
}

/// Frames with shadows, of hard and soft lights, with ambient rays and without; clipped, and with
/// levels of detail.
std::vector<FrameRequest> requests(const VolumeInfo &info) {
  std::vector<FrameRequest> requests;
  for (const std::uint32_t shadow_rays : {1u, 4u}) {
    for (const std::uint32_t ambient_rays : {0u, 2u}) {
      FrameRequest request{.camera = orbit_cameras(info, 3)[shadow_rays % 3],
                           .isovalue = kIsovalue,
                           .ambient_rays = ambient_rays,
                           .shadow_rays = shadow_rays,
                           .light_angle = 15};
      request.light.towards_light = glm::dvec3(0.4, 2, 0.7);
      requests.push_back(request);
    }
  }
  requests.push_back(requests.back());
  const glm::dvec3 centre = 0.5 * glm::dvec3(info.dims);
  requests.back().clip = {{{{0.2, 1, -0.1}, glm::dot(glm::dvec3(0.2, 1, -0.1), centre)}}, true};
  requests.push_back(requests[1]);
  requests.back().voxel_pixels = 3;
  return requests;
}

/// With all levels of detail.
const CompressedVolume &volume_of_test() {
  static const CompressedVolume volume = [] {
    const VolumeInfo info = test::grid_info({26, 23, 29});
    ArrayReader reader(info, test::sample(info.dims, test::gyroid_field(11)));
    return compress(reader, {.rate = 16, .levels = 0});
  }();
  return volume;
}

/// A renderer's pictures are the twin's; shadows make them darker.
void expect_the_twins(Renderer &renderer, std::span<const FrameRequest> frames,
                      ImageSize size = kFrame) {
  const CompressedVolume &volume = volume_of_test();
  TwinRenderer twin(volume, size);
  for (FrameRequest request : frames) {
    SCOPED_TRACE(testing::Message()
                 << request.shadow_rays << " shadow rays, " << request.ambient_rays
                 << " ambient ones, " << request.clip.planes.size() << " planes, "
                 << request.voxel_pixels << " pixels");
    twin.render(request);
    const Image8 expected = twin.shade(request.light);
    for (int again = 0; again < 2; ++again) {
      renderer.render(request);
      EXPECT_EQ(renderer.shade(request.light).pixels, expected.pixels);
    }
    request.shadow_rays = 0;
    renderer.render(request);
    const Image8 lit = renderer.shade(request.light);
    EXPECT_NE(lit.pixels, expected.pixels);
    for (std::size_t i = 0; i < lit.pixels.size(); ++i)
      ASSERT_LE(expected.pixels[i], lit.pixels[i]);
    request.light.towards_light = -*request.light.towards_light;
    EXPECT_NE(renderer.shade(request.light).pixels, lit.pixels) << "the light is elsewhere";
  }
}

TEST(ShadowHost, FramesAreTheTwins) {
  HostRenderer host(volume_of_test(), {.largest = kFrame});
  expect_the_twins(host, requests(volume_of_test().info));
}

class ShadowOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, ShadowOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(ShadowOnDevice, SmallFrameIsTheTwins) {
  constexpr ImageSize kSmall{13, 9};
  DeviceRenderer renderer(device_, volume_of_test(), {.size = kSmall, .with_given_rays = true});
  const std::vector<FrameRequest> frames = requests(volume_of_test().info);
  expect_the_twins(renderer, std::span(frames).subspan(2, 1), kSmall);
}

TEST_P(ShadowOnDevice, FramesAreTheTwinsClippedAndByLevels) {
  DeviceRenderer renderer(device_, volume_of_test(),
                          {.size = kFrame, .with_levels = true, .with_given_rays = true});
  expect_the_twins(renderer, requests(volume_of_test().info));
}

/// After the first pass of a round, pictures show the rounds before.
TEST_P(ShadowOnDevice, PicturesOfPasses) {
  FrameRequest request = requests(volume_of_test().info)[3];
  DeviceRenderer renderer(device_, volume_of_test(),
                          {.size = kFrame, .cache_slots = 64, .with_given_rays = true});
  std::vector<Image8> images;
  request.on_pass = [&](const PassStats &) {
    images.push_back(renderer.shade(request.light));
    return true;
  };
  renderer.render(request);
  images.push_back(renderer.shade(request.light));
  EXPECT_GT(images.size(), 6u);
  request.on_pass = nullptr;
  renderer.render(request);
  EXPECT_EQ(images.back().pixels, renderer.shade(request.light).pixels);
  // Seven waves follow those of the camera, each of a pass at least.
  request.on_pass = [later_passes = 0](const PassStats &pass) mutable {
    later_passes += pass.completed_percent == 100 ? 1 : 0;
    return later_passes < 4;
  };
  EXPECT_TRUE(renderer.render(request).cancelled);
  EXPECT_NE(renderer.shade(request.light).pixels, images.back().pixels) << "not all rounds";
}

TEST(Shadow, BadLightsAreRefused) {
  HostRenderer host(volume_of_test(), {.largest = kFrame});
  const FrameRequest good = requests(volume_of_test().info).front();
  const auto refuse = [&](const auto &change, const char *why) {
    FrameRequest request = good;
    change(request);
    EXPECT_THAT([&] { host.render(request); }, testing::ThrowsMessage<Error>(HasSubstr(why)));
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  refuse([](FrameRequest &request) { request.light.towards_light.reset(); },
         "shadows need a light");
  refuse([](FrameRequest &request) { request.light.towards_light = glm::dvec3(0); },
         "a light in direction 0 0 0");
  refuse([](FrameRequest &request) { request.light.towards_light->y = kNan; },
         "a light in direction");
  refuse([](FrameRequest &request) { request.shadow_rays = 256; }, "256 shadow rays");
  for (const double angle : {0.0, 46.0, kNan})
    refuse([&](FrameRequest &request) { request.light_angle = angle; }, "a light angle of");
  refuse([](FrameRequest &request) { request.surfaces = {{.isovalue = 0.1f, .opacity = 0.5f}}; },
         "end at surfaces of opacity 1");
  EXPECT_NO_THROW(host.render(good));
}

TEST_P(ShadowOnDevice, NeedARendererWithRays) {
  DeviceRenderer renderer(device_, volume_of_test(), {.size = kFrame});
  EXPECT_THAT([&] { renderer.render(requests(volume_of_test().info).front()); },
              testing::ThrowsMessage<Error>(HasSubstr("made with_rays")));
}

}  // namespace
}  // namespace isowave::core
