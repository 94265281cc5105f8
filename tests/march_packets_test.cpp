// core/march_packets against start_rays and march: pass by pass, the same rays hit, wait and leave,
// with the same bits, counts and stamps. And whole frames against the twin, where the walk of eight
// rays is hard, or the cache is small.

#include "core/stages/march_packets.hpp"

#include <gtest/gtest.h>

#include <map>

#include "core/render/renderer.hpp"
#include "tests/rays_world.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr float kIsovalue = 0.3f;

class MarchPacketsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};

  /// Elsewhere nobody marches in packets, and Mesa takes a quarter of an hour to compile them.
  void SetUp() override {
    if (!MarchPackets::suits(device_.info()) && device_.info().platform != "Oclgrind")
      GTEST_SKIP() << "rays go alone there";
  }

  /// Draws a frame both ways, an ample cache empty at first, then full. Returns how many rays hit.
  std::uint64_t expect_same_passes(const test::TestVolume &volume, const Camera &camera,
                                   ImageSize size, std::uint32_t spec_count) {
    RaysWorld alone(device_, volume, camera, size, kIsovalue, spec_count),
        packets(device_, volume, camera, size, kIsovalue, spec_count);
    MarchPackets march_packets(device_, size.num_rays(), kDefaultSolver);
    std::uint64_t num_hits = 0;
    for (int frame = 0; frame < 2; ++frame) {
      SCOPED_TRACE(fmt::format("frame {}", frame));
      const HitRecord stale = {1.0f, 2, 3, 4.0f, 5.0f, 6.0f, 7.0f, 8.0f, 9.0f};
      packets.rays.hits.write(std::vector<HitRecord>(size.num_rays(), stale));
      alone.rays.forget_rays();
      packets.rays.forget_rays();
      alone.start_rays(alone.macrocells, alone.rays);
      march_packets.begin_frame(packets.rays);
      for (int pass = 0; pass == 0 || alone.counts().next_active_count != 0; ++pass) {
        SCOPED_TRACE(fmt::format("pass {}", pass));
        for (RaysWorld *world : {&alone, &packets}) {
          world->rays.open_pass();
          if (pass != 0 || frame != 0) world->provide();
        }
        alone.march(alone.macrocells, alone.cache, alone.rays);
        march_packets(packets.macrocells, packets.cache, packets.rays);
        expect_same_rays(packets, alone);
        for (RaysWorld *world : {&alone, &packets})
          world->request_ahead(world->macrocells, world->cache, world->rays);
        expect_counts(packets.rays.counts, alone.counts());
        expect_stamps(packets, alone);
        num_hits += alone.counts().hit_count;
        if (HasFailure()) return num_hits;
      }
    }
    return num_hits;
  }

  static void expect_same_rays(const RaysWorld &got, const RaysWorld &expected) {
    EXPECT_EQ(got.waiting(), expected.waiting());
    const std::map<uint, uint> looks_ahead = looking_ahead(got);
    EXPECT_EQ(looks_ahead, looking_ahead(expected));
    test::expect_same_hits(got.rays.hits.read(), expected.rays.hits.read(), got.frame.view.width);
  }

  /// By pixel, of the rays that wait.
  static std::map<uint, uint> looking_ahead(const RaysWorld &world) {
    std::map<uint, uint> log_ahead;
    for (const RayEntry &entry : world.entries()) {
      log_ahead.emplace(entry.pixel, entry.log_ahead);
      EXPECT_EQ(entry.in_doubt, 0u) << "pixel " << entry.pixel;
    }
    return log_ahead;
  }

  /// When each cached block was last read or needed.
  static std::map<uint, uint> stamps(const RaysWorld &world) {
    const std::vector<uint> by_slot = world.cache.slot_stamps.read(),
                            slots = world.slots_by_block();
    std::map<uint, uint> stamps;
    for (uint block = 0; block < slots.size(); ++block) {
      if (slots[block] != ISO_BLOCK_ABSENT) stamps.emplace(block, by_slot.at(slots[block]));
    }
    return stamps;
  }

  /// Rays alone that share a work-group out look into blocks behind the one that decides, too,
  /// where they are few. Else the same blocks are read in a pass.
  static void expect_stamps(const RaysWorld &got, const RaysWorld &expected) {
    const std::map<uint, uint> of_packets = stamps(got), of_rays = stamps(expected);
    const PassCounts counts = expected.counts();
    const bool are_few = counts.active_count < 512;
    ASSERT_EQ(of_packets.size(), of_rays.size());
    for (const auto &[block, stamp] : of_rays) {
      ASSERT_LE(of_packets.at(block), stamp) << "block " << block;
      if (!are_few && stamp >= 2 * counts.pass) {
        ASSERT_EQ(of_packets.at(block), stamp) << "block " << block;
      }
    }
  }

  /// Draws frames of the twin's bits, one after the other. Returns how many rays hit.
  std::uint64_t expect_pictures(const test::TestVolume &volume,
                                const std::vector<CameraCase> &cameras, ImageSize size,
                                float isovalue, RendererOptions options = {}) {
    std::uint64_t num_hits = 0;
    options.size = size;
    options.packets = RayPackets::kOn;
    Renderer renderer(device_, volume.compressed, options);
    for (const CameraCase &c : cameras) {
      SCOPED_TRACE(c.name);
      const FrameStats stats =
          renderer.render({.camera = c.camera, .isovalue = isovalue, .normals = Normals::kCell});
      test::expect_same_hits(renderer.hits(),
                             test::twin_hits(volume, c.camera, size, isovalue, Normals::kCell),
                             size.width);
      num_hits += stats.rays_hit;
    }
    return num_hits;
  }

  static std::vector<CameraCase> orbit(const test::TestVolume &volume, std::uint32_t num_views) {
    std::vector<CameraCase> cases;
    for (const Camera &camera : orbit_cameras(volume.info(), num_views))
      cases.push_back({fmt::format("view {}", cases.size()), camera});
    return cases;
  }
};

