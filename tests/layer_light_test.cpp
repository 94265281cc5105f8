// Ambient and shadow rays of frames with several surfaces and slices, and light that bounces: the
// hits of every layer have them, and they end at opaque surfaces. Devices and the host must have
// the twin's pictures.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/view/color_maps.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;

constexpr ImageSize kSize{43, 31}, kSmall{7, 5};

CompressedVolume gyroid(const glm::uvec3 &dims, float period) {
  VolumeInfo info = test::grid_info(dims);
  info.spacing = {0.5, 0.7, 0.4};
  info.origin = {3, -20, 11};
  const std::vector<float> voxels = test::sample(dims, test::gyroid_field(period));
  ArrayReader reader(info, voxels);
  return compress(reader, {.rate = 9});
}

CompressedVolume gyroid() {
  return gyroid({40, 37, 44}, 11);
}

ClipPlane through(const VolumeInfo &info, double place, const glm::dvec3 &normal) {
  const glm::dvec3 index = place * (glm::dvec3(info.dims) - 1.0);
  return {normal, glm::dot(normal, info.origin + info.index_to_world() * index)};
}

/// One opaque surface; one behind glass; two opaque ones, one of them never clipped.
const std::vector<std::vector<SurfaceStyle>> kScenes{
    {{0.4f, {0.8f, 0.2f, 0.1f}, 1}},
    {{0.2f, {0.9f, 0.9f, 0.2f}, 0.3f}, {0.6f, {0.1f, 0.4f, 0.8f}, 1}},
    {{0.7f, {0.1f, 0.4f, 0.8f}, 1},
     {0.2f, {0.9f, 0.9f, 0.2f}, 0.3f},
     {0.5f, {0.3f, 0.9f, 0.4f}, 1, false}}};

FrameRequest lit_request(const VolumeInfo &info, const std::vector<SurfaceStyle> &surfaces) {
  FrameRequest request{.camera = orbit_cameras(info, 1)[0], .surfaces = surfaces};
  request.light.towards_light = glm::dvec3(0.4, -0.5, 0.8);
  request.ambient_rays = 3;
  request.shadow_rays = 2;
  request.light_angle = 5;
  return request;
}

/// Pictures with and without light rays are those of the twin, and differ.
void expect_lit_as_the_twin(Renderer &renderer, TwinRenderer &twin, const FrameRequest &request) {
  const Appearance &appearance = request.light;
  renderer.render(without_light_rays(request));
  const Image8 unlit = renderer.shade(appearance);
  twin.render(request);
  EXPECT_FALSE(renderer.render(request).cancelled);
  expect_same_hits(renderer.hits(), twin.hits(), size_of(request, renderer.abilities()).width);
  EXPECT_EQ(renderer.shade(appearance).pixels, twin.shade(appearance).pixels);
  EXPECT_NE(renderer.shade(appearance).pixels, unlit.pixels);
}

void expect_scenes_lit_as_the_twin(Renderer &renderer, const CompressedVolume &volume) {
  const VolumeInfo &info = volume.info;
  const std::vector<ClipPlane> planes{through(info, 0.5, {-0.3, -1, 0.2}),
                                      through(info, 0.6, {-1, -0.1, -0.5})};
  TwinRenderer twin(volume, kSize);
  for (const std::vector<SurfaceStyle> &surfaces : kScenes) {
    for (const Clip &clip : {Clip{}, Clip{planes}, Clip{planes, false}}) {
      SCOPED_TRACE(fmt::format("{} surfaces, {} planes", surfaces.size(), clip.planes.size()));
      FrameRequest request = lit_request(info, surfaces);
      request.clip = clip;
      request.bounce_rays = clip.planes.empty() ? 0 : 4;
      expect_lit_as_the_twin(renderer, twin, request);
    }
  }
  FrameRequest request = lit_request(info, kScenes[1]);
  request.bounce_rays = 2;
  request.light.color_by = ColorByAxis{{1, 0.2, 0}, 0, 20, color_map("magma")};
  request.slices = {{{through(info, 0.4, {0.2, 1, 0.3}), 0.6f}}, -1, 1, color_map("viridis")};
  expect_lit_as_the_twin(renderer, twin, request);
}

