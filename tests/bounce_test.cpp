// Light that bounces: the twin against geometry, then whole frames of devices and the host against
// the twin.

#include "core/stages/bounce.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "core/base/error.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "kernels_cl/portable/bounce.h"
#include "reference/twin.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;
using testing::HasSubstr;

constexpr float kIsovalue = 0.2f;
constexpr ImageSize kFrame{31, 23};

TEST(BounceDirections, GoToTheLight) {
  const glm::dvec3 light = glm::normalize(glm::dvec3(1, -2, 0.5));
  const LightRays straight{.num_ambient = 3, .light = light, .angle = 20, .bounces = true};
  const auto directions = make_light_directions(straight);
  ASSERT_EQ(directions.size(), 4 * ISO_AMBIENT_PATTERNS);
  EXPECT_EQ(light_row(0, 2), 0u);
  for (std::size_t i = std::size_t{3} * ISO_AMBIENT_PATTERNS; i < directions.size(); ++i) {
    const glm::dvec3 d(directions[i].x, directions[i].y, directions[i].z);
    EXPECT_NEAR(glm::dot(d, light), 1, 1e-6);
  }
  LightRays soft = straight;
  soft.num_shadow = 2;
  EXPECT_EQ(make_light_directions(soft).size(), 5 * ISO_AMBIENT_PATTERNS) << "the shadow rays'";
  EXPECT_EQ(light_row(2, 0), 0u);
  EXPECT_EQ(light_row(2, 1), 1u);
  EXPECT_EQ(light_row(2, 2), 0u);
}

// ---- geometry

constexpr double kRadius = 20;
constexpr glm::dvec3 kMiddle(27, 27, 26);

/// A block whose upper side, at the middle's height, has a bowl: half a ball.
const TestVolume &bowl() {
  static const TestVolume volume(
      glm::uvec3(55, 55, 32),
      [](const glm::dvec3 &v) {
        const double to_ball = glm::length(v - kMiddle) - kRadius, to_top = kMiddle.z - v.z;
        return 0.5 + 0.01 * std::min(to_ball, to_top);
      },
      28);
  return volume;
}

/// What the filter needs of hits.
std::vector<GivenRay> places_of(const VolumeInfo &info, const Camera &camera, ImageSize size,
                                const std::vector<HitRecord> &hits) {
  const FrameParams frame = make_frame_params(info, camera, size, 0);
  const AmbientParams params = make_ambient_params(info, 1);
  std::vector<GivenRay> places(hits.size());
  for (uint ray = 0; ray < hits.size(); ++ray)
    places[ray] = normal_ray(&frame, &params, ray, hits[ray]);
  return places;
}

constexpr ImageSize kAbove{24, 24};
Camera from_above() {
  return {.eye = {27, 27, 200}, .at = {27, 27, 0}, .up = {0, 1, 0}, .parallel_height = 24};
}

/// The light of what is seen from above, in a square around the bowl's axis.
OpenCounts seen_from_above(const glm::dvec3 &light, std::uint32_t num_rays,
                           std::vector<HitRecord> *hits) {
  const Twin twin(bowl().compressed);
  *hits = twin.render(from_above(), kAbove, 0.5f);
  return twin.open(
      from_above(), kAbove, 0.5f, *hits,
      {.num_ambient = num_rays, .light = glm::normalize(light), .angle = 3, .bounces = true});
}

/// What the rays of a place of the bowl find: the mean of the light that they bring, and how many
/// leave. By the midpoint rule, in double precision, for rays that begin `lift` above it. Light
/// comes from straight above, to all of the bowl.
///
/// place  from the middle of the ball
std::array<double, 2> light_of_bowl(const glm::dvec3 &place, double lift) {
  constexpr int kSteps = 120;
  const glm::dvec3 normal = -glm::normalize(place), begin = place + lift * normal;
  const glm::dvec3 u = glm::normalize(glm::cross(normal, glm::dvec3(0.6, 0.8, 0))),
                   v = glm::cross(normal, u);
  double light = 0, open = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double area = (i + 0.5) / kSteps, angle = 2 * std::numbers::pi * (j + 0.5) / kSteps;
      const glm::dvec3 d = std::sqrt(1 - area) * normal +
                           std::sqrt(area) * (std::cos(angle) * u + std::sin(angle) * v);
      const double b = glm::dot(begin, d);
      const double t = -b + std::sqrt(b * b - glm::dot(begin, begin) + kRadius * kRadius);
      const double height = begin.z + t * d.z;  // of where the ray meets the ball
      light += std::max(0.0, -height / kRadius) / (kSteps * kSteps);
      open += height >= 0 ? 1.0 / (kSteps * kSteps) : 0;
    }
  }
  return {light, open};
}

