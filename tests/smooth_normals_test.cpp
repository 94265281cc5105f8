// Smooth normals: the arithmetic against plain loops in double precision, the stage pass by pass,
// and what a frame does with it. Whole frames of all kinds are in the tests that draw them.

#include "core/stages/smooth_normals.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <map>
#include <set>

#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "kernels_cl/portable/smooth_gradient.h"
#include "reference/twin.hpp"
#include "tests/rays_world.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;
using test::twin_hits;

// ---- the arithmetic

/// One block or several, cut off in all ways, and two voxels thick.
const std::vector<glm::uvec3> kDims = {{2, 2, 2}, {4, 4, 4},  {5, 2, 9},
                                       {3, 6, 7}, {8, 12, 5}, {2, 13, 6}};

HitRecord hit_in(const FrameParams &frame, const glm::ivec3 &cell, const glm::vec3 &at) {
  HitRecord hit = no_hit();
  hit.t = 1;
  hit.block_id = block_id_at(&frame, static_cast<uint>(cell.x / 4), static_cast<uint>(cell.y / 4),
                             static_cast<uint>(cell.z / 4));
  hit.cell = static_cast<uint>(cell.x % 4 + 4 * (cell.y % 4) + 16 * (cell.z % 4));
  hit.x = at.x;
  hit.y = at.y;
  hit.z = at.z;
  hit.grad_x = hit.grad_y = hit.grad_z = 77;  // of the cell
  return hit;
}

template <class Visit>
void for_each_cell(const glm::uvec3 &dims, Visit visit) {
  for (int z = 0; z + 1 < static_cast<int>(dims.z); ++z) {
    for (int y = 0; y + 1 < static_cast<int>(dims.y); ++y) {
      for (int x = 0; x + 1 < static_cast<int>(dims.x); ++x) visit(glm::ivec3(x, y, z));
    }
  }
}

glm::vec3 smooth(const FrameParams &frame, const std::vector<float> &voxels, const glm::ivec3 &cell,
                 const glm::vec3 &at) {
  HitRecord hit = hit_in(frame, cell, at);
  const HitRecord before = hit;
  smooth_gradients(frame, voxels, {&hit, 1});
  EXPECT_EQ(std::memcmp(&hit, &before, offsetof(HitRecord, grad_x)), 0) << "only the gradient";
  return {hit.grad_x, hit.grad_y, hit.grad_z};
}

glm::vec3 random_position(Random &random) {
  const auto coordinate = [&random] { return static_cast<float>(random() % 1025) / 1024.0f; };
  return {coordinate(), coordinate(), coordinate()};
}

TEST(SmoothGradient, LinearFieldsAreExact) {
  Random random(3);
  for (const glm::uvec3 &dims : kDims) {
    const FrameParams frame = grid_frame(dims);
    const auto voxels = test::sample(
        dims, [](const glm::dvec3 &p) { return 3 - 0.5 * p.x + 8 * p.y + 0.25 * p.z; });
    for_each_cell(dims, [&](const glm::ivec3 &cell) {
      EXPECT_EQ(smooth(frame, voxels, cell, random_position(random)), glm::vec3(-0.5f, 8, 0.25f));
    });
  }
}

/// Central differences at the cell's voxels, one-sided at the border, trilinear between them.
struct DoubleGradient {
  glm::dvec3 gradient{0};
  double largest = 0;  ///< |difference| at one of the voxels
};

