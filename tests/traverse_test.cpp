// core/traverse: the blocks of each ray against a walk over every cell (the same
// arithmetic, so equal), and against slabs in double (its own, so every block that a ray crosses
// must be there).

#include "core/paper/traverse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/paper/initial_rays.hpp"
#include "core/stages/zfp_decode.hpp"
#include "kernels_cl/portable/grid_dda.h"
#include "kernels_cl/portable/ray_state.h"
#include "kernels_cl/portable/window.h"
#include "tests/ray_cases.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

/// Which blocks are selected, one entry per block.
using Selection = std::vector<bool>;

std::vector<uint> masks_of(const FrameParams &frame, const Selection &selected) {
  const uint coarse_x = (frame.grid.blocks_x + 3) / 4, coarse_y = (frame.grid.blocks_y + 3) / 4,
             coarse_z = (frame.grid.blocks_z + 3) / 4;
  std::vector<uint> masks(2 * std::size_t{coarse_x} * coarse_y * coarse_z);
  for (uint b = 0; b < selected.size(); ++b) {
    if (!selected[b]) continue;
    const uint x = b % frame.grid.blocks_x, y = b / frame.grid.blocks_x % frame.grid.blocks_y,
               z = b / frame.grid.blocks_x / frame.grid.blocks_y;
    const uint bit = x % 4 + 4 * (y % 4) + 16 * (z % 4);
    masks[2 * (x / 4 + coarse_x * (y / 4 + coarse_y * (z / 4))) + bit / 32] |= 1u << bit % 32;
  }
  return masks;
}

Selection random_selection(const FrameParams &frame, uint one_in, uint seed) {
  Random random(seed);
  Selection selected(std::size_t{frame.grid.blocks_x} * frame.grid.blocks_y * frame.grid.blocks_z);
  for (std::size_t b = 0; b < selected.size(); ++b) selected[b] = random() % one_in == 0;
  return selected;
}

/// The blocks and macrocells that are active at the frame's isovalue.
Selection selection_of(const Macrocells &macrocells, const FrameParams &frame) {
  const std::vector<uint> masks = macrocells.masks().read();
  const BlockGrid &grid = frame.grid;
  const uint coarse_x = (grid.blocks_x + 3) / 4, coarse_y = (grid.blocks_y + 3) / 4;
  Selection selected(block_count(grid));
  for (uint b = 0; b < selected.size(); ++b) {
    const uint x = b % grid.blocks_x, y = b / grid.blocks_x % grid.blocks_y,
               z = b / grid.blocks_x / grid.blocks_y, bit = x % 4 + 4 * (y % 4) + 16 * (z % 4);
    selected[b] =
        masks[2 * (x / 4 + coarse_x * (y / 4 + coarse_y * (z / 4))) + bit / 32] >> bit % 32 & 1;
  }
  return selected;
}

using BlockLists = std::vector<std::vector<uint>>;  ///< by pixel, in ray order

BlockLists walk_cells(const FrameParams &frame, const Selection &selected) {
  BlockLists lists(std::size_t{frame.view.width} * frame.view.height);
  for (uint pixel = 0; pixel < lists.size(); ++pixel) {
    lists[pixel] = blocks_of_ray(frame, pixel);
    std::erase_if(lists[pixel], [&](uint block) { return !selected[block]; });
  }
  return lists;
}

/// Length of a ray within the dual cells of a block, in voxels; negative when it misses them.
double stay_in_block(const FrameParams &frame, const Ray &ray, uint block) {
  const double b[3] = {4.0 * (block % frame.grid.blocks_x),
                       4.0 * (block / frame.grid.blocks_x % frame.grid.blocks_y),
                       4.0 * (block / frame.grid.blocks_x / frame.grid.blocks_y)};
  const double last[3] = {frame.grid.dims_x - 1.0, frame.grid.dims_y - 1.0,
                          frame.grid.dims_z - 1.0};
  const RayAxis axes[3] = {ray.x, ray.y, ray.z};
  double enter = 0, exit = 1e30;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = b[axis], high = std::min(low + 4, last[axis]), o = axes[axis].o,
                 d = axes[axis].d;
    if (high <= low) return -1;
    if (d == 0) {  // a ray within a shared face belongs to one side only: not asked for
      if (o <= low || o >= high) return -1;
      continue;
    }
    enter = std::max(enter, ((d > 0 ? low : high) - o) / d);
    exit = std::min(exit, ((d > 0 ? high : low) - o) / d);
  }
  return (exit - enter) * std::hypot(double(ray.x.d), double(ray.y.d), double(ray.z.d));
}

class TraverseOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// The kernel itself, since masks that no isovalue makes are wanted.
  struct Stages {
    Stages(ocl::Device &device, std::uint64_t pixels, uint group_size)
        : rays(device, {pixels}),
          compaction(device, pixels, 8),
          initial_rays(device, pixels),
          range(ocl::Range::strided(pixels, group_size, device)),
          kernel(device, group_defines(group_size)) {}

    Wavefront rays;
    Compaction compaction;
    InitialRays initial_rays;
    ocl::Range range;
    ocl::Kernel<kernels::traverse> kernel;
  };

  /// Passes of spec_count blocks until every ray has left the volume.
  BlockLists traverse_all(Stages &stages, const FrameParams &frame, const Selection &selected,
                          uint spec_count) {
    Wavefront &rays = stages.rays;
    const ocl::Buffer<uint> masks(device_, "masks",
                                  std::span<const uint>(masks_of(frame, selected)));
    const uint num_pixels = frame.view.width * frame.view.height;
    ocl::Buffer<uint> pairs(device_, "pairs", std::size_t{num_pixels} * spec_count);
    rays.frame = frame;
    PassCounts start{};
    start.ray_count = num_pixels;
    rays.counts.write({&start, 1});
    stages.initial_rays(rays, stages.compaction);
    std::vector<uint> active = rays.next_active_ray_ids.read();
    active.resize(rays.counts.read().front().next_active_count);
    BlockLists lists(num_pixels);
    for (uint passes = 0; !active.empty(); ++passes) {
      if (passes > 1000) {
        ADD_FAILURE() << "the rays never leave";
        break;
      }
      pairs.fill(0xABCDEF01u);
      std::vector<uint> entries =
          active;  // each looks ahead by its own number, where the frame says so
      for (uint &entry : entries) entry = pack_entry(entry, entry % 7, 0);
      entries.resize(rays.num_rays);  // whole: see kernels_cl/README.md, Oclgrind
      rays.active_ray_ids.write(entries);
      rays.closest_pairs.fill(0);
      PassCounts counts = distinct_counts();
      counts.active_count = static_cast<uint>(active.size());
      counts.window_count = counts.active_count;
      counts.spec_count = spec_count;
      counts.pair_count = counts.ahead_count = 0;
      rays.counts.write({&counts, 1});
      stages.kernel(stages.range, rays.frame, 1, masks, rays.counts, rays.active_ray_ids,
                    rays.ray_block_ids, pairs, rays.closest_pairs);
      const std::vector<uint> got = pairs.read(), states = rays.ray_block_ids.read();
      counts.pair_count =
          collect(got, active, spec_count, frame.schedule.per_ray_speculation, lists);
      for (const uint ray : active)
        counts.ahead_count += own_ahead(ray, spec_count, frame.schedule.per_ray_speculation);
      expect_counts(rays.counts, counts);
      std::vector<uint> closest = rays.closest_pairs.read();
      closest.resize(active.size());
      EXPECT_EQ(closest, std::vector<uint>(active.size(), ISO_INVALID_ID));
      std::vector<uint> still;
      for (const uint ray : active) {
        if (states[ray] != ISO_INVALID_ID) still.push_back(ray);
      }
      active = still;
    }
    return lists;
  }

  /// Blocks that a ray is to look ahead at.
  static uint own_ahead(uint ray, uint spec_count, bool per_ray) {
    return per_ray ? std::min(1u << ray % 7, spec_count) : spec_count;
  }

  /// Appends a pass's pairs to the lists; returns how many there are.
  static uint collect(const std::vector<uint> &pairs, const std::vector<uint> &active,
                      uint spec_count, bool per_ray, BlockLists &lists) {
    uint num_pairs = 0;
    for (std::size_t a = 0; a < active.size(); ++a) {
      bool ended = false;
      const uint ahead = own_ahead(active[a], spec_count, per_ray);
      for (uint k = 0; k < spec_count; ++k) {
        const uint block = pairs[a * spec_count + k];
        EXPECT_FALSE(ended && block != ISO_INVALID_ID) << "a gap in the pairs of ray " << active[a];
        ended = block == ISO_INVALID_ID;
        if (ended) continue;
        EXPECT_LT(k, ahead) << "ray " << active[a] << " looks too far ahead";
        lists[active[a]].push_back(block);
        ++num_pairs;
      }
    }
    for (std::size_t i = active.size() * spec_count; i < pairs.size(); ++i) {
      EXPECT_EQ(pairs[i], 0xABCDEF01u) << "written past the end, at " << i;
    }
    return num_pairs;
  }

  void expect_walks(const glm::uvec3 &dims, const std::vector<CameraCase> &cameras, uint one_in,
                    std::initializer_list<uint> spec_counts, ImageSize size, uint group_size,
                    bool per_ray = false) {
    Stages stages(device_, size.num_pixels(), group_size);
    for (const CameraCase &c : cameras) {
      FrameParams frame = case_frame(dims, c, size);
      frame.schedule.per_ray_speculation = per_ray;
      const Selection selected = random_selection(frame, one_in, 1);
      const BlockLists expected = walk_cells(frame, selected);
      for (const uint spec_count : spec_counts) {
        SCOPED_TRACE(fmt::format(
            "{} x {} x {}, camera '{}', one block in {}, spec count {}, group size {}, seed 1",
            dims.x, dims.y, dims.z, c.name, one_in, spec_count, group_size));
        const BlockLists got = traverse_all(stages, frame, selected, spec_count);
        ASSERT_EQ(first_difference(got, expected), kNoDifference) << "(a pixel)";
      }
      expect_crossed_blocks(frame, selected, expected, c.name);
      if (HasFatalFailure()) return;
    }
  }

  /// `lists` holds each selected block that a ray spends more than 1/1000 voxel in.
  static void expect_crossed_blocks(const FrameParams &frame, const Selection &selected,
                                    const BlockLists &lists, const std::string &name) {
    for (uint pixel = 0; pixel < lists.size(); ++pixel) {
      const Ray ray = make_ray(&frame, pixel);
      for (uint block = 0; block < selected.size(); ++block) {
        if (!selected[block] || stay_in_block(frame, ray, block) < 1e-3) continue;
        ASSERT_EQ(std::ranges::count(lists[pixel], block), 1)
            << "block " << block << ", pixel " << pixel << ", camera '" << name << "'";
      }
      for (const uint block : lists[pixel]) {
        const RayAxis axes[3] = {ray.x, ray.y, ray.z};
        if (axes[0].d == 0 || axes[1].d == 0 || axes[2].d == 0) continue;
        ASSERT_GT(stay_in_block(frame, ray, block), -1e-4)
            << "block " << block << ", pixel " << pixel;
      }
    }
  }

  ocl::Device device_{GetParam()};
};