/// Rays that leave a place of a ball's inside, distributed by their cosine, meet all of the ball
/// alike. So half of them leave half a ball, and half meet it, where the cosine with the vertical
/// has the mean 1/2.
TEST(BounceOracle, ABowlGetsAQuarterOfTheLight) {
  for (const glm::dvec3 &place : {glm::dvec3(0, 0, -1), glm::dvec3(0.6, 0, -0.8)}) {
    EXPECT_NEAR(light_of_bowl(kRadius * place, 0)[0], 0.25, 1e-3);
    EXPECT_NEAR(light_of_bowl(kRadius * place, 0)[1], 0.5, 1e-2);
  }
}

/// The filter evens out what geometry says, too.
TEST(BounceTwin, ABowlGetsWhatGeometrySays) {
  constexpr std::uint32_t kRays = 64;
  std::vector<HitRecord> hits;
  const OpenCounts open = seen_from_above({0, 0, 1}, kRays, &hits);
  ASSERT_EQ(open.num_bounced, kRays);
  std::vector<float> expected(hits.size());
  glm::dvec2 sum(0), sum_expected(0);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const glm::dvec3 place(double(i % 24) - 11.5, 11.5 - double(i / 24),
                           200 - double(hits[i].t) - kMiddle.z);
    ASSERT_NEAR(glm::length(place), kRadius, 0.1);
    const auto [light, num_open] = light_of_bowl(place, ISO_AMBIENT_LIFT);
    expected[i] = static_cast<float>(kRays * light);
    sum += glm::dvec2(open.bounced[i], open.counts[i]);
    sum_expected += double(kRays) * glm::dvec2(light, num_open);
  }
  const std::vector<GivenRay> places = places_of(bowl().info(), from_above(), kAbove, hits);
  for (uint step = 0; step < ISO_BOUNCE_STEPS; ++step) {
    const std::vector<float> before = expected;
    for (uint ray = 0; ray < hits.size(); ++ray)
      expected[ray] = filtered_light(kAbove.width, kAbove.height, places.data(), before.data(), ray,
                                     1u << step);
  }
  // The volume rounds the rim off, within a voxel of the ball's 40: about a third of these rays are
  // open, and others meet a slope that gets more light than a wall.
  for (std::size_t i = 0; i < hits.size(); ++i)
    EXPECT_NEAR(open.bounced[i] / expected[i], 1, 0.025) << i;
  EXPECT_NEAR(sum.x / sum_expected.x, 1, 0.02);
  EXPECT_NEAR(sum.y / sum_expected.y, 1, 0.02) << "they are ambient rays, too";
}

TEST(BounceTwin, WhatFacesAwayFromTheLightSendsNoneOn) {
  std::vector<HitRecord> hits;
  const OpenCounts open = seen_from_above({0, 0, -1}, 8, &hits);
  EXPECT_THAT(open.bounced, testing::Each(0.0f));
}

/// The bowl's wall hides part of the bowl from a slanting light.
TEST(BounceTwin, WhatIsInShadowSendsNoneOn) {
  std::vector<HitRecord> hits;
  const OpenCounts above = seen_from_above({0, 0, 1}, 64, &hits),
                   slanting = seen_from_above({1, 0, 0.2}, 64, &hits);
  double lit = 0, all = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    lit += slanting.bounced[i];
    all += above.bounced[i];
  }
  EXPECT_GT(lit, 0);
  // Without shadows, the mean cosine over the half that faces the light would be about 1/3 of all.
  EXPECT_LT(lit, 0.25 * all);
}

// ---- the filter

GivenRay place_at(const glm::vec3 &at, const glm::vec3 &normal) {
  const glm::vec3 n = glm::normalize(normal);
  return {at.x, at.y, at.z, n.x, n.y, n.z, 0};
}

TEST(BounceFilter, NeighboursCountIfTheyAreOfTheSameSurface) {
  const GivenRay of = place_at({1, 2, 3}, {0, 0, 1});
  EXPECT_EQ(likeness(of, place_at({5, -3, 3}, {0, 0, 1})), 1.0f) << "in the plane";
  EXPECT_EQ(likeness(of, of), 1.0f);
  EXPECT_EQ(likeness(of, place_at({2, 2, 3}, {1, 0, 0})), 0.0f) << "at right angles";
  EXPECT_EQ(likeness(of, place_at({2, 2, 3}, {0, 0, -1})), 0.0f) << "the other side";
  EXPECT_EQ(likeness(of, place_at({1, 2, 9}, {0, 0, 1})), 0.0f) << "another layer";
  EXPECT_NEAR(likeness(of, place_at({2, 2, 3}, {1, 0, 1})), std::pow(0.5, 4), 1e-6);
  EXPECT_NEAR(likeness(of, place_at({1, 2, 3.5}, {0, 0, 1})), 1 - 0.5 / 0.75, 1e-6);
}

