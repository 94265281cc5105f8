// core/intersect: every pair against the portable headers on the host (equal bits), and rays
// against closed forms in double on a plane and on a saddle, which are trilinear.

#include "core/paper/intersect.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <vector>

#include "kernels_cl/portable/cell_intersect.h"
#include "tests/ray_cases.hpp"
#include "tests/stage_support.hpp"
#include "tests/stage_world.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

/// A hit within a block, with the moment in double.
struct BlockHit {
  PairHit pair{ISO_NO_HIT, 0.0f};
  double t = 0;
  float largest = 0;  ///< |corner - isovalue| of the cell
};

double value_of(TwoFloat t) {
  return double(t.hi) + double(t.lo);
}

/// Cell by cell through a block, in the portable headers.
BlockHit trace_block(const FrameParams &frame, const std::vector<float> &voxels, uint pixel,
                     uint block) {
  const Ray ray = make_ray(&frame, pixel);
  const LastPlanes last = last_planes(&frame);
  const int bx = int(block % frame.grid.blocks_x),
            by = int(block / frame.grid.blocks_x % frame.grid.blocks_y),
            bz = int(block / frame.grid.blocks_x / frame.grid.blocks_y);
  const int end_x = std::min(4 * bx + 4, last.x), end_y = std::min(4 * by + 4, last.y),
            end_z = std::min(4 * bz + 4, last.z);
  RayEvent enter = region_entry(&ray, bx, by, bz, 4, last);
  GridWalk cell = walk_from(&ray, locate(ray.x, 0, enter, 1, 4 * bx, end_x - 1),
                            locate(ray.y, 1, enter, 1, 4 * by, end_y - 1),
                            locate(ray.z, 2, enter, 1, 4 * bz, end_z - 1), 1, last);
  BlockHit hit;
  while (cell.x >= 4 * bx && cell.x < end_x && cell.y >= 4 * by && cell.y < end_y &&
         cell.z >= 4 * bz && cell.z < end_z) {
    const RayEvent exit = walk_exit(&cell, &ray);
    const std::array<float, 8> w = cell_corners(frame, voxels, cell.x, cell.y, cell.z);
    const uint number = uint(cell.x % 4 + 4 * (cell.y % 4) + 16 * (cell.z % 4));
    CellChange change;
    if (change_in_cell(kDefaultSolver, &ray, w.data(), cell.x, cell.y, cell.z, enter, exit,
                       &change)) {
      hit.pair = {number, refine(kDefaultSolver, change.cubic, change.bracket)};
      const double t_enter = value_of(enter.t), t_exit = value_of(exit.t);
      hit.t = t_enter + hit.pair.s * (t_exit - t_enter);
      for (const float corner : w) hit.largest = std::max(hit.largest, std::abs(corner));
      return hit;
    }
    walk_step(&cell, &ray, exit, 1, last);
    enter = exit;
  }
  return hit;
}

enum class Field { kPlane, kSaddle, kRandom };

/// Small whole numbers and quarters: voxels are exact.
double field_value(Field field, double x, double y, double z) {
  return field == Field::kPlane ? x - 2 * y + 0.5 * z : x * y - 6 * x - 8 * y + 2 * z;
}

std::vector<float> make_voxels(Field field, const glm::uvec3 &dims) {
  if (field == Field::kRandom) return random_voxels(dims, -1, 1, 5);
  std::vector<float> voxels;
  for (uint z = 0; z < dims.z; ++z) {
    for (uint y = 0; y < dims.y; ++y) {
      for (uint x = 0; x < dims.x; ++x)
        voxels.push_back(static_cast<float>(field_value(field, x, y, z)));
    }
  }
  return voxels;
}

/// Where the ray is first on the other side than where it enters the domain, by the quadratic
/// formula.
struct ClosedForm {
  bool certain = false;  ///< nothing happens within rounding of an end of the ray, or of a tangent
  std::optional<double> t;
};

