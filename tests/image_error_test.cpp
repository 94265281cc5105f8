// Rays and levels of detail that are chosen for an error of the picture.

#include "core/accuracy/image_error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "core/accuracy/bounded_renderer.hpp"
#include "core/accuracy/flip.hpp"
#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// All levels of detail of waves that are some five voxels long.
CompressedVolume waves(const glm::uvec3 &dims, std::size_t levels = 0) {
  const std::vector<float> voxels = test::sample(dims, test::gyroid_field(7));
  ArrayReader reader(test::grid_info(dims), voxels);
  CompressOptions how{.rate = 16};
  how.levels = static_cast<std::uint32_t>(levels);
  return compress(reader, how);
}

FrameRequest request_of(const Camera &camera, ImageSize size, double max_image_error) {
  FrameRequest request{.camera = camera, .isovalue = 0.3f, .size = size};
  request.max_image_error = max_image_error;
  return request;
}

/// Small pictures are looked at whole.
TEST(ImageError, TilesOfSmallPicturesCoverThem) {
  for (const ImageSize size :
       {ImageSize{160, 90}, ImageSize{64, 48}, ImageSize{20, 17}, ImageSize{3, 300}}) {
    const TileSample sample = sample_tiles(size, kNumTiles, kTileSide);
    std::vector<int> counts(size.num_pixels());
    for (const Tile &tile : sample.tiles) {
      EXPECT_GE(tile.width, std::min(size.width, kLeastTileSide));
      EXPECT_GE(tile.height, std::min(size.height, kLeastTileSide));
      for (std::uint32_t y = 0; y < tile.height; ++y) {
        for (std::uint32_t x = 0; x < tile.width; ++x)
          ++counts.at((tile.row + y) * size.width + tile.column + x);
      }
    }
    EXPECT_EQ(sample.share, 1);
    EXPECT_EQ(std::ranges::count(counts, 1), std::ptrdiff_t(counts.size()));
  }
}

/// Tiles of large pictures are a part of those that divide it, some in each quarter.
TEST(ImageError, TilesOfLargePicturesAreASample) {
  for (const ImageSize size : {ImageSize{640, 360}, ImageSize{1920, 1081}, ImageSize{90, 5000}}) {
    const TileSample sample = sample_tiles(size, kNumTiles, kTileSide);
    EXPECT_GE(sample.tiles.size(), kNumTiles);
    EXPECT_LE(sample.tiles.size(), 2 * kNumTiles);
    EXPECT_EQ(sample.tiles.size() % 2, 0u);
    EXPECT_LE(sample.share, 0.5);
    int quarters = 0;
    double pixels = 0;
    for (const Tile &tile : sample.tiles) {
      EXPECT_LE(tile.column + tile.width, size.width);
      EXPECT_LE(tile.row + tile.height, size.height);
      EXPECT_LE(tile.width, kTileSide);
      EXPECT_LE(tile.height, kTileSide);
      quarters |= 1 << ((2 * tile.column + tile.width > size.width ? 1 : 0) +
                        (2 * tile.row + tile.height > size.height ? 2 : 0));
      pixels += double(tile.width) * tile.height;
    }
    EXPECT_EQ(quarters, 15);
    EXPECT_NEAR(pixels / double(size.num_pixels()), sample.share, 0.03 * sample.share);
    const TileSample again = sample_tiles(size, kNumTiles, kTileSide);
    for (std::size_t i = 0; i < sample.tiles.size(); ++i) {
      EXPECT_EQ(again.tiles[i].column, sample.tiles[i].column);
      EXPECT_EQ(again.tiles[i].row, sample.tiles[i].row);
    }
  }
}

