// core/macrocells: ranges and masks against plain loops over the voxels that libzfp decodes.

#include "core/stages/macrocells.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "core/stages/zfp_decode.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/level_bounds.hpp"
#include "kernels_cl/portable/block_grid.h"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// What a block's dual cells hold, padding left out. min > max: the block owns no cell.
struct Range {
  float min = kInfinity, max = -kInfinity;
  /// Half open: inside := f >= isovalue.
  bool holds(float isovalue) const { return min < isovalue && isovalue <= max; }
};

std::vector<Range> dual_cell_ranges(const glm::uvec3 &dims, const std::vector<float> &voxels) {
  const glm::uvec3 blocks = (dims + 3u) / 4u;
  std::vector<Range> ranges(std::size_t{blocks.x} * blocks.y * blocks.z);
  for (uint z = 0; z + 1 < dims.z; ++z) {
    for (uint y = 0; y + 1 < dims.y; ++y) {
      for (uint x = 0; x + 1 < dims.x; ++x) {
        Range &range = ranges[x / 4 + blocks.x * (y / 4 + std::size_t{blocks.y} * (z / 4))];
        for (uint corner = 0; corner < 8; ++corner) {
          const float value =
              voxels[x + (corner & 1) +
                     dims.x * (y + (corner >> 1 & 1) + std::size_t{dims.y} * (z + (corner >> 2)))];
          range.min = std::min(range.min, value);
          range.max = std::max(range.max, value);
        }
      }
    }
  }
  return ranges;
}

/// Values at and around every end of a range, and far outside.
std::vector<float> awkward_isovalues(const std::vector<Range> &ranges, std::size_t max_ranges) {
  std::vector<float> isovalues = {-kInfinity, kInfinity, 0.0f, -1e30f, 1e30f};
  const std::size_t step = std::max<std::size_t>(1, ranges.size() / max_ranges);
  for (std::size_t i = 0; i < ranges.size(); i += step) {
    const Range &range = ranges[i];
    if (range.min > range.max) continue;
    for (const float value : {range.min, range.max}) {
      isovalues.push_back(value);
      isovalues.push_back(std::nextafter(value, -kInfinity));
      isovalues.push_back(std::nextafter(value, kInfinity));
    }
    isovalues.push_back(0.5f * range.min + 0.5f * range.max);
  }
  return isovalues;
}

class MacrocellsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Builds the ranges of a volume and checks them and the masks of many isovalues.
  void expect_exact(const CompressedVolume &volume, std::size_t max_ranges = 20) {
    const glm::uvec3 dims = volume.info.dims;
    SCOPED_TRACE(fmt::format("{} x {} x {}, {} bits per block", dims.x, dims.y, dims.z,
                             volume.bits_per_block));
    FrameParams params = grid_frame(dims);
    const DeviceStream stream(device_, volume);
    std::array<float, 2> extremes{};
    Macrocells macrocells(device_, params, stream, {}, {}, &extremes);
    const std::vector<float> voxels = decode_with_libzfp(volume);
    const std::vector<Range> expected = dual_cell_ranges(dims, voxels);
    expect_ranges(macrocells, expected);
    EXPECT_EQ(extremes[0], std::ranges::min(voxels));
    EXPECT_EQ(extremes[1], std::ranges::max(voxels));

    std::size_t num_selected = 0, num_in_range = 0;
    for (const float isovalue : awkward_isovalues(expected, max_ranges)) {
      SCOPED_TRACE(fmt::format("isovalue {:a}", isovalue));
      params.surface.isovalue = isovalue;
      macrocells.select(params);
      params.surface = macrocells.surface(params);
      expect_box(params, macrocells.masks().read());
      expect_mask(macrocells, params, expected, isovalue, num_selected, num_in_range);
      if (HasFatalFailure()) return;
    }
    /* Not every selected block holds the isovalue, for a range has 8 bits; but a mask of ones would
     * be useless. */
    EXPECT_LE(num_selected, 3 * num_in_range + 2 * expected.size());
  }

  /// The box around all set bits, to whole macrocells.
  static void expect_box(const FrameParams &params, const std::vector<uint> &masks) {
    const int cells[3] = {int(params.grid.blocks_x + 3) / 4, int(params.grid.blocks_y + 3) / 4,
                          int(params.grid.blocks_z + 3) / 4};
    int begin[3] = {1 << 20, 1 << 20, 1 << 20}, end[3] = {0, 0, 0};
    for (int cell = 0; cell < cells[0] * cells[1] * cells[2]; ++cell) {
      if ((masks[2 * std::size_t(cell)] | masks[2 * std::size_t(cell) + 1]) == 0) continue;
      const int at[3] = {cell % cells[0], cell / cells[0] % cells[1], cell / cells[0] / cells[1]};
      for (int axis = 0; axis < 3; ++axis) {
        begin[axis] = std::min(begin[axis], 4 * at[axis]);
        end[axis] = std::max(end[axis], 4 * at[axis] + 4);
      }
    }
    const int got_begin[3] = {params.surface.active_begin_x, params.surface.active_begin_y,
                              params.surface.active_begin_z};
    const int got_end[3] = {params.surface.active_end_x, params.surface.active_end_y,
                            params.surface.active_end_z};
    const uint dims[3] = {params.grid.dims_x, params.grid.dims_y, params.grid.dims_z};
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_EQ(got_end[axis], std::min(end[axis], int(num_owning_blocks(dims[axis]))))
          << "axis " << axis;
      if (end[axis] != 0) {
        ASSERT_EQ(got_begin[axis], begin[axis]) << "axis " << axis;
      }
    }
  }

  static void expect_ranges(const Macrocells &macrocells, const std::vector<Range> &expected) {
    const std::vector<float> &thresholds = macrocells.thresholds();
    const std::vector<ushort> ranges = macrocells.ranges().read();
    ASSERT_EQ(thresholds.size(), 256u);
    ASSERT_TRUE(std::ranges::is_sorted(thresholds));
    ASSERT_EQ(thresholds.front(), -kInfinity);
    ASSERT_EQ(thresholds.back(), kInfinity);
    ASSERT_EQ(ranges.size(), expected.size());
    for (std::size_t b = 0; b < ranges.size(); ++b) {
      const uint low = ranges[b] & 255u, high = ranges[b] >> 8;
      const Range &range = expected[b];
      if (range.min > range.max) {
        ASSERT_GT(low, high) << "block " << b << " owns no dual cell";
        continue;
      }
      ASSERT_LE(thresholds[low], range.min) << "block " << b;
      ASSERT_GE(thresholds[high], range.max) << "block " << b;
      /* Tight: one step further in would cut the range, but for repeated thresholds. */
      ASSERT_TRUE(thresholds[low + 1] > range.min || low == 254) << "block " << b;
      ASSERT_TRUE(thresholds[high - 1] < range.max || high == 1) << "block " << b;
    }
  }

  static bool is_selected(const std::vector<uint> &masks, const FrameParams &params, uint block) {
    const uint x = block % params.grid.blocks_x,
               y = block / params.grid.blocks_x % params.grid.blocks_y,
               z = block / params.grid.blocks_x / params.grid.blocks_y;
    const uint coarse_x = (params.grid.blocks_x + 3) / 4, coarse_y = (params.grid.blocks_y + 3) / 4;
    const uint coarse = x / 4 + coarse_x * (y / 4 + coarse_y * (z / 4)),
               bit = x % 4 + 4 * (y % 4) + 16 * (z % 4);
    return (masks[2 * coarse + bit / 32] >> bit % 32 & 1) != 0;
  }

  /// A block whose dual cells hold values on both sides must be selected; one that owns no cell
  /// must not.
  static void expect_mask(const Macrocells &macrocells, const FrameParams &params,
                          const std::vector<Range> &expected, float isovalue,
                          std::size_t &num_selected, std::size_t &num_in_range) {
    const std::vector<uint> masks = macrocells.masks().read();
    const std::vector<float> &thresholds = macrocells.thresholds();
    const std::vector<ushort> ranges = macrocells.ranges().read();
    std::size_t num_bits = 0, num_blocks_selected = 0;
    for (const uint word : masks) num_bits += static_cast<std::size_t>(std::popcount(word));
    for (uint b = 0; b < expected.size(); ++b) {
      const bool selected = is_selected(masks, params, b);
      const Range &range = expected[b];
      const bool in_range = range.holds(isovalue);
      if (in_range) {
        ASSERT_TRUE(selected) << "block " << b << " of [" << range.min << ", " << range.max
                              << "] is missed";
      }
      if (range.min > range.max) {
        ASSERT_FALSE(selected) << "block " << b << " owns no dual cell";
      }
      if (selected) {  // as far as 8 bits can tell
        ASSERT_LT(thresholds[ranges[b] & 255u], isovalue) << "block " << b;
        ASSERT_GE(thresholds[ranges[b] >> 8], isovalue) << "block " << b;
      }
      num_blocks_selected += selected;
      num_in_range += in_range;
    }
    EXPECT_EQ(num_bits, num_blocks_selected) << "bits of blocks outside the volume";
    num_selected += num_blocks_selected;
  }

  ocl::Device device_{GetParam()};
};