ClosedForm closed_form(const FrameParams &frame, Field field, const Ray &ray) {
  const double o[3] = {ray.x.o, ray.y.o, ray.z.o}, d[3] = {ray.x.d, ray.y.d, ray.z.d};
  const double last[3] = {frame.grid.dims_x - 1.0, frame.grid.dims_y - 1.0,
                          frame.grid.dims_z - 1.0};
  double enter = 0, exit = 1e30;
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0) {
      if (o[axis] < 0 || o[axis] > last[axis]) return {true, std::nullopt};
      continue;
    }
    const double t0 = -o[axis] / d[axis], t1 = (last[axis] - o[axis]) / d[axis];
    enter = std::max(enter, std::min(t0, t1));
    exit = std::min(exit, std::max(t0, t1));
  }
  if (exit - enter < 1e-3) return {exit < enter - 1e-3, std::nullopt};
  const auto f = [&](double t) {
    return field_value(field, o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]) -
           frame.surface.isovalue;
  };
  /* f is a quadratic: from three values of it, about the middle of the ray, u in [-1,1]. */
  const double middle = 0.5 * (enter + exit), half = 0.5 * (exit - enter);
  const double c = f(middle), a = 0.5 * (f(enter) + f(exit)) - c, b = 0.5 * (f(exit) - f(enter));
  std::vector<double> roots;
  const double discriminant = b * b - 4 * a * c, size = std::abs(a) + std::abs(b) + std::abs(c);
  if (std::abs(discriminant) < 1e-3 * size * size) return {};
  if (discriminant > 0) {
    const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
    roots.push_back(c / q);
    if (std::abs(a) > 1e-12 * size) roots.push_back(q / a);
  }
  std::ranges::sort(roots);
  ClosedForm answer{true, std::nullopt};
  for (const double u : roots) {
    if (std::abs(std::abs(u) - 1) < 1e-3) return {};
    if (!answer.t && std::abs(u) < 1) answer.t = middle + u * half;
  }
  return answer;
}

/// The stages under test, and those that make their input. Blocks stay cached from frame to frame.
struct Stages {
  Stages(ocl::Device &device, const FrameParams &frame, uint num_slots, uint group_size)
      : world(device, frame, num_slots, group_size),
        group(device, {world.rays.num_rays, num_slots, group_size}),
        intersect(device, world.rays.num_rays, group_size) {}

  StageWorld world;
  Group group;
  Intersect intersect;
};

class IntersectOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  struct Tally {
    std::size_t tested = 0, untested = 0, hits = 0, certain_hits = 0, certain_misses = 0;
  };

  /// What the rays of one frame have met so far, by pixel.
  struct FirstHits {
    explicit FirstHits(uint num_pixels) : t(num_pixels), largest(num_pixels) {}
    std::vector<std::optional<double>> t;
    std::vector<float> largest;  ///< |corner - isovalue| of the cell
    bool all_tested = true;
  };

  /// One frame: passes of spec_count blocks of every ray, until all rays are through. Slots may be
  /// scarce: then each pass tests what it can, and what it cannot is not tried again.
  void run(const glm::uvec3 &dims, Field field, const FrameParams &frame, Stages &stages,
           uint spec_count, Tally &tally) {
    const uint num_pixels = frame.view.width * frame.view.height;
    const std::vector<float> voxels = make_voxels(field, dims);
    stages.world.set_frame(frame);
    std::vector<std::vector<uint>> blocks(num_pixels);
    std::size_t longest = 0;
    for (uint pixel = 0; pixel < num_pixels; ++pixel) {
      blocks[pixel] = blocks_of_ray(frame, pixel);
      longest = std::max(longest, blocks[pixel].size());
    }
    FirstHits first_hits(num_pixels);
    const uint rays_at_once = num_pixels / spec_count;
    for (uint first_ray = 0; first_ray < num_pixels; first_ray += rays_at_once) {
      std::vector<uint> active;
      for (uint pixel = first_ray; pixel < std::min(num_pixels, first_ray + rays_at_once); ++pixel)
        active.push_back(pixel);
      stages.world.set_active(active);
      for (std::size_t done = 0; done < longest; done += spec_count) {
        std::vector<uint> pairs;
        for (const uint pixel : active) {
          for (std::size_t k = done; k < done + spec_count; ++k)
            pairs.push_back(k < blocks[pixel].size() ? blocks[pixel][k] : ISO_INVALID_ID);
        }
        run_pass(stages, voxels, pairs, spec_count, first_hits, tally);
        if (HasFatalFailure()) return;
      }
    }
    if (first_hits.all_tested && field != Field::kRandom)
      expect_closed_form(field, frame, first_hits, tally);
  }

  static void run_pass(Stages &stages, const std::vector<float> &voxels,
                       const std::vector<uint> &pairs, uint spec_count, FirstHits &first_hits,
                       Tally &tally) {
    auto &[world, group, intersect] = stages;
    world.begin_pass(pairs, spec_count);
    world.cache.request(world.rays);
    world.assign_slots();
    world.fill_slots(voxels);
    group(world.cache, world.rays);
    intersect(world.cache, group.groups(), world.rays);

    const FrameParams &frame = world.frame;
    const uint num_slots = world.cache.num_slots;
    const std::vector<PairHit> got = world.rays.pair_hits.read();
    const std::vector<uint> table = world.slots_by_block();
    const auto cached = [&](uint block) { return table[block] < num_slots; };
    std::vector<uint> closest(world.rays.num_rays, ISO_INVALID_ID);
    for (uint pair = 0; pair < pairs.size(); ++pair) {
      const uint pixel = world.active_ray_ids[pair / spec_count];
      if (pairs[pair] == ISO_INVALID_ID) continue;
      if (got[pair].cell != ISO_NO_HIT) {
        closest[pair / spec_count] = std::min(closest[pair / spec_count], pair);
      }
      if (!std::ranges::all_of(dual_grid_blocks(frame, pairs[pair]), cached)) {
        ASSERT_EQ(got[pair].cell, ISO_NOT_TESTED) << "pair " << pair;
        first_hits.all_tested = false;
        ++tally.untested;
        continue;
      }
      const BlockHit expected = trace_block(frame, voxels, pixel, pairs[pair]);
      ASSERT_EQ(got[pair].cell, expected.pair.cell)
          << "pixel " << pixel << ", block " << pairs[pair];
      ASSERT_EQ(std::bit_cast<uint>(got[pair].s), std::bit_cast<uint>(expected.pair.s))
          << "pixel " << pixel << ", block " << pairs[pair];
      ++tally.tested;
      if (expected.pair.cell >= ISO_NO_HIT) continue;
      ++tally.hits;
      if (first_hits.t[pixel]) continue;
      first_hits.t[pixel] = expected.t;
      first_hits.largest[pixel] = expected.largest;
    }
    ASSERT_EQ(first_difference(world.rays.closest_pairs.read(), closest), kNoDifference)
        << "of closest pairs";
  }

  /// Residual of the field at the hit: 46 u M (derived in cell_intersect_test.cpp), u = 2^-24.
  static void expect_closed_form(Field field, const FrameParams &frame, const FirstHits &first_hits,
                                 Tally &tally) {
    for (uint pixel = 0; pixel < first_hits.t.size(); ++pixel) {
      const Ray ray = make_ray(&frame, pixel);
      const std::optional<double> &t = first_hits.t[pixel];
      if (t) {
        const double residual = field_value(field, ray.x.o + *t * ray.x.d, ray.y.o + *t * ray.y.d,
                                            ray.z.o + *t * ray.z.d) -
                                frame.surface.isovalue;
        ASSERT_LE(std::abs(residual), 46 * 0x1p-24 * first_hits.largest[pixel])
            << "pixel " << pixel;
      }
      const ClosedForm expected = closed_form(frame, field, ray);
      if (!expected.certain) continue;
      ASSERT_EQ(t.has_value(), expected.t.has_value()) << "pixel " << pixel;
      ++(expected.t ? tally.certain_hits : tally.certain_misses);
      if (!expected.t) continue;
      /* The nearest of two roots, not the other: those are apart by more than this. */
      ASSERT_NEAR(*t, *expected.t, 1e-3) << "pixel " << pixel;
    }
  }

  bool is_slow() const { return is_llvmpipe(device_.info()); }

  /// Every camera (on a slow device every fourth), each with one of the isovalues in turn.
  void run_cameras(const glm::uvec3 &dims, Field field, const std::vector<float> &isovalues,
                   Tally &tally) {
    const uint num_blocks = uint((dims.x + 3) / 4 * ((dims.y + 3) / 4) * ((dims.z + 3) / 4));
    const ImageSize size{23, 17};
    const std::vector<CameraCase> cameras = camera_cases(dims);
    Stages stages(device_, case_frame(dims, cameras[0], size), std::max(8u, num_blocks), 64);
    for (std::size_t i = 0; i < cameras.size(); i += is_slow() ? 4 : 1) {
      const float isovalue = isovalues[i % isovalues.size()];
      SCOPED_TRACE(fmt::format("{} x {} x {}, camera '{}', field {}, isovalue {}", dims.x, dims.y,
                               dims.z, cameras[i].name, static_cast<int>(field), isovalue));
      run(dims, field, case_frame(dims, cameras[i], size, isovalue), stages, 3, tally);
      if (HasFatalFailure()) return;
    }
  }

  ocl::Device device_{GetParam()};
};

