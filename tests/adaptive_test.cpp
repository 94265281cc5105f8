// Adaptive samples: which pixels get more rays, and their colours, against whole pictures of many
// rays and of one.

#include "core/accuracy/adaptive_renderer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/accuracy/pixels_to_refine.hpp"
#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

constexpr float kIsovalue = 0.1f;
constexpr ImageSize kSize{24, 18, 3};

// ---- which pixels

/// A grey picture [rows][columns].
std::vector<std::uint8_t> grey(const std::vector<int> &values) {
  std::vector<std::uint8_t> rgb;
  for (const int value : values) rgb.insert(rgb.end(), 3, static_cast<std::uint8_t>(value));
  return rgb;
}

TEST(PixelsToRefine, AreThoseOnBothSidesOfAStep) {
  constexpr int kLow = 100, kHigh = kLow + kLargestDifference + 1;
  EXPECT_THAT(pixels_to_refine({4, 2}, grey({kLow, kLow, kHigh, kHigh,  //
                                             kLow, kLow, kHigh, kHigh})),
              ElementsAre(1, 2, 5, 6));
  EXPECT_THAT(pixels_to_refine({2, 3}, grey({kLow, kLow, kLow, kLow, kHigh, kHigh})),
              ElementsAre(2, 3, 4, 5));
}

TEST(PixelsToRefine, AreNoneIfNeighboursDifferByNoMoreThanTheLargestDifference) {
  constexpr int kStep = kLargestDifference;
  EXPECT_THAT(pixels_to_refine({3, 2}, grey({0, kStep, 2 * kStep, 0, kStep, 2 * kStep})),
              IsEmpty());
}

/// Each of the eight neighbours counts, and none beyond a row's end.
TEST(PixelsToRefine, AreOnePixelAndItsNeighbours) {
  std::vector<int> values(25, 50);
  values[12] = 250;
  EXPECT_THAT(pixels_to_refine({5, 5}, grey(values)), ElementsAre(6, 7, 8, 11, 12, 13, 16, 17, 18));
  std::vector<int> at_the_end(9, 50);
  at_the_end[5] = 0;
  EXPECT_THAT(pixels_to_refine({3, 3}, grey(at_the_end)), ElementsAre(1, 2, 4, 5, 7, 8));
}

TEST(PixelsToRefine, DifferInAnyChannel) {
  for (std::size_t channel = 0; channel < 3; ++channel) {
    std::vector<std::uint8_t> rgb(6, 10);
    rgb[channel] = 10 + kLargestDifference + 1;
    EXPECT_THAT(pixels_to_refine({2, 1}, rgb), ElementsAre(0, 1)) << channel;
  }
  EXPECT_THAT(pixels_to_refine({1, 1}, grey({7})), IsEmpty());
}

// ---- their colours

/// A ball with a dent: silhouettes and smooth parts.
double ball(const glm::dvec3 &voxel) {
  const glm::dvec3 at = voxel - glm::dvec3(9, 8.5, 8);
  return 6 - glm::length(at) - 2 * std::exp(-glm::length(at - glm::dvec3(3, 1, 5)));
}

struct Scene {
  TestVolume volume{test::grid_info({19, 18, 17}, {1, 1.5, 0.75}), test::sample({19, 18, 17}, ball),
                    12};
  FrameRequest request{camera(), kIsovalue, kSize};

  /// A part of the ball fills half of the picture.
  Camera camera() const {
    Camera result = orbit_cameras(volume.info(), 1)[0];
    result.fovy_deg = 20;
    result.at += glm::dvec3(5, 0, -2);
    return result;
  }

  FrameRequest adaptive() const {
    FrameRequest result = request;
    result.adaptive = true;
    return result;
  }
  FrameRequest one_ray() const {
    FrameRequest result = request;
    result.size->samples = 1;
    return result;
  }
};

/// The picture by two whole ones of the twin: of all rays where pixels differ, else of one ray.
Image8 expected_picture(const Scene &scene, const Appearance &appearance) {
  TwinRenderer twin(scene.volume.compressed, kSize);
  twin.render(scene.one_ray());
  const Image8 judged = twin.shade(), first = twin.shade(appearance);
  twin.render(scene.request);
  Image8 picture = twin.shade(appearance);
  const std::vector<std::uint32_t> refined = pixels_to_refine(kSize, judged.pixels);
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
    if (!std::ranges::binary_search(refined, i / 3)) picture.pixels[i] = first.pixels[i];
  }
  return picture;
}

/// Highlights differ within pixels whose neighbours are alike in the default appearance.
const Appearance kShiny{{0.2f, 0.4f, 1.0f}, {0, 0, 0}, 0.1f, 0.5f, 9.0f};

