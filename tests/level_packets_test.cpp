// Frames of several levels of detail in packets of eight rays, with blocks decoded on demand
// (kernels_cl/device/packet_bands.h): the first pass draws all bands, and rays that find no slot go
// on one by one. The bits are the twin's, however many wait.

#include <gtest/gtest.h>

#include <numeric>

#include "core/render/device_renderer.hpp"
#include "core/zfp/level_bounds.hpp"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr ImageSize kSize{53, 35};

CompressedVolume pyramid_of(const glm::uvec3 &dims, const std::vector<float> &voxels,
                            CompressOptions options = {.rate = 9}) {
  ArrayReader reader(test::grid_info(dims), voxels);
  options.levels = 0;
  return compress(reader, options);
}

std::vector<Camera> cameras_of(const VolumeInfo &info) {
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0, middle = glm::floor(0.5 * last);
  std::vector<Camera> all = orbit_cameras(info, 2);
  all.push_back(test::camera_along(0.3 * last, {1, 0.4, -0.3}));                // from within
  all.push_back(test::camera_along({middle.x, middle.y, -last.z}, {0, 0, 1}));  // along planes
  return all;
}

/// Blocks of some frames, and passes.
struct Seen {
  std::uint64_t hits = 0, blocks = 0, in_first_pass = 0, waited = 0;
  std::size_t frames = 0, passes = 0;

  void add(const FrameStats &stats) {
    ++frames;
    passes += stats.passes.size();
    hits += stats.rays_hit;
    in_first_pass += stats.passes.front().counts.decoded_count;
    waited += stats.passes.front().counts.next_active_count;
    for (const PassStats &pass : stats.passes) blocks += pass.counts.decoded_count;
  }
};

class LevelPacketsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void SetUp() override {
    if (!MarchPackets::suits(device_.info()) || !MarchPackets::may_decode(device_.info()))
      GTEST_SKIP() << "frames of several levels go ray by ray there";
  }

  /// Draws frames of two levels or more from a cold cache, and again, with the twin's bits.
  Seen draw(const CompressedVolume &volume, float isovalue, const FrameRequest &as,
            RendererOptions options = {}) {
    options.size = kSize;
    options.with_levels = true;
    options.with_bounds = as.bound != FieldBound::kNone;
    options.with_given_rays = as.ambient_rays != 0;
    DeviceRenderer renderer(device_, volume, options);
    const Twin twin(volume, as.voxel_pixels, as.voxel_error, as.bound);
    Seen seen;
    for (const Camera &camera : cameras_of(volume.info)) {
      FrameRequest request = seen_from(camera, as);
      request.isovalue = isovalue;
      const auto expected = twin.render(camera, kSize, isovalue, kDefaultSolver, request.normals);
      for (int time = 0; time < 2; ++time) {
        SCOPED_TRACE(fmt::format("frame {}", seen.frames));
        const FrameStats stats = renderer.render(request);
        EXPECT_LT(stats.first_level, stats.last_level) << "no border is tested";
        test::expect_same_hits(renderer.hits(), expected, kSize.width);
        EXPECT_EQ(stats.rays_hit, test::num_hits(expected));
        EXPECT_GE(stats.passes.front().counts.active_count, stats.passes.front().counts.hit_count);
        EXPECT_LE(stats.passes.front().counts.active_count, kSize.num_rays());
        seen.add(stats);
      }
      if (as.ambient_rays != 0) {
        const OpenCounts got = renderer.open();
        const auto open =
            twin.open(camera, kSize, isovalue, expected, {.num_ambient = as.ambient_rays});
        for (std::size_t ray = 0; ray < expected.size(); ++ray) {
          if (expected[ray].t == INFINITY) continue;
          EXPECT_EQ(got.counts[ray], open.counts[ray]) << "ray " << ray;
        }
      }
    }
    return seen;
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, LevelPacketsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Packets leave out what rays alone only look ahead at.
TEST_P(LevelPacketsOnDevice, FramesTakeOnePassAndFewerBlocks) {
  const glm::uvec3 dims(40, 37, 44);
  for (const auto &field : {test::gyroid_field(11), test::noise_field(5)}) {
    const CompressedVolume volume = pyramid_of(dims, test::sample(dims, field));
    const FrameRequest request{.voxel_pixels = 2.5, .normals = Normals::kCell};
    const Seen packets = draw(volume, 0.4f, request),
               alone = draw(volume, 0.4f, request, {.on_demand = DecodeOnDemand::kOff});
    EXPECT_LE(packets.passes, packets.frames + 1) << "a ray may wait for another thread's block";
    EXPECT_GT(alone.passes, 2 * alone.frames);
    EXPECT_LT(packets.blocks, alone.blocks);
    EXPECT_EQ(packets.hits, alone.hits);
    EXPECT_GT(packets.hits, 2000u);
  }
}

/// Rays wait in a band, before a border and behind it, and go on alone.
TEST_P(LevelPacketsOnDevice, TinyCaches) {
  const glm::uvec3 dims(30, 27, 33);
  for (const auto &field : {test::gyroid_field(8), test::noise_field(5)}) {
    const CompressedVolume volume = pyramid_of(dims, test::sample(dims, field));
    for (const std::uint32_t slots : {13u, 40u}) {
      SCOPED_TRACE(fmt::format("{} slots", slots));
      const Seen seen = draw(volume, 0.3f, {.voxel_pixels = 3}, {.cache_slots = slots});
      EXPECT_GE(seen.in_first_pass, slots);
      EXPECT_GT(seen.waited, 500u);
      EXPECT_GT(seen.passes, seen.frames);
    }
  }
}

/// Levels that disagree: where rays come to a border, all hit there, or wait for the blocks of the
/// hit.
TEST_P(LevelPacketsOnDevice, HitsAtBordersWait) {
  const glm::uvec3 dims(48, 40, 44);
  CompressedVolume volume = pyramid_of(dims, test::sample(dims, test::gyroid_field(11)));
  volume.coarser_levels =
      pyramid_of(dims,
                 test::sample(dims, [](const glm::dvec3 &p) { return -test::gyroid_field(11)(p); }))
          .coarser_levels;
  for (const std::uint32_t slots : {13u, 100u, 0u}) {
    SCOPED_TRACE(fmt::format("{} slots", slots));
    EXPECT_GT(draw(volume, 0.0f, {.voxel_pixels = 2.5}, {.cache_slots = slots}).hits, 4000u);
  }
}

TEST_P(LevelPacketsOnDevice, VoxelsWithoutData) {
  const glm::uvec3 dims(40, 37, 33);
  for (const test::NamedHole &hole : test::holes(dims)) {
    SCOPED_TRACE(hole.name);
    const CompressedVolume volume = pyramid_of(
        dims, test::with_hole(dims, test::sample(dims, test::gyroid_field(11)), hole.hole));
    for (const std::uint32_t slots : {0u, 40u})
      draw(volume, 0.3f, {.voxel_pixels = 2.5}, {.cache_slots = slots});
  }
}

/// Streams of each level decoded to other values: fewer planes, bounds.
TEST_P(LevelPacketsOnDevice, FewerPlanesAndBounds) {
  const glm::uvec3 dims(30, 27, 33);
  const CompressedVolume volume =
      pyramid_of(dims, test::sample(dims, test::gyroid_field(10)),
                 {.precision = BlockPrecision{.min_exponent = -9}, .measure_error = true});
  for (const std::uint32_t slots : {0u, 60u}) {
    for (const double voxel_error : {0.3, 0.01}) {
      draw(volume, 0.4f, {.voxel_pixels = 3, .voxel_error = voxel_error}, {.cache_slots = slots});
    }
    for (const FieldBound bound : {FieldBound::kLower, FieldBound::kUpper})
      draw(volume, 0.4f, {.voxel_pixels = 3, .bound = bound}, {.cache_slots = slots});
  }
}

TEST_P(LevelPacketsOnDevice, AmbientRays) {
  const glm::uvec3 dims(30, 27, 33);
  const CompressedVolume volume = pyramid_of(dims, test::sample(dims, test::gyroid_field(10)));
  for (const std::uint32_t slots : {0u, 60u})
    draw(volume, 0.4f, {.voxel_pixels = 3, .ambient_rays = 2}, {.cache_slots = slots});
}

/// One renderer, by turns: all bands, the finest level, a coarse one alone.
TEST_P(LevelPacketsOnDevice, TakeTurnsWithOtherFrames) {
  const glm::uvec3 dims(40, 37, 44);
  const CompressedVolume volume = pyramid_of(dims, test::sample(dims, test::gyroid_field(11)));
  for (const std::uint32_t slots : {0u, 90u}) {
    DeviceRenderer renderer(device_, volume,
                            {.size = kSize, .cache_slots = slots, .with_levels = true});
    for (const double voxel_pixels : {3.0, 0.0, 60.0, 3.0, 60.0, 0.0, 3.0}) {
      const Camera camera = cameras_of(volume.info)[0];
      renderer.render({.camera = camera, .isovalue = 0.4f, .voxel_pixels = voxel_pixels});
      test::expect_same_hits(renderer.hits(),
                             Twin(volume, voxel_pixels).render(camera, kSize, 0.4f), kSize.width);
    }
  }
}

}  // namespace
}  // namespace isowave::core