/// A tile's middle is the picture's there, with pixels as large as in the picture's middle. In
/// parallel projection, and in the middle of the picture, all of a tile is.
TEST(ImageError, TilesSeeWhatThePictureShows) {
  const CompressedVolume volume = waves({40, 36, 44}, 1);
  HostRenderer renderer(volume);
  constexpr ImageSize kSize{200, 150};
  Camera camera = orbit_cameras(volume.info, 1)[0];
  for (const bool is_parallel : {false, true}) {
    if (is_parallel) camera = in_parallel(camera);
    FrameRequest request{.camera = camera, .isovalue = 0.3f, .size = kSize};
    renderer.render(request);
    const Image8 whole = renderer.shade();
    for (const Tile &tile : {Tile{80, 60, 40, 30}, Tile{20, 30, 40, 30}, Tile{150, 100, 40, 30}}) {
      const Camera of_tile = camera_of(tile, camera, kSize);
      const glm::dvec2 middle(tile.column + 20.0 - 100, 75.0 - tile.row - 15);
      const glm::dvec3 seen = point_of_ray(of_tile, {0, 0}, tile.height, 30),
                       in_picture = point_of_ray(camera, middle, kSize.height, 30);
      EXPECT_LT(glm::length(seen - in_picture), 1e-9);
      EXPECT_NEAR(pixel_size_at(of_tile, tile.height, 30), pixel_size_at(camera, kSize.height, 30),
                  1e-9);
      if (!is_parallel && tile.column != 80) continue;
      request.camera = of_tile;
      request.size = {tile.width, tile.height};
      renderer.render(request);
      Image8 part = renderer.shade();
      const Flip flip(part);
      for (std::uint32_t y = 0; y < tile.height; ++y) {
        std::copy_n(&whole.pixels[3 * ((tile.row + y) * kSize.width + tile.column)], 3 * tile.width,
                    &part.pixels[3 * y * tile.width]);
      }
      EXPECT_LT(flip.error(part), 0.001) << tile.column;
    }
  }
}

/// Student's quantile of 95 % is 1.7823 at 12 degrees of freedom, and 1.7613 at 14.
TEST(ImageError, MeansHaveAConfidenceInterval) {
  for (const auto &[count, quantile] : {std::pair{24, 1.7823}, std::pair{28, 1.7613}}) {
    std::vector<double> errors(std::size_t(count), 0.1);
    EXPECT_NEAR(highest_mean(errors, 0.1), 0.1, 1e-12);
    for (std::size_t i = 0; i < errors.size() / 2; ++i) errors[i] = 0.3;
    EXPECT_NEAR(highest_mean(errors, 0.1), 0.2, 1e-12) << "neighbours are alike";
    for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = i % 2 == 0 ? 0.3 : 0.1;
    const double of_mean = std::sqrt(0.75 * count / 2 * 0.2 * 0.2) / count;
    EXPECT_NEAR(highest_mean(errors, 0.25), 0.2 + quantile * of_mean, 1e-4 * quantile);
    EXPECT_NEAR(highest_mean(errors, 1), 0.2, 1e-12) << "all tiles";
  }
}

/// FLIP of the whole picture against 64 rays a pixel.
double error_of(Renderer &renderer, FrameRequest request, std::uint32_t samples,
                double voxel_pixels) {
  request.max_image_error.reset();
  request.size->samples = kReferenceSamples;
  renderer.render(request);
  const Flip reference(renderer.shade(request.light));
  request.size->samples = samples;
  request.voxel_pixels = voxel_pixels;
  renderer.render(request);
  return reference.error(renderer.shade(request.light));
}

TEST(ImageError, ChoosesTheCheapestThatKeepsIt) {
  const CompressedVolume volume = waves({72, 60, 64});
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  const Camera camera = orbit_cameras(volume.info, 1)[0];
  constexpr ImageSize kSize{96, 72, 8};
  std::uint32_t last_samples = 0;
  for (const double limit : {1.0, 0.15, 0.05, 1e-9}) {
    const FrameRequest request = request_of(camera, kSize, limit);
    const FrameStats stats = bounded.render(request);
    const DetailChoice &choice = stats.detail.value();
    const ImageError &image = choice.image.value();
    EXPECT_TRUE(choice.reachable);
    EXPECT_TRUE(choice.advice.empty());
    EXPECT_LE(image.mean, image.highest);
    EXPECT_LE(image.highest, limit);
    EXPECT_EQ(bounded.size().samples, image.samples);
    EXPECT_EQ(bounded.size().width, kSize.width);
    EXPECT_LE(error_of(renderer, request, image.samples, choice.detail.voxel_pixels), limit);
    EXPECT_GE(image.samples, last_samples);
    last_samples = image.samples;
    for (std::size_t i = 0; i + 1 < image.tries.size(); ++i) {
      const ImageError::Try &before = image.tries[i];
      EXPECT_TRUE(before.error > limit / 2 || before.samples == kReferenceSamples)
          << "a cheaper one was left out";
    }
    if (limit == 1) {
      EXPECT_EQ(image.samples, 1u);
      EXPECT_GT(choice.detail.voxel_pixels, 1);
      EXPECT_EQ(image.tries.size(), 1u);
    }
    if (limit == 1e-9) {
      EXPECT_EQ(image.samples, kReferenceSamples);
      EXPECT_EQ(choice.detail, Detail{});
      EXPECT_EQ(image.highest, 0) << "the reference itself";
    }
  }
}

