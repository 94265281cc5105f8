// Frames on the host of fewer bit planes, of bounds of the field, within an error and within a
// time: the bits of the twin and of devices.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/accuracy/bounded_renderer.hpp"
#include "core/accuracy/with_choices.hpp"
#include "core/base/error.hpp"
#include "core/frame/timed_renderer.hpp"
#include "core/host/host_renderer.hpp"
#include "core/platform/memory.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin.hpp"
#include "tests/api_support.hpp"
#include "tests/bounds_scene.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::BoundsScene;
using test::error_of;
using test::expect_same_hits;
using testing::HasSubstr;

constexpr ImageSize kSize{43, 31};

/// Draws the volume and its bounds with all detail and less of it. Returns the number of hits.
std::uint64_t check(const CompressedVolume &volume, float isovalue,
                    const HostRendererOptions &options = {}) {
  HostRenderer renderer(volume, options);
  const std::vector<Camera> cameras = orbit_cameras(volume.info, 2);
  std::uint64_t hits = 0;
  for (const double voxel_pixels : {0.0, 2.0}) {
    for (const double voxel_error : {0.0, 0.02, 0.3}) {
      for (const FieldBound bound : {FieldBound::kNone, FieldBound::kLower, FieldBound::kUpper}) {
        SCOPED_TRACE(fmt::format("{} pixels, error {}, bound {}", voxel_pixels, voxel_error,
                                 static_cast<int>(bound)));
        const Twin twin(volume, voxel_pixels, voxel_error, bound);
        for (const Camera &camera : cameras) {
          const FrameStats stats = renderer.render({.camera = camera,
                                                    .isovalue = isovalue,
                                                    .size = kSize,
                                                    .voxel_pixels = voxel_pixels,
                                                    .voxel_error = voxel_error,
                                                    .bound = bound});
          expect_same_hits(renderer.hits(), twin.render(camera, kSize, isovalue), kSize.width);
          hits += stats.rays_hit;
        }
      }
    }
  }
  return hits;
}

TEST(HostValues, FramesAreTheTwins) {
  for (const glm::uvec3 dims : {glm::uvec3(40, 37, 44), {33, 9, 18}}) {
    for (const CompressOptions &options :
         {CompressOptions{.rate = 6},
          CompressOptions{.precision = BlockPrecision{.min_exponent = -6}}}) {
      EXPECT_GT(check(BoundsScene(dims, test::gyroid_field(11), options).volume, 0.4f), 5000u);
      EXPECT_GT(check(BoundsScene(dims, test::noise_field(5), options).volume, 0.4f), 5000u);
    }
  }
}

TEST(HostValues, WholeNumbers) {
  const BoundsScene scene("fuel_64x33x32_uint8.raw.gz",
                          {.precision = BlockPrecision{.min_exponent = 1, .whole_numbers = true}});
  EXPECT_GT(check(scene.volume, 60), 1000u);
}

TEST(HostValues, VoxelsWithoutData) {
  const glm::uvec3 dims(34, 29, 31);
  for (const test::NamedHole &hole : test::holes(dims)) {
    SCOPED_TRACE(hole.name);
    const std::vector<float> voxels =
        test::with_hole(dims, test::sample(dims, test::gyroid_field(11)), hole.hole);
    if (std::ranges::all_of(voxels, [](float voxel) { return std::isnan(voxel); })) continue;
    check(test::compressed(dims, voxels, {.rate = 12, .measure_error = true, .levels = 0}), 0.3f);
  }
}

TEST(HostValues, AnyLimitGivesTheSameBits) {
  const BoundsScene scene({40, 31, 33}, test::gyroid_field(13), {.rate = 9});
  std::uint64_t least = HostBlocks::ray_bytes();
  for (const VolumeInfo &info : level_infos(scene.volume, true)) least += HostBlocks::bytes(info);
  EXPECT_GT(check(scene.volume, 0.2f, {least + 20 * platform::page_bytes(), 2}), 5000u);
}

