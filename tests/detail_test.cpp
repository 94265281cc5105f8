// Frames in bands of several levels of detail: where the borders are, and that every device draws
// what the twin draws.

#include "core/view/detail.hpp"
#include "core/io/open_volume.hpp"
#include "core/paper/blocks_pipeline.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <random>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "core/volume/pyramid.hpp"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::camera_along;
using test::expect_same_hits;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kTiny{6, 5}, kSmall{12, 8}, kMedium{96, 64};

std::vector<VolumeInfo> levels_of(const VolumeInfo &finest) {
  std::vector<VolumeInfo> levels = {finest};
  while (levels.size() < max_levels(finest.dims)) levels.push_back(coarser_level(levels.back()));
  return levels;
}

CompressedVolume pyramid_of(const glm::uvec3 &dims, const test::VoxelFunction &field,
                            CompressOptions options = {.rate = 8}) {
  ArrayReader reader(test::grid_info(dims), test::sample(dims, field));
  options.levels = 0;
  return compress(reader, options);
}

// ---- where the borders are

TEST(LevelFrames, BordersAreWhereVoxelsAreFarEnoughApart) {
  const std::vector<VolumeInfo> levels = levels_of(test::grid_info({64, 64, 64}, {0.5, 1.5, 1}));
  const Camera camera = camera_along({-10, 48, 32}, {1, 0, 0}, {0, 1, 0}, 90);
  const ImageSize size{100, 50};
  const auto frames = make_level_frames(levels, camera, size, 0.5f, 3.0);
  ASSERT_EQ(frames.size(), 5u);
  EXPECT_EQ(frames[0].band.begin_t, 0.0f);
  std::size_t last = 0;
  for (std::size_t level = 1; level < frames.size() && draws(frames[level]); ++level) {
    last = level;
    const double world = double{frames[level].band.begin_t} * frames[level].view.t_scale;
    EXPECT_EQ(world, double{frames[level - 1].band.end_t} * frames[level - 1].view.t_scale)
        << "not the same border";
    const double pixel = 2.0 * world / 50;  // a picture of 90 degrees is twice as high as it is far
    EXPECT_NEAR(1.5 * (1 << level) / pixel, 3.0, 1e-5);
  }
  EXPECT_GE(last, 2u);
  EXPECT_EQ(frames[last].band.end_t, INFINITY);
}

/// Pixels are the picture's, however many rays each has.
TEST(LevelFrames, MoreRaysDoNotMoveBorders) {
  const std::vector<VolumeInfo> levels = levels_of(test::grid_info({64, 64, 64}));
  const Camera camera = orbit_cameras(levels[0], 1)[0];
  const auto one = make_level_frames(levels, camera, {96, 64}, 0.5f, 1.2);
  const auto nine = make_level_frames(levels, camera, {96, 64, 3}, 0.5f, 1.2);
  EXPECT_GT(std::ranges::count_if(one, draws), 1);
  for (std::size_t level = 0; level < one.size(); ++level) {
    EXPECT_EQ(nine[level].band.begin_t, one[level].band.begin_t);
    EXPECT_EQ(nine[level].band.end_t, one[level].band.end_t);
    EXPECT_EQ(nine[level].view.width, 3 * one[level].view.width);
    EXPECT_EQ(nine[level].view.height, 3 * one[level].view.height);
  }
}

TEST(LevelFrames, BlockIdsCountOn) {
  const std::vector<VolumeInfo> levels = levels_of(test::grid_info({40, 33, 50}));
  const auto frames = make_level_frames(levels, orbit_cameras(levels[0], 1)[0], kMedium, 0.5f, 1.0);
  ASSERT_EQ(frames.size(), 4u);
  for (std::size_t level = 1; level < frames.size(); ++level) {
    EXPECT_EQ(frames[level].place.begin_z,
              frames[level - 1].place.begin_z + frames[level - 1].grid.blocks_z);
    EXPECT_EQ(frames[level].place.blocks_x, frames[0].grid.blocks_x);
    EXPECT_EQ(frames[level].place.blocks_y, frames[0].grid.blocks_y);
  }
}