/// Light of a plane that is the same everywhere stays so, to its edges; a single bright ray
/// spreads.
TEST(BounceFilter, KeepsWhatIsEvenAndSpreadsTheRest) {
  const TestVolume volume(
      glm::uvec3(24), [](const glm::dvec3 &v) { return 0.02 * v.z; }, 28);
  const Camera camera{
      .eye = {12, 12, 90}, .at = {12, 12, 0}, .up = {0, 1, 0}, .parallel_height = 16};
  constexpr ImageSize kSize{15, 11};
  const std::vector<HitRecord> hits = Twin(volume.compressed).render(camera, kSize, 0.2f);
  const std::vector<GivenRay> places = places_of(volume.info(), camera, kSize, hits);
  const std::vector<float> even(kSize.num_rays(), 2.5f);
  std::vector<float> one(kSize.num_rays(), 0.0f), spread(kSize.num_rays());
  constexpr uint kBright = 15 * 5 + 7;
  one[kBright] = 16;
  for (uint ray = 0; ray < hits.size(); ++ray) {
    for (const uint apart : {1u, 8u})
      EXPECT_EQ(filtered_light(kSize.width, kSize.height, places.data(), even.data(), ray, apart),
                2.5f);
    spread[ray] = filtered_light(kSize.width, kSize.height, places.data(), one.data(), ray, 1);
  }
  EXPECT_NEAR(spread[kBright], 4, 1e-4);
  EXPECT_NEAR(spread[kBright + 1], 2, 1e-4);
  EXPECT_NEAR(spread[kBright + 15 + 1], 1, 1e-4);
  EXPECT_EQ(spread[kBright + 2], 0);
}

// ---- frames

/// With all levels of detail.
const CompressedVolume &volume_of_test() {
  static const CompressedVolume volume = [] {
    const VolumeInfo info = test::grid_info({26, 23, 29}, {1, 1.5, 0.75});
    ArrayReader reader(info, test::sample(info.dims, test::gyroid_field(11)));
    return compress(reader, {.rate = 16, .levels = 0});
  }();
  return volume;
}

/// Frames with light that bounces: alone; with hard and soft shadows and more ambient rays;
/// clipped; with levels of detail.
std::vector<FrameRequest> requests() {
  const VolumeInfo &info = volume_of_test().info;
  FrameRequest request{
      .camera = orbit_cameras(info, 3)[1], .isovalue = kIsovalue, .bounce_rays = 3};
  request.light.towards_light = glm::dvec3(0.4, 2, 0.7);
  std::vector<FrameRequest> requests{request};
  request.shadow_rays = 1;
  request.ambient_rays = 4;
  requests.push_back(request);
  request.shadow_rays = 2;
  request.light_angle = 15;
  request.camera = orbit_cameras(info, 3)[2];
  requests.push_back(request);
  const glm::dvec3 centre = 0.5 * glm::dvec3(info.dims) * info.spacing;
  request.clip = {{{{0.2, 1, -0.1}, glm::dot(glm::dvec3(0.2, 1, -0.1), centre)}}, true};
  requests.push_back(request);
  request.clip = {};
  request.shadow_rays = 0;
  request.voxel_pixels = 3;
  requests.push_back(request);
  return requests;
}

/// Renderer  has open(), the light that its last frame found.
template <class Renderer>
void expect_the_twins(Renderer &renderer, std::span<const FrameRequest> frames,
                      ImageSize size = kFrame) {
  TwinRenderer twin(volume_of_test(), size);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    SCOPED_TRACE(i);
    FrameRequest request = frames[i];
    twin.render(request);
    const Image8 expected = twin.shade(request.light);
    for (int again = 0; again < 2; ++again) {
      renderer.render(request);
      const OpenCounts got = renderer.open();
      EXPECT_EQ(got.num_bounced, std::max(request.bounce_rays, request.ambient_rays));
      EXPECT_EQ(got.bounced, twin.open().bounced);
      EXPECT_EQ(renderer.shade(request.light).pixels, expected.pixels);
    }
    request.ambient_rays = std::max(request.bounce_rays, request.ambient_rays);
    request.bounce_rays = 0;
    renderer.render(request);
    const Image8 without = renderer.shade(request.light);
    EXPECT_NE(without.pixels, expected.pixels);
    for (std::size_t pixel = 0; pixel < without.pixels.size(); ++pixel)
      ASSERT_GE(expected.pixels[pixel], without.pixels[pixel]) << "light is added";
  }
}