std::vector<float> sphere_voxels(const glm::uvec3 &dims) {
  std::vector<float> voxels;
  for (uint z = 0; z < dims.z; ++z) {
    for (uint y = 0; y < dims.y; ++y) {
      for (uint x = 0; x < dims.x; ++x) {
        const glm::vec3 p = glm::vec3(x, y, z) - 0.5f * glm::vec3(dims);
        voxels.push_back(std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z));
      }
    }
  }
  return voxels;
}

constexpr glm::uvec3 kAwkwardDims[] = {{2, 2, 2},   {4, 4, 4},    {5, 5, 5},
                                       {2, 19, 21}, {17, 2, 9},   {13, 22, 2},
                                       {9, 10, 11}, {41, 41, 41}, {70, 18, 33}};

TEST_P(MacrocellsOnDevice, SmallPartialBlocks) {
  const glm::uvec3 dims(5, 6, 9);
  expect_exact(compress_with_libzfp(random_voxels(dims, -1, 1, 1), dims, 256), 3);
}

TEST_P(MacrocellsOnDevice, RandomVolumesOfAwkwardDims) {
  for (const glm::uvec3 &dims : kAwkwardDims) {
    expect_exact(compress_with_libzfp(random_voxels(dims, -50, 200, 2), dims, 512));
  }
}

TEST_P(MacrocellsOnDevice, SmoothVolumesOfAwkwardDims) {
  for (const glm::uvec3 &dims : kAwkwardDims)
    expect_exact(compress_with_libzfp(sphere_voxels(dims), dims, 1024));
}

/// Ranges are those of the volume; what the isovalue touches where each block is raised or lowered
/// by its own bound follows from them.
TEST_P(MacrocellsOnDevice, SmallBlocksMovedByTheirBounds) {
  const glm::uvec3 dims(17, 10, 9);
  CompressedVolume volume = compress_with_libzfp(sphere_voxels(dims), dims, 1024);
  FrameParams params = grid_frame(dims);
  volume.bounds.exponent = -6;
  for (std::size_t i = 0; i < volume.block_count(); ++i)
    volume.bounds.codes.push_back(i % 5 == 0 ? 32 : i % 16);  // 0.5, and up to 0.23
  DeviceStream stream(device_, volume, 0, ByteTable::kBounds);
  Macrocells macrocells(device_, params, stream);
  const std::vector<float> decoded = decode_with_libzfp(volume);
  std::size_t num_selected = 0, num_in_range = 0, num_if_all_alike = 0;
  for (const float sign : {-1.0f, 1.0f}) {
    const ValueOffset offset{0, sign * std::ldexp(1.0f, volume.bounds.exponent)};
    std::vector<float> moved = decoded;
    for (std::size_t i = 0; i < moved.size(); ++i) {
      const std::size_t x = i % dims.x / 4, y = i / dims.x % dims.y / 4,
                        z = i / dims.x / dims.y / 4;
      moved[i] += offset_of_voxel(offset, volume.bounds,
                                  x + params.grid.blocks_x * (y + params.grid.blocks_y * z), 0);
    }
    const std::vector<Range> expected = dual_cell_ranges(dims, moved);
    for (const float isovalue : awkward_isovalues(expected, 4)) {
      params.surface.isovalue = isovalue;
      const auto masks = [&](float uniform, float unit) {
        stream.layout.value_offset = uniform;
        stream.layout.bound_unit = unit;
        macrocells.select(params, 0, &stream);
        params.surface = macrocells.surface(params);
        return macrocells.masks().read();
      };
      const std::vector<uint> by_block = masks(0, offset.unit), alike = masks(sign * 0.5f, 0);
      for (uint b = 0; b < expected.size(); ++b) {
        const bool selected = is_selected(by_block, params, b);
        ASSERT_TRUE(selected || !expected[b].holds(isovalue))
            << "block " << b << " at " << isovalue;
        num_selected += selected;
        num_in_range += expected[b].holds(isovalue);
        num_if_all_alike += is_selected(alike, params, b);
      }
    }
  }
  EXPECT_LE(num_selected, 3 * num_in_range);
  EXPECT_LT(num_selected, num_if_all_alike);
}