DoubleGradient gradient_in_double(const glm::uvec3 &dims, const std::vector<float> &voxels,
                                  const glm::ivec3 &cell, const glm::vec3 &at) {
  const auto value = [&](const glm::ivec3 &p) {
    return double{voxels[static_cast<std::size_t>(p.x) +
                         dims.x * (static_cast<std::size_t>(p.y) +
                                   std::size_t{dims.y} * static_cast<std::size_t>(p.z))]};
  };
  DoubleGradient result;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::ivec3 place(corner & 1, corner >> 1 & 1, corner >> 2);
    double weight = 1;
    for (int axis = 0; axis < 3; ++axis)
      weight *= place[axis] != 0 ? double{at[axis]} : 1.0 - double{at[axis]};
    for (int axis = 0; axis < 3; ++axis) {
      glm::ivec3 low = cell + place, high = low;
      low[axis] = std::max(low[axis] - 1, 0);
      high[axis] = std::min(high[axis] + 1, static_cast<int>(dims[axis]) - 1);
      const double difference = (value(high) - value(low)) / (high[axis] - low[axis]);
      result.gradient[axis] += weight * difference;
      result.largest = std::max(result.largest, std::abs(difference));
    }
  }
  return result;
}

/// With u = 2^-24: a difference is rounded once, by at most u of it; its scale is a power of two. A
/// lerp of values up to M rounds twice, each time by at most u M, and does not enlarge errors. That
/// is (1 + 3 * 2) u M, and 8 with the terms in u^2.
TEST(SmoothGradient, EqualsPlainLoopsInDouble) {
  Random random(4);
  for (const glm::uvec3 &dims : kDims) {
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    const FrameParams frame = grid_frame(dims);
    const std::vector<float> voxels = random_voxels(dims, -5, 3, random());
    for_each_cell(dims, [&](const glm::ivec3 &cell) {
      const glm::vec3 at = random_position(random);
      const glm::vec3 got = smooth(frame, voxels, cell, at);
      const DoubleGradient expected = gradient_in_double(dims, voxels, cell, at);
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(got[axis], expected.gradient[axis], 8 * 0x1p-24 * expected.largest);
    });
  }
}

/// On the face of two cells both have the same gradient, in all bits, also where blocks meet.
TEST(SmoothGradient, IsTheSameFromBothSidesOfAFace) {
  Random random(5);
  const glm::uvec3 dims(9, 10, 11);
  const FrameParams frame = grid_frame(dims);
  const std::vector<float> voxels = random_voxels(dims, -5, 3, 6);
  for_each_cell(dims, [&](const glm::ivec3 &cell) {
    for (int axis = 0; axis < 3; ++axis) {
      if (cell[axis] + 2 == static_cast<int>(dims[axis])) continue;
      glm::ivec3 next = cell;
      ++next[axis];
      glm::vec3 leaving = random_position(random), entering = leaving;
      leaving[axis] = 1;
      entering[axis] = 0;
      const glm::vec3 a = smooth(frame, voxels, cell, leaving),
                      b = smooth(frame, voxels, next, entering);
      EXPECT_EQ(std::memcmp(&a, &b, sizeof(a)), 0);
    }
  });
}

TEST(SmoothGradient, WhereDifferencesVanishTheCellsStays) {
  const glm::uvec3 dims(7, 6, 5);
  const FrameParams frame = grid_frame(dims);
  const auto sheets = test::sample(dims, [](const glm::dvec3 &p) { return std::fmod(p.x, 2); });
  EXPECT_EQ(smooth(frame, sheets, {2, 1, 1}, {0.5f, 0.5f, 0.5f}), glm::vec3(77));
  EXPECT_EQ(smooth(frame, sheets, {0, 1, 1}, {0.5f, 0.5f, 0.5f}), glm::vec3(0.5f, 0, 0));
}

/// The blocks that the cell's voxels and their neighbours along the axes are in.
std::set<uint> blocks_of_stencil(const FrameParams &frame, const glm::ivec3 &cell) {
  const glm::ivec3 last(last_planes(&frame).x, last_planes(&frame).y, last_planes(&frame).z);
  std::set<uint> blocks;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::ivec3 voxel = cell + glm::ivec3(corner & 1, corner >> 1 & 1, corner >> 2);
    for (int axis = 0; axis < 3; ++axis) {
      for (const int step : {-1, 1}) {
        glm::ivec3 at = voxel;
        at[axis] = std::clamp(at[axis] + step, 0, last[axis]);
        const glm::uvec3 block(at / 4);
        blocks.insert(block.x + frame.grid.blocks_x * (block.y + frame.grid.blocks_y * block.z));
      }
    }
  }
  return blocks;
}