/// Other frames and rays of any origin are not those of the frame before.
TEST(HostValues, EachFrameHasItsOwn) {
  const BoundsScene scene({30, 31, 33}, test::gyroid_field(13), {.rate = 9});
  HostRenderer renderer(scene.volume), fresh(scene.volume);
  FrameRequest request{orbit_cameras(scene.volume.info, 1)[0], 0.2f, kSize};
  const std::vector<WorldRay> rays = {{{-5, 12, 9}, {1, 0.3, 0.2}}, {{9, 12, -9}, {0.1, 0, 1}}};
  const auto cast = fresh.cast_rays(rays, 0.2f, Normals::kSmooth);
  EXPECT_EQ(test::num_hits(cast), 2u);
  for (const FieldBound bound : {FieldBound::kLower, FieldBound::kUpper}) {
    request.bound = bound;
    request.voxel_error = 0.3;
    renderer.render(request);
    const std::vector<HitRecord> bounded = renderer.hits();
    expect_same_hits(renderer.cast_rays(rays, 0.2f, Normals::kSmooth), cast, 1);
    request.bound = FieldBound::kNone;
    request.voxel_error = 0;
    renderer.render(request);
    fresh.render(request);
    expect_same_hits(renderer.hits(), fresh.hits(), kSize.width);
    EXPECT_NE(depth_of(bounded), renderer.depth());
  }
}

TEST(HostValues, ErrorsThatAreNotKnownAreOneLine) {
  BoundsScene scene({20, 20, 20}, test::gyroid_field(9), {.rate = 9});
  FrameRequest request{orbit_cameras(scene.volume.info, 1)[0], 0.2f, kSize};
  request.bound = FieldBound::kUpper;
  CompressedVolume wrong = scene.volume, unknown = scene.volume;
  wrong.errors_are_stated = true;
  wrong.value_range = {0, 0.1f};
  EXPECT_THAT(error_of([&] { HostRenderer(wrong).render(request); }), HasSubstr("blocks hold"));
  unknown.max_voxel_error.reset();
  unknown.bounds = {};
  HostRenderer renderer(unknown);
  EXPECT_THAT(error_of([&] { renderer.render(request); }), HasSubstr("error is not known"));
  request.bound = FieldBound::kNone;
  EXPECT_GT(renderer.render(request).rays_hit, 0u);
}

/// Pictures of 1/8, 1/4 and 1/2 of the rays, and the one before for bands that were not drawn.
TEST(HostValues, FramesWithinATime) {
  const BoundsScene scene({40, 36, 44}, test::gyroid_field(11), {.rate = 9});
  const ImageSize full{128, 100};
  HostRenderer host(scene.volume, {.num_threads = 1});
  double now = 0;
  TimedRenderer frames(host, [&] { return now += 1; });
  const FrameRequest request{orbit_cameras(scene.volume.info, 1)[0], 0.2f, full};
  const FrameStats first = frames.render(within_ms(1e-6, request));
  ASSERT_EQ(first.steps.size(), 1u);
  EXPECT_FALSE(first.complete);
  EXPECT_EQ(first.steps[0].size.width, 16u);
  EXPECT_EQ(first.steps[0].voxel_pixels, 0.0) << "levels of detail do not pay on the host";
  const auto hits_of = [&](ImageSize size, double voxel_pixels) {
    HostRenderer alone(scene.volume);
    FrameRequest of = request;
    of.size = size;
    of.voxel_pixels = voxel_pixels;
    alone.render(of);
    return alone.hits();
  };
  // The largest picture is eight times as large along each axis, and 100 rows are 13 of 8.
  const std::vector<HitRecord> small = hits_of(first.steps[0].size, 0), shown = host.hits();
  ASSERT_EQ(shown.size(), full.num_rays());
  EXPECT_GT(test::num_hits(small), 30u);
  for (std::size_t row = 0; row < 100; ++row) {
    for (std::size_t column = 0; column < 128; ++column) {
      const auto small_row = static_cast<std::size_t>((double(row) + 0.5) * 13 / 100);
      const double x = (double(column) + 0.5 - 64) * 13 / 100 + 8;
      const auto small_column = static_cast<std::size_t>(std::clamp(x, 0.0, 15.0));
      ASSERT_EQ(shown[column + 128 * row].t, small[small_column + 16 * small_row].t)
          << column << ", " << row;
    }
  }
  const FrameStats whole = frames.render(within_ms(1e9, request));
  EXPECT_TRUE(whole.complete);
  EXPECT_EQ(whole.last_level, 0u);
  expect_same_hits(host.hits(), hits_of(full, 0), full.width);

  // Time for some bands of the whole picture: rays that these do not hit show the one before.
  const std::vector<HitRecord> fine = hits_of(full, 0);
  bool is_mixed = false;
  for (double budget = 4; budget < 40; ++budget) {
    const FrameStats frame = frames.render(within_ms(budget, request));
    if (frame.steps.back().size.width != 128 || !frame.steps.back().cancelled) continue;
    is_mixed = true;
    const auto rows = static_cast<std::size_t>(
        std::lround(frame.steps.back().completed_percent * full.height / 100));
    const std::vector<HitRecord> hits = host.hits();
    for (std::size_t ray = 0; ray < rows * full.width; ++ray) {
      if (fine[ray].t != INFINITY) {
        ASSERT_EQ(hits[ray].t, fine[ray].t) << ray;
      }
    }
    EXPECT_GT(test::num_hits({hits.begin() + std::ptrdiff_t(rows * full.width), hits.end()}), 0u);
  }
  EXPECT_TRUE(is_mixed);
}

