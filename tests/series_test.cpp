// Series of volumes: the files of a pattern in their order, the steps of a fourth axis, and what is
// no series.

#include "core/sources/series.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/zfp/voxel_sample.hpp"
#include "isowave/host.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// 5x4x3 voxels of uint8: `base` and above.
std::string voxels_of(int base) {
  std::string voxels;
  for (int i = 0; i < 60; ++i) voxels += static_cast<char>(base + i);
  return voxels;
}

std::string nrrd(const std::string &fields, const std::string &data) {
  return "NRRD0004\ntype: uint8\nencoding: raw\n" + fields + "\n" + data;
}

std::string one_nrrd(int base, const std::string &more = "") {
  return nrrd("dimension: 3\nsizes: 5 4 3\n" + more, voxels_of(base));
}

std::string four_axes(int num_steps, const std::string &more = "") {
  std::string data;
  for (int step = 0; step < num_steps; ++step) data += voxels_of(20 * step);
  return nrrd("dimension: 4\nsizes: 5 4 3 " + std::to_string(num_steps) + "\n" + more, data);
}

std::string gzipped(const std::string &text) {
  const TemporaryFolder folder;
  const std::string path = (folder / "z").string();
  const gzFile file = gzopen(path.c_str(), "wb");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
  return test::read_file(path);
}

class SeriesTest : public testing::Test {
 protected:
  std::string path(const std::string &name) const { return (folder_ / name).string(); }
  void write(const std::string &name, const std::string &text) const {
    test::write_file(folder_ / name, text);
  }
  std::vector<std::string> names_of(const std::string &pattern) const {
    std::vector<std::string> names;
    for (const SeriesStep &step : find_steps(path(pattern)))
      names.push_back(std::filesystem::path(step.path).filename().string());
    return names;
  }
  Series open(const std::string &name) const { return {find_steps(path(name)), {}, {}}; }
  /// The least and the largest voxel.
  static std::vector<float> range_of(const CompressedVolume &volume) {
    return {volume.value_range[0], volume.value_range[1]};
  }

  TemporaryFolder folder_;
};

TEST_F(SeriesTest, FilesOfAPatternAreInNaturalOrder) {
  for (const char *name : {"s_10.nrrd", "s_2.nrrd", "s_1.nrrd", "s_02.nrrd", "s_b.nrrd",
                           "s_100.nrrd", "s_2b.nrrd", "t_3.nrrd", "s_9.raw"})
    write(name, "");
  EXPECT_THAT(names_of("s_*.nrrd"), ElementsAre("s_1.nrrd", "s_02.nrrd", "s_2.nrrd", "s_2b.nrrd",
                                                "s_10.nrrd", "s_100.nrrd", "s_b.nrrd"));
  EXPECT_THAT(names_of("s_?.nrrd"), ElementsAre("s_1.nrrd", "s_2.nrrd", "s_b.nrrd"));
  EXPECT_THAT(names_of("[st]_[0-9].*"), ElementsAre("s_1.nrrd", "s_2.nrrd", "s_9.raw", "t_3.nrrd"));
  EXPECT_THAT([&] { names_of("u_*.nrrd"); }, ThrowsMessage<Error>(HasSubstr("no file")));
}

TEST_F(SeriesTest, AFileOfThatNameIsNoPattern) {
  write("a[1].nrrd", one_nrrd(0));
  write("a1.nrrd", one_nrrd(0));
  EXPECT_FALSE(is_pattern(path("a[1].nrrd")));
  EXPECT_TRUE(find_steps(path("a[1].nrrd")).empty()) << "one volume";
  EXPECT_TRUE(find_steps(path("a1.nrrd")).empty());
  EXPECT_TRUE(is_pattern(path("a[2].nrrd")));
  EXPECT_FALSE(is_pattern("generate:blobs_8x8x8_uint8"));
}

TEST_F(SeriesTest, StepsOfFilesHaveTheirVoxels) {
  for (int i : {2, 10, 1}) write("s_" + std::to_string(i) + ".nrrd", one_nrrd(3 * i));
  Series series = open("s_*.nrrd");
  ASSERT_EQ(series.size(), 3u);
  EXPECT_EQ(range_of(series.open(0)), (std::vector<float>{3, 62}));
  series.prepare(2);
  EXPECT_EQ(range_of(series.open(1)), (std::vector<float>{6, 65})) << "not the prepared one";
  EXPECT_EQ(range_of(series.open(2)), (std::vector<float>{30, 89}));
  series.prepare(0);
  series.prepare(1);
  EXPECT_EQ(range_of(series.open(0)), (std::vector<float>{3, 62}));
  EXPECT_EQ(range_of(series.open(1)), (std::vector<float>{6, 65}));
  EXPECT_EQ(range_of(series.open(1)), (std::vector<float>{6, 65})) << "once more";
  series.prepare(3);
  EXPECT_THAT([&] { series.open(3); }, ThrowsMessage<Error>(HasSubstr("step 3 of a series of 3")));
}

