// Several and translucent surfaces on devices: layers, pictures and counts of the twin. The twin
// itself is judged by layer_frames_test.cpp.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/error.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "kernels_cl/portable/clip.h"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{43, 31};

CompressedVolume compressed(const VolumeInfo &info, const std::vector<float> &voxels) {
  ArrayReader reader(info, voxels);
  return compress(reader, {.rate = 9});
}

VolumeInfo placed_grid(const glm::uvec3 &dims) {
  VolumeInfo info = test::grid_info(dims);
  info.spacing = {0.5, 0.7, 0.4};
  info.origin = {3, -20, 11};
  return info;
}

CompressedVolume gyroid() {
  const VolumeInfo info = placed_grid({40, 37, 44});
  return compressed(info, test::sample(info.dims, test::gyroid_field(11)));
}

CompressedVolume noise_with_gaps() {
  const VolumeInfo info = placed_grid({40, 37, 44});
  std::vector<float> voxels = test::sample(info.dims, test::noise_field(5));
  for (std::size_t i = 0; i < voxels.size(); i += 97) voxels[i] = NAN;
  return compressed(info, voxels);
}

/// Eight surfaces, not in the order of their isovalues.
std::vector<SurfaceStyle> eight_surfaces() {
  std::vector<SurfaceStyle> surfaces;
  for (int i = 0; i < 8; ++i) {
    const float isovalue = 0.1f + 0.1f * static_cast<float>(i * 3 % 8);
    surfaces.push_back({isovalue, {0.1f * static_cast<float>(i), 0.5f, 0.9f}, i == 5 ? 1 : 0.15f});
  }
  return surfaces;
}

const std::vector<std::vector<SurfaceStyle>> kScenes{
    {{0.4f, {0.8f, 0.2f, 0.1f}, 1}},                                    // one, opaque
    {{0.4f, {0.8f, 0.2f, 0.1f}, 0.05f}},                                // more layers than drawn
    {{0.2f, {0.9f, 0.9f, 0.2f}, 0.3f}, {0.6f, {0.1f, 0.4f, 0.8f}, 1}},  // one within another
    {{0.6f, {0.1f, 0.4f, 0.8f}, 0.5f}, {0.2f, {0.9f, 0.9f, 0.2f}, 0.25f}},  // the other way round
    eight_surfaces()};

std::vector<Camera> cameras_of(const VolumeInfo &info) {
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0;
  std::vector<Camera> all = orbit_cameras(info, 1);
  Camera within = all.front();
  within.eye = info.origin + info.index_to_world() * (0.3 * last);
  all.push_back(within);
  Camera parallel = all.front();
  parallel.parallel_height = 0.8 * glm::distance(parallel.eye, parallel.at);
  all.push_back(parallel);
  return all;
}

std::vector<Clip> clips_of(const VolumeInfo &info) {
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0;
  const auto through = [&](const glm::dvec3 &index, const glm::dvec3 &normal) -> ClipPlane {
    return {normal, glm::dot(normal, info.origin + info.index_to_world() * index)};
  };
  const std::vector<ClipPlane> planes{through(0.5 * last, {-0.3, -1, 0.2}),
                                      through(0.6 * last, {-1, -0.1, -0.5})};
  return {{}, {planes}, {planes, false}};
}

struct Seen {
  std::uint64_t layers = 0, hits = 0, cut = 0, caps = 0, second_crossings = 0;
};

/// Draws all scenes from all cameras, and clipped from the first.
Seen check(Renderer &renderer, const CompressedVolume &volume, Normals normals) {
  Seen seen;
  TwinRenderer twin(volume, kSize);
  for (const std::vector<SurfaceStyle> &surfaces : kScenes) {
    for (const Camera &camera : cameras_of(volume.info)) {
      for (const Clip &clip : clips_of(volume.info)) {
        if (!clip.planes.empty() && camera != orbit_cameras(volume.info, 1)[0]) continue;
        SCOPED_TRACE(fmt::format("{} surfaces, {} planes", surfaces.size(), clip.planes.size()));
        FrameRequest request{.camera = camera, .size = kSize, .clip = clip, .surfaces = surfaces};
        request.normals = normals;
        const FrameStats expected = twin.render(request), got = renderer.render(request);
        EXPECT_EQ(got.layers.layers, expected.layers.layers);
        EXPECT_EQ(got.layers.hits, expected.layers.hits);
        EXPECT_EQ(got.layers.rays_cut, expected.layers.rays_cut);
        EXPECT_EQ(got.rays_hit, expected.rays_hit);
        EXPECT_FALSE(got.cancelled);
        expect_same_hits(renderer.hits(), twin.hits(), kSize.width);
        for (const bool transparent : {false, true}) {
          const Appearance appearance{.background = {0.2f, 0.3f, 0.1f},
                                      .transparent = transparent,
                                      .background_top = glm::vec3(0.9f, 0, 0.5f)};
          EXPECT_EQ(renderer.shade(appearance).pixels, twin.shade(appearance).pixels);
        }
        seen.layers = std::max<std::uint64_t>(seen.layers, got.layers.layers);
        seen.hits += got.layers.hits;
        seen.cut += got.layers.rays_cut;
        seen.caps += static_cast<std::uint64_t>(std::ranges::count_if(twin.hits(), is_cap));
      }
    }
  }
  return seen;
}

