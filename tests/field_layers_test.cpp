// Colours of several and translucent surfaces by a second volume: the same bits of all renderers,
// and pictures that follow from those of one surface.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "core/base/error.hpp"
#include "core/frame/field_values.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/field_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::field_of_gyroid;
using test::turned_gyroid;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{51, 37};
constexpr Appearance kPlain{.background = {0.2f, 0.3f, 0.1f}};

/// Two translucent surfaces around an opaque one.
FrameRequest request_of(const VolumeInfo &info) {
  FrameRequest request{.camera = orbit_cameras(info, 1)[0],
                       .size = kSize,
                       .light = test::by_field(),
                       .field_values = true};
  request.surfaces = {{0.2f, {0.8f, 0.2f, 0.1f}, 0.4f},
                      {-0.3f, {0.1f, 0.4f, 0.8f}, 0.3f},
                      {0.5f, {0.3f, 0.7f, 0.2f}, 1}};
  return request;
}

/// All surfaces mapped, and one that is not; clipped with caps, and values of caps alone; slices
/// with ambient rays and shadows; a given range, and a map along an axis.
std::vector<FrameRequest> requests(const VolumeInfo &info) {
  std::vector<FrameRequest> all(6, request_of(info));
  all[1].surfaces[1].mapped = false;
  all[2].clip = all[3].clip = test::far_half(info, all[0].camera);
  all[2].surfaces[0].clipped = false;
  all[3].field_on_caps = true;
  all[4].slices = {{{all[2].clip.planes[0], 0.5f}}, -0.8, 1.1, color_map("magma")};
  all[4].light.towards_light = glm::dvec3(0.2, 1, 0.3);
  all[4].ambient_rays = 2;
  all[4].shadow_rays = 1;
  all[4].surfaces[0].mapped = false;
  all[5].field_values = false;
  all[5].light = {.color_by = ColorByAxis{{0, 0, 1}, 10, 25, color_map("viridis")}};
  all[5].surfaces[2].mapped = false;
  FrameRequest given = all[0];
  given.light.color_by_field->low = -1.0;
  given.light.color_by_field->high = 2.5;
  given.normals = Normals::kCell;
  all.push_back(given);
  return all;
}

/// Draws the frames, and compares them with the twin's. Returns the layers.
std::uint64_t expect_twins_bytes(Renderer &renderer, const CompressedVolume &volume,
                                 const CompressedVolume &field) {
  std::uint64_t layers = 0;
  TwinRenderer twin(volume, kSize, kDefaultSolver, &field);
  const std::vector<FrameRequest> all = requests(volume.info);
  for (std::size_t i = 0; i < all.size(); ++i) {
    SCOPED_TRACE(fmt::format("request {}", i));
    const FrameStats expected = twin.render(all[i]), got = renderer.render(all[i]);
    EXPECT_EQ(got.layers.hits, expected.layers.hits);
    expect_same_hits(renderer.hits(), twin.hits(), kSize.ray_columns());
    EXPECT_EQ(renderer.shade(kPlain).pixels, twin.shade(kPlain).pixels);
    EXPECT_FALSE(renderer.has_field_values());
    layers += expected.layers.layers;
  }
  return layers;
}

class FieldLayersOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, FieldLayersOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(FieldLayersOnDevice, SmallFrame) {
  const CompressedVolume volume = turned_gyroid(), field = field_of_gyroid();
  constexpr ImageSize kSmall{11, 9};
  DeviceRenderer renderer(device_, volume,
                          {.size = kSmall, .cache_slots = 60, .max_surfaces = 2, .field = &field});
  TwinRenderer twin(volume, kSmall, kDefaultSolver, &field);
  FrameRequest request = request_of(volume.info);
  request.size = kSmall;
  request.surfaces.pop_back();
  twin.render(request);
  renderer.render(request);
  expect_same_hits(renderer.hits(), twin.hits(), kSmall.width);
  EXPECT_EQ(renderer.shade(kPlain).pixels, twin.shade(kPlain).pixels);
}

TEST_P(FieldLayersOnDevice, FramesAreTheTwins) {
  const CompressedVolume volume = turned_gyroid(), field = field_of_gyroid();
  RendererOptions options{.size = kSize, .max_surfaces = 3, .with_given_rays = true};
  options.field = &field;
  DeviceRenderer renderer(device_, volume, options);
  EXPECT_LE(device_.ledger().peak(), renderer.memory_plan().peak());
  EXPECT_GT(expect_twins_bytes(renderer, volume, field), 20u);
}

/// So few slots, of the volume and of the field, that hits wait for blocks.
TEST_P(FieldLayersOnDevice, FramesOfFewSlotsAreTheTwins) {
  const CompressedVolume volume = turned_gyroid(), field = field_of_gyroid();
  RendererOptions options{.size = kSize, .cache_slots = 40, .max_surfaces = 3};
  options.with_given_rays = true;
  options.field = &field;
  options.field_slots = 8;
  DeviceRenderer renderer(device_, volume, options);
  expect_twins_bytes(renderer, volume, field);
}

