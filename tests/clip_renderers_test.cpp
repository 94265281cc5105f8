// Clipped frames: the bits of the twin on the host and on devices, with caps and open, whole and in
// levels of detail. The twin itself is judged by clip_oracle_test.cpp.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::camera_along;
using test::expect_same_hits;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{43, 31};
constexpr std::uint32_t kAmbient = 3;

VolumeInfo placed_grid(const glm::uvec3 &dims) {
  VolumeInfo info = test::grid_info(dims);
  info.spacing = {0.5, 0.7, 0.4};
  info.origin = {3, -20, 11};
  info.direction = glm::dmat3({0.8, 0.6, 0}, {-0.6, 0.8, 0}, {0, 0, 1});
  return info;
}

CompressedVolume pyramid_of(const VolumeInfo &info, const std::vector<float> &voxels) {
  ArrayReader reader(info, voxels);
  return compress(reader, {.rate = 9, .levels = 0});
}

glm::dvec3 in_world(const VolumeInfo &info, const glm::dvec3 &index) {
  return info.origin + info.index_to_world() * index;
}

/// A plane through a point, in index space.
ClipPlane plane_through(const VolumeInfo &info, const glm::dvec3 &index, const glm::dvec3 &normal) {
  return {normal, glm::dot(normal, in_world(info, index))};
}

std::vector<Clip> clips_of(const VolumeInfo &info, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> anywhere(-1, 1);
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0;
  const auto random_plane = [&] {
    const glm::dvec3 at(anywhere(random), anywhere(random), anywhere(random));
    const glm::dvec3 normal(anywhere(random), anywhere(random), anywhere(random));
    return plane_through(info, last * (0.5 + 0.3 * at), normal);
  };
  const glm::dmat3 to_world = info.index_to_world();
  const glm::dvec3 along_z = glm::cross(to_world[0], to_world[1]);
  const ClipPlane voxels = plane_through(info, glm::floor(0.5 * last), along_z);
  const ClipPlane slab_end{-voxels.normal, -voxels.offset - 1.3 * glm::dot(along_z, to_world[2])};
  std::vector<Clip> clips{{{random_plane()}},
                          {{random_plane(), random_plane(), random_plane()}},
                          {{voxels}},             // in a plane of voxels
                          {{voxels, slab_end}}};  // 1.3 voxels of them
  const std::array<ClipPlane, 6> box =
      box_planes(in_world(info, 0.3 * last) - 2.0, in_world(info, 0.6 * last) + 2.0);
  clips.push_back({{box.begin(), box.end()}});
  clips.push_back({{random_plane()}, false});
  clips.push_back({{voxels, slab_end}, false});
  return clips;
}

std::vector<Camera> cameras_of(const VolumeInfo &info) {
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0;
  std::vector<Camera> all = orbit_cameras(info, 2);
  Camera within = all.front();
  within.eye = in_world(info, 0.3 * last);
  all.push_back(within);
  Camera parallel = all.front();
  parallel.parallel_height = 0.8 * glm::distance(parallel.eye, parallel.at);
  all.push_back(parallel);
  return all;
}

/// Counted over some frames, so that no test is passed by pictures of nothing.
struct Seen {
  std::uint64_t hits = 0, caps = 0, not_as_whole = 0, open = 0;
};

/// Draws all cameras and clips.
///
/// Draw  (const FrameRequest &) -> hits; Open: () -> OpenCounts of the last frame
template <class Draw, class Open>
Seen check(const CompressedVolume &volume, float isovalue, double voxel_pixels, Draw draw,
           Open open_of_last) {
  Seen seen;
  const Twin twin(volume, voxel_pixels);
  for (const Camera &camera : cameras_of(volume.info)) {
    const auto whole = twin.render(camera, kSize, isovalue);
    for (const Clip &clip : clips_of(volume.info, 7)) {
      SCOPED_TRACE(fmt::format("{} planes, {} pixels", clip.planes.size(), voxel_pixels));
      FrameRequest request{.camera = camera,
                           .isovalue = isovalue,
                           .clip = clip,
                           .size = kSize,
                           .voxel_pixels = voxel_pixels,
                           .ambient_rays = kAmbient};
      const auto expected =
          twin.render(camera, kSize, isovalue, kDefaultSolver, Normals::kSmooth, clip);
      expect_same_hits(draw(request), expected, kSize.width);
      const OpenCounts open =
          twin.open(camera, kSize, isovalue, expected, kAmbient, kDefaultSolver, clip);
      const OpenCounts got = open_of_last();
      for (std::size_t ray = 0; ray < expected.size(); ++ray) {
        const HitRecord &hit = expected[ray];
        seen.not_as_whole += hit.t != whole[ray].t;
        if (hit.t == INFINITY) continue;
        ++seen.hits;
        seen.caps += is_cap(hit);
        seen.open += open.counts[ray];
        EXPECT_EQ(got.counts[ray], open.counts[ray]) << "ray " << ray;
      }
    }
  }
  return seen;
}

