// Bricks on every device and with both pipelines: what they draw, put together, must be the whole
// volume's picture bit for bit.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <utility>

#include "core/base/error.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/compose.hpp"
#include "core/bricks/cuts.hpp"
#include "core/bricks/surface_work.hpp"
#include "core/render/device_renderer.hpp"
#include "core/volume/range_thresholds.hpp"
#include "kernels_cl/portable/block_cells.h"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::camera_along;
using test::expect_same_hits;
using test::TestVolume;

/// The id of a brick's block in the whole volume.
std::uint32_t whole_id(const VolumeInfo &whole, const VolumeInfo &brick, std::uint32_t id) {
  const glm::ivec3 kept = blocks_along(brick), all = blocks_along(whole);
  const glm::ivec3 at =
      glm::ivec3(brick.brick.first_voxel / 4u) +
      glm::ivec3(int(id) % kept.x, int(id) / kept.x % kept.y, int(id) / kept.x / kept.y);
  return static_cast<std::uint32_t>(at.x + all.x * (at.y + all.y * at.z));
}

class BricksOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  /// Draws the bricks one after the other, and compares with the scalar twin of the whole. Returns
  /// the number of hits.
  std::uint64_t check(const TestVolume &whole, const Cuts &cuts, const std::vector<Camera> &cameras,
                      float isovalue, RendererOptions options) {
    options = GetParam().with(options);
    const std::size_t num_rays = options.size.num_rays();
    struct Composed {
      std::vector<HitRecord> hits;
      std::vector<std::uint32_t> place;
      std::vector<std::uint64_t> colors, depths, words;
      std::vector<std::pair<std::size_t, HitRecord>> all{};  ///< ray, and what a brick has found
    };
    std::vector<Composed> frames(
        cameras.size(),
        {std::vector<HitRecord>(num_rays, no_hit()), std::vector<std::uint32_t>(num_rays, kNoPlace),
         std::vector<std::uint64_t>(num_rays, ~std::uint64_t{0}),
         std::vector<std::uint64_t>(num_rays, ~std::uint64_t{0}),
         std::vector<std::uint64_t>(num_rays)});
    for (std::size_t brick = 0; brick < cuts.bricks().size(); ++brick) {
      const CompressedVolume volume = cut_brick(whole.compressed, cuts.bricks()[brick]);
      DeviceRenderer renderer(device_, volume, options);
      for (std::size_t view = 0; view < cameras.size(); ++view) {
        Composed &frame = frames[view];
        renderer.render({.camera = cameras[view], .isovalue = isovalue});
        const View rays = make_view(whole.info(), cameras[view], options.size);
        const std::uint32_t place = cuts.order_from({rays.eye_x, rays.eye_y, rays.eye_z})[brick];
        const std::vector<HitRecord> hits = renderer.hits();
        for (std::size_t ray = 0; ray < num_rays; ++ray) {
          HitRecord hit = hits[ray];
          if (hit.block_id == ISO_INVALID_ID) continue;
          hit.block_id = whole_id(whole.info(), volume.info, hit.block_id);
          frame.all.emplace_back(ray, hit);
          if (place > frame.place[ray]) continue;
          frame.place[ray] = place;
          frame.hits[ray] = hit;
        }
        color_words(renderer.shade_packed({}), place, frame.words);
        reduce_into(frame.colors, frame.words, Reduction::kMin);
        field_words(hits, HitField::kT, place, frame.words);
        reduce_into(frame.depths, frame.words, Reduction::kMin);
      }
    }
    std::uint64_t num_hits = 0;
    DeviceRenderer renderer(device_, whole.compressed, options);
    for (std::size_t view = 0; view < cameras.size(); ++view) {
      SCOPED_TRACE(fmt::format("view {}", view));
      const Composed &frame = frames[view];
      const auto expected = test::twin_hits(whole, cameras[view], options.size, isovalue);
      expect_same_hits(frame.hits, expected, options.size.width);
      std::size_t num_doubles = 0;  // of a hit: a ray in the plane of a cut is in one brick, too
      for (const auto &[ray, hit] : frame.all)
        num_doubles += hit.t <= expected[ray].t && hit.block_id != expected[ray].block_id;
      EXPECT_EQ(num_doubles, 0u);
      std::vector<HitRecord> depths(num_rays, no_hit());
      set_field(frame.depths, HitField::kT, depths);
      EXPECT_EQ(depth_of(depths), depth_of(expected));
      renderer.render({.camera = cameras[view], .isovalue = isovalue});
      Image8 image{options.size.width, options.size.height, 3,
                   std::vector<std::uint8_t>(3 * num_rays)};
      set_colors(frame.colors, 0, 3, image.pixels);
      EXPECT_EQ(image.pixels, renderer.shade().pixels);
      num_hits += test::num_hits(expected);
    }
    return num_hits;
  }

  ocl::Device device_{GetParam().device};
};
INSTANTIATE_TEST_SUITE_P(Pipelines, BricksOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

/// Eyes outside, inside a brick, and in the plane of a cut, along which rays run, in both
/// directions.
std::vector<Camera> views_of(const VolumeInfo &info, const glm::dvec3 &cut) {
  const glm::dvec3 end(info.dims - 1u), middle = 0.5 * end;
  return {orbit_cameras(info, 1)[0], camera_along(middle + 0.3, {1, 0.25, -0.5}),
          camera_along({cut.x, middle.y, -9}, {0, 0, 1}),
          camera_along({end.x + 9, cut.y, cut.z}, {-1, 0, 0}), camera_along(cut, {0.2, 1, 0.4})};
}

TEST_P(BricksOnDevice, SmallTwoBricks) {
  const TestVolume volume({9, 10, 11}, test::noise_field(3), 8);
  EXPECT_GT(check(volume, Cuts(blocks_along(volume.info()), 2),
                  {camera_along({4, 4.5, 4}, {1, 0.25, -0.5})}, 0.1f, {.size = {6, 5}}),
            10u);
}

TEST_P(BricksOnDevice, EyesOutsideInsideAndOnCuts) {
  const TestVolume volume({37, 30, 26}, test::gyroid_field(9));
  const Cuts cuts(blocks_along(volume.info()), glm::uvec3(3, 2, 2));
  EXPECT_GT(check(volume, cuts, views_of(volume.info(), {12, 16, 12}), 0.2f, {.size = {49, 33}}),
            2000u);
}

/// Isovalue and voxels are equal, and surfaces lie in planes of voxels: on cuts as well.
TEST_P(BricksOnDevice, SurfacesInTheCuts) {
  const glm::uvec3 dims(21, 18, 17);
  const auto steps = [](const glm::dvec3 &p) {
    return (p.x >= 8 ? 1.0 : 0.0) + (p.y >= 8 ? 1.0 : 0.0) + (p.z >= 8 ? 1.0 : 0.0);
  };
  const TestVolume volume(dims, steps, 16);
  const Cuts cuts(blocks_along(volume.info()), glm::uvec3(2, 2, 2));
  for (const float isovalue : {1.0f, 2.0f, 0.5f})
    EXPECT_GT(check(volume, cuts, views_of(volume.info(), {8, 8, 8}), isovalue, {.size = {33, 21}}),
              100u);
}

TEST_P(BricksOnDevice, OneBlockEachInTightCaches) {
  const TestVolume volume(test::grid_info({13, 9, 12}, {1, 2, 0.5}),
                          test::sample({13, 9, 12}, test::noise_field(4)), ErrorGoal{0.01});
  const Cuts cuts(blocks_along(volume.info()), 36);
  EXPECT_GT(check(volume, cuts, {orbit_cameras(volume.info(), 1)[0]}, 0.1f,
                  {.size = {25, 17}, .cache_slots = 27}),
            100u);
}

/// Ranges of values are stored through the whole's thresholds, so that bricks find the blocks that
/// the whole finds. So bricks have its default view, too.
TEST_P(BricksOnDevice, SameActiveBlocks) {
  const TestVolume volume({21, 18, 17}, test::sphere_field({21, 18, 17}));
  const RendererOptions options = GetParam().with({.size = {9, 7}});
  DeviceRenderer whole(device_, volume.compressed, options);
  const Cuts cuts(blocks_along(volume.info()), 3);
  std::vector<float> samples;
  for (const BlockBox &own : cuts.bricks()) {
    const auto some = range_samples(cut_brick(volume.compressed, own), volume.info());
    samples.insert(samples.end(), some.begin(), some.end());
  }
  RendererOptions of_brick = options;
  of_brick.range_thresholds = range_thresholds(samples);
  EXPECT_EQ(of_brick.range_thresholds, whole.macrocells().thresholds());
  const std::vector<float> isovalues = {0.8f};
  BlockBox box{glm::ivec3(99), glm::ivec3(-1)};
  for (const BlockBox &own : cuts.bricks()) {
    const CompressedVolume brick = cut_brick(volume.compressed, own);
    DeviceRenderer renderer(device_, brick, of_brick);
    const std::optional<BlockBox> active = renderer.surface_box(isovalues);
    ASSERT_TRUE(active);
    const glm::ivec3 first(brick.info.brick.first_voxel / 4u);
    EXPECT_TRUE(glm::all(glm::greaterThanEqual(active->begin + first, own.begin)));
    EXPECT_TRUE(glm::all(glm::lessThanEqual(active->end + first, own.end)));
    box.begin = glm::min(box.begin, active->begin + first);
    box.end = glm::max(box.end, active->end + first);
  }
  const std::optional<BlockBox> expected = whole.surface_box(isovalues);
  ASSERT_TRUE(expected);
  EXPECT_EQ(box.begin, expected->begin);
  EXPECT_EQ(box.end, expected->end);
}

/// Bands of several levels of detail, whose borders lie in bricks and on cuts. Other kinds of a
/// pipeline have the same kernels there.
TEST_P(BricksOnDevice, LevelsOfDetail) {
  if (!GetParam().pipeline->has_levels()) return;  // draws the finest level alone
  const VolumeInfo info = test::grid_info({41, 37, 33});
  ArrayReader reader(info, test::sample(info.dims, test::noise_field(6)));
  constexpr std::size_t kLevels = 3;
  const CompressedVolume whole = compress(reader, {.rate = 8, .levels = kLevels});
  const Cuts cuts(blocks_along(info), glm::uvec3(3, 2, 2), cut_unit(kLevels));
  const ImageSize size{49, 33};
  RendererOptions options = GetParam().with({.size = size});
  options.with_levels = true;
  DeviceRenderer of_whole(device_, whole, options);
  const std::vector<Camera> cameras = views_of(info, {16, 16, 16});
  std::vector<std::vector<HitRecord>> hits(cameras.size(),
                                           std::vector<HitRecord>(size.num_rays(), no_hit()));
  std::vector<std::vector<std::uint32_t>> place(
      cameras.size(), std::vector<std::uint32_t>(size.num_rays(), kNoPlace));
  const auto request = [&](std::size_t view) {
    return FrameRequest{.camera = cameras[view], .isovalue = 0.2f, .voxel_pixels = 2.5};
  };
  for (std::size_t brick = 0; brick < cuts.bricks().size(); ++brick) {
    const CompressedVolume volume = cut_brick(whole, cuts.bricks()[brick], kLevels);
    DeviceRenderer renderer(device_, volume, options);
    for (std::size_t view = 0; view < cameras.size(); ++view) {
      renderer.render(request(view));
      const View rays = make_view(info, cameras[view], size);
      const std::uint32_t at = cuts.order_from({rays.eye_x, rays.eye_y, rays.eye_z})[brick];
      const std::vector<HitRecord> own = renderer.hits();
      for (std::size_t ray = 0; ray < own.size(); ++ray) {
        if (own[ray].block_id == ISO_INVALID_ID || at > place[view][ray]) continue;
        place[view][ray] = at;
        hits[view][ray] = own[ray];
      }
    }
  }
  std::size_t num_levels = 0;
  for (std::size_t view = 0; view < cameras.size(); ++view) {
    SCOPED_TRACE(fmt::format("view {}", view));
    const FrameStats stats = of_whole.render(request(view));
    num_levels = std::max(num_levels, stats.last_level - stats.first_level + 1);
    std::vector<HitRecord> expected = of_whole.hits();
    EXPECT_GT(test::num_hits(expected), 200u);
    for (std::size_t ray = 0; ray < expected.size(); ++ray)  // ids are a brick's own
      hits[view][ray].block_id = expected[ray].block_id;
    expect_same_hits(hits[view], expected, size.width);
  }
  EXPECT_EQ(num_levels, kLevels);
}

/// Ambient rays begin in any brick and go on in others: they meet what they meet in the whole.
class AmbientBricksOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void SetUp() override {
    if (is_llvmpipe(GetParam()) && !long_tests())
      GTEST_SKIP() << "compiling the kernels of both kinds of rays takes llvmpipe minutes";
  }

  void check(const CompressedVolume &whole, const Cuts &cuts, const std::vector<Camera> &cameras,
             RendererOptions options, std::uint32_t num_rays, double voxel_pixels = 0) {
    constexpr float kIsovalue = 0.2f;
    options.with_given_rays = true;
    options.with_levels = voxel_pixels > 0;
    const Twin twin(whole, voxel_pixels);
    std::vector<CompressedVolume> bricks;
    std::vector<std::unique_ptr<DeviceRenderer>> renderers;
    const std::vector<VolumeInfo> infos = level_infos(whole, options.with_levels);
    const std::size_t num_levels = infos.size();
    for (const BlockBox &own : cuts.bricks()) {
      bricks.push_back(cut_brick(whole, own, num_levels));
      renderers.push_back(std::make_unique<DeviceRenderer>(device_, bricks.back(), options));
    }
    const std::size_t num_pixels = options.size.num_rays();
    std::uint64_t num_met_elsewhere = 0;
    for (std::size_t view = 0; view < cameras.size(); ++view) {
      SCOPED_TRACE(fmt::format("view {}", view));
      const View rays = make_view(whole.info, cameras[view], options.size);
      const auto places = cuts.order_from({rays.eye_x, rays.eye_y, rays.eye_z});
      std::vector<HitRecord> placed(num_pixels, no_hit());
      std::vector<std::uint32_t> place(num_pixels, kNoPlace);
      for (std::size_t brick = 0; brick < bricks.size(); ++brick) {
        renderers[brick]->render(
            {.camera = cameras[view], .isovalue = kIsovalue, .voxel_pixels = voxel_pixels});
        const std::vector<HitRecord> own = renderers[brick]->placed_hits();
        for (std::size_t pixel = 0; pixel < num_pixels; ++pixel) {
          if (!std::isfinite(own[pixel].t) || places[brick] > place[pixel]) continue;
          place[pixel] = places[brick];
          placed[pixel] = own[pixel];
        }
      }
      const std::vector<FrameParams> frames =
          make_level_frames(infos, cameras[view], options.size, kIsovalue, voxel_pixels);
      const auto first = std::ranges::find_if(frames, draws);
      const LevelRange levels{
          std::size_t(first - frames.begin()),
          std::size_t(first - frames.begin() + std::count_if(first, frames.end(), draws))};
      OpenCounts open{std::vector<uchar>(num_pixels), num_rays};
      for (std::uint32_t round = 0; round < num_rays; ++round) {
        std::vector<bool> is_met(num_pixels);
        for (std::size_t brick = 0; brick < bricks.size(); ++brick) {
          const FrameRequest lit{
              .camera = cameras[view], .isovalue = kIsovalue, .ambient_rays = num_rays};
          if (round == 0) renderers[brick]->begin_ambient(lit, placed, levels);
          LaterPasses stats;
          const auto blocked = renderers[brick]->blocked_rays(lit, round, stats);
          EXPECT_GT(stats.passes, 0u);
          for (std::size_t pixel = 0; pixel < num_pixels; ++pixel) {
            const bool meets =
                std::isfinite(placed[pixel].t) && (blocked[pixel / 64] >> pixel % 64 & 1) != 0;
            num_met_elsewhere += meets && place[pixel] != places[brick];
            is_met[pixel] = is_met[pixel] || meets;
          }
        }
        for (std::size_t pixel = 0; pixel < num_pixels; ++pixel)
          open.counts[pixel] = static_cast<uchar>(
              open.counts[pixel] + (std::isfinite(placed[pixel].t) && !is_met[pixel]));
      }
      const std::vector<HitRecord> hits = twin.render(cameras[view], options.size, kIsovalue);
      const OpenCounts expected =
          twin.open(cameras[view], options.size, kIsovalue, hits, {.num_ambient = num_rays});
      EXPECT_EQ(open.counts, expected.counts);
      DeviceRenderer &renderer = *renderers.front();
      renderer.set_open(open);
      const FrameParams frame =
          make_frame_params(whole.info, cameras[view], options.size, kIsovalue);
      EXPECT_EQ(renderer.shade().pixels,
                shade_scalar(frame, make_shade_params(whole.info, {}), hits, 1, expected).pixels);
    }
    EXPECT_GT(num_met_elsewhere, 0u);
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, AmbientBricksOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(AmbientBricksOnDevice, SmallFrame) {
  const TestVolume volume({14, 15, 13}, test::gyroid_field(6));
  check(volume.compressed, Cuts(blocks_along(volume.info()), 2),
        {orbit_cameras(volume.info(), 1)[0]}, {.size = {7, 5}}, 1);
}

TEST_P(AmbientBricksOnDevice, EyesOutsideInsideAndOnCuts) {
  const TestVolume volume({37, 30, 26}, test::gyroid_field(9));
  check(volume.compressed, Cuts(blocks_along(volume.info()), glm::uvec3(2, 2, 1)),
        views_of(volume.info(), {16, 16, 12}), {.size = {31, 23}, .cache_slots = 100}, 3);
}

TEST_P(AmbientBricksOnDevice, LevelsOfDetail) {
  const VolumeInfo info = test::grid_info({50, 44, 60});
  ArrayReader reader(info, test::sample(info.dims, test::gyroid_field(14)));
  const CompressedVolume whole = compress(reader, {.rate = 8, .levels = 3});
  const Cuts cuts(blocks_along(info), 3, num_blocks, cut_unit(3));
  for (const double voxel_pixels : {0.7, 6.0})  // several levels, and a coarser one alone
    check(whole, cuts, {orbit_cameras(info, 2)[1]}, {.size = {37, 29}}, 2, voxel_pixels);
}

TEST_P(AmbientBricksOnDevice, RaysThatGoOnAreRefused) {
  const TestVolume volume({9, 10, 11}, test::noise_field(3), 8);
  const Cuts cuts(blocks_along(volume.info()), 2);
  const CompressedVolume brick = cut_brick(volume.compressed, cuts.bricks()[0]);
  const RendererOptions options{.size = {6, 5}, .with_given_rays = true};
  DeviceRenderer renderer(device_, brick, options);
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  EXPECT_THROW(renderer.render({.camera = camera, .ambient_rays = 1}), Error);
  EXPECT_THROW(renderer.cast_rays({}, 0.1f, Normals::kCell), Error);
  DeviceRenderer whole(device_, volume.compressed, options);
  whole.render({.camera = camera});
  EXPECT_THROW(whole.begin_ambient({.camera = camera}, whole.hits(), {}), Error);
}

// ---- without a device

/// What a brick keeps is the whole's, bit for bit, cut out of it or compressed by itself.
TEST(Bricks, KeepTheWholesVoxels) {
  const VolumeInfo info = test::grid_info({23, 17, 14});
  const Cuts cuts(blocks_along(info), 7);
  const std::vector<float> source = test::sample(info.dims, test::gyroid_field(7));
  const auto open = [&] { return std::make_unique<ArrayReader>(info, source); };
  for (const bool is_bounded : {false, true}) {
    Storage storage{.rate = 5};
    if (is_bounded) storage.tolerance = 0.01;
    const CompressedVolume whole = compress_volume(open, "a test's volume", storage);
    const std::vector<float> voxels = decode_with_libzfp(whole);
    const auto path = std::filesystem::path(testing::TempDir()) /
                      fmt::format("bricks_{}_{}.zfp", int(is_bounded), getpid());
    write_zfp_file(whole, path);
    for (const BlockBox &own : cuts.bricks()) {
      const CompressedVolume cut = cut_brick(whole, own), read = read_brick(path, own),
                             compressed = compress_brick(open, "a test's volume", storage, own);
      const VolumeInfo &brick = cut.info;
      EXPECT_EQ(cut.words, read.words);
      EXPECT_EQ(cut.words, compressed.words);
      EXPECT_EQ(cut.index, read.index);
      EXPECT_EQ(cut.index, compressed.index);
      const std::vector<float> decoded = decode_with_libzfp(cut);
      std::size_t i = 0;
      for (std::uint32_t z = 0; z < brick.dims.z; ++z) {
        for (std::uint32_t y = 0; y < brick.dims.y; ++y) {
          for (std::uint32_t x = 0; x < brick.dims.x; ++x, ++i) {
            const glm::uvec3 at = brick.brick.first_voxel + glm::uvec3(x, y, z);
            ASSERT_EQ(
                decoded[i],
                voxels[at.x + std::size_t{info.dims.x} * (at.y + std::size_t{info.dims.y} * at.z)]);
          }
        }
      }
    }
    std::filesystem::remove(path);
  }
}

/// Each of a brick's blocks has its bound in the whole, and the brick what is known of all voxels.
TEST(Bricks, KeepTheWholesBounds) {
  const VolumeInfo info = test::grid_info({41, 37, 33});
  ArrayReader reader(info, test::sample(info.dims, test::noise_field(6)));
  constexpr std::size_t kLevels = 3;
  for (const bool is_bounded : {false, true}) {
    CompressOptions options{.rate = 8, .measure_error = true, .levels = kLevels};
    if (is_bounded) options.precision = BlockPrecision{.min_exponent = -5};
    const CompressedVolume whole = compress(reader, options);
    const auto path = std::filesystem::path(testing::TempDir()) /
                      fmt::format("bounds_{}_{}.zfp", int(is_bounded), getpid());
    write_zfp_file(whole, path);
    const Cuts cuts(blocks_along(info), 5, num_blocks, cut_unit(kLevels));
    for (const BlockBox &own : cuts.bricks()) {
      EXPECT_TRUE(read_brick(path, own, kLevels).bounds.codes.empty());
      for (const CompressedVolume &brick :
           {cut_brick(whole, own, kLevels), read_brick(path, own, kLevels, true)}) {
        EXPECT_EQ(brick.value_range, whole.value_range);
        EXPECT_EQ(brick.max_voxel_error, whole.max_voxel_error);
        for (std::size_t i = 0; i < kLevels; ++i) {
          const CompressedVolume &of_brick = *levels_of(brick, true)[i],
                                 &of_whole = *levels_of(whole, true)[i];
          EXPECT_EQ(of_brick.bounds.exponent, of_whole.bounds.exponent);
          EXPECT_EQ(of_brick.bounds.by_place, i == 0);
          EXPECT_EQ(largest_bound(of_brick.bounds), largest_bound(of_whole.bounds));
          ASSERT_EQ(of_brick.bounds.codes.size(), of_brick.block_count());
          for (std::uint32_t id = 0; id < of_brick.block_count(); ++id) {
            EXPECT_EQ(of_brick.bounds.codes[id],
                      of_whole.bounds.codes[whole_id(of_whole.info, of_brick.info, id)]);
          }
        }
      }
    }
    std::filesystem::remove(path);
  }
}

/// Another spacing moves no brick: see load_brick().
TEST(Bricks, LevelsKeepTheirPlaces) {
  const VolumeInfo info = test::grid_info({41, 37, 33});
  ArrayReader reader(info, test::sample(info.dims, test::noise_field(6)));
  const CompressedVolume whole = compress(reader, {.rate = 8, .levels = 3});
  const Cuts cuts(blocks_along(info), 2, num_blocks, cut_unit(3));
  CompressedVolume brick = cut_brick(whole, cuts.bricks()[1], 3);
  const std::vector<VolumeInfo> before = level_infos(brick, true);
  set_spacing(brick, {2, 3, 4});
  const std::vector<VolumeInfo> after = level_infos(brick, true);
  ASSERT_EQ(after.size(), 3u);
  for (std::size_t level = 0; level < 3; ++level) {
    EXPECT_NE(before[level].brick, BrickOf{});
    EXPECT_EQ(after[level].brick, before[level].brick);
    EXPECT_EQ(after[level].dims, before[level].dims);
    EXPECT_EQ(after[level].spacing, before[level].spacing * glm::dvec3(2, 3, 4));
  }
}

/// Blocks that a surface touches are shared out.
TEST(Bricks, SurfacesAreSharedOut) {
  const VolumeInfo info = test::grid_info({128, 66, 80});
  // A wall near the end of x, in three quarters of y.
  const std::vector<float> source = test::sample(
      info.dims, [](const glm::dvec3 &p) { return p.x > 101.5 && p.y < 48 ? 1.0 : 0.0; });
  ArrayReader reader(info, source);
  const CompressedVolume whole = compress(reader, {.rate = 16});
  const glm::ivec3 blocks = blocks_along(info);
  const std::vector<float> isovalues = {0.5f};
  std::vector<std::uint32_t> counts;
  for (int z = 0; z < blocks.z; z += 2 * kWorkUnit) {
    const BlockBox slab{{0, 0, z}, {blocks.x, blocks.y, std::min(z + 2 * kWorkUnit, blocks.z)}};
    const auto some = count_touched(cut_brick(whole, slab), isovalues);
    counts.insert(counts.end(), some.begin(), some.end());
  }
  const SurfaceWork work(blocks, counts);
  EXPECT_EQ(work({glm::ivec3(0), blocks}), 12u * 20u);
  EXPECT_EQ(work({{24, 4, 0}, {28, 12, 8}}), 8u * 8u);
  EXPECT_EQ(work({{0, 0, 0}, {24, blocks.y, blocks.z}}), 0u);
  const Cuts cuts(blocks, 4, work, kWorkUnit);
  for (const BlockBox &brick : cuts.bricks()) EXPECT_GE(work(brick), 32u);
}

/// The cells that a ray passes through in all bricks, one after the other, are those of the whole
/// volume: none is left out, none comes twice.
TEST(Bricks, RaysPassThroughEachCellInOneBrick) {
  const char *asked = std::getenv("ISOWAVE_FUZZ_RAYS");
  const int num_rays = asked == nullptr ? 20000 : std::atoi(asked);
  std::mt19937 random(5);
  const auto real = [&](float first, float end) {
    return std::uniform_real_distribution<float>(first, end)(random);
  };
  const VolumeInfo info = test::grid_info({29, 22, 18});
  const Cuts cuts(blocks_along(info), 11);
  const glm::ivec3 last = glm::ivec3(info.dims) - 1;
  std::uint64_t num_cells = 0;
  // Cells from where the ray enters a box of blocks to where it leaves it.
  const auto walk = [&](Ray ray, const FrameParams &frame, const glm::ivec3 &begin,
                        const glm::ivec3 &end, std::vector<glm::ivec3> &cells) {
    ray.x.origin = frame.brick.origin_x;
    ray.y.origin = frame.brick.origin_y;
    ray.z.origin = frame.brick.origin_z;
    const LastPlanes planes = last_planes(&frame);
    const glm::ivec3 ends = glm::min(4 * end, glm::ivec3(planes.x, planes.y, planes.z)),
                     origin(ray.x.origin, ray.y.origin, ray.z.origin);
    RayEvent enter;
    if (glm::any(glm::greaterThanEqual(4 * begin, ends))) return;  // owns no cell
    if (!box_entry(&ray, {4 * begin.x, 4 * begin.y, 4 * begin.z}, {ends.x, ends.y, ends.z}, &enter))
      return;
    GridWalk at = walk_from(&ray, locate(ray.x, 0, enter, 1, 4 * begin.x, planes.x - 1),
                            locate(ray.y, 1, enter, 1, 4 * begin.y, planes.y - 1),
                            locate(ray.z, 2, enter, 1, 4 * begin.z, planes.z - 1), 1, planes);
    while (true) {
      const glm::ivec3 cell(at.x, at.y, at.z);
      if (glm::any(glm::lessThan(cell, 4 * begin)) || glm::any(glm::greaterThanEqual(cell, ends)))
        return;
      cells.push_back(cell + origin);
      walk_step(&at, &ray, walk_exit(&at, &ray), 1, planes);
    }
  };
  for (int i = 0; i < num_rays; ++i) {
    glm::vec3 o, d;
    for (int axis = 0; axis < 3; ++axis) {
      const float end = static_cast<float>(last[axis]);
      const int kind = static_cast<int>(random() % 4);
      o[axis] = kind == 0 ? std::floor(real(-4, end + 4)) : real(-end, 2 * end);
      d[axis] = random() % 5 == 0 ? 0.0f : (kind == 1 ? std::floor(real(-2, 3)) : real(-1, 1));
    }
    if (d == glm::vec3(0)) continue;
    const Ray ray =
        make_whole_ray(make_ray_axis(o.x, d.x), make_ray_axis(o.y, d.y), make_ray_axis(o.z, d.z));
    std::vector<glm::ivec3> expected, got;
    walk(ray, make_grid_params(info), glm::ivec3(0), blocks_along(info), expected);
    const std::vector<std::uint32_t> places = cuts.order_from(o);
    for (std::uint32_t place = 0; place < places.size(); ++place) {
      const auto brick = std::size_t(std::ranges::find(places, place) - places.begin());
      const BlockBox &own = cuts.bricks()[brick];
      const FrameParams frame = make_grid_params(brick_info(info, own));
      const glm::ivec3 first(
          glm::uvec3(frame.brick.origin_x, frame.brick.origin_y, frame.brick.origin_z) / 4u);
      walk(ray, frame, own.begin - first, own.end - first, got);
    }
    ASSERT_EQ(got, expected) << fmt::format("ray {} from {} {} {} along {} {} {}", i, o.x, o.y, o.z,
                                            d.x, d.y, d.z);
    num_cells += expected.size();
  }
  EXPECT_GT(num_cells, 2u * std::uint64_t(num_rays));
}

}  // namespace
}  // namespace isowave::core