TEST(BounceHost, FramesAreTheTwins) {
  HostRenderer host(volume_of_test(), {.largest = kFrame});
  expect_the_twins(host, requests());
}

class BounceOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, BounceOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

RendererOptions with_bounce(ImageSize size) {
  RendererOptions options;
  options.size = size;
  options.with_bounce = true;
  return options;
}

TEST_P(BounceOnDevice, SmallFrameIsTheTwins) {
  constexpr ImageSize kSmall{9, 7};
  DeviceRenderer renderer(device_, volume_of_test(), with_bounce(kSmall));
  const std::vector<FrameRequest> frames = requests();
  expect_the_twins(renderer, std::span(frames).first(1), kSmall);
}

TEST_P(BounceOnDevice, FramesAreTheTwinsClippedAndByLevels) {
  RendererOptions options = with_bounce(kFrame);
  options.with_levels = true;
  DeviceRenderer renderer(device_, volume_of_test(), options);
  expect_the_twins(renderer, requests());
}

/// What is launched between passes and behind the last one has a stage, too.
TEST_P(BounceOnDevice, StagesAreTimed) {
  ocl::Device device(GetParam(), true);
  DeviceRenderer renderer(device, volume_of_test(), with_bounce(kFrame));
  for (int frames = 0; frames < 2; ++frames) {
    const FrameStats stats = renderer.render(requests()[0]);
    for (const char *stage : {"ambient", "bounce", "march"})
      EXPECT_TRUE(stats.ambient.stage_ms.contains(stage)) << stage;
    EXPECT_FALSE(stats.passes[0].stage_ms.contains("bounce")) << "the frame before";
  }
}

/// With hardly any memory, waves need many passes. Pictures of passes show the rounds before.
TEST_P(BounceOnDevice, PicturesOfPasses) {
  FrameRequest request = requests()[2];
  RendererOptions options = with_bounce(kFrame);
  options.cache_slots = 64;
  DeviceRenderer renderer(device_, volume_of_test(), options);
  std::vector<std::uint32_t> rounds;
  request.on_pass = [&](const PassStats &) {
    const OpenCounts open = renderer.open();
    EXPECT_LE(open.num_bounced, open.num_ambient);
    for (std::size_t i = 0; i < open.bounced.size(); ++i)
      EXPECT_LE(open.counts[i] + open.bounced[i], float(open.num_ambient)) << "shares of light";
    rounds.push_back(open.num_bounced);
    return true;
  };
  renderer.render(request);
  EXPECT_TRUE(std::ranges::is_sorted(rounds));
  EXPECT_EQ(rounds.back(), 4u);
  const Image8 whole = renderer.shade(request.light);
  request.on_pass = nullptr;
  renderer.render(request);
  EXPECT_EQ(renderer.shade(request.light).pixels, whole.pixels);
  request.on_pass = [&](const PassStats &) { return renderer.open().num_bounced < 2; };
  EXPECT_TRUE(renderer.render(request).cancelled);
  EXPECT_EQ(renderer.open().num_bounced, 2u);
  EXPECT_NE(renderer.shade(request.light).pixels, whole.pixels) << "not all rounds";
  request.on_pass = nullptr;
  request.bounce_rays = 0;
  renderer.render(request);
  EXPECT_EQ(renderer.open().num_bounced, 0u);
}

TEST_P(BounceOnDevice, NeedsARendererWithBounce) {
  DeviceRenderer renderer(device_, volume_of_test(), {.size = kFrame, .with_given_rays = true});
  EXPECT_THAT([&] { renderer.render(requests().front()); },
              testing::ThrowsMessage<Error>(HasSubstr("made with_bounce")));
}

TEST(Bounce, BadRequestsAreRefused) {
  HostRenderer host(volume_of_test(), {.largest = kFrame});
  const auto refuse = [&](const auto &change, const char *why) {
    FrameRequest request = requests().front();
    change(request);
    EXPECT_THAT([&] { host.render(request); }, testing::ThrowsMessage<Error>(HasSubstr(why)));
  };
  refuse([](FrameRequest &request) { request.light.towards_light.reset(); },
         "bounced light needs a light of the scene");
  refuse([](FrameRequest &request) { request.bounce_rays = 256; }, "256 bounce rays");
  refuse([](FrameRequest &request) { request.surfaces = {{.isovalue = 0.1f, .opacity = 0.5f}}; },
         "end at surfaces of opacity 1, and there is none");
}

}  // namespace
}  // namespace isowave::core
