// Frames of several levels of detail on the host: the bits of the twin and of devices.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/platform/memory.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin.hpp"
#include "tests/api_support.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::camera_along;
using test::compressed;
using test::expect_same_hits;
using testing::HasSubstr;

constexpr ImageSize kSize{43, 31};

CompressedVolume pyramid_of(const VolumeInfo &info, const std::vector<float> &voxels,
                            CompressOptions options = {.rate = 8}) {
  ArrayReader reader(info, voxels);
  options.levels = 0;
  return compress(reader, options);
}

CompressedVolume pyramid_of(const glm::uvec3 &dims, const test::VoxelFunction &field,
                            const CompressOptions &options = {.rate = 8}) {
  return pyramid_of(test::grid_info(dims), test::sample(dims, field), options);
}

std::vector<Camera> cameras_of(const VolumeInfo &info) {
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0, middle = glm::floor(0.5 * last);
  std::vector<Camera> all = orbit_cameras(info, 2);
  all.push_back(camera_along(0.3 * last, {1, 0.4, -0.3}));                // from within
  all.push_back(camera_along({middle.x, middle.y, -last.z}, {0, 0, 1}));  // along planes
  Camera parallel = all.front();
  parallel.parallel_height = 1.2 * last.y;
  all.push_back(parallel);
  return all;
}

/// Counted over some frames.
struct Seen {
  std::uint64_t hits = 0, at_borders = 0, open = 0;
  std::size_t most_levels = 0;
};

/// Draws all cameras at several distances of voxels, with smooth and cells' normals, and ambient
/// rays.
Seen check(const CompressedVolume &volume, const std::vector<Camera> &cameras, float isovalue,
           const HostRendererOptions &options = {}) {
  Seen seen;
  HostRenderer renderer(volume, options);
  for (const double voxel_pixels : {0.0, 1.3, 3.0, 40.0}) {
    const Twin twin(volume, voxel_pixels);
    for (std::size_t view = 0; view < cameras.size(); ++view) {
      SCOPED_TRACE(fmt::format("{} pixels, view {}", voxel_pixels, view));
      FrameRequest request{.camera = cameras[view],
                           .isovalue = isovalue,
                           .size = kSize,
                           .voxel_pixels = voxel_pixels,
                           .ambient_rays = 2};
      const FrameStats stats = renderer.render(request);
      const auto expected = twin.render(request.camera, kSize, isovalue);
      expect_same_hits(renderer.hits(), expected, kSize.width);
      EXPECT_EQ(stats.rays_hit, test::num_hits(expected));
      const OpenCounts open =
          twin.open(request.camera, kSize, isovalue, expected, {.num_ambient = 2});
      for (std::size_t ray = 0; ray < expected.size(); ++ray) {
        if (expected[ray].t == INFINITY) continue;
        EXPECT_EQ(renderer.open().counts[ray], open.counts[ray]) << "ray " << ray;
        seen.open += open.counts[ray];
      }
      request.normals = Normals::kCell;
      request.ambient_rays = 0;
      renderer.render(request);
      expect_same_hits(renderer.hits(),
                       twin.render(request.camera, kSize, isovalue, kDefaultSolver, Normals::kCell),
                       kSize.width);
      seen.hits += stats.rays_hit;
      seen.most_levels = std::max(seen.most_levels, stats.last_level - stats.first_level + 1);
      for (const FrameParams &frame :
           make_level_frames(renderer.levels(), request.camera, kSize, isovalue, voxel_pixels)) {
        if (!draws(frame) || frame.band.begin_t == 0) continue;
        seen.at_borders += std::uint64_t(
            std::ranges::count(expected, frame.band.begin_t * frame.view.t_scale, &HitRecord::t));
      }
    }
  }
  return seen;
}

TEST(HostLevels, FramesAreTheTwins) {
  Seen sum;
  for (const glm::uvec3 dims : {glm::uvec3(40, 37, 44), {33, 9, 18}}) {
    for (const auto &field :
         {test::gyroid_field(11), test::noise_field(5), test::sphere_field(dims)}) {
      for (const CompressOptions &options :
           {CompressOptions{.rate = 8},
            CompressOptions{.precision = BlockPrecision{.min_exponent = -6}}}) {
        const CompressedVolume volume = pyramid_of(dims, field, options);
        const Seen seen = check(volume, cameras_of(volume.info), 0.4f);
        EXPECT_GT(seen.hits, 1000u);
        EXPECT_GT(seen.most_levels, 1u);
        sum.at_borders += seen.at_borders;
        sum.open += seen.open;
      }
    }
  }
  EXPECT_GT(sum.at_borders, 10u);
  EXPECT_GT(sum.open, 1000u);
}

TEST(HostLevels, WholeNumbersAndSpacing) {
  VolumeInfo info = test::grid_info({30, 27, 33}, {1, 0.5, 2});
  info.origin = {40, -7, 3};
  info.type = VoxelType::kUint8;
  const CompressedVolume volume =
      pyramid_of(info, test::sample(info.dims, test::plateau_field()),
                 {.precision = BlockPrecision{.min_exponent = -1, .whole_numbers = true}});
  EXPECT_GT(check(volume, orbit_cameras(info, 3), 102).hits, 1000u);
}

