// Boxes of a volume's voxels: the bits of the whole volume as libzfp decodes it, and nothing read
// but their blocks.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <isowave/isowave.hpp>
#include <random>

#include "core/api/volume_implementation.hpp"
#include "tests/run_program.hpp"

namespace isowave {
namespace {

using core::CompressedVolume;
using testing::HasSubstr;
using Index3 = std::array<std::uint32_t, 3>;

constexpr Grid kGrid{.dims = {37, 18, 23}};  // unequal, and no multiples of 4

struct Case {
  const char *name;
  Compression compression;
};

const std::array kCases = {
    Case{"Rate", {.rate = 7, .levels = 0}},
    Case{"Tolerance", {.tolerance = 0.7, .levels = 0}},
    Case{"Exact", {.exact = true, .levels = 0}},
};

/// Smooth, so that blocks have lengths of their own, with noise, so that none is empty.
std::shared_ptr<const Volume> make_volume(const Compression &compression) {
  std::minstd_rand random(1);
  std::vector<std::uint16_t> voxels;
  for (std::uint32_t z = 0; z < kGrid.dims[2]; ++z) {
    for (std::uint32_t y = 0; y < kGrid.dims[1]; ++y) {
      for (std::uint32_t x = 0; x < kGrid.dims[0]; ++x)
        voxels.push_back(static_cast<std::uint16_t>(x * y + 40 * z + random() % (1 + x)));
    }
  }
  return compress(voxels, kGrid, compression);
}

const CompressedVolume &level_of(const Volume &volume, std::uint32_t level) {
  const CompressedVolume &finest = volume.implementation().volume;
  return level == 0 ? finest : finest.coarser_levels.at(level - 1);
}

/// A region of a decoded level, voxel by voxel.
std::vector<float> cut_out(const std::vector<float> &voxels, const Index3 &dims,
                           const Region &region) {
  std::vector<float> result;
  for (std::uint32_t z = region.begin[2]; z < region.end[2]; z += region.step[2]) {
    for (std::uint32_t y = region.begin[1]; y < region.end[1]; y += region.step[1]) {
      for (std::uint32_t x = region.begin[0]; x < region.end[0]; x += region.step[0])
        result.push_back(voxels.at(x + std::size_t{dims[0]} * (y + std::size_t{dims[1]} * z)));
    }
  }
  return result;
}

bool same_bits(const std::vector<float> &a, const std::vector<float> &b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

/// The whole, single voxels, slices along each axis, the border, and any, with steps, too.
std::vector<Region> regions_in(const Index3 &dims) {
  const auto [x, y, z] = dims;
  std::vector<Region> regions = {
      {{0, 0, 0}, dims},
      {{0, 0, 0}, {1, 1, 1}},
      {{x - 1, y - 1, z - 1}, dims},
      {{x / 2, 0, 0}, {x / 2 + 1, y, z}},
      {{0, y / 2, 0}, {x, y / 2 + 1, z}},
      {{0, 0, z / 2}, {x, y, z / 2 + 1}},
      {{0, 0, 0}, dims, {5, 9, 13}},
      {{0, 0, 0}, dims, {0xFFFFFFFFu, 1, 0xFFFFFFFEu}},
  };
  std::minstd_rand random(2);
  for (int i = 0; i < 50; ++i) {
    Region region;
    for (int axis = 0; axis < 3; ++axis) {
      region.begin.at(axis) = static_cast<std::uint32_t>(random() % dims.at(axis));
      region.end.at(axis) = static_cast<std::uint32_t>(
          region.begin.at(axis) + 1 + random() % (dims.at(axis) - region.begin.at(axis)));
      region.step.at(axis) = i % 2 == 0 ? 1 : static_cast<std::uint32_t>(1 + random() % 7);
    }
    regions.push_back(region);
  }
  return regions;
}

class VoxelRegion : public testing::TestWithParam<Case> {
 protected:
  const std::shared_ptr<const Volume> volume_ = make_volume(GetParam().compression);
  const core::test::TemporaryFolder folder_;
};
INSTANTIATE_TEST_SUITE_P(Ways, VoxelRegion, testing::ValuesIn(kCases),
                         [](const auto &one) { return one.param.name; });

TEST_P(VoxelRegion, HasTheBitsOfTheWholeLevel) {
  volume_->save(folder_ / "volume.zfp");
  const auto opened = open_volume(folder_ / "volume.zfp");
  ASSERT_GT(volume_->num_levels(), 1u);
  for (std::uint32_t level = 0; level < volume_->num_levels(); ++level) {
    const std::vector<float> whole = core::decode_with_libzfp(level_of(*volume_, level));
    const Index3 dims = volume_->level_grid(level).dims;
    for (const Region &region : regions_in(dims)) {
      const std::vector<float> expected = cut_out(whole, dims, region);
      EXPECT_TRUE(same_bits(volume_->decode(level, region), expected));
      EXPECT_TRUE(same_bits(opened->decode(level, region), expected));
    }
    EXPECT_TRUE(same_bits(volume_->decode(level), whole));
    EXPECT_TRUE(same_bits(opened->decode(level), whole));
  }
}

/// Whether a region has voxels of a block.
bool touches(const Region &region, const Index3 &block) {
  for (int axis = 0; axis < 3; ++axis) {
    bool some = false;
    for (std::uint32_t v = region.begin.at(axis); v < region.end.at(axis);
         v += region.step.at(axis))
      some |= v / 4 == block.at(axis);
    if (!some) return false;
  }
  return true;
}

/// The file's bytes without any bit of blocks that the region does not touch.
std::string only_blocks_of(std::string bytes, const CompressedVolume &volume,
                           const Region &region) {
  const glm::uvec3 blocks = volume.num_blocks();
  std::uint32_t id = 0;
  for (std::uint32_t z = 0; z < blocks.z; ++z) {
    for (std::uint32_t y = 0; y < blocks.y; ++y) {
      for (std::uint32_t x = 0; x < blocks.x; ++x, ++id) {
        if (touches(region, {x, y, z})) continue;
        for (std::uint64_t bit = volume.block_begin(id); bit < volume.block_begin(id + 1); ++bit) {
          const std::uint64_t at = volume.file_first_bit + bit;
          bytes.at(at / 8) = static_cast<char>(bytes.at(at / 8) & ~(1 << at % 8));
        }
      }
    }
  }
  return bytes;
}

void overwrite(const std::filesystem::path &path, const std::string &bytes) {
  std::ofstream(path, std::ios::in | std::ios::out | std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// Regions are read from a file whose other blocks are gone.
TEST_P(VoxelRegion, NeedsItsOwnBlocksAlone) {
  volume_->save(folder_ / "volume.zfp");
  const auto opened = open_volume(folder_ / "volume.zfp");
  const std::string bytes = core::test::read_file(folder_ / "volume.zfp");
  for (const Region &region :
       {Region{{0, 0, 9}, {37, 18, 10}}, Region{{33, 0, 0}, {34, 18, 23}},
        Region{{5, 6, 7}, {6, 7, 8}}, Region{{0, 0, 0}, {37, 18, 23}, {16, 9, 11}}}) {
    const std::vector<float> expected = opened->decode(0, region), whole = opened->decode();
    overwrite(folder_ / "volume.zfp",
              only_blocks_of(bytes, opened->implementation().volume, region));
    EXPECT_TRUE(same_bits(opened->decode(0, region), expected));
    EXPECT_FALSE(same_bits(opened->decode(), whole));
    overwrite(folder_ / "volume.zfp", bytes);
  }
}

/// What is behind a region may be missing altogether.
TEST_P(VoxelRegion, ReadsNothingBehindItsBlocks) {
  volume_->save(folder_ / "volume.zfp");
  const auto opened = open_volume(folder_ / "volume.zfp");
  const CompressedVolume &volume = opened->implementation().volume;
  const Region front{{0, 0, 0}, {37, 18, 4}}, behind{{0, 0, 4}, {37, 18, 5}};
  const std::vector<float> expected = opened->decode(0, front);
  const std::uint64_t layer = volume.num_blocks().x * volume.num_blocks().y;
  // Files are read by words of 32 bits.
  const std::uint64_t end_bit = volume.file_first_bit + volume.block_begin(layer) + 31;
  std::filesystem::resize_file(folder_ / "volume.zfp", (end_bit + 7) / 8);
  EXPECT_TRUE(same_bits(opened->decode(0, front), expected));
  EXPECT_THROW((void)opened->decode(0, behind), Error);
}

TEST_P(VoxelRegion, OutsideTheLevelIsOneLine) {
  const auto error_of = [&](std::uint32_t level, const Region &region) -> std::string {
    try {
      (void)volume_->decode(level, region);
    } catch (const Error &error) {
      return error.what();
    }
    return "no error";
  };
  const std::string z = "along z: must hold a voxel, and end by 23";
  EXPECT_EQ(error_of(0, {{0, 0, 3}, {1, 1, 3}}), "region 3 to 3 in steps of 1 " + z);
  EXPECT_EQ(error_of(0, {{0, 0, 3}, {1, 1, 2}}), "region 3 to 2 in steps of 1 " + z);
  EXPECT_EQ(error_of(0, {{0, 0, 3}, {1, 1, 24}}), "region 3 to 24 in steps of 1 " + z);
  EXPECT_EQ(error_of(0, {{0, 0, 0}, {1, 1, 1}, {1, 1, 0}}), "region 0 to 1 in steps of 0 " + z);
  EXPECT_THAT(error_of(0, {{37, 0, 0}, {38, 1, 1}}), HasSubstr("along x"));
  EXPECT_THAT(error_of(0, {{0, 18, 0}, {1, 18, 1}}), HasSubstr("along y"));
  EXPECT_THAT(error_of(1, {{0, 0, 0}, {37, 18, 23}}), HasSubstr("along x"));
  EXPECT_THAT(error_of(9, {{0, 0, 0}, {1, 1, 1}}), HasSubstr("level 9"));
}

}  // namespace
}  // namespace isowave