TEST(HostValues, NoPictureIsShownBeforeOneIsKept) {
  const BoundsScene scene({20, 20, 20}, test::gyroid_field(9), {.rate = 9});
  HostRenderer renderer(scene.volume);
  EXPECT_THAT(error_of([&] { renderer.keep_picture(); }), HasSubstr("no picture"));
  renderer.render({orbit_cameras(scene.volume.info, 1)[0], 0.2f, kSize});
  EXPECT_THAT(error_of([&] { renderer.fill_from_kept(); }), HasSubstr("none was kept"));
}

class HostValuesOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, HostValuesOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Bounds of the error, and the detail that keeps one.
TEST_P(HostValuesOnDevice, ErrorsAreTheDevices) {
  const BoundsScene scene({40, 37, 44}, test::gyroid_field(17), {.rate = 18});
  ocl::Device device(GetParam());
  DeviceRenderer on_device(device, scene.volume, with_choices({.size = kSize}, scene.volume));
  HostRenderer on_host(scene.volume);
  BoundedRenderer device_choice(on_device, scene.volume, scene.volume.rate()),
      host_choice(on_host, scene.volume, scene.volume.rate());
  FrameRequest request{orbit_cameras(scene.volume.info, 1)[0], 0.2f, kSize};
  for (const double voxel_pixels : {0.0, 2.0}) {
    request.voxel_pixels = voxel_pixels;
    on_device.render(request);
    const std::vector<float> depth = on_device.depth();
    const Certificate expected = certify(on_device, scene.volume, request, depth),
                      got = certify(on_host, scene.volume, request, depth);
    EXPECT_EQ(got.bounds, expected.bounds);
    EXPECT_GT(summarize(got, 1).num_certified, 100u);
  }
  request.voxel_pixels = 0;
  for (const double error : {0.01, 0.5, 4.0}) {
    request.max_surface_error = error;
    const FrameStats expected = device_choice.render(request), got = host_choice.render(request);
    ASSERT_TRUE(got.detail && expected.detail);
    EXPECT_EQ(got.detail->detail.voxel_pixels, expected.detail->detail.voxel_pixels);
    EXPECT_EQ(got.detail->detail.voxel_error, expected.detail->detail.voxel_error);
    EXPECT_EQ(got.detail->reachable, expected.detail->reachable);
    EXPECT_EQ(got.detail->median, expected.detail->median);
    expect_same_hits(on_host.hits(), on_device.hits(), kSize.width);
  }
}

}  // namespace
}  // namespace isowave::core