TEST(HostLevels, VoxelsWithoutDataAreOnNoSide) {
  const glm::uvec3 dims(40, 37, 33);
  for (const test::NamedHole &hole : test::holes(dims)) {
    SCOPED_TRACE(hole.name);
    const CompressedVolume volume = compressed(
        dims, test::with_hole(dims, test::sample(dims, test::gyroid_field(11)), hole.hole),
        {.rate = 12, .levels = 0});
    check(volume, cameras_of(volume.info), 0.3f);
  }
}

/// Levels whose active blocks take up a corner of the volume, and levels that disagree.
TEST(HostLevels, ActiveBlocksFarFromBorders) {
  const glm::uvec3 dims(96, 80, 64);
  const auto ball = [](const glm::vec3 &centre, float inner, float outer) {
    return [=](const glm::vec3 &at) { return glm::distance(at, centre) < 9 ? inner : outer; };
  };
  CompressedVolume volume = pyramid_of(dims, ball({75, 60, 45}, 1, 0));
  std::vector<Camera> cameras = orbit_cameras(volume.info, 3);
  cameras.push_back(camera_along({12, 11, 10}, {1, 0.8, 0.6}));  // from within
  check(volume, cameras, 0.5f);
  // Every ray that comes to the border hits there.
  volume.coarser_levels = pyramid_of(dims, ball({20, 20, 20}, 0, 1)).coarser_levels;
  EXPECT_GT(check(volume, cameras, 0.5f).at_borders, 300u);
}

/// A coarser level is made when a frame needs it. Whatever the limit, frames have the same bits.
TEST(HostLevels, AnyLimitGivesTheSameBits) {
  const CompressedVolume volume = pyramid_of({70, 41, 53}, test::gyroid_field(13), {.rate = 9});
  const std::vector<Camera> cameras = {orbit_cameras(volume.info, 1)[0],
                                       camera_along({30, 20, 20}, {1, 0.4, -0.3})};
  std::uint64_t least = HostBlocks::ray_bytes();
  for (const VolumeInfo &info : level_infos(volume, true)) least += HostBlocks::bytes(info);
  EXPECT_EQ(HostRenderer(volume).memory_bytes(), HostBlocks::bytes(volume.info));
  for (const std::uint64_t pages : {0, 20}) {
    const std::uint64_t limit = least + pages * platform::page_bytes();
    HostRenderer renderer(volume, {.memory_limit = limit});
    for (const double voxel_pixels : {0.0, 1.3, 40.0}) {
      renderer.render(
          {.camera = cameras[1], .isovalue = 0.2f, .size = kSize, .voxel_pixels = voxel_pixels});
      EXPECT_LE(renderer.memory_bytes(), limit);
    }
    for (const std::uint32_t threads : {1, 2})
      EXPECT_GT(check(volume, cameras, 0.2f, {limit, threads}).hits, 1000u);
  }
  EXPECT_THAT(test::error_of([&] { HostRenderer(volume, {.memory_limit = least - 1}); }),
              HasSubstr("raise the limit"));
}

TEST(HostLevels, OnlyLevelsThatDrawAreDecoded) {
  const CompressedVolume volume = pyramid_of({64, 64, 64}, test::gyroid_field(16));
  const Camera camera = camera_along({32, 32, -200}, {0, 0, 1}, {0, 1, 0}, 30);
  const auto num_decoded = [&](double voxel_pixels) {
    HostRenderer renderer(volume);
    renderer.render(
        {.camera = camera, .isovalue = 0.4f, .size = kSize, .voxel_pixels = voxel_pixels});
    return renderer.num_decoded_blocks();
  };
  EXPECT_LT(3 * num_decoded(4.0), num_decoded(0));
}

TEST(HostLevels, VolumesWithoutThemAreRefused) {
  const CompressedVolume volume = compressed(
      {20, 20, 20}, test::sample({20, 20, 20}, test::gyroid_field(9)), {.rate = 8, .levels = 1});
  HostRenderer renderer(volume);
  FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0], .isovalue = 0.2f};
  request.voxel_pixels = 1;
  EXPECT_THAT(test::error_of([&] { renderer.render(request); }),
              HasSubstr("leave out voxel_pixels"));
  EXPECT_EQ(renderer.levels().size(), 1u);
}

class HostLevelsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, HostLevelsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(HostLevelsOnDevice, FramesAreTheDevices) {
  const CompressedVolume volume = pyramid_of({30, 27, 33}, test::gyroid_field(10));
  ocl::Device device(GetParam());
  const ImageSize size{24, 16, 2};
  DeviceRenderer renderer(device, volume,
                          {.size = size, .with_levels = true, .with_given_rays = true});
  HostRenderer host(volume);
  FrameRequest request{.isovalue = 0.4f, .size = size};
  for (const Camera &camera : cameras_of(volume.info)) {
    for (const double voxel_pixels : {0.0, 1.5, 4.0, 40.0}) {
      request.camera = camera;
      request.voxel_pixels = voxel_pixels;
      request.ambient_rays = voxel_pixels == 4.0 ? 3 : 0;
      const FrameStats expected = renderer.render(request), got = host.render(request);
      EXPECT_EQ(got.first_level, expected.first_level);
      EXPECT_EQ(got.last_level, expected.last_level);
      expect_same_hits(host.hits(), renderer.hits(), size.ray_columns());
      EXPECT_EQ(host.shade().pixels, renderer.shade().pixels);
    }
  }
}

}  // namespace
}  // namespace isowave::core
