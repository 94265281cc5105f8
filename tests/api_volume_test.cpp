// Volumes as users of the library get them: compressed, saved, opened, or refused.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <isowave/isowave.hpp>

#include "tests/api_support.hpp"
#include "tests/run_program.hpp"

namespace isowave {
namespace {

using core::test::error_of;
using core::test::kSphereEdge;
using core::test::sphere;
using core::test::sphere_grid;
using core::test::sphere_voxels;
using testing::HasSubstr;
namespace test = core::test;

TEST(Api, VersionIsThePrograms) {
  EXPECT_THAT(test::run_isowave("--version").out, HasSubstr(std::string(version())));
}

TEST(Api, VolumesSayWhatTheyAre) {
  const auto volume = sphere({.rate = 16, .measure_error = true, .levels = 2});
  EXPECT_EQ(volume->grid().dims,
            (std::array<std::uint32_t, 3>{kSphereEdge, kSphereEdge, kSphereEdge}));
  EXPECT_EQ(volume->grid().spacing, (Vector3{1, 2, 1}));
  EXPECT_EQ(volume->grid().origin, (Vector3{5, 6, 7}));
  EXPECT_EQ(volume->source_type(), VoxelType::kFloat32);
  EXPECT_EQ(volume->num_levels(), 2u);
  EXPECT_EQ(volume->bits_per_voxel(), 16.0);
  EXPECT_EQ(volume->compression(), "fixed rate");
  EXPECT_EQ(sphere({.tolerance = 0.1})->compression(), "fixed accuracy");
  EXPECT_EQ(sphere({})->compression(), "reversible");
  EXPECT_EQ(*sphere({})->max_voxel_error(), 0);
  const std::vector<float> voxels = sphere_voxels(), decoded = volume->decode();
  ASSERT_EQ(decoded.size(), voxels.size());
  double largest = 0;
  for (std::size_t i = 0; i < voxels.size(); ++i)
    largest = std::max(largest, std::abs(double{voxels[i]} - double{decoded[i]}));
  EXPECT_GT(largest, 0);
  EXPECT_EQ(*volume->max_voxel_error(), largest);
  EXPECT_EQ(volume->value_range()[0], *std::ranges::min_element(voxels));
  EXPECT_EQ(volume->value_range()[1], *std::ranges::max_element(voxels));
}

TEST(Api, AStepOfAFileIsAVolume) {
  const test::TemporaryFolder folder;
  std::string bytes = "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 4 5 6 2\nencoding: raw\n\n";
  std::vector<float> second;
  for (int i = 0; i < 240; ++i) {
    bytes += static_cast<char>(i);
    if (i >= 120) second.push_back(static_cast<float>(i));
  }
  test::write_file(folder / "a.nrrd", bytes);
  EXPECT_EQ(open_volume(folder / "a.nrrd", {}, {.step = 1})->decode(), second);
  EXPECT_NE(open_volume(folder / "a.nrrd", {}, {.step = 0})->decode(), second);
  EXPECT_THAT(error_of([&] { open_volume(folder / "a.nrrd", {}, {.step = 2}); }),
              HasSubstr("step 2 of a file that has 2"));
}

TEST(Api, VolumesSuggestIsovalues) {
  const auto volume = sphere({});
  const std::vector<double> suggested = volume->suggested_isovalues();
  ASSERT_FALSE(suggested.empty());
  for (const double isovalue : suggested) EXPECT_EQ(volume->isovalue_notice(isovalue), "");
  EXPECT_EQ(volume->suggested_isovalues(), suggested);
  const std::vector<std::uint8_t> constant(4 * 4 * 4, 7);
  EXPECT_TRUE(compress(constant, Grid{.dims = {4, 4, 4}})->suggested_isovalues().empty());
}

TEST(Api, EveryVoxelTypeIsCompressed) {
  const auto check = [](auto zero) {
    using T = decltype(zero);
    std::vector<T> voxels(5 * 4 * 3);
    for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = static_cast<T>(i);
    const bool is_integer = std::is_integral_v<T>;
    const auto volume = compress(voxels, Grid{.dims = {5, 4, 3}},
                                 is_integer ? Compression{.exact = true} : Compression{.rate = 32});
    EXPECT_EQ(volume->source_type(), voxel_type_of<T>());
    const std::vector<float> decoded = volume->decode();
    for (std::size_t i = 0; i < voxels.size(); ++i)
      EXPECT_NEAR(decoded[i], static_cast<double>(voxels[i]), is_integer ? 0 : 1e-3);
  };
  check(std::uint8_t{});
  check(std::int8_t{});
  check(std::uint16_t{});
  check(std::int16_t{});
  check(std::uint32_t{});
  check(std::int32_t{});
  check(float{});
  check(double{});
}

TEST(Api, SavedFilesAreThoseOfConvert) {
  const test::TemporaryFolder folder;
  for (const Compression &compression :
       {Compression{.rate = 8}, Compression{.tolerance = 0.01}, Compression{.rate = 4, .levels = 0},
        Compression{.tolerance = 0.01, .levels = 3}}) {
    const auto volume = sphere(compression);
    volume->save(folder / "saved.zfp");
    const auto opened = open_volume(folder / "saved.zfp");
    EXPECT_EQ(opened->decode(), volume->decode());
    EXPECT_EQ(opened->num_levels(), volume->num_levels());
    EXPECT_EQ(opened->max_voxel_error(), volume->max_voxel_error());
    EXPECT_EQ(opened->grid().origin, volume->grid().origin);
    opened->save(folder / "again.zfp");
    EXPECT_EQ(test::read_file(folder / "again.zfp"), test::read_file(folder / "saved.zfp"));
  }
  const std::string raw = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz";
  open_volume(raw, {.tolerance = 0.5, .levels = 2})->save(folder / "library.zfp");
  ASSERT_EQ(test::run_isowave("convert " + raw + " -o " + test::quoted(folder / "program.zfp") +
                              " --tolerance 0.5 --levels 2")
                .status,
            0);
  EXPECT_EQ(test::read_file(folder / "library.zfp"), test::read_file(folder / "program.zfp"));
}

TEST(Api, ProgressGoesFromNothingToAll) {
  std::map<std::string, std::vector<double>> told;
  Compression compression{.tolerance = 0.01};
  compression.progress = [&](std::string_view what, double done) {
    told[std::string(what)].push_back(done);
  };
  sphere(compression);
  ASSERT_EQ(told.size(), 2u);
  for (const auto &[what, done] : told) {
    EXPECT_TRUE(std::ranges::is_sorted(done)) << what;
    EXPECT_EQ(done.back(), 1.0) << what;
  }
}

TEST(Api, WhatCannotBeCompressedIsAnError) {
  const std::vector<float> voxels = sphere_voxels();
  const Grid grid = sphere_grid();
  EXPECT_THAT(error_of([&] {
                compress(voxels, Grid{.dims = {kSphereEdge, kSphereEdge, kSphereEdge + 1}});
              }),
              HasSubstr("9261 voxels"));
  EXPECT_THAT(error_of([&] {
                compress(std::vector<float>(2), Grid{.dims = {2, 1, 1}});
              }),
              HasSubstr("dims 2x1x1"));
  EXPECT_THAT(error_of([&] { compress(voxels, grid, {.rate = 33}); }), HasSubstr("33"));
  EXPECT_THAT(error_of([&] { compress(voxels, grid, {.rate = 8, .exact = true}); }),
              HasSubstr("more than one"));
  EXPECT_THAT(
      error_of([&] { compress(std::vector<double>(voxels.size(), 0.1), grid, {.exact = true}); }),
      HasSubstr("float64"));
  EXPECT_THAT(error_of([&] { compress(voxels, grid, {.tolerance = -1}); }), HasSubstr("-1"));
  std::vector<float> holes = voxels;
  holes[17] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NO_THROW(compress(holes, grid));
  holes[18] = std::numeric_limits<float>::infinity();
  EXPECT_THAT(error_of([&] { compress(holes, grid); }), HasSubstr("infinite"));
  EXPECT_NO_THROW(compress(holes, grid, {.map_nan = 0.0f}));
  EXPECT_NO_THROW(compress(holes, grid, {.no_data = double{holes[18]}}));
  Grid bad = grid;
  bad.spacing[1] = 0;
  EXPECT_THAT(error_of([&] { compress(voxels, bad); }), HasSubstr("spacing"));
}

TEST(Api, WhatCannotBeOpenedIsAnError) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(error_of([&] { open_volume(folder / "none.nrrd"); }), HasSubstr("none.nrrd"));
  EXPECT_THAT(error_of([&] { open_volume(folder / "none.zfp", {.rate = 4}); }),
              HasSubstr("compressed already"));
  EXPECT_THAT(error_of([&] { open_volume("generate:nothing_8x8x8_uint8"); }), HasSubstr("nothing"));
  EXPECT_THAT(error_of([&] { open_device("no such device"); }), HasSubstr("no such device"));
  EXPECT_THAT(error_of([&] { sphere()->save(folder / "no" / "such" / "folder.zfp"); }),
              HasSubstr("folder.zfp"));
  EXPECT_THAT(error_of([&] { sphere()->save(folder / "a.nrrd"); }),
              AllOf(HasSubstr("a.nrrd"), HasSubstr("ending .zfp")));
  EXPECT_FALSE(std::filesystem::exists(folder / "a.nrrd"));
  EXPECT_THAT(error_of([&] { save_png(Frame{}, folder / "a.png"); }), HasSubstr("no picture"));
  EXPECT_THAT(error_of([&] { encode_png(Frame{}); }), HasSubstr("no picture"));
}

}  // namespace
}  // namespace isowave