/// In most random scenes, the whole picture has the error that its tiles show.
TEST(ImageError, PromiseHoldsInRandomScenes) {
  std::mt19937 random(7);
  const auto between = [&](double low, double high) {
    return low + (high - low) * std::ldexp(double(random()), -32);
  };
  int num_kept = 0, num_fewer = 0, num_lost = 0;
  const int num_scenes = long_tests() ? 100 : 6;
  const CompressedVolume volume = waves({56, 60, 64});
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  for (int scene = 0; scene < num_scenes; ++scene) {
    Camera camera = turned(orbit_cameras(volume.info, 1)[0], between(0, 360));
    camera.eye += between(-0.5, 0.8) * (camera.eye - camera.at);
    FrameRequest request = request_of(camera, {120, 90, 4}, between(0.03, 0.15));
    request.isovalue = float(between(-0.6, 0.6));
    const DetailChoice choice = bounded.render(request).detail.value();
    if (!choice.reachable) {
      ++num_kept;  // it promised nothing
      continue;
    }
    const double limit = request.max_image_error.value();
    num_kept +=
        error_of(renderer, request, choice.image->samples, choice.detail.voxel_pixels) <= limit;
    num_fewer += choice.image->samples < 4 || choice.detail.voxel_pixels > 0;
    num_lost += error_of(renderer, request, 1, 4) > limit;
  }
  RecordProperty("kept", num_kept);
  RecordProperty("fewer", num_fewer);
  EXPECT_GE(num_kept, 0.9 * num_scenes);
  EXPECT_GE(num_fewer, 0.5 * num_scenes);
  EXPECT_GE(num_lost, 0.5 * num_scenes) << "the cheapest always would do";
}

TEST(ImageError, SaysWhatWouldHelp) {
  const CompressedVolume volume = waves({40, 36, 44});
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  const Camera camera = orbit_cameras(volume.info, 1)[0];
  const DetailChoice choice = bounded.render(request_of(camera, {64, 48, 2}, 1e-6)).detail.value();
  EXPECT_FALSE(choice.reachable);
  EXPECT_EQ(choice.image->samples, 2u);
  EXPECT_EQ(choice.detail, Detail{});
  EXPECT_GT(choice.image->mean, 1e-6);
  EXPECT_THAT(choice.advice, HasSubstr("allow more of them, up to 8 x 8"));
}

/// All views of a series have what is chosen once, for the same colours.
TEST(ImageError, SeriesHaveOneChoice) {
  const CompressedVolume volume = waves({40, 36, 44});
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  const Camera near = orbit_cameras(volume.info, 1)[0];
  Camera far = near;
  far.eye += 2.5 * (far.eye - far.at);
  FrameRequest request = request_of(near, {80, 60, 4}, 0.05);
  request.series = {near, far};
  const DetailChoice first = bounded.render(request).detail.value(),
                     second = bounded.render(seen_from(far, request)).detail.value();
  EXPECT_EQ(first.image->num_tiles, second.image->num_tiles);
  EXPECT_GE(first.image->num_tiles, 20u);
  EXPECT_EQ(first.image->samples, second.image->samples);
  EXPECT_EQ(first.image->mean, second.image->mean);
  EXPECT_GT(first.total_ms, 0);
  EXPECT_EQ(second.total_ms, 0);
  request.light.surface = {0.1f, 0.1f, 0.1f};
  request.light.background = glm::vec3(0);
  const DetailChoice dark = bounded.render(request).detail.value();
  EXPECT_GT(dark.total_ms, 0) << "other colours";
  EXPECT_NE(dark.image->mean, first.image->mean);
  request.max_image_error.reset();
  EXPECT_THAT([&] { bounded.render(request); }, ThrowsMessage<Error>(HasSubstr("series")));
}