/// At 1 bit per voxel zfp overshoots a step several times: ranges must come from decoded values.
TEST_P(MacrocellsOnDevice, OvershootAtOneBitPerVoxel) {
  const glm::uvec3 dims(24, 24, 24);
  std::vector<float> voxels = random_voxels(dims, 0, 1, 3);
  for (float &v : voxels) v = v < 0.5f ? 0.0f : 255.0f;
  const CompressedVolume volume = compress_with_libzfp(voxels, dims, 64);
  const std::vector<float> decoded = decode_with_libzfp(volume);
  const auto [least, largest] = std::ranges::minmax_element(decoded);
  ASSERT_TRUE(*least < 0.0f || *largest > 255.0f) << "no overshoot: the test tests nothing";
  expect_exact(volume);
}

/// What lies in the padding of the last blocks is no part of the volume. libzfp pads with copies of
/// voxels, which would go unnoticed; another writer need not.
TEST_P(MacrocellsOnDevice, PaddingIsNotCounted) {
  const glm::uvec3 dims(14, 10, 7), padded(16, 12, 8);
  std::vector<float> voxels = random_voxels(padded, -1, 1, 4);
  for (uint i = 0; i < voxels.size(); ++i) {
    if (i % 16 >= dims.x || i / 16 % 12 >= dims.y || i / 16 / 12 >= dims.z)
      voxels[i] = i % 2 ? 1000.0f : -1000.0f;
  }
  CompressedVolume volume = compress_with_libzfp(voxels, padded, 2048);
  volume.info.dims = dims;
  expect_exact(volume);
}

/// One voxel of a million must not coarsen the table for all others.
TEST_P(MacrocellsOnDevice, Outliers) {
  const glm::uvec3 dims(40, 40, 40);
  std::vector<float> voxels = sphere_voxels(dims);
  voxels[12345] = 1e30f;
  voxels[54321] = -1e30f;
  const CompressedVolume volume = compress_with_libzfp(voxels, dims, 2048);
  expect_exact(volume);
  FrameParams params = grid_frame(dims);
  const DeviceStream stream(device_, volume);
  const Macrocells macrocells(device_, params, stream);
  const auto within = std::ranges::count_if(macrocells.thresholds(),
                                            [](float t) { return t > -1.0f && t < 100.0f; });
  EXPECT_GT(within, 200);
}

/// Nearly all distinct values are noise upon two plateaus; a table of quantiles alone would take
/// all between for one.
TEST_P(MacrocellsOnDevice, NoisyPlateaus) {
  const glm::uvec3 dims(64, 40, 40);
  std::vector<float> voxels = random_voxels(dims, 0, 1, 5);
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    const float x = static_cast<float>(i % 64);
    voxels[i] += 100 * std::clamp((x - 28) / 8, 0.0f, 1.0f);
  }
  const CompressedVolume volume = compress_with_libzfp(voxels, dims, 1024);
  expect_exact(volume);
  FrameParams params = grid_frame(dims);
  const DeviceStream stream(device_, volume);
  const Macrocells macrocells(device_, params, stream);
  const auto between =
      std::ranges::count_if(macrocells.thresholds(), [](float t) { return t > 2 && t < 99; });
  EXPECT_GT(between, 100);
}