TEST_P(MarchPacketsOnDevice, SmallFrame) {
  const test::TestVolume volume({10, 9, 11}, test::gyroid_field(11), 8);
  EXPECT_GT(expect_same_passes(volume, orbit_cameras(volume.info(), 1).front(), {6, 5}, 4), 5u);
}

/// Pictures that end within packets and tiles, and tiles beside the screen box.
TEST_P(MarchPacketsOnDevice, EveryPassOfAFrame) {
  const test::TestVolume volume({30, 27, 33}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  for (const ImageSize size : {ImageSize{61, 47}, ImageSize{130, 9}, ImageSize{1, 1},
                               ImageSize{3, 40}, ImageSize{257, 17}}) {
    for (const uint spec_count : {1u, 8u}) {
      SCOPED_TRACE(fmt::format("{} x {}, {} ahead", size.width, size.height, spec_count));
      expect_same_passes(volume, camera, size, spec_count);
    }
  }
}

TEST_P(MarchPacketsOnDevice, EveryPassFromAwkwardCameras) {
  const glm::uvec3 dims(38, 41, 35);
  const test::TestVolume volume(dims, test::gyroid_field(15), 8);
  std::uint64_t num_hits = 0;
  for (const CameraCase &c : camera_cases(dims)) {
    SCOPED_TRACE(c.name);
    num_hits += expect_same_passes(volume, c.camera, {41, 27}, 4);
  }
  EXPECT_GT(num_hits, 10000u);
}

TEST_P(MarchPacketsOnDevice, NothingIsActive) {
  const test::TestVolume volume({10, 9, 11}, test::gyroid_field(11), 8);
  EXPECT_EQ(expect_pictures(volume, orbit(volume, 1), {13, 7}, 1e6f), 0u);
}

TEST_P(MarchPacketsOnDevice, SmallPictures) {
  const test::TestVolume volume({9, 10, 11}, test::noise_field(21), 8);
  EXPECT_GT(expect_pictures(volume, orbit(volume, 1), {6, 5}, 0.6f), 2u);
  EXPECT_GT(expect_pictures(volume, orbit(volume, 1), {6, 5}, 0.6f,
                            {.cache_slots = kMinCacheSlots, .stream = StreamPlace::kHost}),
            2u);
}

/// Isovalues that voxels have, whole regions of them.
TEST_P(MarchPacketsOnDevice, TiesFromAwkwardCameras) {
  const glm::uvec3 dims(38, 41, 35);
  VolumeInfo info = test::grid_info(dims);
  info.type = VoxelType::kUint8;
  const test::TestVolume volume(info, test::sample(dims, test::plateau_field()), {.exact = true});
  EXPECT_GT(expect_pictures(volume, camera_cases(dims), {41, 27}, 102.0f), 5000u);
}

TEST_P(MarchPacketsOnDevice, NoiseFromAwkwardCameras) {
  for (const glm::uvec3 dims : {glm::uvec3(38, 41, 35), {2, 13, 6}, {17, 64, 5}}) {
    const test::TestVolume volume(dims, test::noise_field(3), 8);
    EXPECT_GT(expect_pictures(volume, camera_cases(dims), {41, 27}, 0.8f), 100u);
  }
}

/// Rays wait for each other's blocks, and for blocks that were freed.
TEST_P(MarchPacketsOnDevice, TinyCaches) {
  const test::TestVolume volume({30, 27, 33}, test::gyroid_field(10), 8);
  for (const std::uint32_t num_slots : {40u, kMinCacheSlots}) {
    for (const StreamPlace stream : {StreamPlace::kDevice, StreamPlace::kHost}) {
      SCOPED_TRACE(fmt::format("{} slots", num_slots));
      EXPECT_GT(expect_pictures(volume, orbit(volume, 2), {13, 9}, 0.3f,
                                {.cache_slots = num_slots, .stream = stream}),
                50u);
    }
  }
}

/// On the diagonal, the field is a square that only touches the isovalue: float32 cannot tell
/// whether a ray there crosses the surface twice, or not at all.
TEST_P(MarchPacketsOnDevice, DoubtsAreSettledOnTheSpot) {
  const glm::uvec3 dims(18, 17, 19);
  const test::TestVolume volume(
      dims, [](const glm::dvec3 &p) { return (p.x - 8.5) * (p.y - 8.5); }, 32);
  const CameraCase c = camera_cases(dims)[11];
  ASSERT_EQ(c.name, "diagonal of a face");
  EXPECT_GT(expect_pictures(volume, {c}, {23, 17}, 0.0f), 50u);
}

INSTANTIATE_TEST_SUITE_P(Devices, MarchPacketsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