/// The hits of layers behind the first have light rays: what a clear surface lies before is lit as
/// if the surface were not there.
void expect_light_behind_glass(Renderer &renderer, const VolumeInfo &info) {
  SurfaceStyle glass = kScenes[1][0];
  const SurfaceStyle solid = kScenes[1][1];
  glass.opacity = 1e-6f;
  const Appearance appearance = lit_request(info, {}).light;
  renderer.render(lit_request(info, {solid}));
  const Image8 alone = renderer.shade(appearance);
  renderer.render(without_light_rays(lit_request(info, {solid})));
  const Image8 unlit = renderer.shade(appearance);
  renderer.render(lit_request(info, {glass, solid}));
  const Image8 behind = renderer.shade(appearance);
  std::size_t num_differ = 0, num_lit = 0;
  for (std::size_t i = 0; i < alone.pixels.size(); ++i) {
    if (std::abs(int{alone.pixels[i]} - int{behind.pixels[i]}) > 1) ++num_differ;
    if (std::abs(int{alone.pixels[i]} - int{unlit.pixels[i]}) > 1) ++num_lit;
  }
  EXPECT_EQ(num_differ, 0u);
  EXPECT_GT(num_lit, alone.pixels.size() / 20);
}

/// Surfaces that are given as a list of one have the light of a plain frame.
void expect_plain_light(Renderer &renderer, const VolumeInfo &info) {
  FrameRequest request = lit_request(info, kScenes[0]);
  request.light.surface = kScenes[0][0].color;
  renderer.render(request);
  const Image8 listed = renderer.shade(request.light);
  request.surfaces.clear();
  request.isovalue = kScenes[0][0].isovalue;
  renderer.render(request);
  EXPECT_EQ(renderer.shade(request.light).pixels, listed.pixels);
}

/// Light that bounces within the only surface of a list is that of a plain frame, up to rounding.
void expect_plain_bounce(Renderer &renderer, const VolumeInfo &info) {
  FrameRequest request = lit_request(info, kScenes[0]);
  request.light.surface = kScenes[0][0].color;
  request.bounce_rays = 5;
  renderer.render(request);
  const Image8 listed = renderer.shade(request.light);
  request.surfaces.clear();
  request.isovalue = kScenes[0][0].isovalue;
  renderer.render(request);
  const Image8 plain = renderer.shade(request.light);
  for (std::size_t i = 0; i < plain.pixels.size(); ++i)
    ASSERT_LE(std::abs(int{plain.pixels[i]} - int{listed.pixels[i]}), 1) << i;
}

/// What a red surface sends on is red. If it has the colours of a map, it has that of the surface
/// that gets it.
void expect_light_of_the_sender(Renderer &renderer, const VolumeInfo &info) {
  FrameRequest request =
      lit_request(info, {{0.2f, {0, 1, 0}, 0.5f, true, false}, {0.6f, {1, 0, 0}, 1}});
  const auto pictures = [&](std::uint32_t bounce_rays) {
    request.ambient_rays = 4;
    request.bounce_rays = bounce_rays;
    renderer.render(request);
    return renderer.shade(request.light).pixels;
  };
  const auto changes = [&] {  // of red, green, blue
    const std::vector<std::uint8_t> before = pictures(0), after = pictures(4);
    std::array<int, 3> sums{};
    for (std::size_t i = 0; i < before.size(); ++i) {
      EXPECT_GE(after[i], before[i]);
      sums[i % 3] += after[i] - before[i];
    }
    return sums;
  };
  // The green surface has no red to show it by, and the red one is lit by itself.
  const std::array<int, 3> by_red = changes();
  EXPECT_GT(by_red[0], 500);
  EXPECT_EQ(by_red[1] + by_red[2], 0);
  request.surfaces[0].color = {1, 1, 0};
  EXPECT_GT(changes()[0], by_red[0] + 500) << "what is yellow is lit by red, too";
  request.light.color_by = ColorByAxis{{1, 0, 0}, 0, 20, color_map("gray")};
  const std::array<int, 3> by_map = changes();
  EXPECT_GT(by_map[1], 500);
  EXPECT_GT(by_map[2], 0) << "what is gray";
}

/// Two balls. The one at small x has no values above `most`.
CompressedVolume two_balls(double most) {
  VolumeInfo info = test::grid_info({48, 24, 24});
  info.type = VoxelType::kUint8;
  const std::vector<float> voxels = test::sample(info.dims, [&](const glm::dvec3 &at) {
    const auto ball = [&](double x) {
      return std::round(std::max(0.0, 255 - 25 * glm::length(at - glm::dvec3(x, 11.5, 11.5))));
    };
    return std::max(std::min(most, ball(12)), ball(36));
  });
  return test::TestVolume(info, voxels, ErrorGoal{.exact = true}).compressed;
}