TEST_P(TraverseOnDevice, SmallWalks) {
  const glm::uvec3 dims(18, 9, 21);
  const std::vector<CameraCase> cameras = camera_cases(dims);
  expect_walks(dims, {cameras[0], cameras[1], cameras[9]}, 3, {2}, {5, 3}, 8);
}

TEST_P(TraverseOnDevice, AllBlocksSelected) {
  for (const glm::uvec3 dims :
       {glm::uvec3(38, 41, 35), glm::uvec3(5, 6, 7), glm::uvec3(2, 9, 33), glm::uvec3(2, 2, 2)}) {
    expect_walks(dims, camera_cases(dims), 1, {1, 7, 64}, {23, 17}, 64);
  }
}

TEST_P(TraverseOnDevice, RandomBlocksSelected) {
  for (const glm::uvec3 dims : {glm::uvec3(38, 41, 35), glm::uvec3(17, 33, 2)}) {
    expect_walks(dims, camera_cases(dims), 4, {1, 2, 7, 64}, {23, 17}, 64);
  }
}

TEST_P(TraverseOnDevice, EachRayLooksAheadByItsOwnNumber) {
  const glm::uvec3 dims(38, 41, 35);
  expect_walks(dims, camera_cases(dims), 4, {1, 2, 7, 64}, {23, 17}, 64, true);
}

