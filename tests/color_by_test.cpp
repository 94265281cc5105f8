// Colours along an axis: what a colour map shows where, and the same bytes of all renderers.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/view/color_maps.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{51, 37};
const glm::dvec3 kAxis(1, -2, 4);

CompressedVolume gyroid() {
  VolumeInfo info = test::grid_info({30, 27, 34});
  info.spacing = {0.5, 0.7, 0.4};
  info.origin = {300, -20, 11};
  info.direction = glm::dmat3({0.8, 0.6, 0}, {-0.6, 0.8, 0}, {0, 0, 1});
  ArrayReader reader(info, test::sample(info.dims, test::gyroid_field(11)));
  return compress(reader, {.rate = 12, .levels = 0});
}

/// Light from all around alone: surfaces have the map's colours.
Appearance flat(const VolumeInfo &info, std::string_view map) {
  const auto [low, high] = range_along(info, kAxis);
  return {.ambient = 1,
          .diffuse = 0,
          .specular = 0,
          .above = 0,
          .color_by = ColorByAxis{kAxis, low, high, color_map(map)}};
}

std::vector<FrameRequest> requests(const VolumeInfo &info) {
  const Camera camera = orbit_cameras(info, 1)[0];
  Camera parallel = camera;
  parallel.parallel_height = 0.8 * glm::distance(camera.eye, camera.at);
  FrameRequest plain{.camera = camera, .isovalue = 0.2f, .size = kSize};
  FrameRequest levels = plain, layers = plain;
  levels.camera = parallel;
  levels.voxel_pixels = 3;
  layers.surfaces = {{.isovalue = 0.2f, .opacity = 0.4f}, {.isovalue = 0.5f}};
  layers.light = flat(info, "gray");
  return {plain, levels, layers};
}

TEST(ColorBy, ShowsWhereHitsAre) {
  const CompressedVolume volume = gyroid();
  TwinRenderer twin(volume, kSize);
  const Appearance appearance = flat(volume.info, "gray");
  const ColorByAxis &by = *appearance.color_by;
  std::size_t num_hits = 0;
  std::array<int, 4> quarters{};
  for (std::size_t i = 0; i < 2; ++i) {
    twin.render(requests(volume.info)[i]);
    const FrameArrays arrays = twin.fetch({.picture = true, .positions = true}, appearance);
    for (std::size_t pixel = 0; pixel < kSize.num_pixels(); ++pixel) {
      const auto [x, y, z] = arrays.positions[pixel];
      if (std::isnan(x)) continue;
      const double along = glm::dot(glm::normalize(kAxis), glm::dvec3(x, y, z));
      const double expected = 255 * (along - by.low) / (by.high - by.low);
      EXPECT_NEAR(arrays.picture[3 * pixel], expected, 0.51);
      EXPECT_EQ(arrays.picture[3 * pixel], arrays.picture[3 * pixel + 2]);
      ++num_hits;
      ++quarters[std::min(3, int(expected / 64))];
    }
  }
  EXPECT_GT(num_hits, 1000u);
  for (const int of_quarter : quarters) EXPECT_GT(of_quarter, 20);
}

TEST(ColorBy, ColoursBeyondTheRangeAreTheLastOnes) {
  const CompressedVolume volume = gyroid();
  TwinRenderer twin(volume, kSize);
  twin.render(requests(volume.info)[0]);
  Appearance appearance = flat(volume.info, "magma");
  const std::array<std::uint32_t, 256> colors = color_map("magma");
  for (const bool above : {true, false}) {
    appearance.color_by->low = above ? 1000 : -1001;
    appearance.color_by->high = appearance.color_by->low + 1;
    const std::uint32_t expected = colors[above ? 0 : 255];
    const FrameArrays arrays = twin.fetch({.picture = true, .depth = true}, appearance);
    for (std::size_t pixel = 0; pixel < kSize.num_pixels(); ++pixel) {
      if (std::isinf(arrays.depth[pixel])) continue;
      for (std::size_t channel = 0; channel < 3; ++channel)
        ASSERT_EQ(arrays.picture[3 * pixel + channel], expected >> 8 * channel & 255);
    }
  }
}

