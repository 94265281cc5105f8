// Volumes whose voxels a function gives, and samples of them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <isowave/isowave.hpp>
#include <numeric>
#include <set>

#include "core/base/error.hpp"
#include "core/sources/layer_reader.hpp"
#include "tests/run_program.hpp"
#include "tests/setting.hpp"

namespace isowave {
namespace {

using testing::HasSubstr;

constexpr Grid kGrid{.dims = {17, 19, 30}, .spacing = {1, 2, 3}, .origin = {4, 5, 6}};
constexpr std::size_t kLayer = 17 * 19;

template <class T>
std::vector<T> ramp() {
  std::vector<T> voxels(kLayer * 30);
  for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = static_cast<T>(i * i % 251);
  return voxels;
}

/// Gives the voxels, and counts how often each layer was asked for.
template <class T>
ReadLayers counting_reader(const std::vector<T> &voxels, std::vector<int> &counts) {
  counts.assign(30, 0);
  return [&](std::uint32_t z, std::uint32_t num_layers, std::span<std::byte> out) {
    ASSERT_EQ(out.size(), num_layers * kLayer * sizeof(T));
    std::memcpy(out.data(), voxels.data() + z * kLayer, out.size());
    for (std::uint32_t i = z; i < z + num_layers; ++i) ++counts.at(i);
  };
}

template <class T>
class LayerReaderOfType : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int16_t, std::uint32_t, float, double>;
TYPED_TEST_SUITE(LayerReaderOfType, Types);

/// Each layer is asked for once, and what comes out is what the array itself gives.
TYPED_TEST(LayerReaderOfType, CompressesAsAnArrayDoes) {
  const std::vector<TypeParam> voxels = ramp<TypeParam>();
  for (const Compression &compression :
       {Compression{.rate = 8}, Compression{.tolerance = 0.5},
        Compression{.tolerance_relative = 0.01}, Compression{.rate = 8, .levels = 2}}) {
    std::vector<int> counts;
    const auto of_layers =
        compress(counting_reader(voxels, counts), voxel_type_of<TypeParam>(), kGrid, compression);
    EXPECT_THAT(counts, testing::Each(1));
    const auto of_array = compress(voxels, kGrid, compression);
    EXPECT_EQ(of_layers->decode(), of_array->decode());
    EXPECT_EQ(of_layers->compressed_bytes(), of_array->compressed_bytes());
    EXPECT_EQ(of_layers->grid().spacing, kGrid.spacing);
    EXPECT_EQ(of_layers->source_type(), voxel_type_of<TypeParam>());
  }
}

TEST(LayerReader, CompressesToTheFileThatIsSaved) {
  const core::test::TemporaryFolder folder;
  const std::vector<float> voxels = ramp<float>();
  for (const Compression &compression : {Compression{.rate = 8}, Compression{.tolerance = 0.5},
                                         Compression{.rate = 8, .levels = 2}}) {
    std::vector<int> counts;
    const auto of_layers = compress_to_file(counting_reader(voxels, counts), VoxelType::kFloat32,
                                            kGrid, folder / "layers.zfp", compression);
    EXPECT_THAT(counts, testing::Each(1));
    const auto of_array = compress(voxels, kGrid, compression);
    of_array->save(folder / "array.zfp");
    EXPECT_EQ(core::test::read_file(folder / "layers.zfp"),
              core::test::read_file(folder / "array.zfp"));
    EXPECT_EQ(of_layers->decode(), of_array->decode());
  }
  std::vector<int> counts;
  EXPECT_THROW(compress_to_file(counting_reader(voxels, counts), VoxelType::kFloat32, kGrid,
                                folder / "layers.nrrd"),
               Error);
  EXPECT_FALSE(std::filesystem::exists(folder / "layers.nrrd"));
}

TEST(LayerReader, AsksAgainWhereNothingIsKept) {
  const std::vector<float> voxels = ramp<float>();
  std::vector<int> counts;
  const auto volume = compress(counting_reader(voxels, counts), VoxelType::kFloat32, kGrid,
                               {.tolerance = 0.5}, false);
  EXPECT_THAT(counts, testing::Each(2));
  EXPECT_EQ(volume->decode(), compress(voxels, kGrid, {.tolerance = 0.5})->decode());
}

TEST(LayerReader, WhatTheFunctionThrowsIsTheError) {
  const auto fail = [](std::uint32_t, std::uint32_t, std::span<std::byte>) {
    throw std::runtime_error("the store is gone");
  };
  try {
    compress(ReadLayers(fail), VoxelType::kUint8, kGrid);
    FAIL();
  } catch (const Error &error) {
    EXPECT_THAT(error.what(), HasSubstr("the store is gone"));
  }
  Grid flat = kGrid;
  flat.dims[2] = 1;
  EXPECT_THROW(compress(ReadLayers(fail), VoxelType::kUint8, flat), Error);
}

TEST(LayerReader, NoRoomForTheTemporaryFileIsOneLine) {
  std::vector<int> counts;
  const std::vector<float> voxels = ramp<float>();
  const core::test::TemporaryFolder folder;
  const core::test::Setting tmpdir("TMPDIR", (folder / "file").string());
  std::ofstream(folder / "file") << "no folder";
  try {
    compress(counting_reader(voxels, counts), VoxelType::kFloat32, kGrid, {.tolerance = 0.5});
    FAIL();
  } catch (const Error &error) {
    EXPECT_THAT(error.what(), HasSubstr("TMPDIR"));
    EXPECT_EQ(std::string_view(error.what()).find('\n'), std::string_view::npos);
  }
}

TEST(VoxelSample, HasAllVoxelsOfASmallVolume) {
  const auto volume = compress(ramp<float>(), kGrid, {.tolerance = 0.5, .levels = 2});
  std::vector<float> sample = volume->sample(1 << 20), decoded = volume->decode();
  std::ranges::sort(sample);
  std::ranges::sort(decoded);
  EXPECT_EQ(sample, decoded);
  const auto whole_numbers = compress(ramp<std::uint8_t>(), kGrid, {.exact = true});
  sample = whole_numbers->sample(1 << 20);
  decoded = whole_numbers->decode();
  std::ranges::sort(sample);
  std::ranges::sort(decoded);
  EXPECT_EQ(sample, decoded);
}

TEST(VoxelSample, IsSpreadOverALargeOne) {
  constexpr std::uint32_t kEdge = 64;
  std::vector<float> voxels(kEdge * kEdge * kEdge);
  for (std::size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = static_cast<float>(i / (kEdge * kEdge));  // z
  const auto volume = compress(voxels, Grid{.dims = {kEdge, kEdge, kEdge}}, {.tolerance = 0.01});
  const std::vector<float> sample = volume->sample(voxels.size() / 8);
  EXPECT_LE(sample.size(), voxels.size() / 8);
  EXPECT_GE(sample.size(), voxels.size() / 16);
  std::set<int> layers;
  for (const float value : sample) layers.insert(static_cast<int>(std::lround(value)));
  EXPECT_EQ(layers.size(), kEdge);
  EXPECT_EQ(sample, volume->sample(voxels.size() / 8));
}

TEST(Volume, LevelsHaveGridsAndVoxelsOfTheirOwn) {
  Grid grid{.dims = {20, 24, 28}, .spacing = {1, 2, 3}, .origin = {4, 5, 6}};
  std::vector<float> voxels(20 * 24 * 28);
  std::iota(voxels.begin(), voxels.end(), 0.0f);
  const auto volume = compress(voxels, grid, {.rate = 32, .levels = 2});
  ASSERT_EQ(volume->num_levels(), 2u);
  EXPECT_EQ(volume->level_grid(0).dims, grid.dims);
  const Grid coarse = volume->level_grid(1);
  EXPECT_EQ(coarse.dims, (std::array<std::uint32_t, 3>{11, 13, 15}));
  EXPECT_EQ(coarse.spacing, (Vector3{2, 4, 6}));
  EXPECT_EQ(coarse.origin, grid.origin);
  EXPECT_EQ(volume->decode(1).size(), 11u * 13 * 15);
  // Inside, a ramp stays one: voxel (1,1,1) of the coarse level is voxel (2,2,2).
  EXPECT_NEAR(volume->decode(1)[1 + 11 * (1 + 13)], voxels[2 + 20 * (2 + 24 * 2)], 0.5);
  EXPECT_THROW((void)volume->level_grid(2), Error);
  EXPECT_THROW((void)volume->decode(2), Error);
}

}  // namespace
}  // namespace isowave
