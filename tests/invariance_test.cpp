// What must not change the picture: speculation, cache size, grouping, work-group size, what was
// drawn before, and who watches. And what the counts of a frame's passes must say of each other.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numeric>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "core/stages/march_packets.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;
using test::twin_hits;

/// Sheets at several depths, so that rays go on behind a miss; 9x10x11 has 27 blocks.
TestVolume small_volume() {
  return TestVolume({9, 10, 11}, test::noise_field(21), 8);
}
TestVolume medium_volume() {
  return TestVolume({30, 27, 33}, test::gyroid_field(10), 8);
}

constexpr ImageSize kTiny{6, 5}, kSmall{12, 8}, kMedium{80, 54};
constexpr float kIsovalue = 0.8f;  // both fields: many candidate blocks that rays only graze

class InvarianceOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  bool is_slow() const { return is_llvmpipe(device_.info()); }
  /// The picture's size in cases that are called Small.
  ImageSize small_size() const { return is_simulator(device_.info()) ? kTiny : kSmall; }

  static bool is_blocks() { return GetParam().is_blocks(); }

  /// Draws the default view with fresh options; it must be the twin's.
  FrameStats check(const TestVolume &volume, const RendererOptions &options) {
    return check_exactly(volume, GetParam().with(options));
  }
  FrameStats check_exactly(const TestVolume &volume, const RendererOptions &options) {
    const Camera camera = orbit_cameras(volume.info(), 1)[0];
    DeviceRenderer renderer(device_, volume.compressed, options);
    const FrameStats stats = renderer.render({camera, kIsovalue});
    expect_same_hits(renderer.hits(), twin_hits(volume, camera, options.size, kIsovalue),
                     options.size.width);
    expect_consistent(stats, renderer.options());
    const FrameStats cells =
        renderer.render({.camera = camera, .isovalue = kIsovalue, .normals = Normals::kCell});
    EXPECT_EQ(cells.normals.passes, 0u);
    expect_same_hits(renderer.hits(),
                     twin_hits(volume, camera, options.size, kIsovalue, Normals::kCell),
                     options.size.width);
    return stats;
  }

  /// The relations between the counts of one frame.
  void expect_consistent(const FrameStats &stats, const RendererOptions &options) const {
    const std::uint64_t pixels = options.size.num_pixels();
    ASSERT_FALSE(stats.passes.empty());
    std::uint64_t hits = 0;
    for (std::size_t i = 0; i < stats.passes.size(); ++i) {
      SCOPED_TRACE(fmt::format("pass {}", i));
      const PassStats &pass = stats.passes[i];
      const PassCounts &c = pass.counts;
      EXPECT_EQ(c.ray_count, pixels);
      EXPECT_LE(c.active_count, pixels);
      /* Pipeline `rays` looks ahead at the end of a pass, for the rays that are left. */
      const BlocksOptions *blocks = blocks_options(*options.pipeline);
      const bool is_blocks = blocks != nullptr;
      const uint looking = is_blocks ? c.active_count : c.next_active_count;
      if (looking != 0) {
        const auto for_all = std::min<std::uint64_t>(options.max_speculation, pixels / looking);
        EXPECT_GE(c.spec_count, for_all);
        EXPECT_TRUE((is_blocks && blocks->scanned_pairs) || c.spec_count == for_all)
            << c.spec_count;
        EXPECT_GE(pass.n_spec, 1);
        EXPECT_LE(pass.n_spec, options.max_speculation);
        EXPECT_LE(pass.n_spec,
                  options.per_ray_speculation ? options.max_speculation : c.spec_count);
      }
      EXPECT_LE(c.pair_count, c.ahead_count);
      EXPECT_EQ(pass.visible_blocks.has_value(), is_blocks);
      EXPECT_LE(c.window_count, c.active_count);
      EXPECT_EQ(c.window_count == 0, c.active_count == 0);
      EXPECT_LE(c.decoded_count, options.cache_slots);
      EXPECT_LE(c.hit_count, c.granted_count);
      EXPECT_LE(c.next_active_count + c.hit_count, c.active_count);
      if (i != 0) {
        EXPECT_EQ(c.active_count, stats.passes[i - 1].counts.next_active_count);
        EXPECT_EQ(c.pass, stats.passes[i - 1].counts.pass + 1);
      }
      if (is_blocks) {
        expect_consistent_pairs(c, options, blocks->scanned_pairs);
      } else {
        // The first pass of a frame provides at most what a cancelled one before it left on the
        // list. Packets that decode on demand, and waited for another thread, go on in later
        // passes.
        if (i != 0 && !MarchPackets::may_decode(device_.info())) {
          EXPECT_LE(c.decoded_count, stats.passes[i - 1].counts.requested_count);
        }
      }
      EXPECT_DOUBLE_EQ(pass.utilization_percent, 100.0 * c.granted_count / double(pixels));
      EXPECT_DOUBLE_EQ(pass.completed_percent,
                       100.0 * double(pixels - c.next_active_count) / double(pixels));
      hits += c.hit_count;
    }
    EXPECT_EQ(hits, stats.rays_hit);
    EXPECT_EQ(stats.passes.back().counts.next_active_count == 0, !stats.cancelled);
  }

  static void expect_consistent_pairs(const PassCounts &c, const RendererOptions &options,
                                      bool scanned_pairs) {
    EXPECT_EQ(c.pair_slot_count, scanned_pairs ? c.pair_count : c.window_count * c.spec_count);
    EXPECT_LE(c.pair_slot_count, options.size.num_pixels());
    EXPECT_LE(c.pair_count, c.pair_slot_count);
    EXPECT_LE(c.granted_count, c.pair_count);
    EXPECT_LE(c.visible_count, c.granted_count);
    EXPECT_LE(c.visible_count, options.cache_slots);
    EXPECT_EQ(c.visible_count == 0, c.granted_count == 0);
    EXPECT_LE(c.decoded_count, c.requested_count);
  }

  static std::uint64_t total(const FrameStats &stats, uint PassCounts::*count) {
    return std::accumulate(
        stats.passes.begin(), stats.passes.end(), std::uint64_t{0},
        [&](std::uint64_t sum, const PassStats &pass) { return sum + pass.counts.*count; });
  }

  ocl::Device device_{GetParam().device};
};
INSTANTIATE_TEST_SUITE_P(Devices, InvarianceOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

// ---- speculation

TEST_P(InvarianceOnDevice, SmallSpeculationLimits) {
  const TestVolume volume = small_volume();
  for (const std::uint32_t limit : {1u, 2u, 64u}) {
    if (is_simulator(device_.info()) && limit != 2) continue;  // 1: twice the passes
    SCOPED_TRACE(limit);
    check(volume, {.size = small_size(), .max_speculation = limit});
  }
}

TEST_P(InvarianceOnDevice, SpeculationNeverNeedsMorePasses) {
  const TestVolume volume = medium_volume();
  std::vector<std::size_t> num_passes;
  for (const std::uint32_t limit : {1u, 2u, 3u, 7u, 16u, 33u, 64u}) {
    SCOPED_TRACE(limit);
    const FrameStats stats = check(
        volume, {.size = kMedium, .max_speculation = limit, .on_demand = DecodeOnDemand::kOff});
    EXPECT_EQ(total(stats, &PassCounts::decoded_count), total(stats, &PassCounts::requested_count));
    for (const PassStats &pass : stats.passes) {  // an ample cache: no ray waits for slots
      if (is_blocks()) {
        EXPECT_EQ(pass.counts.granted_count, pass.counts.pair_count);
      }
    }
    num_passes.push_back(stats.passes.size());
  }
  EXPECT_TRUE(std::is_sorted(num_passes.rbegin(), num_passes.rend()))
      << testing::PrintToString(num_passes);
  EXPECT_GT(num_passes.front(), 2 * num_passes.back()) << "else this scene tests nothing";
}

/// Places that rays leave go to others: the same picture, in no more passes, with more of the
/// places in use.
TEST_P(InvarianceOnDevice, SmallScannedSpeculation) {
  if (!is_blocks() || GetParam().per_ray_speculation) GTEST_SKIP() << "has no scanned speculation";
  const bool is_small = is_slow() || is_simulator(device_.info());
  const TestVolume volume = is_small ? small_volume() : medium_volume();
  const auto check_scanned = [&](RendererOptions options) {
    BlocksOptions of_blocks = *blocks_options(*GetParam().pipeline);
    of_blocks.scanned_pairs = true;
    options = GetParam().with(options);
    options.pipeline = blocks_pipeline(of_blocks);
    return check_exactly(volume, options);
  };
  check_scanned({.size = small_size()});
  if (is_simulator(device_.info())) return;  // takes it long enough
  // Few slots: rays wait, and only some take part.
  check_scanned({.size = kTiny, .cache_slots = 20, .max_speculation = 3});
  if (is_small) return;
  for (const std::uint32_t limit : {64u, 3u}) {
    SCOPED_TRACE(limit);
    const FrameStats global = check(volume, {.size = kMedium, .max_speculation = limit}),
                     scanned = check_scanned({.size = kMedium, .max_speculation = limit});
    ASSERT_LE(scanned.passes.size(), global.passes.size());
    double more = 0;
    for (std::size_t i = 0; i < scanned.passes.size(); ++i)
      more += double(scanned.passes[i].counts.spec_count) - global.passes[i].counts.spec_count;
    EXPECT_TRUE(limit == 3 || more > 0) << "else this scene tests nothing";
  }
}

// ---- cache size

/// One dual grid for all rays: the first pass asks for far more, and yet every pass takes the first
/// ray on.
TEST_P(InvarianceOnDevice, CacheOfEightSlots) {
  const TestVolume volume = small_volume();
  const FrameStats ample = check(volume, {.size = kTiny, .max_speculation = 1});
  // A block or a ray's end in every pass (blocks) or every other (rays: what is asked for comes
  // with the next).
  const std::uint64_t steps =
      total(ample, &PassCounts::granted_count) + ample.passes[0].counts.active_count;
  const std::uint64_t bound = is_blocks() ? steps : 2 * steps;
  for (const std::uint32_t limit : {1u, 64u}) {
    SCOPED_TRACE(limit);
    const FrameStats stats =
        check(volume, {.size = kTiny, .cache_slots = 8, .max_speculation = limit});
    EXPECT_GT(total(stats, &PassCounts::requested_count), total(stats, &PassCounts::decoded_count))
        << "else this scene tests nothing";
    EXPECT_LE(stats.passes.size(), bound);
    for (const PassStats &pass : stats.passes) {
      EXPECT_TRUE(!is_blocks() || pass.counts.granted_count > 0 ||
                  pass.counts.next_active_count < pass.counts.active_count);
    }
  }
}

TEST_P(InvarianceOnDevice, CacheSizes) {
  const TestVolume volume = medium_volume();
  const std::uint32_t blocks = std::uint32_t(volume.compressed.block_count());
  for (const std::uint32_t slots : {16u, 64u, 200u, blocks, 4 * blocks}) {
    SCOPED_TRACE(fmt::format("{} slots", slots));
    const ImageSize size = slots <= 64 ? kSmall : kMedium;
    const FrameStats stats = check(volume, {.size = size, .cache_slots = slots});
    const bool waited =
        total(stats, &PassCounts::requested_count) > total(stats, &PassCounts::decoded_count);
    if (is_blocks()) {
      EXPECT_EQ(waited, slots < blocks) << "else this scene tests nothing";
    }
    EXPECT_TRUE(waited || slots > 64) << "else this scene tests nothing";
  }
}

/// Slots are taken over and over; every block that comes back must be decoded again, to its own
/// values.
TEST_P(InvarianceOnDevice, ManyViewsThroughFewSlots) {
  const TestVolume volume = medium_volume();
  constexpr ImageSize size{14, 10};
  for (const std::uint32_t slots : {13u, 9u, 31u}) {
    if (is_slow() && slots != 13) continue;
    SCOPED_TRACE(fmt::format("{} slots", slots));
    DeviceRenderer renderer(device_, volume.compressed,
                            GetParam().with({.size = size, .cache_slots = slots}));
    for (const Camera &camera : orbit_cameras(volume.info(), 2)) {
      expect_consistent(renderer.render({camera, kIsovalue}), renderer.options());
      expect_same_hits(renderer.hits(), twin_hits(volume, camera, size, kIsovalue), size.width);
    }
  }
}

// ---- work-groups

TEST_P(InvarianceOnDevice, SmallWorkGroups) {
  const TestVolume volume = small_volume();
  for (const std::uint32_t group : {8u, 128u}) {
    if (is_slow() && (group != 8 || !is_blocks())) continue;
    if (is_simulator(device_.info()) && group != 8) continue;  // takes half a minute
    if (group > device_.capabilities().max_work_group_size) continue;
    SCOPED_TRACE(group);
    check(volume, {.size = small_size(), .group_size = group});
  }
}

TEST_P(InvarianceOnDevice, WorkGroupSizes) {
  const TestVolume volume = medium_volume();
  for (const std::uint32_t group : {8u, 16u, 32u, 64u, 128u, 256u}) {
    // PoCL compiles every kernel for each. 8 and 128: see SmallWorkGroups; 64 is the default.
    if (!long_tests() && group != 16 && group != 256) continue;
    if (is_slow() && group != 256) continue;
    if (group > device_.capabilities().max_work_group_size) continue;
    SCOPED_TRACE(group);
    check(volume, {.size = kMedium, .group_size = group});
    check(volume, {.size = kSmall, .cache_slots = 40, .max_speculation = 7, .group_size = group});
  }
}

TEST_P(InvarianceOnDevice, ImageShapes) {
  const TestVolume volume = medium_volume();
  for (const ImageSize size : {ImageSize{1, 1}, {1, 97}, {513, 1}, {63, 65}, {7, 3}}) {
    SCOPED_TRACE(fmt::format("{}x{}", size.width, size.height));
    check(volume, {.size = size});
  }
}

// ---- one renderer, many frames

TEST_P(InvarianceOnDevice, WarmCacheDecodesNothing) {
  const TestVolume volume = small_volume();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer renderer(device_, volume.compressed, GetParam().with({.size = kSmall}));
  const FrameStats cold = renderer.render({camera, kIsovalue});
  const auto hits = renderer.hits();
  const FrameStats warm = renderer.render({camera, kIsovalue});
  expect_same_hits(renderer.hits(), hits, kSmall.width);
  EXPECT_GT(total(cold, &PassCounts::decoded_count), 0u);
  EXPECT_EQ(total(warm, &PassCounts::requested_count), 0u);
  EXPECT_EQ(total(warm, &PassCounts::granted_count), total(cold, &PassCounts::granted_count));
  EXPECT_EQ(warm.passes.size(), is_blocks() ? cold.passes.size() : 1u);
}

TEST_P(InvarianceOnDevice, FramesInAnyOrderEqualFreshRenderers) {
  const TestVolume volume = medium_volume();
  constexpr ImageSize kFrame{40, 27};
  const auto cameras = orbit_cameras(volume.info(), 3);
  const std::vector<float> isovalues{0.8f, -0.3f, 5.0f};  // 5: nothing to hit
  struct Frame {
    std::size_t view, iso;
  };
  std::vector<Frame> frames;
  for (std::size_t view = 0; view < cameras.size(); ++view) {
    for (std::size_t iso = 0; iso < isovalues.size(); ++iso) frames.push_back({view, iso});
  }
  constexpr std::uint32_t kSeed = 5;
  std::mt19937 random(kSeed);
  SCOPED_TRACE(fmt::format("seed {}", kSeed));
  for (const std::uint32_t slots : {0u, 150u}) {
    DeviceRenderer renderer(device_, volume.compressed,
                            GetParam().with({.size = kFrame, .cache_slots = slots}));
    std::shuffle(frames.begin(), frames.end(), random);
    for (const Frame &frame : frames) {
      SCOPED_TRACE(
          fmt::format("{} slots, isovalue {}, view {}", slots, isovalues[frame.iso], frame.view));
      expect_consistent(renderer.render({cameras[frame.view], isovalues[frame.iso]}),
                        renderer.options());
      expect_same_hits(renderer.hits(),
                       twin_hits(volume, cameras[frame.view], kFrame, isovalues[frame.iso]),
                       kFrame.width);
    }
  }
}

TEST_P(InvarianceOnDevice, MemoryIsFixedBeforeTheFirstFrame) {
  const TestVolume volume = small_volume();
  DeviceRenderer renderer(device_, volume.compressed,
                          GetParam().with({.size = kTiny, .cache_slots = 20}));
  const ocl::MemoryLedger &ledger = device_.ledger();
  const std::uint64_t current = ledger.current(), peak = ledger.peak();
  EXPECT_GT(current, 0u);
  for (const Camera &camera : orbit_cameras(volume.info(), 2)) {
    renderer.render({.camera = camera, .isovalue = kIsovalue, .on_pass = [&](const PassStats &) {
                       EXPECT_EQ(ledger.current(), current);
                       return true;
                     }});
    renderer.shade();
  }
  EXPECT_EQ(ledger.current(), current);
  EXPECT_EQ(ledger.peak(), peak);
  std::uint64_t sum = 0;
  for (const auto &[name, entry] : ledger.by_name()) {
    EXPECT_FALSE(name.empty());
    EXPECT_LE(entry.current, entry.peak) << name;
    sum += entry.current;
  }
  EXPECT_EQ(sum, current);
  EXPECT_EQ(ledger.by_name().at("block cache").current, 20u * 256);
}

// ---- watching and cancelling

TEST_P(InvarianceOnDevice, PicturesOfPassesOnlyGainHits) {
  const TestVolume volume = medium_volume();
  constexpr ImageSize kFrame{40, 27};
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  const auto expected = twin_hits(volume, camera, kFrame, kIsovalue);
  const auto of_cells = twin_hits(volume, camera, kFrame, kIsovalue, Normals::kCell);
  for (const std::uint32_t slots : {0u, 100u}) {
    SCOPED_TRACE(fmt::format("{} slots", slots));
    DeviceRenderer renderer(
        device_, volume.compressed,
        GetParam().with({.size = kFrame,
                         .cache_slots = slots,
                         .max_speculation = 4,
                         .on_demand = slots == 0 ? DecodeOnDemand::kOff : DecodeOnDemand::kAuto}));
    std::uint64_t found = 0;
    std::size_t calls = 0;
    const FrameStats stats = renderer.render(
        {.camera = camera, .isovalue = kIsovalue, .on_pass = [&](const PassStats &pass) {
           ++calls;
           found += pass.counts.hit_count;
           const auto hits = renderer.hits();
           EXPECT_EQ(test::num_hits(hits), found);
           // A hit, once found, is final, but for its normal.
           const bool are_all_found = pass.completed_percent == 100;
           for (std::size_t i = 0; i < hits.size(); ++i) {
             if (std::isfinite(hits[i].t)) {
               const bool is_smooth = std::memcmp(&hits[i], &expected[i], sizeof(HitRecord)) == 0;
               EXPECT_TRUE(std::memcmp(&hits[i], &of_cells[i], sizeof(HitRecord)) == 0 ||
                           (are_all_found && is_smooth))
                   << "pixel " << i;
             }
           }
           return true;
         }});
    EXPECT_FALSE(stats.cancelled);
    EXPECT_EQ(calls, stats.passes.size() + stats.normals.passes);
    EXPECT_GT(stats.normals.passes, 1u) << "else this scene tests no waiting";
    EXPECT_GT(calls, 3u) << "else this scene tests nothing";
    expect_same_hits(renderer.hits(), expected, kFrame.width);
  }
}

TEST_P(InvarianceOnDevice, CancelledFrameLeavesNoTrace) {
  const TestVolume volume = small_volume();
  const auto cameras = orbit_cameras(volume.info(), 2);
  DeviceRenderer renderer(device_, volume.compressed,
                          GetParam().with({.size = kTiny, .cache_slots = 8, .max_speculation = 2}));
  for (const std::size_t stop_after : {1u, 2u}) {
    SCOPED_TRACE(stop_after);
    std::size_t calls = 0;
    const FrameStats cancelled = renderer.render(
        {.camera = cameras[0], .isovalue = kIsovalue, .on_pass = [&](const PassStats &) {
           return ++calls < stop_after;
         }});
    EXPECT_TRUE(cancelled.cancelled);
    EXPECT_EQ(cancelled.passes.size(), stop_after);
    EXPECT_GT(cancelled.passes.back().counts.next_active_count, 0u)
        << "else there was nothing to cancel";
    EXPECT_EQ(test::num_hits(renderer.hits()), cancelled.rays_hit);
    expect_consistent(cancelled, renderer.options());
    const FrameStats next = renderer.render({cameras[1], kIsovalue});
    expect_consistent(next, renderer.options());
    expect_same_hits(renderer.hits(), twin_hits(volume, cameras[1], kTiny, kIsovalue), kTiny.width);
  }
}

/// With profiling every stage is timed and the host waits after each pass: the same bits.
TEST_P(InvarianceOnDevice, ProfilingChangesNothing) {
  const TestVolume volume = small_volume();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  ocl::Device device(GetParam().device, true);
  DeviceRenderer renderer(device, volume.compressed, GetParam().with({.size = kSmall}));
  const FrameStats stats = renderer.render({camera, kIsovalue});
  expect_same_hits(renderer.hits(), twin_hits(volume, camera, kSmall, kIsovalue), kSmall.width);
  expect_consistent(stats, renderer.options());
  for (const PassStats &pass : stats.passes) {
    const auto stages = is_blocks() ? std::vector{"traverse", "request",   "cache",    "decode",
                                                  "group",    "intersect", "composite"}
                                    : std::vector{"march"};
    for (const char *stage : stages) EXPECT_TRUE(pass.stage_ms.contains(stage)) << stage;
  }
}

}  // namespace
}  // namespace isowave::core
