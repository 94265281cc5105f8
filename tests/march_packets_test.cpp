// core/march_packets against start_rays and march: pass by pass, the same rays hit, wait and leave,
// with the same bits, counts and stamps. And whole frames against the twin, where the walk of eight
// rays is hard, or the cache is small. Blocks decoded on demand: what is in the cache then, and
// frames again, many threads at the same blocks.

#include "core/stages/march_packets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <map>

#include "core/render/device_renderer.hpp"
#include "tests/rays_world.hpp"
#include "tests/slot_values.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr float kIsovalue = 0.3f;

class MarchPacketsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};

  /// Other devices do not march in packets, and Mesa takes a quarter of an hour to compile them.
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
      march_packets.begin_frame();
      for (int pass = 0; pass == 0 || alone.counts().next_active_count != 0; ++pass) {
        SCOPED_TRACE(fmt::format("pass {}", pass));
        for (RaysWorld *world : {&alone, &packets}) {
          world->rays.open_pass();
          if (pass != 0 || frame != 0) world->provide();
        }
        alone.march(alone.macrocells, alone.cache, alone.rays);
        march_packets(packets.macrocells, packets.stream, packets.cache, packets.rays);
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
  /// where they are few (lanes_per_ray()). Else the same blocks are read in a pass.
  void expect_stamps(const RaysWorld &got, const RaysWorld &expected) const {
    const std::map<uint, uint> of_packets = stamps(got), of_rays = stamps(expected);
    const PassCounts counts = expected.counts();
    const ocl::Range range = ocl::Range::strided(expected.rays.num_rays, ocl::kGroupSize, device_);
    const bool are_few = 2 * counts.active_count <= range.num_groups * range.group_size;
    ASSERT_EQ(of_packets.size(), of_rays.size());
    for (const auto &[block, stamp] : of_rays) {
      ASSERT_LE(of_packets.at(block), stamp) << "block " << block;
      if (!are_few && stamp >= 2 * counts.pass) {
        ASSERT_EQ(of_packets.at(block), stamp) << "block " << block;
      }
    }
  }

  /// Draws two frames with blocks decoded on demand, of the twin's bits, and looks at the cache
  /// after each pass.
  ///
  /// num_slots  0: one for each block
  void expect_on_demand(const test::TestVolume &volume, const Camera &camera, ImageSize size,
                        uint num_slots) {
    RaysWorld world(device_, volume, camera, size, kIsovalue, 4, num_slots);
    MarchPackets march_packets(device_, size.num_rays(), kDefaultSolver, &world.stream);
    const std::vector<HitRecord> twin =
        test::twin_hits(volume, camera, size, kIsovalue, Normals::kCell);
    const std::vector<float> values = decode_blocks_with_libzfp(volume.compressed);
    uint num_on_demand = 0;
    for (int frame = 0; frame < 2; ++frame) {
      SCOPED_TRACE(fmt::format("frame {}", frame));
      world.rays.forget_rays();
      march_packets.begin_frame();
      for (int pass = 0; pass == 0 || world.counts().next_active_count != 0; ++pass) {
        SCOPED_TRACE(fmt::format("pass {}", pass));
        ASSERT_LT(pass, 10000);
        world.rays.open_pass();
        if (pass != 0 || frame != 0) world.provide();
        const uint num_provided = pass != 0 || frame != 0 ? world.counts().decoded_count : 0,
                   num_free = count_free(world);
        march_packets(world.macrocells, world.stream, world.cache, world.rays);
        expect_whole_cache(world, values);
        num_on_demand = world.counts().decoded_count - num_provided;
        EXPECT_EQ(count_free(world), num_free - num_on_demand);
        EXPECT_EQ(world.counts().free_count, num_free - num_on_demand);
        if (pass == 0 && frame == 0) {
          EXPECT_GT(num_on_demand, 5u);
        }
        world.request_ahead(world.macrocells, world.cache, world.rays);
        if (HasFailure()) return;
      }
      test::expect_same_hits(world.rays.hits.read(), twin, size.width);
    }
    if (num_slots == 0) {
      EXPECT_EQ(num_on_demand, 0u) << "all was cached";
    }
  }

  static uint count_free(const RaysWorld &world) {
    const std::vector<uint> blocks = world.cache.slot_block_ids.read();
    return static_cast<uint>(std::ranges::count(blocks, ISO_INVALID_ID));
  }

  /// Each cached block is in one slot, with its values and bits; free slots are listed once; no
  /// block is marked.
  ///
  /// expected  [block][64]
  static void expect_whole_cache(const RaysWorld &world, const std::vector<float> &expected) {
    const std::vector<uint> blocks = world.cache.slot_block_ids.read(),
                            free_slots = world.cache.free_slots.read(),
                            marks = world.cache.requested_bits.read(),
                            slots = world.slots_by_block();
    const std::vector<float> values = test::slot_values(world.cache.values);
    const std::vector<ulong> inside = world.cache.inside.read();
    const CacheState state = world.cache.state.read().front();
    ASSERT_EQ(std::ranges::count(marks, 0u), std::ssize(marks));
    ASSERT_EQ(state.free_count, std::ranges::count(blocks, ISO_INVALID_ID));
    std::vector<uint> is_free(blocks.size());
    for (uint i = 0; i < state.free_count; ++i) ++is_free.at(free_slots[i]);
    for (uint slot = 0; slot < blocks.size(); ++slot) {
      ASSERT_EQ(is_free[slot], blocks[slot] == ISO_INVALID_ID ? 1u : 0u) << "slot " << slot;
      if (blocks[slot] == ISO_INVALID_ID) continue;
      ASSERT_EQ(slots.at(blocks[slot]), slot) << "block " << blocks[slot];
      for (uint v = 0; v < 64; ++v) {
        const float value = values[64 * std::size_t{slot} + v];
        ASSERT_EQ(std::bit_cast<uint>(value),
                  std::bit_cast<uint>(expected[64 * std::size_t{blocks[slot]} + v]))
            << "block " << blocks[slot] << ", voxel " << v;
        ASSERT_EQ(inside[slot] >> v & 1, value - kIsovalue >= 0 ? 1u : 0u);
      }
    }
    for (uint block = 0; block < slots.size(); ++block) {
      if (slots[block] == ISO_BLOCK_ABSENT) continue;
      ASSERT_EQ(blocks.at(slots[block]), block);
    }
    test::expect_pages_of_cached_blocks(world.frame, world.cache.table.read());
  }

  /// Draws frames of the twin's bits, one after the other. Returns how many rays hit.
  std::uint64_t expect_pictures(const test::TestVolume &volume,
                                const std::vector<CameraCase> &cameras, ImageSize size,
                                float isovalue, RendererOptions options = {}) {
    std::uint64_t num_hits = 0;
    options.size = size;
    options.packets = RayPackets::kOn;
    DeviceRenderer renderer(device_, volume.compressed, options);
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

/// Rays of a packet that are far apart, with blocks at the same positions in groups of 4^3 blocks:
/// one takes the place of another that somebody still looks into (opened_blocks.h). Frames come
/// again, when the cells of blocks are known before their voxels are needed.
TEST_P(MarchPacketsOnDevice, RaysApartTakeEachOthersPlaces) {
  const test::TestVolume volume({90, 34, 37}, test::noise_field(3), 8);
  std::vector<CameraCase> cameras = orbit(volume, 4);
  cameras.insert(cameras.end(), cameras.begin(), cameras.begin() + 4);
  for (const DecodeOnDemand on_demand : {DecodeOnDemand::kOff, DecodeOnDemand::kOn}) {
    EXPECT_GT(expect_pictures(volume, cameras, {8, 6}, 0.6f, {.on_demand = on_demand}), 50u);
  }
}

/// Rays wait for each other's blocks, and for blocks that were freed.
TEST_P(MarchPacketsOnDevice, TinyCaches) {
  const test::TestVolume volume({30, 27, 33}, test::gyroid_field(10), 8);
  for (const std::uint32_t num_slots : {40u, kMinCacheSlots}) {
    for (const DecodeOnDemand on_demand : {DecodeOnDemand::kOff, DecodeOnDemand::kOn}) {
      for (const StreamPlace stream : {StreamPlace::kDevice, StreamPlace::kHost}) {
        SCOPED_TRACE(fmt::format("{} slots, {}", num_slots, static_cast<int>(on_demand)));
        EXPECT_GT(
            expect_pictures(volume, orbit(volume, 2), {13, 9}, 0.3f,
                            {.cache_slots = num_slots, .on_demand = on_demand, .stream = stream}),
            50u);
      }
    }
  }
}

/// What march_packets leaves where rays decode blocks themselves: a cache in which all is as cache
/// and decode would have left it.
TEST_P(MarchPacketsOnDevice, SmallCacheFilledOnDemand) {
  const test::TestVolume volume({10, 9, 11}, test::gyroid_field(11), 8);
  for (const uint num_slots : {0u, 9u})
    expect_on_demand(volume, orbit_cameras(volume.info(), 1).front(), {6, 5}, num_slots);
}

TEST_P(MarchPacketsOnDevice, CacheFilledOnDemand) {
  const glm::uvec3 dims(30, 27, 33);
  // Blocks of one length, and of lengths of their own.
  for (const test::TestVolume &volume :
       {test::TestVolume(dims, test::gyroid_field(11), 8),
        test::TestVolume(test::grid_info(dims), test::sample(dims, test::gyroid_field(11)),
                         {.tolerance = 0.01})}) {
    for (const uint num_slots : {0u, 200u, 50u, 9u, 8u}) {
      SCOPED_TRACE(fmt::format("{} slots", num_slots));
      expect_on_demand(volume, orbit_cameras(volume.info(), 1).front(), {61, 47}, num_slots);
    }
  }
}

/// Blocks that rays only look ahead at are left out.

TEST_P(MarchPacketsOnDevice, FewerBlocksOnDemand) {
  const test::TestVolume volume({30, 27, 33}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  std::vector<FrameStats> stats;
  for (const DecodeOnDemand on_demand : {DecodeOnDemand::kOff, DecodeOnDemand::kOn}) {
    DeviceRenderer renderer(device_, volume.compressed,
                            {.size = {61, 47}, .packets = RayPackets::kOn, .on_demand = on_demand});
    stats.push_back(
        renderer.render({.camera = camera, .isovalue = kIsovalue, .normals = Normals::kCell}));
  }
  EXPECT_GT(stats[0].passes.size(), 1u);
  std::uint64_t decoded_in_turns = 0, decoded = 0;
  for (const PassStats &pass : stats[0].passes) decoded_in_turns += pass.counts.decoded_count;
  for (const PassStats &pass : stats[1].passes) decoded += pass.counts.decoded_count;
  EXPECT_LT(decoded, decoded_in_turns);
  EXPECT_GT(decoded, 50u);
  EXPECT_EQ(stats[1].rays_hit, stats[0].rays_hit);
}

/// All rays go through the same blocks, past a surface in each, to a wall behind. So threads go
/// side by side, and one often comes to the block that another is at. Slots have values that show:
/// who reads them too early hits something before the wall.
TEST_P(MarchPacketsOnDevice, ThreadsMeetAtBlocks) {
  const test::TestVolume volume(
      {160, 13, 14},
      [](const glm::dvec3 &p) { return kIsovalue + std::max(p.y - 7.3, p.x - 150.4); }, 32);
  const Camera camera =
      test::camera_along({-20.0, 6.2, 6.3}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.1);
  const ImageSize size{1, 64};
  RaysWorld world(device_, volume, camera, size, kIsovalue, 4);
  // Groups for all 8 tiles.
  MarchPackets march_packets(device_, 1 << 20, kDefaultSolver, &world.stream);
  const std::vector<HitRecord> twin =
      test::twin_hits(volume, camera, size, kIsovalue, Normals::kCell);
  for (int frame = 0; frame < 500 && !HasFailure(); ++frame) {
    SCOPED_TRACE(fmt::format("frame {}", frame));
    world.cache.clear();
    test::fill_slots(world.cache.values, SlotType::kFloat32, frame % 2 == 0 ? 1000.0f : -1000.0f);
    world.cache.inside.fill(frame % 2 == 0 ? ~ulong{0} : 0);
    world.rays.forget_rays();
    march_packets.begin_frame();
    uint num_hits = 0;
    for (int pass = 0; pass == 0 || world.counts().next_active_count != 0; ++pass) {
      world.rays.open_pass();
      if (pass != 0 || frame != 0) world.provide();
      march_packets(world.macrocells, world.stream, world.cache, world.rays);
      num_hits += world.counts().hit_count;
      world.request_ahead(world.macrocells, world.cache, world.rays);
    }
    EXPECT_EQ(num_hits, size.num_rays());
    test::expect_same_hits(world.rays.hits.read(), twin, size.width);
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