void expect_seen(const Seen &seen) {
  EXPECT_EQ(seen.layers, ISO_MAX_LAYERS);
  EXPECT_GT(seen.hits, 50'000u);
  EXPECT_GT(seen.cut, 100u);
  EXPECT_GT(seen.caps, 300u);
}

class LayersOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  Seen check_device(const CompressedVolume &volume, RendererOptions options,
                    Normals normals = Normals::kSmooth) {
    options.size = kSize;
    options.max_surfaces = 8;
    DeviceRenderer renderer(device_, volume, options);
    return check(renderer, volume, normals);
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, LayersOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(LayersOnDevice, SmallFrames) {
  const VolumeInfo info = placed_grid({14, 13, 17});
  const auto volume = compressed(info, test::sample(info.dims, test::gyroid_field(6)));
  constexpr ImageSize kSmall{11, 9};
  DeviceRenderer renderer(device_, volume, {.size = kSmall, .cache_slots = 30, .max_surfaces = 2});
  TwinRenderer twin(volume, kSmall);
  for (const std::size_t scene : {1, 2}) {
    const FrameRequest request{.camera = orbit_cameras(info, 1)[0], .surfaces = kScenes[scene]};
    twin.render(request);
    renderer.render(request);
    expect_same_hits(renderer.hits(), twin.hits(), kSmall.width);
    EXPECT_EQ(renderer.shade().pixels, twin.shade().pixels);
  }
}

TEST_P(LayersOnDevice, FramesAreTheTwins) {
  expect_seen(check_device(gyroid(), {}));
  check_device(noise_with_gaps(), {}, Normals::kCell);
}

/// With so few slots that most rays wait, and go on one by one.
TEST_P(LayersOnDevice, FramesOfFewSlotsAreTheTwins) {
  expect_seen(check_device(gyroid(), {.cache_slots = 40}));
}

TEST_P(LayersOnDevice, FramesWithoutPacketsAreTheTwins) {
  expect_seen(check_device(gyroid(), {.packets = RayPackets::kOff}));
}

/// The stream may stay on the host, and a ray may have several of its rays in one pixel.
TEST_P(LayersOnDevice, SamplesOfAVolumeOnTheHost) {
  const CompressedVolume volume = gyroid();
  const ImageSize size{20, 15, 3};
  DeviceRenderer renderer(device_, volume,
                          {.size = size, .stream = StreamPlace::kHost, .max_surfaces = 2});
  TwinRenderer twin(volume, size);
  const FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0], .surfaces = kScenes[2]};
  twin.render(request);
  renderer.render(request);
  expect_same_hits(renderer.hits(), twin.hits(), size.ray_columns());
  for (const bool transparent : {false, true})
    EXPECT_EQ(renderer.shade({.transparent = transparent}).pixels,
              twin.shade({.transparent = transparent}).pixels);
}

TEST_P(LayersOnDevice, OneOpaqueSurfaceIsThePlainPicture) {
  const CompressedVolume volume = gyroid();
  for (const std::uint32_t samples : {1u, 2u, 3u}) {
    DeviceRenderer renderer(device_, volume, {.size = {24, 18, samples}, .max_surfaces = 1});
    FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0], .isovalue = 0.4f};
    const Appearance appearance{.background = {0.3f, 0.4f, 0.5f}};
    Appearance transparent = appearance;
    transparent.transparent = true;
    renderer.render(request);
    const Image8 plain = renderer.shade(appearance), clear = renderer.shade(transparent);
    request.surfaces = {{0.4f, appearance.surface, 1}};
    request.light = appearance;
    renderer.render(request);
    EXPECT_EQ(renderer.shade(appearance).pixels, plain.pixels);
    EXPECT_EQ(renderer.shade(transparent).pixels, clear.pixels);
    request.surfaces.clear();
    renderer.render(request);
    EXPECT_EQ(renderer.shade(appearance).pixels, plain.pixels);
  }
}

/// The surface is in blocks far behind the cap: a ray that goes on there begins outside their box.
TEST_P(LayersOnDevice, GoesOnFarBehindACap) {
  const VolumeInfo info = test::grid_info({64, 14, 15});
  const auto volume =
      compressed(info, test::sample(info.dims, [](const glm::dvec3 &at) { return 50.3 - at.x; }));
  constexpr ImageSize kFew{12, 10};
  DeviceRenderer renderer(device_, volume, {.size = kFew, .max_surfaces = 1});
  TwinRenderer twin(volume, kFew);
  FrameRequest request{.camera = test::camera_along({-9, 6.6, 7.3}, {1, 0.02, 0.03})};
  request.surfaces = {{0, {0.8f, 0.2f, 0.1f}, 0.3f}};
  request.clip = {{{{1, 0, 0}, 5.5}}};
  twin.render(request);
  const FrameStats stats = renderer.render(request);
  EXPECT_EQ(stats.layers.layers, 2u);
  expect_same_hits(renderer.hits(), twin.hits(), kFew.width);
  EXPECT_EQ(renderer.shade().pixels, twin.shade().pixels);
}