TEST(LevelFrames, OneLevelDrawsAllWhereTheVolumeReachesNoBorder) {
  const std::vector<VolumeInfo> levels = levels_of(test::grid_info({64, 64, 64}));
  const Camera near_camera = orbit_cameras(levels[0], 1)[0];
  const Camera far_camera = camera_along({32, 32, -2000}, {0, 0, 1});
  const auto drawn = [&](const Camera &camera, double voxel_pixels) {
    const auto frames = make_level_frames(levels, camera, {128, 72}, 0.5f, voxel_pixels);
    EXPECT_EQ(std::ranges::count_if(frames, draws), 1);
    const auto found = std::ranges::find_if(frames, draws);
    EXPECT_EQ(found->band.begin_t, 0.0f);
    EXPECT_EQ(found->band.end_t, INFINITY);
    return found - frames.begin();
  };
  EXPECT_EQ(drawn(near_camera, 0), 0);
  EXPECT_EQ(drawn(near_camera, 1e-3), 0);
  EXPECT_EQ(drawn(far_camera, 0), 0);
  EXPECT_EQ(drawn(far_camera, 0.4), 3);  // a pixel is 32 voxels wide
  EXPECT_EQ(drawn(far_camera, 100), 4);  // there is no coarser one
  EXPECT_EQ(drawn(near_camera, 100), 4) << "finer ones end before the volume begins";
}

/// Wherever the eye is and however the grid lies: each point of the volume is in the band of the
/// level that is fine enough there.
TEST(LevelFrames, NoPointIsLeftOut) {
  std::mt19937 random(11);
  const auto number = [&](double low, double high) {
    return low + (high - low) * double(random()) * 0x1p-32;
  };
  std::size_t num_drawing = 0, num_frames = 0;
  for (int i = 0; i < 300; ++i) {
    VolumeInfo info = test::grid_info({random() % 60 + 5, random() % 60 + 5, random() % 60 + 5},
                                      {number(0.5, 2), number(0.5, 2), number(0.5, 2)});
    const glm::dvec3 x = glm::normalize(glm::dvec3(number(-1, 1), number(-1, 1), number(-1, 1)));
    const glm::dvec3 y =
        glm::normalize(glm::cross(x, glm::dvec3(number(-1, 1), number(-1, 1), number(-1, 1))));
    info.direction = glm::dmat3(x, y, glm::cross(x, y));
    const std::vector<VolumeInfo> levels = levels_of(info);
    const glm::dmat3 to_world = info.index_to_world();
    const glm::dvec3 last = glm::dvec3(info.dims) - 1.0;
    const auto point = [&](double beyond) {
      const auto along = [&] { return number(-beyond, 1 + beyond); };
      return info.origin + to_world * (last * glm::dvec3(along(), along(), along()));
    };
    const Camera camera = camera_along(point(2), {1, 0.1, 0.2});
    const double error = std::exp2(number(-3, 6));
    const auto frames = make_level_frames(levels, camera, kMedium, 0.5f, error);
    num_drawing += std::size_t(std::ranges::count_if(frames, draws));
    num_frames += frames.size();
    const double pixel = 2 * std::tan(glm::radians(30.0)) / kMedium.height;
    const double voxel = std::max({info.spacing.x, info.spacing.y, info.spacing.z});
    for (int j = 0; j < 50; ++j) {
      const double distance = glm::length(point(0) - camera.eye);
      const double exact = std::log2(error * pixel * distance / voxel);
      if (std::abs(exact - std::round(exact)) < 1e-4) continue;  // at a border
      const auto level =
          static_cast<std::size_t>(std::clamp(std::floor(exact), 0.0, double(levels.size() - 1)));
      const double t = distance / double{frames[level].view.t_scale};
      EXPECT_LE(double{frames[level].band.begin_t}, t);
      EXPECT_GE(double{frames[level].band.end_t}, t);
      EXPECT_TRUE(draws(frames[level]));
    }
  }
  EXPECT_LT(2 * num_drawing, num_frames) << "most levels are not needed";
}

TEST(LevelFrames, RefusesWhatIsNoDistance) {
  const std::vector<VolumeInfo> levels = levels_of(test::grid_info({20, 20, 20}));
  for (const double bad : {-1.0, double(NAN), double(INFINITY)}) {
    EXPECT_THAT(
        [&] { make_level_frames(levels, orbit_cameras(levels[0], 1)[0], kSmall, 0.5f, bad); },
        ThrowsMessage<Error>(HasSubstr("pixels between voxels")));
  }
}