/// Most coarse macrocells are empty: the walk skips them, and must come out where a cell walk does.
TEST_P(TraverseOnDevice, FewBlocksSelected) {
  for (const glm::uvec3 dims : {glm::uvec3(100, 97, 70), glm::uvec3(161, 18, 34)}) {
    expect_walks(dims, camera_cases(dims), 150, {1, 2, 64}, {23, 17}, 64);
    expect_walks(dims, {camera_cases(dims)[0]}, 1u << 30, {1}, {23, 17}, 64);
  }
}

TEST_P(TraverseOnDevice, GroupSizesDoNotMatter) {
  const glm::uvec3 dims(38, 41, 35);
  for (const uint group_size : kGroupSizes) {
    expect_walks(dims, {camera_cases(dims)[0], camera_cases(dims)[2]}, 4, {3}, {71, 53},
                 group_size);
  }
}

/// The host class with masks of a real isovalue, one pass.
TEST_P(TraverseOnDevice, MasksOfAnIsovalue) {
  const glm::uvec3 dims(33, 34, 35);
  std::vector<float> voxels(33 * 34 * 35);
  for (std::size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = std::sin(0.2f * float(i % 33)) * float(i / 33 % 34);
  const CompressedVolume volume = compress_with_libzfp(voxels, dims, 1024);
  const DeviceStream stream(device_, volume);
  FrameParams frame = case_frame(dims, camera_cases(dims)[0], {40, 30}, 3.0f);
  Wavefront rays(device_, {40 * 30});
  Macrocells macrocells(device_, frame, stream);
  macrocells.select(frame);
  frame.surface = macrocells.surface(frame);
  rays.frame = frame;
  const BlockLists expected = walk_cells(frame, selection_of(macrocells, frame));
  Compaction compaction(device_, 40 * 30, 64);
  InitialRays(device_, 40 * 30)(rays, compaction);
  std::vector<uint> active = rays.next_active_ray_ids.read();
  active.resize(rays.counts.read().front().next_active_count);
  rays.active_ray_ids.write(active);
  PassCounts counts{};
  counts.active_count = static_cast<uint>(active.size());
  counts.window_count = counts.active_count;
  counts.spec_count = 1;
  rays.counts.write({&counts, 1});
  Traverse(device_, 40 * 30, 64)(macrocells, rays);
  const std::vector<uint> pairs = rays.pair_block_ids.read();
  std::size_t num_pairs = 0;
  for (std::size_t a = 0; a < active.size(); ++a) {
    const std::vector<uint> &list = expected[active[a]];
    ASSERT_EQ(pairs[a], list.empty() ? ISO_INVALID_ID : list.front()) << "ray " << active[a];
    num_pairs += !list.empty();
  }
  EXPECT_EQ(rays.counts.read().front().pair_count, num_pairs);
  EXPECT_GT(num_pairs, 100u);
}

/// After a pass with scanned places: each ray of the window has the next blocks of its list,
/// counts.spec_count or what is left, of which the pass has counted up to `counted`, and the places
/// of the next ray begin where its own end.
///
/// done   [pixel] how many blocks of its list a ray has had; goes on
/// still  becomes the rays that are still on their way
void expect_pairs(const Wavefront &rays, const PassCounts &counts, uint counted,
                  const std::vector<uint> &active, const BlockLists &expected,
                  std::vector<std::size_t> &done, std::vector<uint> &still) {
  const std::vector<uint> begins = rays.pair_begins.read(), of = rays.pair_rays.read(),
                          blocks = rays.pair_block_ids.read(), stands = rays.ray_block_ids.read(),
                          closest = rays.closest_pairs.read();
  uint place = 0;
  for (uint a = 0; a < active.size(); ++a) {
    const uint ray = active[a];
    if (a < counts.window_count) {
      ASSERT_EQ(begins[a], place) << a;
      const std::size_t there = std::min<std::size_t>(expected[ray].size() - done[ray], counted),
                        own = std::min<std::size_t>(there, counts.spec_count);
      for (std::size_t k = 0; k < own; ++k, ++place) {
        ASSERT_EQ(blocks[place], expected[ray][done[ray]++]) << "ray " << ray;
        ASSERT_EQ(of[place], a);
      }
      ASSERT_EQ(closest[a], ISO_INVALID_ID);
      const bool is_through = stands[ray] == ISO_INVALID_ID;
      ASSERT_TRUE(is_through || own != there || there == counted)
          << "not as soon as it has looked at its last block";
      ASSERT_TRUE(!is_through || done[ray] == expected[ray].size()) << "blocks are left out";
    }
    if (stands[ray] != ISO_INVALID_ID) still.push_back(ray);
  }
  ASSERT_EQ(begins[counts.window_count], place);
}

/// All passes of a frame with scanned places, against the lists of the walk: N_Spec is the most for
/// which there are places enough, each ray gets that many or what is before it, and the places of
/// the next ray begin where its own end. The first pass takes a third of the rays alone.
TEST_P(TraverseOnDevice, SmallScannedPlaces) {
  const bool is_small = is_simulator(device_.info());
  const ImageSize size = is_small ? ImageSize{7, 5} : ImageSize{71, 53};
  const glm::uvec3 dims = is_small ? glm::uvec3(17, 18, 9) : glm::uvec3(33, 34, 35);
  std::vector<float> voxels(std::size_t{dims.x} * dims.y * dims.z);
  for (std::size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = std::sin(0.2f * float(i % dims.x)) * float(i / dims.x % dims.y);
  const CompressedVolume volume = compress_with_libzfp(voxels, dims, 1024);
  const DeviceStream stream(device_, volume);
  FrameParams frame = case_frame(dims, camera_cases(dims)[0], size, 3.0f);
  Macrocells macrocells(device_, frame, stream);
  macrocells.select(frame);
  frame.surface = macrocells.surface(frame);
  const BlockLists expected = walk_cells(frame, selection_of(macrocells, frame));
  const uint num_pixels = static_cast<uint>(size.num_pixels());
  for (const uint most : {64u, 3u}) {
    SCOPED_TRACE(most);
    frame.schedule.max_spec_count = most;
    frame.schedule.scanned_pairs = 1;
    Wavefront rays(device_, {.num_rays = num_pixels, .scanned_pairs = true});
    rays.frame = frame;
    Compaction compaction(device_, num_pixels, 8);
    InitialRays(device_, num_pixels)(rays, compaction);
    Traverse traverse(device_, num_pixels, 8, true);
    std::vector<uint> active = rays.next_active_ray_ids.read();
    active.resize(rays.counts.read().front().next_active_count);
    std::vector<std::size_t> done(num_pixels);
    bool gave_more = false;
    for (uint passes = 0; !active.empty(); ++passes) {
      ASSERT_LT(passes, 200u) << "the rays never leave";
      SCOPED_TRACE(passes);
      std::vector<uint> entries = active;
      entries.resize(num_pixels);  // whole: see kernels_cl/README.md, Oclgrind
      rays.active_ray_ids.write(entries);
      PassCounts counts{};
      counts.ray_count = num_pixels;
      counts.active_count = static_cast<uint>(active.size());
      counts.window_count = passes == 0 ? counts.active_count / 3 : counts.active_count;
      const uint before = speculation_count(&frame, counts.active_count),
                 counted = std::min(most, 4 * before);
      counts.spec_count = before;
      counts.pair_slot_count = 12345;
      rays.counts.write({&counts, 1});
      traverse(macrocells, rays);

      const auto left = [&](uint a) { return expected[active[a]].size() - done[active[a]]; };
      const auto places = [&](uint spec_count) {
        std::size_t sum = 0;
        for (uint a = 0; a < counts.window_count; ++a)
          sum += std::min<std::size_t>(left(a), spec_count);
        return sum;
      };
      uint spec_count = before;
      const std::size_t there_are =
          passes == 0 ? std::size_t{counts.window_count} * before : num_pixels;
      while (spec_count < counted && places(spec_count + 1) <= there_are) ++spec_count;
      gave_more |= spec_count > before;
      counts.spec_count = spec_count;
      counts.pair_count = counts.pair_slot_count = static_cast<uint>(places(spec_count));
      counts.ahead_count = counts.window_count * spec_count;
      expect_counts(rays.counts, counts);
      std::vector<uint> still;
      expect_pairs(rays, counts, counted, active, expected, done, still);
      if (HasFatalFailure()) return;
      active = still;
    }
    for (uint ray = 0; ray < num_pixels; ++ray) ASSERT_EQ(done[ray], expected[ray].size());
    EXPECT_TRUE(gave_more || most == 3) << "else this scene tests nothing";
    if (is_small) break;
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, TraverseOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);
}  // namespace
}  // namespace isowave::core