std::set<uint> blocks_of_hit(const FrameParams &frame, const HitRecord &hit) {
  const BlockCoords b = block_coords(&frame, hit.block_id);
  return blocks_of_stencil(
      frame, {4 * b.x + hit.cell % 4, 4 * b.y + hit.cell / 4 % 4, 4 * b.z + hit.cell / 16});
}

TEST(SmoothGradient, NeedsTheBlocksOfItsVoxelsAndNoOther) {
  for (const glm::uvec3 &dims : {glm::uvec3(13, 9, 14), glm::uvec3(4, 5, 2)}) {
    const FrameParams frame = grid_frame(dims);
    for_each_cell(dims, [&](const glm::ivec3 &cell) {
      const HitRecord hit = hit_in(frame, cell, {0, 0, 0});
      const Stencil stencil =
          stencil_of(block_coords(&frame, hit.block_id), hit.cell, last_planes(&frame));
      const BlockCoords base = stencil_base(&stencil);
      std::set<uint> got;
      for (uint corner = 0; corner < 8; ++corner) {
        if ((stencil_blocks(&stencil) >> corner & 1u) != 0)
          got.insert(block_id_at(&frame, base.x + (corner & 1), base.y + (corner >> 1 & 1),
                                 base.z + (corner >> 2)));
      }
      EXPECT_EQ(got, blocks_of_stencil(frame, cell));
    });
  }
}

// ---- the stage

constexpr float kIsovalue = 0.3f;

class SmoothNormalsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};

  void expect_wave(const glm::uvec3 &dims, ImageSize size, uint num_slots = 0,
                   uint group_size = RaysWorld::kGroupSize) {
    SCOPED_TRACE(fmt::format("{} x {} rays, {} slots, groups of {}", size.width, size.height,
                             num_slots, group_size));
    const TestVolume volume(dims, test::gyroid_field(11), 8);
    const Camera camera = orbit_cameras(volume.info(), 1).front();
    RaysWorld world(device_, volume, camera, size, kIsovalue, 8, num_slots, group_size);
    SmoothNormals normals(device_, size.num_rays(), group_size);
    find_hits(world, normals);
    const auto cells = twin_hits(volume, camera, size, kIsovalue, Normals::kCell);
    const auto smooth = twin_hits(volume, camera, size, kIsovalue);
    expect_same_hits(world.rays.hits.read(), cells, size.width);
    expect_passes(world, normals, cells, smooth);
  }

  /// Normals that begin too early leave everything as it is.
  static void find_hits(RaysWorld &world, SmoothNormals &normals) {
    Wavefront &rays = world.rays;
    world.start_rays(world.macrocells, rays);
    for (int pass = 0; pass == 0 || world.counts().next_active_count != 0; ++pass) {
      ASSERT_LT(pass, 2000);
      rays.open_pass();
      if (pass != 0) world.provide();
      world.march(world.macrocells, world.cache, rays);
      world.request_ahead(world.macrocells, world.cache, rays);
      if (world.counts().next_active_count == 0) break;
      const auto hits = rays.hits.read();
      const PassCounts counts = world.counts(), next = rays.next_counts.read().front();
      rays.open_pass();
      normals(world.cache, rays, true);
      rays.unopen_pass();
      expect_same_hits(rays.hits.read(), hits, world.frame.view.width);
      expect_counts(rays.counts, counts);
      expect_counts(rays.next_counts, next);
    }
  }

  /// From the first pass to the last.
  static void expect_passes(RaysWorld &world, SmoothNormals &normals,
                            const std::vector<HitRecord> &cells,
                            const std::vector<HitRecord> &smooth) {
    Wavefront &rays = world.rays;
    std::set<uint> left;  // pixels
    for (uint pixel = 0; pixel < cells.size(); ++pixel) {
      if (std::isfinite(cells[pixel].t)) left.insert(pixel);
    }
    ASSERT_FALSE(left.empty());
    for (int pass = 0; pass == 0 || !left.empty(); ++pass) {
      ASSERT_LT(pass, 2000);
      const std::size_t num_before = left.size();
      rays.open_pass();
      if (pass != 0) world.provide();
      normals(world.cache, rays, pass == 0);
      left = expect_pass(world, left, cells, smooth);
      if (pass != 0) {
        EXPECT_LT(left.size(), num_before) << "one ray at least is served";
      }
      if (HasFailure()) return;
    }
    expect_same_hits(rays.hits.read(), smooth, world.frame.view.width);
  }

  /// Returns the rays that wait: those of `rays` whose blocks are not all cached.
  static std::set<uint> expect_pass(const RaysWorld &world, const std::set<uint> &rays,
                                    const std::vector<HitRecord> &cells,
                                    const std::vector<HitRecord> &smooth) {
    const std::vector<uint> slots = world.slots_by_block();
    const std::vector<uint> stamps = world.cache.slot_stamps.read();
    const std::vector<HitRecord> hits = world.rays.hits.read();
    const PassCounts counts = world.counts();
    std::set<uint> waiting, listed;
    for (const uint pixel : rays) {
      const std::set<uint> blocks = blocks_of_hit(world.frame, cells[pixel]);
      const bool waits =
          std::ranges::any_of(blocks, [&](uint block) { return slots[block] == ISO_BLOCK_ABSENT; });
      if (waits) waiting.insert(pixel);
      EXPECT_EQ(
          std::memcmp(&hits[pixel], waits ? &cells[pixel] : &smooth[pixel], sizeof(HitRecord)), 0)
          << "pixel " << pixel << (waits ? " waits" : " is served");
    }
    EXPECT_EQ(counts.next_active_count, waiting.size());
    std::vector<uint> entries;
    for (const RayEntry &entry : world.entries()) entries.push_back(entry.pixel);
    listed.insert(entries.begin(), entries.end());
    EXPECT_EQ(listed, waiting);
    expect_requests(world, entries, cells, slots, stamps);
    return waiting;
  }

  /// The first rays of the list, those of the window, have asked for what they miss.
  static void expect_requests(const RaysWorld &world, const std::vector<uint> &entries,
                              const std::vector<HitRecord> &cells, const std::vector<uint> &slots,
                              const std::vector<uint> &stamps) {
    const PassCounts counts = world.counts();
    std::set<uint> wanted;
    for (uint i = 0; i < entries.size() && i < counts.window_count; ++i) {
      for (const uint block : blocks_of_hit(world.frame, cells[entries[i]])) {
        if (slots[block] == ISO_BLOCK_ABSENT) {
          wanted.insert(block);
        } else {
          EXPECT_EQ(stamps[slots[block]], 2 * counts.pass + 1) << "needed";
        }
      }
    }
    std::vector<uint> list(std::min(counts.requested_count, world.cache.capacity));
    world.cache.request_block_ids.read(list);
    const std::set<uint> got(list.begin(), list.end());
    EXPECT_EQ(got.size(), list.size()) << "a block is listed twice";
    if (counts.requested_count <= world.cache.capacity) {
      EXPECT_EQ(got, wanted);
    } else {
      EXPECT_TRUE(std::ranges::includes(wanted, got));
    }
    if (entries.empty()) return;
    const CacheState state = world.cache.state.read().front();
    std::set<uint> first;
    const glm::uvec3 base = world.coords(state.first_block_id);
    for (uint corner = 0; corner < 8; ++corner) {
      if ((state.first_touched >> corner & 1u) != 0)
        first.insert(block_id_at(&world.frame, base.x + (corner & 1), base.y + (corner >> 1 & 1),
                                 base.z + (corner >> 2)));
    }
    EXPECT_EQ(first, blocks_of_hit(world.frame, cells[entries.front()])) << "is served first";
  }
};