TEST_P(IntersectOnDevice, SmallPlane) {
  const glm::uvec3 dims(7, 6, 5);
  const FrameParams frame = case_frame(dims, camera_cases(dims)[0], {7, 5}, 0.25f);
  Stages stages(device_, frame, 8, 8);
  Tally tally;
  run(dims, Field::kPlane, frame, stages, 2, tally);
  EXPECT_GT(tally.certain_hits, 0u);
}

TEST_P(IntersectOnDevice, Plane) {
  Tally tally;
  run_cameras({18, 21, 17}, Field::kPlane, {0.25f, -7.0f, 3.3f}, tally);
  EXPECT_GT(tally.certain_hits, is_slow() ? 250u : 1000u);
  EXPECT_GT(tally.certain_misses, is_slow() ? 250u : 1000u);
}

TEST_P(IntersectOnDevice, Saddle) {
  Tally tally;
  run_cameras({18, 21, 17}, Field::kSaddle, {-48.0f, -30.5f, 12.25f, -44.0f}, tally);
  EXPECT_GT(tally.certain_hits, is_slow() ? 250u : 1000u);
  EXPECT_GT(tally.certain_misses, is_slow() ? 125u : 500u);
}

TEST_P(IntersectOnDevice, RandomVoxelsOfAwkwardDims) {
  Tally tally;
  for (const glm::uvec3 dims :
       {glm::uvec3(18, 21, 17), glm::uvec3(5, 6, 7), glm::uvec3(2, 9, 33), glm::uvec3(2, 2, 2)}) {
    run_cameras(dims, Field::kRandom, {0.1f}, tally);
  }
  EXPECT_GT(tally.hits, is_slow() ? 2500u : 10000u);
  EXPECT_EQ(tally.untested, 0u);
}

TEST_P(IntersectOnDevice, GroupSizesDoNotMatter) {
  const glm::uvec3 dims(18, 21, 17);
  const FrameParams frame = case_frame(dims, camera_cases(dims)[1], {71, 53});
  for (const uint group_size : kGroupSizes) {
    if (is_slow() && group_size == 64) continue;  // as the other cases
    Stages stages(device_, frame, 5 * 6 * 5, group_size);
    Tally tally;
    run(dims, Field::kRandom, frame, stages, 2, tally);
    EXPECT_GT(tally.hits, 1000u);
  }
}

TEST_P(IntersectOnDevice, ScarceSlots) {
  const glm::uvec3 dims(18, 21, 17);
  const FrameParams frame = case_frame(dims, camera_cases(dims)[0], {23, 17});
  for (const uint num_slots : {8u, 9u, 40u}) {
    Stages stages(device_, frame, num_slots, 64);
    Tally tally;
    run(dims, Field::kRandom, frame, stages, 4, tally);
    EXPECT_GT(tally.tested, 0u);
    EXPECT_GT(tally.untested, 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, IntersectOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