/// What planes have taken away casts no shadow on a surface that they leave whole, and what they
/// have left does, though rays come from what they have taken away.
///
/// make  a renderer of a volume
template <class Make>
void expect_light_through_what_is_clipped(const Make &make) {
  const CompressedVolume volume = two_balls(255), without_core = two_balls(150);
  FrameRequest request{.camera = orbit_cameras(volume.info, 3)[1]};
  request.surfaces = {{50, {0.9f, 0.9f, 0.2f}, 0.4f, false}, {180, {0.1f, 0.4f, 0.8f}, 1, true}};
  request.light.towards_light = glm::dvec3(1, 0.1, 0.05);
  request.ambient_rays = request.shadow_rays = 2;
  const Clip clip{{{{1, 0, 0}, 24}}};
  const auto picture = [&](const CompressedVolume &of) {
    const std::unique_ptr<Renderer> renderer = make(of);
    renderer->render(request);
    return renderer->shade(request.light).pixels;
  };
  EXPECT_NE(picture(volume), picture(without_core));
  request.clip = clip;
  const std::vector<std::uint8_t> clipped = picture(volume);
  EXPECT_EQ(clipped, picture(without_core));
  request.clip.planes[0].offset = 1000;
  EXPECT_NE(clipped, picture(volume)) << "the other ball's core casts shadows";
}

TEST(LayerLightHost, PicturesAreTheTwins) {
  const CompressedVolume volume = gyroid();
  HostRenderer renderer(volume, {.largest = kSize});
  expect_scenes_lit_as_the_twin(renderer, volume);
  expect_light_behind_glass(renderer, volume.info);
  expect_plain_light(renderer, volume.info);
  expect_plain_bounce(renderer, volume.info);
  expect_light_of_the_sender(renderer, volume.info);
  expect_light_through_what_is_clipped([](const CompressedVolume &of) {
    return std::make_unique<HostRenderer>(of, HostRendererOptions{.largest = kSize});
  });
  expect_light_through_what_is_clipped(
      [](const CompressedVolume &of) { return std::make_unique<TwinRenderer>(of, kSize); });
}

class LayerLightOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  DeviceRenderer renderer_of(const CompressedVolume &volume, RendererOptions options) {
    options.max_surfaces = 4;
    options.with_bounce = true;
    return {device_, volume, options};
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, LayerLightOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(LayerLightOnDevice, SmallFrame) {
  const CompressedVolume volume = gyroid({10, 9, 12}, 6);
  DeviceRenderer renderer = renderer_of(volume, {.size = kSmall, .cache_slots = 30});
  TwinRenderer twin(volume, kSmall);
  FrameRequest request = lit_request(volume.info, kScenes[2]);
  request.clip = {{through(volume.info, 0.5, {-0.3, -1, 0.2})}};
  request.ambient_rays = request.shadow_rays = request.bounce_rays = 1;
  expect_lit_as_the_twin(renderer, twin, request);
}

TEST_P(LayerLightOnDevice, PicturesAreTheTwins) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer = renderer_of(volume, {.size = kSize});
  expect_scenes_lit_as_the_twin(renderer, volume);
  expect_light_behind_glass(renderer, volume.info);
  expect_plain_light(renderer, volume.info);
  expect_plain_bounce(renderer, volume.info);
  expect_light_of_the_sender(renderer, volume.info);
  expect_light_through_what_is_clipped([&](const CompressedVolume &of) {
    return std::make_unique<DeviceRenderer>(
        device_, of, RendererOptions{.size = kSize, .max_surfaces = 4, .with_given_rays = true});
  });
}

/// Rays wait for blocks, and pictures of all passes are looked at.
TEST_P(LayerLightOnDevice, PassByPass) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer = renderer_of(volume, {.size = kSize, .cache_slots = 60});
  FrameRequest request = lit_request(volume.info, kScenes[2]);
  request.bounce_rays = 2;
  TwinRenderer twin(volume, kSize);
  twin.render(request);
  std::uint32_t num_passes = 0;
  request.on_pass = [&](const PassStats &) {
    ++num_passes;
    renderer.shade(request.light);
    return true;
  };
  renderer.render(request);
  EXPECT_EQ(renderer.shade(request.light).pixels, twin.shade(request.light).pixels);
  ASSERT_GT(num_passes, 20u);
  for (const std::uint32_t stop : {num_passes / 4, num_passes / 2}) {
    std::uint32_t pass = 0;
    renderer.clear_cache();  // as the first frame, though the number of passes varies
    request.on_pass = [&](const PassStats &) { return ++pass < stop; };
    EXPECT_TRUE(renderer.render(request).cancelled);
    renderer.shade(request.light);
  }
  request.on_pass = {};
  renderer.render(request);
  EXPECT_EQ(renderer.shade(request.light).pixels, twin.shade(request.light).pixels);
}

}  // namespace
}  // namespace isowave::core