// ---- pictures

/// Hits at the border between two bands.
std::size_t num_border_hits(const std::vector<HitRecord> &hits,
                            const std::vector<FrameParams> &frames) {
  std::size_t count = 0;
  for (const HitRecord &hit : hits) {
    for (const FrameParams &frame : frames)
      count += draws(frame) && frame.band.begin_t > 0 &&
               hit.t == frame.band.begin_t * frame.view.t_scale;
  }
  return count;
}

/// Root mean square difference of a picture from the mean of 4 x 4 times as many rays at the finest
/// level.
double error_of(const Image8 &picture, const Image8 &fine) {
  double sum = 0;
  for (std::uint32_t y = 0; y < picture.height; ++y) {
    for (std::uint32_t x = 0; x < picture.width; ++x) {
      for (std::uint32_t channel = 0; channel < 3; ++channel) {
        double mean = 0;
        for (std::uint32_t i = 0; i < 16; ++i) {
          const std::size_t at = 4 * x + i % 4 + std::size_t{fine.width} * (4 * y + i / 4);
          mean += fine.pixels[3 * at + channel] / 16.0;
        }
        const double off =
            picture.pixels[3 * (x + std::size_t{picture.width} * y) + channel] - mean;
        sum += off * off;
      }
    }
  }
  return std::sqrt(sum / (3.0 * picture.width * picture.height));
}

class LevelsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Each camera three times by one renderer, once with cells' normals. Returns the hits at
  /// borders.
  std::size_t check(const CompressedVolume &volume, const std::vector<Camera> &cameras,
                    float isovalue, double voxel_pixels, RendererOptions options) {
    SCOPED_TRACE(fmt::format("{} pixels, {} slots", voxel_pixels, options.cache_slots));
    options.with_levels = true;
    const Twin twin(volume, voxel_pixels);
    const std::vector<VolumeInfo> infos = level_infos(volume, true);
    DeviceRenderer renderer(device_, volume, options);
    std::size_t at_border = 0;
    for (const Camera &camera : cameras) {
      const auto expected = twin.render(camera, options.size, isovalue);
      for (const Normals normals : {Normals::kSmooth, Normals::kCell, Normals::kSmooth}) {
        const FrameStats stats = renderer.render({.camera = camera,
                                                  .isovalue = isovalue,
                                                  .voxel_pixels = voxel_pixels,
                                                  .normals = normals});
        expect_same_hits(renderer.hits(),
                         normals == Normals::kSmooth
                             ? expected
                             : twin.render(camera, options.size, isovalue, kDefaultSolver, normals),
                         options.size.width);
        EXPECT_EQ(stats.rays_hit, test::num_hits(expected));
      }
      const auto frames = make_level_frames(infos, camera, options.size, isovalue, voxel_pixels);
      EXPECT_GT(std::ranges::count_if(frames, draws), 1) << "no border is tested";
      at_border += num_border_hits(expected, frames);
    }
    EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
    return at_border;
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, LevelsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(LevelsOnDevice, SmallFrameIsTheTwins) {
  const CompressedVolume volume = pyramid_of({9, 10, 11}, test::noise_field(8));
  EXPECT_GT(check(volume, {orbit_cameras(volume.info, 1)[0]}, 0.1f, 1.4,
                  {.size = kSmall, .cache_slots = 20}),
            0u);
}

TEST_P(LevelsOnDevice, EveryKindOfVolumeAndPlace) {
  const glm::uvec3 dims(40, 37, 44);
  const auto cameras = [](const CompressedVolume &volume) {
    std::vector<Camera> all = orbit_cameras(volume.info, 2);
    all.push_back(camera_along({11, 13, 17}, {1, 0.4, -0.3}));  // from within
    all.push_back(camera_along({20, 18, -30}, {0, 0, 1}));      // along planes of every level
    return all;
  };
  std::size_t at_border = 0;
  for (const auto &field :
       {test::gyroid_field(11), test::noise_field(5), test::sphere_field(dims)}) {
    for (const CompressOptions &options :
         {CompressOptions{.rate = 8},
          CompressOptions{.precision = BlockPrecision{.min_exponent = -6}}}) {
      const CompressedVolume volume = pyramid_of(dims, field, options);
      const std::uint64_t third =
          volume.payload_bits() / 8 / 3;  // the finest level in four buffers, the next in one
      for (const auto &[place, largest_part] : {std::pair{StreamPlace::kDevice, std::uint64_t{0}},
                                                std::pair{StreamPlace::kDevice, third},
                                                std::pair{StreamPlace::kHost, std::uint64_t{0}}}) {
        for (const double voxel_pixels : {2.5, 6.0}) {
          at_border +=
              check(volume, cameras(volume), 0.4f, voxel_pixels,
                    {.size = kMedium, .stream = place, .largest_stream_part = largest_part});
        }
      }
    }
  }
  EXPECT_GT(at_border, 10u);
}

/// Levels whose active blocks take up a corner of the volume, and borders before it, in it and
/// behind it.
TEST_P(LevelsOnDevice, ActiveBlocksFarFromBorders) {
  const glm::uvec3 dims(96, 80, 64);
  const auto ball = [](const glm::vec3 &centre, float inner, float outer) {
    return [=](const glm::vec3 &at) { return glm::distance(at, centre) < 9 ? inner : outer; };
  };
  CompressedVolume volume = pyramid_of(dims, ball({75, 60, 45}, 1, 0));
  std::vector<Camera> cameras = orbit_cameras(volume.info, 3);
  cameras.push_back(camera_along({12, 11, 10}, {1, 0.8, 0.6}));  // from within
  for (const double voxel_pixels : {1.2, 2.0, 3.0})
    check(volume, cameras, 0.5f, voxel_pixels, {.size = kMedium});
  // Coarser levels that are inside where this one is outside: every ray that comes to their border
  // hits there.
  volume.coarser_levels = pyramid_of(dims, ball({20, 20, 20}, 0, 1)).coarser_levels;
  EXPECT_GT(check(volume, cameras, 0.5f, 1.2, {.size = kMedium}), 500u);
}

TEST_P(LevelsOnDevice, AnyCacheAndSpeculation) {
  const CompressedVolume volume = pyramid_of({30, 27, 33}, test::gyroid_field(10));
  const std::vector<Camera> cameras = orbit_cameras(volume.info, 2);
  check(volume, cameras, 0.4f, 0.5, {.size = kTiny, .cache_slots = 8});
  check(volume, cameras, 0.4f, 1, {.size = kSmall, .cache_slots = 13});
  for (const std::uint32_t slots : {64u, 300u}) {
    for (const std::uint32_t speculation : {1u, 7u, 64u}) {
      for (const bool per_ray : {false, true}) {
        check(volume, cameras, 0.4f, 3,
              {.size = kMedium,
               .cache_slots = slots,
               .max_speculation = speculation,
               .per_ray_speculation = per_ray});
      }
    }
  }
}

TEST_P(LevelsOnDevice, CancelledFramesLeaveNoTrace) {
  const CompressedVolume volume = pyramid_of({30, 27, 33}, test::gyroid_field(10));
  const std::vector<Camera> cameras = orbit_cameras(volume.info, 3);
  std::map<double, Twin> twins;
  for (const double voxel_pixels : {0.0, 3.0, 30.0})
    twins.try_emplace(voxel_pixels, volume, voxel_pixels);
  DeviceRenderer renderer(device_, volume,
                          {.size = kMedium, .cache_slots = 100, .with_levels = true});
  for (std::size_t last_pass = 1; last_pass < 12; ++last_pass) {
    std::size_t pass = 0;
    renderer.render({.camera = cameras[last_pass % 3],
                     .isovalue = last_pass % 2 ? 0.4f : 0.2f,
                     .voxel_pixels = 3,
                     .on_pass = [&](const PassStats &) { return ++pass < last_pass; }});
    for (const double voxel_pixels :
         last_pass % 2 ? std::array{3.0, 0.0, 30.0} : std::array{0.0, 30.0, 3.0}) {
      // Several levels, the finest or a coarse one alone.
      renderer.render({.camera = cameras[0], .isovalue = 0.4f, .voxel_pixels = voxel_pixels});
      expect_same_hits(renderer.hits(), twins.at(voxel_pixels).render(cameras[0], kMedium, 0.4f),
                       kMedium.width);
    }
  }
}

TEST_P(LevelsOnDevice, FewerPlanesOfEveryLevel) {
  const CompressedVolume volume = pyramid_of({30, 27, 33}, test::gyroid_field(10));
  const Camera camera = orbit_cameras(volume.info, 1)[0];
  DeviceRenderer renderer(device_, volume, {.size = kMedium, .with_levels = true});
  for (const double voxel_error : {0.0, 0.3, 0.01}) {
    renderer.render(
        {.camera = camera, .isovalue = 0.4f, .voxel_pixels = 3, .voxel_error = voxel_error});
    expect_same_hits(renderer.hits(), Twin(volume, 3, voxel_error).render(camera, kMedium, 0.4f),
                     kMedium.width);
  }
}

/// A level alone has the planes of twice the error for each level.
TEST_P(LevelsOnDevice, FewerPlanesWithDistance) {
  const CompressedVolume volume = pyramid_of({30, 27, 33}, test::gyroid_field(10));
  const Camera camera = orbit_cameras(volume.info, 1)[0];
  DeviceRenderer renderer(device_, volume, {.size = kMedium, .with_levels = true});
  const FrameStats stats = renderer.render(
      {.camera = camera, .isovalue = 0.4f, .voxel_pixels = 30, .voxel_error = 0.02});
  const std::size_t level = stats.first_level;
  ASSERT_GT(level, 0u);
  ASSERT_EQ(stats.last_level, level);
  const auto drawn_with = [&](double voxel_error) {
    const CompressedVolume &alone = volume.coarser_levels[level - 1];
    return render_scalar(make_frame_params(alone.info, camera, kMedium, 0.4f),
                         decode_with_libzfp(alone, voxel_error));
  };
  const std::vector<float> depth = depth_of(renderer.hits());
  EXPECT_EQ(depth, depth_of(drawn_with(std::ldexp(0.02, static_cast<int>(level)))));
  EXPECT_NE(depth, depth_of(drawn_with(0.02)));
}

/// A band's end is not the rays'.
TEST_P(LevelsOnDevice, FramesAreCompleteAfterTheLastBand) {
  const CompressedVolume volume = pyramid_of({30, 27, 33}, test::gyroid_field(10));
  DeviceRenderer renderer(device_, volume,
                          {.size = kMedium, .cache_slots = 100, .with_levels = true});
  const FrameStats stats = renderer.render(
      {.camera = orbit_cameras(volume.info, 1)[0], .isovalue = 0.4f, .voxel_pixels = 3});
  ASSERT_LT(stats.first_level, stats.last_level);
  for (std::size_t i = 1; i < stats.passes.size(); ++i) {
    EXPECT_GE(stats.passes[i].completed_percent, stats.passes[i - 1].completed_percent);
    EXPECT_LT(stats.passes[i - 1].completed_percent, 100.0);
  }
  EXPECT_EQ(stats.passes.back().completed_percent, 100.0);
}

TEST_P(LevelsOnDevice, DecodesFewerBlocks) {
  const CompressedVolume volume = pyramid_of({64, 64, 64}, test::gyroid_field(16));
  const Camera camera = camera_along({32, 32, -200}, {0, 0, 1}, {0, 1, 0}, 30);
  const auto num_decoded = [&](double voxel_pixels) {
    DeviceRenderer renderer(device_, volume, {.size = kMedium, .with_levels = true});
    const FrameStats stats =
        renderer.render({.camera = camera, .isovalue = 0.4f, .voxel_pixels = voxel_pixels});
    return std::accumulate(
        stats.passes.begin(), stats.passes.end(), std::uint64_t{0},
        [](std::uint64_t sum, const PassStats &pass) { return sum + pass.counts.decoded_count; });
  };
  EXPECT_LT(3 * num_decoded(2.0), num_decoded(0));
}

/// What levels of detail are for where voxels are smaller than pixels: fewer blocks, and a better
/// picture with the rays that they pay for.
TEST_P(LevelsOnDevice, FourRaysAPixelOfACoarseLevelBeatOneOfTheFinest) {
  const auto reader = open_volume(std::string(ISOWAVE_TEST_DATA) + "/head_41x41x41_uint8.raw.gz");
  const CompressedVolume volume = compress(*reader, CompressOptions{.rate = 16, .levels = 0});
  const Camera camera = orbit_cameras(volume.info, 1)[0];
  struct Picture {
    Image8 image;
    std::uint64_t decoded = 0;
  };
  const auto draw = [&](ImageSize size, double voxel_pixels) {
    // Not on demand, as on most devices.
    DeviceRenderer renderer(device_, volume,
                            {.size = size, .on_demand = DecodeOnDemand::kOff, .with_levels = true});
    Picture picture;
    const FrameStats stats =
        renderer.render({.camera = camera, .isovalue = 30, .voxel_pixels = voxel_pixels});
    for (const PassStats &pass : stats.passes) picture.decoded += pass.counts.decoded_count;
    picture.image = renderer.shade();
    return picture;
  };
  const Image8 fine = draw({64, 48}, 0).image;
  const Picture one = draw({16, 12}, 0), four = draw({16, 12, 2}, 0.5);
  const double one_error = error_of(one.image, fine), four_error = error_of(four.image, fine);
  EXPECT_LT(four.decoded, one.decoded);
  EXPECT_LT(four_error, one_error);
  EXPECT_LT(error_of(draw({16, 12, 4}, 0).image, fine), 1.0)
      << "the reference itself, but for rounding";
  RecordProperty("one_ray", fmt::format("{:.2f}, {} blocks", one_error, one.decoded));
  RecordProperty("four_rays", fmt::format("{:.2f}, {} blocks", four_error, four.decoded));
}

TEST_P(LevelsOnDevice, RefusesWhatItCannotDraw) {
  const CompressedVolume volume = pyramid_of({20, 20, 20}, test::gyroid_field(10));
  CompressedVolume flat = volume;
  flat.coarser_levels.clear();
  EXPECT_THAT([&] { DeviceRenderer(device_, flat, {.size = kSmall, .with_levels = true}); },
              ThrowsMessage<Error>(HasSubstr("no levels of detail: compress it with levels")));
  EXPECT_THAT(
      [&] {
        DeviceRenderer(device_, volume,
                       {.size = kSmall, .pipeline = blocks_pipeline(), .with_levels = true});
      },
      ThrowsMessage<Error>(HasSubstr("pipeline blocks")));
  DeviceRenderer renderer(device_, volume, {.size = kSmall, .with_levels = true});
  FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0], .isovalue = 0.4f};
  for (const double bad : {-1.0, double{NAN}, double{INFINITY}}) {
    request.voxel_pixels = bad;
    EXPECT_THROW(renderer.render(request), Error) << bad;
  }
}