TEST(ImageError, BadRequestsAreOneLine) {
  const CompressedVolume volume = waves({20, 20, 20});
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  const FrameRequest request = request_of(orbit_cameras(volume.info, 1)[0], {20, 20, 2}, 0.1);
  EXPECT_THAT([&] { renderer.render(request); }, ThrowsMessage<Error>(HasSubstr("no detail")));
  const auto expect_error = [&](const char *text, const auto &change) {
    FrameRequest bad = request;
    change(bad);
    EXPECT_THAT([&] { bounded.render(bad); }, ThrowsMessage<Error>(HasSubstr(text)));
  };
  for (const double error : {0.0, -1.0, 1.5, std::numeric_limits<double>::quiet_NaN()})
    expect_error("more than 0, up to 1", [&](FrameRequest &r) { r.max_image_error = error; });
  expect_error("one error", [](FrameRequest &r) { r.max_surface_error = 1; });
  expect_error("an error and a time", [](FrameRequest &r) { r.time_budget_ms = 1; });
  expect_error("max_image_error chooses", [](FrameRequest &r) { r.voxel_pixels = 1; });
  expect_error("max_image_error chooses", [](FrameRequest &r) { r.voxel_error = 1; });
  expect_error("bound", [](FrameRequest &r) { r.bound = FieldBound::kLower; });
  expect_error("leave out max_image_error",
               [](FrameRequest &r) { r.surfaces = {{.isovalue = 0}}; });
  expect_error("evidence", [](FrameRequest &r) { r.by = Evidence::kSample; });
  FrameRequest empty = request;  // of it, there is nothing to see
  empty.isovalue = 100;
  const DetailChoice choice = bounded.render(empty).detail.value();
  EXPECT_EQ(choice.image->samples, 1u);
  EXPECT_EQ(choice.image->highest, 0);
}

class ImageErrorOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, ImageErrorOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(ImageErrorOnDevice, ChoicesAreTheSame) {
  if (is_simulator(GetParam())) GTEST_SKIP() << "too many rays";
  const CompressedVolume volume = waves({40, 36, 44});
  constexpr ImageSize kSize{24, 20, 8};
  ocl::Device device(GetParam());
  DeviceRenderer on_device(device, volume, {.size = {256, 256}, .with_levels = true});
  HostRenderer on_host(volume);
  Camera camera = orbit_cameras(volume.info, 1)[0];
  for (const double limit : {0.2, 0.06}) {
    FrameRequest request = request_of(camera, kSize, limit);
    request.light.background_top = glm::vec3(0.2f, 0.4f, 0.9f);
    std::vector<DetailChoice> choices;
    std::vector<std::vector<std::uint8_t>> pictures;
    for (Renderer *renderer :
         {static_cast<Renderer *>(&on_device), static_cast<Renderer *>(&on_host)}) {
      BoundedRenderer bounded(*renderer, volume, volume.rate());
      choices.push_back(bounded.render(request).detail.value());
      pictures.push_back(bounded.shade(request.light).pixels);
    }
    EXPECT_EQ(choices[0].detail, choices[1].detail);
    EXPECT_EQ(choices[0].image->samples, choices[1].image->samples);
    EXPECT_EQ(choices[0].image->mean, choices[1].image->mean);
    ASSERT_EQ(choices[0].image->tries.size(), choices[1].image->tries.size());
    for (std::size_t i = 0; i < choices[0].image->tries.size(); ++i)
      EXPECT_EQ(choices[0].image->tries[i].error, choices[1].image->tries[i].error);
    EXPECT_EQ(pictures[0], pictures[1]);
  }
}

TEST_P(ImageErrorOnDevice, NeedsARendererOfSomeSize) {
  const CompressedVolume volume = waves({20, 20, 20});
  ocl::Device device(GetParam());
  DeviceRenderer renderer(device, volume, {.size = {30, 20}, .with_levels = true});
  BoundedRenderer bounded(renderer, volume, volume.rate());
  EXPECT_THAT(
      [&] {
        bounded.render(request_of(orbit_cameras(volume.info, 1)[0], {30, 20}, 0.1));
      },
      ThrowsMessage<Error>(HasSubstr("65536 rays, and the renderer was made for 600")));
}

}  // namespace
}  // namespace isowave::core