TEST_P(SmoothNormalsOnDevice, SmallWave) {
  expect_wave({10, 9, 11}, {6, 5});
}

TEST_P(SmoothNormalsOnDevice, SmallWaveWithFewSlots) {
  expect_wave({10, 9, 11}, {4, 3}, kMinCacheSlots);
}

TEST_P(SmoothNormalsOnDevice, EveryPassOfAWave) {
  expect_wave({30, 27, 33}, {61, 47});
  expect_wave({30, 27, 33}, {200, 3});
}

TEST_P(SmoothNormalsOnDevice, FewSlots) {
  expect_wave({30, 27, 33}, {11, 9}, 40);
  expect_wave({30, 27, 33}, {5, 3}, kMinCacheSlots);
}

TEST_P(SmoothNormalsOnDevice, GroupSizesDoNotMatter) {
  for (const uint group_size : kGroupSizes) expect_wave({30, 27, 33}, {61, 47}, 0, group_size);
}

INSTANTIATE_TEST_SUITE_P(Devices, SmoothNormalsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

// ---- frames

constexpr ImageSize kFrame{61, 47};

class NormalsOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  static TestVolume volume_of_test() { return {{30, 27, 33}, test::gyroid_field(11)}; }

  ocl::Device device_{GetParam().device};
};
INSTANTIATE_TEST_SUITE_P(Devices, NormalsOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(NormalsOnDevice, SmallFramesOfBothKinds) {
  const glm::uvec3 dims(9, 10, 11);
  const TestVolume volume(dims, test::sphere_field(dims));
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  constexpr ImageSize kSmall{8, 6};
  DeviceRenderer renderer(device_, volume.compressed, GetParam().with({.size = kSmall}));
  for (const Normals normals : {Normals::kSmooth, Normals::kCell}) {
    renderer.render({.camera = camera, .isovalue = 0.5f, .normals = normals});
    expect_same_hits(renderer.hits(), twin_hits(volume, camera, kSmall, 0.5f, normals),
                     kSmall.width);
  }
}

TEST_P(NormalsOnDevice, StatisticsTellWhatTheyTook) {
  const TestVolume volume = volume_of_test();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer renderer(device_, volume.compressed, GetParam().with({.size = kFrame}));
  FrameRequest request{.camera = camera, .isovalue = kIsovalue, .normals = Normals::kCell};
  const FrameStats cells = renderer.render(request);
  EXPECT_EQ(cells.normals.passes, 0u);
  EXPECT_EQ(cells.normals.ms, 0);
  request.normals = Normals::kSmooth;
  const FrameStats smooth = renderer.render(request);
  EXPECT_EQ(smooth.passes.size(), GetParam().is_blocks() ? cells.passes.size() : 1u);
  if (!GetParam().is_blocks()) {  // the other asks for whole dual grids, ahead
    EXPECT_GT(smooth.normals.passes, 1u);
    EXPECT_GT(smooth.normals.decoded_blocks, 0u);
  }
  EXPECT_GT(smooth.normals.ms, 0);
  EXPECT_LE(smooth.normals.ms, smooth.total_ms);
  const FrameStats again = renderer.render(request);
  EXPECT_EQ(again.normals.passes, 1u) << "all is cached";
  EXPECT_EQ(again.normals.decoded_blocks, 0u);
  EXPECT_EQ(again.rays_hit, cells.rays_hit);
}

/// Normals begin before the host knows that a frame needs more passes than the last.
TEST_P(NormalsOnDevice, FramesOfOnePassAndOfSeveralInTurn) {
  const TestVolume volume = volume_of_test();
  const auto cameras = orbit_cameras(volume.info(), 3);
  DeviceRenderer renderer(device_, volume.compressed, GetParam().with({.size = kFrame}));
  for (const std::size_t view : {0u, 0u, 1u, 1u, 1u, 2u, 2u, 0u, 0u}) {
    if (view == 2) renderer.clear_cache();
    if (view == 1) {  // one pass in pipeline `blocks`, too
      EXPECT_EQ(renderer.render({cameras[view], 99}).passes.size(), 1u) << "nothing to hit";
    }
    renderer.render({cameras[view], kIsovalue});
    expect_same_hits(renderer.hits(), twin_hits(volume, cameras[view], kFrame, kIsovalue),
                     kFrame.width);
  }
}

/// Cancelled in the pass before normals, and in each of theirs: all hits are there, some rough; the
/// next frame is as if that had not been.
TEST_P(NormalsOnDevice, CancelledNormalsLeaveNoTrace) {
  const TestVolume volume = volume_of_test();
  const auto cameras = orbit_cameras(volume.info(), 2);
  const auto cells = twin_hits(volume, cameras[0], kFrame, kIsovalue, Normals::kCell);
  const auto next = twin_hits(volume, cameras[1], kFrame, 0.1f);
  DeviceRenderer renderer(device_, volume.compressed,
                          GetParam().with({.size = kFrame, .cache_slots = 60}));
  std::size_t num_cut = 0;
  for (std::uint32_t wanted = 0; wanted < 4; ++wanted) {
    SCOPED_TRACE(wanted);
    renderer.clear_cache();
    std::uint32_t passes = 0;
    const FrameStats stats = renderer.render(
        {.camera = cameras[0], .isovalue = kIsovalue, .on_pass = [&](const PassStats &pass) {
           if (pass.completed_percent < 100) return true;
           return passes++ < wanted;
         }});
    ASSERT_TRUE(stats.cancelled);
    EXPECT_EQ(stats.normals.passes, wanted);
    EXPECT_EQ(stats.rays_hit, test::num_hits(cells));
    const auto got = renderer.hits();
    for (std::size_t i = 0; i < got.size(); ++i) {
      ASSERT_EQ(std::memcmp(&got[i], &cells[i], offsetof(HitRecord, grad_x)), 0);
      num_cut += std::memcmp(&got[i], &cells[i], sizeof(HitRecord)) == 0 && std::isfinite(got[i].t);
    }
    renderer.render({cameras[1], 0.1f});
    expect_same_hits(renderer.hits(), next, kFrame.width);
  }
  EXPECT_GT(num_cut, 0u) << "else nothing was cut short";
}

/// As an interrupt of a notebook does.
TEST_P(NormalsOnDevice, AFrameWhoseWatcherThrowsLeavesNoTrace) {
  const TestVolume volume = volume_of_test();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer renderer(device_, volume.compressed,
                          GetParam().with({.size = kFrame, .cache_slots = 60}));
  const auto expected = twin_hits(volume, camera, kFrame, kIsovalue);
  for (int num_passes = 1; num_passes < 4; ++num_passes) {
    renderer.clear_cache();
    int passes = 0;
    EXPECT_THROW(renderer.render({.camera = camera,
                                  .isovalue = kIsovalue,
                                  .on_pass =
                                      [&](const PassStats &pass) {
                                        if (pass.completed_percent == 100 && ++passes == num_passes)
                                          throw Error("enough");
                                        return true;
                                      }}),
                 Error);
    renderer.render({camera, kIsovalue});
    expect_same_hits(renderer.hits(), expected, kFrame.width);
  }
}

TEST(Normals, HaveNames) {
  for (const Normals normals : {Normals::kSmooth, Normals::kCell})
    EXPECT_EQ(normals_from_string(to_string(normals)), normals);
  EXPECT_THROW(normals_from_string("Smooth"), Error);
}

}  // namespace
}  // namespace isowave::core
