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
                           .size = kSize,
                           .clip = clip,
                           .voxel_pixels = voxel_pixels,
                           .ambient_rays = kAmbient};
      const auto expected =
          twin.render(camera, kSize, isovalue, kDefaultSolver, Normals::kSmooth, clip);
      expect_same_hits(draw(request), expected, kSize.width);
      const OpenCounts open = twin.open(camera, kSize, isovalue, expected,
                                        {.num_ambient = kAmbient}, kDefaultSolver, clip);
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
  EXPECT_GT(seen.hits, 5'000u);
  EXPECT_GT(seen.caps, 500u);
  EXPECT_GT(seen.not_as_whole, 5'000u);
  EXPECT_GT(seen.open, 5'000u);
}

Seen &operator+=(Seen &sum, const Seen &seen) {
  sum.hits += seen.hits;
  sum.caps += seen.caps;
  sum.not_as_whole += seen.not_as_whole;
  sum.open += seen.open;
  return sum;
}

CompressedVolume gyroid() {
  const VolumeInfo info = placed_grid({40, 37, 44});
  return pyramid_of(info, test::sample(info.dims, test::gyroid_field(11)));
}

/// Noise with voxels that have no data.
CompressedVolume noise_with_gaps() {
  const VolumeInfo info = placed_grid({40, 37, 44});
  std::vector<float> voxels = test::sample(info.dims, test::noise_field(5));
  for (std::size_t i = 0; i < voxels.size(); i += 97) voxels[i] = NAN;
  return pyramid_of(info, voxels);
}

Seen check_renderer(auto &renderer, const CompressedVolume &volume,
                    std::initializer_list<double> voxel_pixels) {
  Seen sum;
  for (const double pixels : voxel_pixels) {
    sum += check(
        volume, 0.4f, pixels,
        [&](const FrameRequest &request) {
          renderer.render(request);
          return renderer.hits();
        },
        [&] { return renderer.open(); });
  }
  return sum;
}

TEST(ClippedOnTheHost, FramesAreTheTwins) {
  for (const CompressedVolume &volume : {gyroid(), noise_with_gaps()}) {
    HostRenderer renderer(volume);
    expect_seen(check_renderer(renderer, volume, {0.0, 1.5, 4.0}));
  }
}

class ClippedOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void SetUp() override {
    if (is_llvmpipe(GetParam()) && !long_tests())
      GTEST_SKIP() << "compiling kernels that clip takes llvmpipe more than nine minutes";
  }

  Seen check_device(const CompressedVolume &volume, RendererOptions options,
                    std::initializer_list<double> voxel_pixels) {
    options.size = kSize;
    options.with_levels = options.with_given_rays = true;
    DeviceRenderer renderer(device_, volume, options);
    return check_renderer(renderer, volume, voxel_pixels);
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, ClippedOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(ClippedOnDevice, SmallFrames) {
  const VolumeInfo info = placed_grid({14, 13, 17});
  const auto volume = pyramid_of(info, test::sample(info.dims, test::gyroid_field(6)));
  constexpr ImageSize kSmall{11, 9};
  DeviceRenderer renderer(device_, volume,
                          {.size = kSmall, .cache_slots = 30, .with_levels = true});
  const Camera camera = orbit_cameras(info, 1)[0];
  const Twin twin(volume, 4);
  std::uint64_t caps = 0;
  for (const bool has_caps : {true, false}) {
    const Clip clip{{plane_through(info, {7, 6, 8}, {0.1, 0.2, -1}),
                     plane_through(info, {6, 6, 6}, {0.5, 1, 0.4})},
                    has_caps};
    const auto expected = twin.render(camera, kSmall, 0.2f, kDefaultSolver, Normals::kSmooth, clip);
    renderer.render({.camera = camera, .isovalue = 0.2f, .clip = clip, .voxel_pixels = 4});
    expect_same_hits(renderer.hits(), expected, kSmall.width);
    caps += static_cast<std::uint64_t>(std::ranges::count_if(expected, is_cap));
  }
  EXPECT_GT(caps, 5u);
}

TEST_P(ClippedOnDevice, FramesAreTheTwins) {
  expect_seen(check_device(gyroid(), {}, {0.0, 1.5, 4.0}));
  check_device(noise_with_gaps(), {}, {4.0});
}

/// With so few slots that most rays wait, and go on one by one.
TEST_P(ClippedOnDevice, FramesOfFewSlotsAreTheTwins) {
  expect_seen(check_device(gyroid(), {.cache_slots = 40}, {0.0, 4.0}));
}

TEST_P(ClippedOnDevice, FramesWithoutPacketsAreTheTwins) {
  expect_seen(check_device(gyroid(), {.packets = RayPackets::kOff}, {0.0, 4.0}));
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