// ---- what it is for

/// Not so of every volume (bench/h100.md): where a pixel is covered in part, one ray is
/// as wrong at any level.
TEST(LevelsOfDetail, SpecksSmallerThanAPixelSpoilThePictureLess) {
  const glm::uvec3 dims(128, 128, 128);
  const CompressedVolume volume =
      pyramid_of(dims, [noise = test::noise_field(5)](const glm::dvec3 &p) {
        return 40 - glm::length(p - 63.5) +
               (noise(p) > 0.99 ? 40 : 0);  // a ball, and a voxel in 200 is wrong
      });
  const ImageSize size{48, 32}, fine_size{192, 128};
  const std::array<Twin, 2> twins{Twin(volume), Twin(volume, 0.5)};
  for (const Camera &camera : orbit_cameras(volume.info, 3)) {
    const auto picture = [&](ImageSize image, double voxel_pixels) {
      const FrameParams frame = make_frame_params(volume.info, camera, image, 0.0f);
      return shade_scalar(frame, make_shade_params(volume.info, {}),
                          twins[voxel_pixels > 0].render(camera, image, 0.0f));
    };
    const Image8 fine = picture(fine_size, 0);
    const double with = error_of(picture(size, 0.5), fine),
                 without = error_of(picture(size, 0), fine);
    EXPECT_LT(with, without);
    RecordProperty("error_with_levels", fmt::format("{:.2f}", with));
    RecordProperty("error_without", fmt::format("{:.2f}", without));
  }
}

}  // namespace
}  // namespace isowave::core