/// Draws the scene adaptively.
void expect_adaptive(Renderer &inner, const Scene &scene) {
  AdaptiveRenderer renderer(inner);
  const FrameStats stats = renderer.render(scene.adaptive());
  EXPECT_GT(stats.refined_pixels, kSize.num_pixels() / 20) << "the scene has silhouettes";
  EXPECT_LT(stats.refined_pixels, kSize.num_pixels() / 2) << "and smooth parts";
  for (const Appearance &appearance : {Appearance{}, kShiny})
    EXPECT_EQ(renderer.shade(appearance).pixels, expected_picture(scene, appearance).pixels);
  // All else is of the first rays.
  const FrameArrays arrays = renderer.fetch({.depth = true, .normals = true}, {});
  EXPECT_EQ(arrays.depth.size(), kSize.num_pixels());
  EXPECT_EQ(arrays.normals.size(), kSize.num_pixels());
  TwinRenderer twin(scene.volume.compressed, kSize);
  twin.render(scene.one_ray());
  test::expect_same_hits(renderer.hits(), twin.hits(), kSize.width);
  // The next frame has nothing of it.
  renderer.render(scene.one_ray());
  EXPECT_EQ(renderer.shade().pixels, twin.shade().pixels);
  twin.render(scene.request);
  EXPECT_NE(expected_picture(scene, kShiny).pixels, twin.shade(kShiny).pixels)
      << "some keep one ray";
}

TEST(AdaptiveRenderer, DrawsBothPicturesOnTheHost) {
  const Scene scene;
  HostRenderer renderer(scene.volume.compressed);
  expect_adaptive(renderer, scene);
}

TEST(AdaptiveRenderer, DrawsBothPicturesByTheTwin) {
  const Scene scene;
  TwinRenderer renderer(scene.volume.compressed, kSize);
  expect_adaptive(renderer, scene);
}

/// With so little memory, a thread traces alone, ray by ray.
TEST(AdaptiveRenderer, DrawsTheSameOnTheHostInTheLeastMemory) {
  const Scene scene;
  HostRenderer renderer(scene.volume.compressed,
                        {.memory_limit = HostLevels::least_bytes(scene.volume.compressed)});
  expect_adaptive(renderer, scene);
}

class AdaptiveOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, AdaptiveOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// A device's renderer needs room for one ray a pixel alone.
TEST_P(AdaptiveOnDevice, SmallPictureIsBothPictures) {
  const Scene scene;
  ocl::Device device(GetParam());
  DeviceRenderer renderer(device, scene.volume.compressed,
                          {.size = {kSize.width, kSize.height}, .with_given_rays = true});
  expect_adaptive(renderer, scene);
}

/// Fewer bit planes and gradients of cells are those of the request in all rays.
TEST(AdaptiveRenderer, KeepsTheRequestsFieldAndNormals) {
  Scene scene;
  scene.request.voxel_error = 0.05;
  scene.request.normals = Normals::kCell;
  HostRenderer host(scene.volume.compressed);
  TwinRenderer twin(scene.volume.compressed, kSize);
  AdaptiveRenderer on_host(host), by_twin(twin);
  on_host.render(scene.adaptive());
  const FrameStats stats = by_twin.render(scene.adaptive());
  EXPECT_GT(stats.refined_pixels, 0u);
  EXPECT_EQ(on_host.shade().pixels, by_twin.shade().pixels);
  EXPECT_NE(on_host.shade().pixels, expected_picture(Scene{}, {}).pixels);
}

TEST(AdaptiveRenderer, StopsWhenOnPassSaysSo) {
  const Scene scene;
  HostRenderer host(scene.volume.compressed);
  AdaptiveRenderer renderer(host);
  FrameRequest request = scene.adaptive();
  int passes = 0;
  request.on_pass = [&](const PassStats &) { return ++passes < 1; };
  const FrameStats stats = renderer.render(request);
  EXPECT_TRUE(stats.cancelled);
  EXPECT_FALSE(stats.complete);
  EXPECT_EQ(stats.refined_pixels, 0u);
  request.on_pass = [&](const PassStats &) { return true; };
  EXPECT_TRUE(renderer.render(request).complete);
  EXPECT_EQ(renderer.shade().pixels, expected_picture(scene, {}).pixels);
}

TEST(AdaptiveRenderer, RefusesWhatItCannotDrawInOneLine) {
  const Scene scene;
  HostRenderer host(scene.volume.compressed);
  AdaptiveRenderer renderer(host);
  const auto expect_refused = [&](Renderer &by, const FrameRequest &request, const char *says) {
    EXPECT_THAT([&] { by.render(request); }, ThrowsMessage<Error>(HasSubstr(says)));
  };
  expect_refused(host, scene.adaptive(), "this renderer has no adaptive samples");
  FrameRequest request = scene.adaptive();
  request.size->samples = 1;
  expect_refused(renderer, request, "give samples from 2 on");
  request.size->samples = 9;
  expect_refused(renderer, request, "9 x 9 rays a pixel cannot be drawn");
  request = scene.adaptive();
  request.ambient_rays = 1;
  expect_refused(renderer, request, "adaptive samples have no ambient rays");
  request = scene.adaptive();
  request.voxel_pixels = 1;
  expect_refused(renderer, request, "leave out voxel_pixels");
  request = scene.adaptive();
  request.max_surface_error = 1;
  expect_refused(renderer, request, "leave out max_surface_error");
  request = scene.adaptive();
  request.time_budget_ms = 1;
  expect_refused(renderer, request, "adaptive samples keep no time");
}

}  // namespace
}  // namespace isowave::core