/// Masks of a volume and of its bounds are kept side by side: a renderer that draws them by turns
/// finds them as they were.
TEST_P(MacrocellsOnDevice, SelectionsAreKept) {
  const glm::uvec3 dims(24, 20, 18);
  const CompressedVolume volume = compress_with_libzfp(sphere_voxels(dims), dims, 2048);
  const DeviceStream stream(device_, volume);
  const auto select = [&](Macrocells &macrocells, std::size_t selection, float isovalue,
                          double voxel_error) {
    FrameParams params = grid_frame(dims);
    params.surface.isovalue = isovalue;
    macrocells.use(selection);
    macrocells.select(params, voxel_error, &stream);
    params.surface = macrocells.surface(params);
    return std::pair(macrocells.masks().read(),
                     std::array{static_cast<int>(params.surface.isovalue_index),
                                params.surface.active_begin_x, params.surface.active_begin_y,
                                params.surface.active_begin_z, params.surface.active_end_x,
                                params.surface.active_end_y, params.surface.active_end_z});
  };
  const auto alone = [&](float isovalue, double voxel_error) {
    Macrocells macrocells(device_, grid_frame(dims), stream);
    return select(macrocells, 0, isovalue, voxel_error);
  };
  Macrocells macrocells(device_, grid_frame(dims), stream,
                        std::make_shared<MacrocellBuffers>(
                            device_, MacrocellBuffers::Limits{volume.block_count(),
                                                              num_macrocells(grid_frame(dims).grid),
                                                              kNumFieldBounds}));
  const float first = sphere_voxels(dims)[1000], other = sphere_voxels(dims)[5000];
  const auto expected = alone(first, 0), wider = alone(first, 0.2), another = alone(other, 0);
  EXPECT_NE(expected, wider);
  EXPECT_NE(expected, another);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(select(macrocells, 0, first, 0), expected);
    EXPECT_EQ(select(macrocells, 1, first, 0.2), wider);
    EXPECT_EQ(select(macrocells, 2, other, 0), another);
  }
  EXPECT_EQ(select(macrocells, 1, other, 0), another) << "another isovalue in the same place";
  EXPECT_EQ(select(macrocells, 0, first, 0), expected);
}

/// Rows of 128 blocks and one sample for 128 blocks: were it always the first, the sample would be
/// one face of the volume.
TEST(Macrocells, SampleOfLongRows) {
  std::set<uint> seen;
  for (uint begin = 0; begin < 128 * 128 * 128; begin += 128) {
    const uint block = sampled_block(begin, 128);
    ASSERT_GE(block, begin);
    ASSERT_LT(block, begin + 128);
    seen.insert(block % 128);
  }
  EXPECT_EQ(seen.size(), 128u);
}

TEST_P(MacrocellsOnDevice, ConstantVolumes) {
  const glm::uvec3 dims(9, 10, 11);
  for (const float value : {0.0f, 7.0f, -1e20f}) {
    expect_exact(compress_with_libzfp(std::vector<float>(9 * 10 * 11, value), dims, 1024));
  }
}

/// Two values of blocks only: a table with a single inner threshold, or two.
TEST_P(MacrocellsOnDevice, FewDistinctValues) {
  const glm::uvec3 dims(8, 8, 8);
  std::vector<float> voxels(512, 1.0f);
  std::fill(voxels.begin() + 256, voxels.end(), 2.0f);
  expect_exact(compress_with_libzfp(voxels, dims, 2048));
}

/// More blocks than the sample for the table takes: the rest may hold values beyond every
/// threshold.
TEST_P(MacrocellsOnDevice, MoreBlocksThanSamples) {
  const glm::uvec3 dims(130, 126, 66);  // 33 * 32 * 17 = 17,952 blocks: every second is sampled
  std::vector<float> voxels = sphere_voxels(dims);
  voxels[4] = -1e6f;  // block 1
  expect_exact(compress_with_libzfp(voxels, dims, 256), 5);
}

INSTANTIATE_TEST_SUITE_P(Devices, MacrocellsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