/// The rays that may hit the first surface, which planes leave whole, are few.
TEST_P(LayersOnDevice, AClippedSurfaceAroundAWholeOne) {
  const VolumeInfo info = test::grid_info({60, 60, 60});
  const auto volume = compressed(info, test::sample(info.dims, [](const glm::dvec3 &at) {
                                   return -glm::length(at - glm::dvec3(29.5));
                                 }));
  constexpr ImageSize kWide{64, 48};
  DeviceRenderer renderer(device_, volume, {.size = kWide, .max_surfaces = 2});
  TwinRenderer twin(volume, kWide);
  FrameRequest request{.camera = test::camera_along({29, 31, -20}, {0, 0, 1})};
  request.surfaces = {{-27, {0.8f, 0.2f, 0.1f}, 1}, {-4, {0.1f, 0.9f, 0.1f}, 1, false}};
  request.clip = {{{{0, 0, 1}, 28.5}}};
  twin.render(request);
  const FrameStats stats = renderer.render(request);
  EXPECT_GT(stats.rays_hit, kWide.num_rays() / 2);
  expect_same_hits(renderer.hits(), twin.hits(), kWide.width);
  EXPECT_EQ(renderer.shade().pixels, twin.shade().pixels);
}

/// Pictures during a frame change nothing, and a frame that is stopped has one, too.
TEST_P(LayersOnDevice, StopsWithThePictureSoFar) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(device_, volume, {.size = kSize, .cache_slots = 60, .max_surfaces = 2});
  FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0], .surfaces = kScenes[2]};
  renderer.render(request);
  const std::vector<std::uint8_t> whole = renderer.shade().pixels;
  const std::vector<HitRecord> hits = renderer.hits();
  std::uint32_t num_passes = 0;
  std::vector<std::uint8_t> last;
  request.on_pass = [&](const PassStats &) {
    ++num_passes;
    last = renderer.shade().pixels;
    renderer.hits();
    return true;
  };
  EXPECT_FALSE(renderer.render(request).cancelled);
  EXPECT_EQ(renderer.shade().pixels, whole);
  expect_same_hits(renderer.hits(), hits, kSize.width);
  ASSERT_GT(num_passes, 10u);
  // The very first pass may find no block in the cache, and the number of passes varies.
  for (const std::uint32_t stop : {num_passes / 4, num_passes / 2}) {
    std::uint32_t pass = 0;
    request.on_pass = [&](const PassStats &) { return ++pass < stop; };
    EXPECT_TRUE(renderer.render(request).cancelled);
    EXPECT_NE(renderer.shade().pixels, std::vector<std::uint8_t>(whole.size(), 255)) << stop;
  }
  request.on_pass = {};
  renderer.render(request);
  EXPECT_EQ(renderer.shade().pixels, whole);
}

TEST_P(LayersOnDevice, RefusesWhatItWasNotMadeFor) {
  const CompressedVolume volume = gyroid();
  const FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0], .surfaces = kScenes[2]};
  DeviceRenderer none(device_, volume, {.size = kSize});
  EXPECT_THAT([&] { none.render(request); }, ThrowsMessage<Error>(HasSubstr("with_surfaces")));
  DeviceRenderer one(device_, volume, {.size = kSize, .max_surfaces = 1});
  EXPECT_THAT([&] { one.render(request); },
              ThrowsMessage<Error>(HasSubstr("made for 1 surface, and 2 are given")));
  for (const auto &options :
       {RendererOptions{.size = kSize, .pipeline = blocks_pipeline(), .max_surfaces = 2},
        RendererOptions{.size = kSize, .solver = {0, 4}, .max_surfaces = 2},
        RendererOptions{.size = kSize, .max_surfaces = 9}})
    EXPECT_THROW(DeviceRenderer(device_, volume, options), Error);
}

/// A renderer that draws one surface alone takes no byte for others.
TEST_P(LayersOnDevice, SurfacesTakeMemoryOnlyIfTheyMayCome) {
  const CompressedVolume volume = gyroid();
  const DeviceRenderer none(device_, volume, {.size = kSize, .cache_slots = 60}),
      two(device_, volume, {.size = kSize, .cache_slots = 60, .max_surfaces = 2});
  const std::uint64_t per_ray =
      3 * sizeof(HitRecord) + sizeof(RayColor) + 2 * sizeof(uint) + sizeof(float) + sizeof(uchar);
  EXPECT_GT(two.memory_bytes(), none.memory_bytes() + per_ray * kSize.num_rays());
  EXPECT_LT(two.memory_bytes(), none.memory_bytes() + per_ray * kSize.num_rays() + 3500);
}

}  // namespace
}  // namespace isowave::core