void expect_seen(const Seen &seen) {
  EXPECT_GT(seen.hits, 10'000u);
  EXPECT_GT(seen.caps, 1'000u);
  EXPECT_GT(seen.not_as_whole, 10'000u);
  EXPECT_GT(seen.open, 10'000u);
}

/// Calls draw(volume, isovalue) for some volumes, one without data everywhere.
template <class Draw>
void for_volumes(Draw draw) {
  const VolumeInfo info = placed_grid({40, 37, 44});
  const auto gyroid = test::sample(info.dims, test::gyroid_field(11));
  draw(pyramid_of(info, gyroid), 0.4f);
  auto gaps = test::sample(info.dims, test::noise_field(5));
  for (std::size_t i = 0; i < gaps.size(); i += 97) gaps[i] = NAN;
  draw(pyramid_of(info, gaps), 0.4f);
}

/// Draws with a renderer that Make makes of a volume.
template <class Make>
Seen check_renderer(Make make) {
  Seen sum;
  for_volumes([&](const CompressedVolume &volume, float isovalue) {
    const auto renderer = make(volume);
    for (const double voxel_pixels : {0.0, 1.5, 4.0}) {
      const Seen seen = check(
          volume, isovalue, voxel_pixels,
          [&](const FrameRequest &request) {
            renderer->render(request);
            return renderer->hits();
          },
          [&] { return renderer->open(); });
      sum.hits += seen.hits;
      sum.caps += seen.caps;
      sum.not_as_whole += seen.not_as_whole;
      sum.open += seen.open;
    }
  });
  return sum;
}

TEST(ClippedOnTheHost, FramesAreTheTwins) {
  expect_seen(check_renderer(
      [](const CompressedVolume &volume) { return std::make_unique<HostRenderer>(volume); }));
}

class ClippedOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  Seen check_device(RendererOptions options) {
    options.size = kSize;
    options.with_levels = options.with_given_rays = true;
    return check_renderer([&](const CompressedVolume &volume) {
      return std::make_unique<DeviceRenderer>(device_, volume, options);
    });
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, ClippedOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(ClippedOnDevice, FramesAreTheTwins) {
  expect_seen(check_device({}));
}

/// With so few slots that most rays wait, and go on one by one.
TEST_P(ClippedOnDevice, FramesOfASmallCacheAreTheTwins) {
  expect_seen(check_device({.cache_slots = 40}));
}

TEST_P(ClippedOnDevice, FramesWithoutPacketsAreTheTwins) {
  expect_seen(check_device({.packets = RayPackets::kOff}));
}

/// Pipeline `blocks` is the paper's.
TEST_P(ClippedOnDevice, PipelineBlocksRefuses) {
  const VolumeInfo info = placed_grid({9, 9, 9});
  const auto volume = pyramid_of(info, test::sample(info.dims, test::gyroid_field(3)));
  DeviceRenderer renderer(device_, volume, {.size = kSize, .pipeline = blocks_pipeline()});
  FrameRequest request{.camera = orbit_cameras(info, 1)[0], .isovalue = 0.4f};
  request.clip.planes.push_back({{1, 0, 0}, 5});
  EXPECT_THAT([&] { renderer.render(request); }, ThrowsMessage<Error>(HasSubstr("leave out clip")));
}

}  // namespace
}  // namespace isowave::core