TEST_F(SeriesTest, TheFourthAxisOfNrrdFilesIsSteps) {
  write("a.nrrd", four_axes(4));
  write("time.nrrd", four_axes(4, "kinds: domain domain domain time\n"));
  write("list.nrrd", four_axes(4,
                               "kinds: space space space list\nspace dimension: 3\n"
                               "space directions: (1,0,0) (0,1,0) (0,0,1) none\n"));
  std::string text = four_axes(4), packed = text.substr(0, text.find("\n\n") + 2);
  packed.replace(packed.find("raw"), 3, "gzip");
  write("gzip.nrrd", packed + gzipped(text.substr(text.find("\n\n") + 2)));
  std::string numbers = "NRRD0004\ntype: uint8\nencoding: ascii\ndimension: 4\nsizes: 5 4 3 4\n\n";
  for (int step = 0; step < 4; ++step)
    for (int i = 0; i < 60; ++i) numbers += std::to_string(20 * step + i) + " ";
  write("text.nrrd", numbers);
  for (const char *name : {"a.nrrd", "time.nrrd", "list.nrrd", "gzip.nrrd", "text.nrrd"}) {
    Series series = open(name);
    ASSERT_EQ(series.size(), 4u) << name;
    EXPECT_EQ(series.info().dims, glm::uvec3(5, 4, 3));
    for (int step : {3, 0, 1, 2}) {
      EXPECT_EQ(range_of(series.open(std::size_t(step))),
                (std::vector<float>{20.f * float(step), 20.f * float(step) + 59}))
          << name;
    }
    EXPECT_EQ(series.step(2).what(), path(name) + ", step 2");
    EXPECT_THAT([&] { open_volume(path(name)); },
                ThrowsMessage<Error>(HasSubstr("it is a series of 4 steps")));
  }
}

TEST_F(SeriesTest, BrokenFilesOfStepsAreRefused) {
  const auto refused = [&](const std::string &text, const std::string &why) {
    write("a.nrrd", text);
    EXPECT_THAT(
        [&] {
          Series series = open("a.nrrd");
          for (std::size_t step = 0; step < series.size(); ++step) series.open(step);
          find_steps(path("a.nrrd")).empty() ? static_cast<void>(open_volume(path("a.nrrd")))
                                             : void();
        },
        ThrowsMessage<Error>(HasSubstr(why)))
        << text.substr(0, 90);
  };
  const std::string good = four_axes(3);
  refused(good + "x", "too long: 3 steps of 5x4x3 uint8 voxels need 180 bytes, found 181");
  refused(good.substr(0, good.size() - 1), "truncated: 3 steps");
  std::string packed = good.substr(0, good.find("\n\n") + 2);
  packed.replace(packed.find("raw"), 3, "gzip");
  const std::string data = good.substr(good.find("\n\n") + 2);
  refused(packed + gzipped(data + "x"), "too long");
  refused(packed + gzipped(data.substr(1)), "truncated");
  refused(nrrd("dimension: 4\nsizes: 3 5 4 3\nkinds: vector domain domain domain\n", data),
          "3 components");
  refused(nrrd("dimension: 4\nsizes: 5 4 3 3\nkinds: domain domain domain vector\n", data),
          "3 components");
  refused(nrrd("dimension: 5\nsizes: 5 2 2 3 3\n", data), "need a volume of 3");
}

/// A NIfTI-1 file. dims: one for each axis.
std::string nifti(const std::vector<std::int16_t> &dims, const std::string &data) {
  std::string header(352, '\0');
  const auto put = [&](std::size_t at, auto value) {
    std::memcpy(header.data() + at, &value, sizeof(value));
  };
  put(0, std::int32_t{348});
  put(40, static_cast<std::int16_t>(dims.size()));
  for (std::size_t i = 0; i < dims.size(); ++i) put(42 + 2 * i, dims[i]);
  put(70, std::int16_t{2});
  put(72, std::int16_t{8});
  put(108, 352.0f);
  std::memcpy(header.data() + 344, "n+1", 4);
  return header + data;
}

