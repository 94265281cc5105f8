// Light rays that begin at surfaces which clipping planes leave whole, and enter what the planes
// leave of others: a cap stops them where they come into a solid. Against geometry in double
// precision, and with the bits of all renderers.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/array_reader.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;

const glm::dvec3 kCentre(20, 20, 22);
constexpr double kRadius = 9, kFloor = 6.3, kBottom = 20, kTop = 24;

/// A ball, 0.5 at its surface, above a floor, -0.5 at its surface.
CompressedVolume ball_above_floor() {
  const VolumeInfo info = test::grid_info({41, 41, 37});
  const std::vector<float> voxels = test::sample(info.dims, [](const glm::dvec3 &at) {
    const double ball = 0.5 + 0.2 * (kRadius - glm::length(at - kCentre)),
                 floor = 0.5 + 0.2 * (kFloor - at.z);
    return std::clamp(ball, 0.0, 1.0) - std::clamp(floor, 0.0, 1.0);
  });
  ArrayReader reader(info, voxels);
  return compress(reader, {.rate = 20, .levels = 0});
}

/// Two planes leave a slab of the ball, and the floor is whole. A light above.
FrameRequest scene(bool caps, ImageSize size) {
  FrameRequest request;
  request.camera = {{20, -45, 30}, {20, 20, 14}, {0, 0, 1}, 40};
  request.size = size;
  request.surfaces = {{0.5f, {0.9f, 0.3f, 0.2f}, 1}, {-0.5f, {0.8f, 0.8f, 0.8f}, 1, false}};
  request.clip = {{{{0, 0, 1}, kBottom}, {{0, 0, -2}, -2 * kTop}}, caps};
  request.light.towards_light = glm::normalize(glm::dvec3(0.2, -0.1, 1));
  request.shadow_rays = 1;
  return request;
}

/// How near a ray comes to the ball's surface, and whether a part of it is within what is left of
/// the ball.
struct Meets {
  bool solid;      ///< within the slab and the ball
  bool shell;      ///< through the ball's surface, within the slab
  double nearest;  ///< to where this would change [voxels]
};

Meets meets(const glm::dvec3 &from, const glm::dvec3 &direction) {
  Meets found{false, false, INFINITY};
  constexpr int kSteps = 2000;
  bool was_in_ball = false;
  for (int step = 0; step <= kSteps; ++step) {
    const double z = kBottom + (kTop - kBottom) * step / kSteps;
    const glm::dvec3 at = from + direction * ((z - from.z) / direction.z);
    const double depth = kRadius - glm::length(at - kCentre);
    found.nearest = std::min(found.nearest, std::abs(depth));
    found.solid |= depth > 0;
    found.shell |= step != 0 && (depth > 0) != was_in_ball;
    was_in_ball = depth > 0;
  }
  return found;
}

struct Counts {
  std::size_t solid = 0, shell = 0, open = 0;
};

/// Judges each place of the floor that is seen by whether its colour is that without the ball.
Counts check_floor(Renderer &renderer, bool caps, double voxel_pixels = 0) {
  constexpr ImageSize kSize{80, 60};
  FrameRequest request = scene(caps, kSize);
  request.voxel_pixels = voxel_pixels;
  renderer.render(request);
  const Image8 lit = renderer.shade(request.light);
  const std::vector<HitRecord> hits = renderer.hits();
  const FrameArrays arrays = renderer.fetch({.positions = true}, request.light);
  FrameRequest alone = request;
  alone.surfaces.erase(alone.surfaces.begin());
  renderer.render(alone);
  const Image8 unshaded = renderer.shade(request.light);
  Counts counts;
  std::size_t num_wrong = 0;
  for (std::size_t ray = 0; ray < hits.size(); ++ray) {
    if (!std::isfinite(hits[ray].t) || hits[ray].cell >> ISO_SURFACE_BIT != 1) continue;
    const std::array<double, 3> &place = arrays.positions[ray];
    const glm::dvec3 at(place[0], place[1], place[2]);
    const Meets truth = meets(at, *request.light.towards_light);
    if (truth.nearest < (voxel_pixels == 0 ? 0.5 : 1.0)) continue;
    const bool is_dark =
        !std::equal(&lit.pixels[3 * ray], &lit.pixels[3 * ray] + 3, &unshaded.pixels[3 * ray]);
    num_wrong += is_dark != (caps ? truth.solid : truth.shell) ? 1 : 0;
    ++(truth.shell ? counts.shell : truth.solid ? counts.solid : counts.open);
  }
  EXPECT_EQ(num_wrong, 0u);
  return counts;
}