TEST(ColorBy, MayGoFromHighToLow) {
  const CompressedVolume volume = gyroid();
  TwinRenderer twin(volume, kSize);
  twin.render(requests(volume.info)[0]);
  Appearance appearance = flat(volume.info, "gray");
  const Image8 up = twin.shade(appearance);
  std::swap(appearance.color_by->low, appearance.color_by->high);
  const Image8 down = twin.shade(appearance);
  const std::vector<float> depth = twin.depth();
  for (std::size_t pixel = 0; pixel < depth.size(); ++pixel) {
    if (std::isinf(depth[pixel])) continue;
    EXPECT_NEAR(up.pixels[3 * pixel] + down.pixels[3 * pixel], 255, 1);
  }
}

TEST(ColorBy, TheHostDrawsTheTwinsBytes) {
  const CompressedVolume volume = gyroid();
  TwinRenderer twin(volume, kSize);
  HostRenderer host(volume);
  const Appearance appearance = flat(volume.info, "viridis");
  for (const FrameRequest &request : requests(volume.info)) {
    twin.render(request);
    host.render(request);
    EXPECT_EQ(host.shade(appearance).pixels, twin.shade(appearance).pixels);
  }
}

TEST(ColorBy, RefusesWhatCannotBeShown) {
  const double inf = std::numeric_limits<double>::infinity();
  for (const auto &[low, high] : {std::pair{1.0, 1.0}, {0.0, inf}, {std::nan(""), 1.0}}) {
    EXPECT_THAT([&] { check_color_by({.low = low, .high = high}); },
                ThrowsMessage<Error>(HasSubstr("give two numbers that differ")));
  }
  for (const glm::dvec3 axis : {glm::dvec3(0), glm::dvec3(inf, 0, 0)}) {
    EXPECT_THAT([&] { check_color_by({.axis = axis}); },
                ThrowsMessage<Error>(HasSubstr("direction")));
  }
  EXPECT_THAT([] { color_map("jet"); },
              ThrowsMessage<Error>("there is no colour map 'jet': viridis, magma, cividis, "
                                   "coolwarm, gray, labels"));
}

TEST(ColorMaps, EndWhereTheirAuthorsSay) {
  const auto ends = [](std::string_view name) {
    const auto colors = color_map(name);
    return std::pair{colors.front(), colors.back()};
  };
  EXPECT_EQ(ends("viridis"), std::pair(0x540144u, 0x25e7fdu));
  EXPECT_EQ(ends("magma"), std::pair(0x040000u, 0xbffdfcu));
  EXPECT_EQ(ends("cividis"), std::pair(0x4e2200u, 0x38e8feu));
  EXPECT_EQ(ends("coolwarm"), std::pair(0xc04c3bu, 0x2604b4u));
  EXPECT_EQ(ends("gray"), std::pair(0u, 0xffffffu));
}

class ColorByOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, ColorByOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(ColorByOnDevice, DrawsTheTwinsBytes) {
  const CompressedVolume volume = gyroid();
  TwinRenderer twin(volume, kSize);
  DeviceRenderer renderer(device_, volume, {.size = kSize, .with_levels = true, .max_surfaces = 2});
  for (const FrameRequest &request : requests(volume.info)) {
    twin.render(request);
    renderer.render(request);
    for (const char *map : {"viridis", "coolwarm"}) {
      const Appearance appearance = flat(volume.info, map);
      EXPECT_EQ(renderer.shade(appearance).pixels, twin.shade(appearance).pixels);
    }
    EXPECT_EQ(renderer.shade().pixels, twin.shade().pixels);
  }
}

}  // namespace
}  // namespace isowave::core