TEST_F(SeriesTest, TheFourthAxisOfNiftiFilesIsSteps) {
  const std::string data = voxels_of(0) + voxels_of(20) + voxels_of(40);
  write("a.nii", nifti({5, 4, 3, 3}, data));
  write("a.nii.gz", gzipped(nifti({5, 4, 3, 3, 1}, data)));
  for (const char *name : {"a.nii", "a.nii.gz"}) {
    Series series = open(name);
    ASSERT_EQ(series.size(), 3u) << name;
    for (int step : {2, 0, 1})
      EXPECT_EQ(range_of(series.open(std::size_t(step)))[0], 20.f * float(step)) << name;
  }
  write("b.nii", nifti({5, 4, 3, 1, 3}, data));
  EXPECT_THAT([&] { find_steps(path("b.nii")); },
              ThrowsMessage<Error>(HasSubstr("an image of 5 axes")));
  write("c.nii", nifti({5, 4, 3, 1}, voxels_of(0)));
  EXPECT_TRUE(find_steps(path("c.nii")).empty()) << "one volume";
}

TEST_F(SeriesTest, AllStepsHaveOneGrid) {
  write("s_1.nrrd", one_nrrd(0, "spacings: 1 2 1\n"));
  const auto refused = [&](const std::string &text, const std::string &why) {
    write("s_2.nrrd", text);
    EXPECT_THAT([&] { open("s_*.nrrd"); },
                ThrowsMessage<Error>(
                    testing::AllOf(HasSubstr("s_2.nrrd"), HasSubstr("s_1.nrrd"), HasSubstr(why))));
  };
  refused(nrrd("dimension: 3\nsizes: 5 3 4\n", voxels_of(0)), "has 5x3x4 voxels");
  refused(one_nrrd(0, "spacings: 1 2.1 1\n"), "has a spacing of 1 2.1 1");
  refused(one_nrrd(0, "spacings: 1 2 1\naxis mins: 0 0 4\n"), "lies elsewhere");
  refused(one_nrrd(0, "spacings: 1 -2 1\n"), "lies elsewhere");
  write("s_2.nrrd", one_nrrd(0, "spacings: 1 2.000001 1\n"));
  EXPECT_EQ(open("s_*.nrrd").size(), 2u) << "but for rounding";
  write("s_2.nrrd", "no NRRD");
  EXPECT_THAT([&] { open("s_*.nrrd"); }, ThrowsMessage<Error>(HasSubstr("s_2.nrrd")));
}

TEST_F(SeriesTest, IsInThePublicApi) {
  for (int i : {1, 2, 10}) write("s_" + std::to_string(i) + ".nrrd", one_nrrd(3 * i));
  isowave::Series series(folder_ / "s_*.nrrd");
  ASSERT_EQ(series.size(), 3u);
  EXPECT_EQ(series.grid().dims, (std::array<std::uint32_t, 3>{5, 4, 3}));
  EXPECT_THAT(series.name(2), HasSubstr("s_10.nrrd"));
  series.prepare(1);
  EXPECT_EQ(series.open(1)->value_range()[0], 6);
  EXPECT_EQ(series.open(2)->value_range()[0], 30);
  EXPECT_THAT([&] { series.open(3); }, ThrowsMessage<isowave::Error>(HasSubstr("count from 0")));
  isowave::Series listed(
      std::vector<std::filesystem::path>{folder_ / "s_10.nrrd", folder_ / "s_1.nrrd"});
  EXPECT_EQ(listed.open(0)->value_range()[0], 30) << "in the order given";
  EXPECT_EQ(isowave::Series(folder_ / "s_2.nrrd").size(), 1u) << "one volume is one step";
  series.open(0)->save(folder_ / "z_1.zfp");
  EXPECT_EQ(isowave::Series(folder_ / "z_*.zfp").open(0)->value_range()[0], 3);
  EXPECT_THAT([&] { isowave::Series(folder_ / "z_*.zfp", {.rate = 8}); },
              ThrowsMessage<isowave::Error>(HasSubstr("compressed already")));
  EXPECT_THAT([&] { isowave::Series(std::vector<std::filesystem::path>{}); },
              ThrowsMessage<isowave::Error>(HasSubstr("without a file")));
}

}  // namespace
}  // namespace isowave::core