/// Whatever pass a frame is stopped after, the next one has the twin's bytes.
TEST_P(FieldLayersOnDevice, StopsWithThePictureSoFar) {
  const CompressedVolume volume = turned_gyroid(), field = field_of_gyroid();
  RendererOptions options{.size = kSize, .cache_slots = 40, .max_surfaces = 3};
  options.field = &field;
  options.field_slots = 8;
  DeviceRenderer renderer(device_, volume, options);
  TwinRenderer twin(volume, kSize, kDefaultSolver, &field);
  FrameRequest request = request_of(volume.info);
  twin.render(request);
  const std::vector<std::uint8_t> expected = twin.shade(kPlain).pixels;
  std::size_t num_passes = 0;
  request.on_pass = [&](const PassStats &) {
    ++num_passes;
    return true;
  };
  const FrameStats whole = renderer.render(request);
  EXPECT_GT(whole.field.passes, 2u);
  EXPECT_EQ(renderer.shade(kPlain).pixels, expected);
  std::size_t num_stopped = 0;
  for (std::size_t last = 1; last < num_passes; last += num_passes / 8) {  // their number varies
    renderer.clear_cache();
    FrameRequest stopped = request;
    stopped.on_pass = [&, calls = std::size_t{0}](const PassStats &) mutable {
      return ++calls < last;
    };
    num_stopped += renderer.render(stopped).cancelled ? 1 : 0;
    EXPECT_FALSE(renderer.shade(kPlain).pixels.empty());
    renderer.render(request);
    EXPECT_EQ(renderer.shade(kPlain).pixels, expected) << "stopped after pass " << last;
  }
  EXPECT_GT(num_stopped, 0u);
}

TEST(FieldLayers, TheHostDrawsTheTwinsBytes) {
  const CompressedVolume volume = turned_gyroid(), field = field_of_gyroid();
  HostRenderer host(volume, {.field = &field});
  EXPECT_GT(expect_twins_bytes(host, volume, field), 20u);
}

/// One opaque surface in layers has the picture of the same surface alone.
TEST(FieldLayers, OneOpaqueSurfaceIsThePlainPicture) {
  const CompressedVolume volume = turned_gyroid(), field = field_of_gyroid();
  TwinRenderer twin(volume, kSize, kDefaultSolver, &field);
  Appearance by = test::by_field();
  by.color_by_field->low = -0.5;
  by.color_by_field->high = 3.0;
  for (const bool on_caps : {false, true}) {
    FrameRequest alone = request_of(volume.info);
    alone.clip = test::far_half(volume.info, alone.camera);
    alone.field_on_caps = on_caps;
    alone.light = by;
    FrameRequest layered = alone;
    layered.surfaces = {{0.2f, by.surface, 1}};
    alone.surfaces.clear();
    alone.isovalue = 0.2f;
    twin.render(alone);
    Appearance shown = by;
    shown.background = kPlain.background;
    const std::vector<std::uint8_t> expected = twin.shade(shown).pixels;
    twin.render(layered);
    EXPECT_EQ(twin.shade(kPlain).pixels, expected);
  }
}

/// Surfaces that are not mapped have the colours of a frame without a map.
TEST(FieldLayers, SurfacesMayKeepTheirColours) {
  const CompressedVolume volume = turned_gyroid(), field = field_of_gyroid();
  TwinRenderer twin(volume, kSize, kDefaultSolver, &field);
  FrameRequest mapped = request_of(volume.info), own = mapped, without = mapped;
  for (SurfaceStyle &surface : own.surfaces) surface.mapped = false;
  without.light = {};
  without.field_values = false;
  const auto pixels_of = [&](const FrameRequest &request) {
    twin.render(request);
    return twin.shade(kPlain).pixels;
  };
  EXPECT_EQ(pixels_of(own), pixels_of(without));
  EXPECT_NE(pixels_of(mapped), pixels_of(without));
}

/// Without a range, colours go from the field's least value to its largest.
TEST(FieldLayers, ColoursGoFromTheLeastToTheLargestOfTheField) {
  const CompressedVolume volume = turned_gyroid();
  CompressedVolume field = field_of_gyroid();
  HostRenderer host(volume, {.field = &field});
  FrameRequest request = request_of(volume.info);
  host.render(request);
  const std::vector<std::uint8_t> expected = host.shade(kPlain).pixels;
  request.light.color_by_field->low = field.value_range[0];
  request.light.color_by_field->high = field.value_range[1];
  host.render(request);
  EXPECT_EQ(host.shade(kPlain).pixels, expected);
  request.light.color_by_field->high = field.value_range[1] + 1.0;
  host.render(request);
  EXPECT_NE(host.shade(kPlain).pixels, expected);
  field.value_range = kUnknownRange;
  HostRenderer unknown(volume, {.field = &field});
  unknown.render(request);
  request.light.color_by_field->low.reset();
  EXPECT_THAT([&] { unknown.render(request); },
              ThrowsMessage<Error>(HasSubstr("of the field are not known: give the values")));
}

}  // namespace
}  // namespace isowave::core