void check_all(Renderer &renderer) {
  for (const double voxel_pixels : {0.0, 0.6}) {
    for (const bool caps : {true, false}) {
      SCOPED_TRACE(testing::Message() << "caps " << caps << ", levels " << voxel_pixels);
      const Counts counts = check_floor(renderer, caps, voxel_pixels);
      EXPECT_GT(counts.solid, 40u) << "none is within the ball all the way";
      EXPECT_GT(counts.open, 200u);
    }
  }
}

/// All kinds of light rays, also from layers behind glass.
std::vector<FrameRequest> all_light(ImageSize size) {
  FrameRequest request = scene(true, size);
  request.ambient_rays = 3;
  request.shadow_rays = 2;
  request.light_angle = 20;
  request.surfaces.push_back({-0.2f, {0.2f, 0.3f, 0.9f}, 0.3f, false});
  std::vector<FrameRequest> all(3, request);
  all[1].bounce_rays = 3;
  all[2].clip.caps = false;
  return all;
}

void expect_as_the_twin(Renderer &renderer, const CompressedVolume &volume, ImageSize size) {
  TwinRenderer twin(volume, size);
  std::vector<Image8> pictures;
  for (FrameRequest request : all_light(size)) {
    for (const double voxel_pixels : {0.0, 0.6}) {
      request.voxel_pixels = voxel_pixels;
      renderer.render(request);
      twin.render(request);
      expect_same_hits(renderer.hits(), twin.hits(), size.width);
      pictures.push_back(twin.shade(request.light));
      EXPECT_EQ(renderer.shade(request.light).pixels, pictures.back().pixels);
    }
  }
  EXPECT_NE(pictures.front().pixels, pictures[4].pixels) << "caps stop no ray";
}

TEST(CapLight, IsStoppedInTheTwin) {
  const CompressedVolume volume = ball_above_floor();
  TwinRenderer twin(volume, {80, 60});
  check_all(twin);
}

TEST(CapLight, IsStoppedOnTheHost) {
  const CompressedVolume volume = ball_above_floor();
  HostRenderer renderer(volume);
  check_all(renderer);
  expect_as_the_twin(renderer, volume, {33, 25});
}

class CapLightOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, CapLightOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(CapLightOnDevice, IsStopped) {
  const CompressedVolume volume = ball_above_floor();
  DeviceRenderer renderer(
      device_, volume,
      {.size = {80, 60}, .with_levels = true, .max_surfaces = 2, .with_given_rays = true});
  check_all(renderer);
}

TEST_P(CapLightOnDevice, IsTheTwins) {
  const CompressedVolume volume = ball_above_floor();
  DeviceRenderer renderer(
      device_, volume,
      {.size = {33, 25}, .with_levels = true, .max_surfaces = 3, .with_bounce = true});
  expect_as_the_twin(renderer, volume, {33, 25});
}

/// Small enough for Oclgrind: a ball in a corner, and a floor that is whole.
TEST_P(CapLightOnDevice, SmallFrames) {
  const VolumeInfo info = test::grid_info({13, 12, 14});
  ArrayReader reader(
      info, test::sample(info.dims, [](const glm::dvec3 &at) {
        const double ball = 4 - glm::length(at - glm::dvec3(6, 6, 9)), floor = 3.2 - at.z;
        return std::clamp(0.5 + 0.3 * ball, 0.0, 1.0) - std::clamp(0.5 + 0.3 * floor, 0.0, 1.0);
      }));
  const CompressedVolume volume = compress(reader, {.rate = 20});
  constexpr ImageSize kSmall{7, 5};
  DeviceRenderer renderer(device_, volume,
                          {.size = kSmall, .max_surfaces = 2, .with_given_rays = true});
  TwinRenderer twin(volume, kSmall);
  FrameRequest request = scene(true, kSmall);
  request.camera = {{6, -15, 14}, {6, 6, 3.2}, {0, 0, 1}, 30};
  request.clip.planes = {{{0, 0, 1}, 8}, {{0, 0, -2}, -20}};
  twin.render(request);
  const Image8 capped = twin.shade(request.light);
  renderer.render(request);
  expect_same_hits(renderer.hits(), twin.hits(), kSmall.width);
  EXPECT_EQ(renderer.shade(request.light).pixels, capped.pixels);
  request.clip.caps = false;
  twin.render(request);
  EXPECT_NE(twin.shade(request.light).pixels, capped.pixels) << "no cap stops a ray";
}

}  // namespace
}  // namespace isowave::core
