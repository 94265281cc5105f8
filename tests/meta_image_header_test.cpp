// MetaImage: geometry in one world convention (LPS), voxels to the byte, and headers that must be
// refused in one line.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/volume_headers.hpp"

namespace isowave::core {
namespace {

using test::error_of;
using test::expect_geometry;
using test::expect_ramp;
using test::gzip;
using test::Headers;
using test::meta_image;
using test::ramp;
using test::write_file;
using test::zlib;

using MetaImageFile = Headers;

TEST_F(MetaImageFile, FlippedDirection) {
  const std::string grid =
      "TransformMatrix = -1 0 0 0 1 0 0 0 1\nOffset = -10 -20 30\nElementSpacing = 0.5 2 3\n";
  const std::string packed = zlib(ramp());
  write_file(folder_ / "raw.mha", meta_image(grid + "CompressedData = False\n") + ramp());
  write_file(folder_ / "packed.mha",
             meta_image(grid + fmt::format("CompressedData = True\nCompressedDataSize = {}\n",
                                           packed.size())) +
                 packed);
  for (const char *name : {"raw.mha", "packed.mha"}) {
    SCOPED_TRACE(name);
    const auto reader = open_volume(folder_ / name);
    expect_geometry(reader->info());
    expect_ramp(*reader);
  }
}

TEST_F(MetaImageFile, AnatomicalOrientationSaysThatItIsAPatients) {
  for (const std::string axes : {"RAI", "LPS", "???", "unknown", ""}) {
    const std::string line = axes.empty() ? "" : "AnatomicalOrientation = " + axes + "\n";
    write_file(folder_ / "a.mha", meta_image(line) + ramp());
    EXPECT_EQ(open_volume(folder_ / "a.mha")->info().is_anatomical, axes == "RAI" || axes == "LPS")
        << axes;
  }
}

TEST_F(MetaImageFile, LengthsInOtherUnitsBecomeMillimetres) {
  for (const auto &[unit, millimetres] : {std::pair("um", 1e-3), {"cm", 10.0}, {"mm", 1.0}}) {
    write_file(folder_ / "a.mha",
               meta_image(fmt::format("DistanceUnits = {}\nElementSpacing = 2 -4 8\n"
                                      "Offset = 1 2 3\n",
                                      unit)) +
                   ramp());
    const auto reader = open_volume(folder_ / "a.mha");
    EXPECT_EQ(reader->info().spacing, glm::dvec3(2, 4, 8) * millimetres);
    EXPECT_EQ(reader->info().origin, glm::dvec3(1, 2, 3) * millimetres);
    EXPECT_EQ(reader->notices().size(), millimetres == 1 ? 0u : 1u);
  }
}

TEST_F(MetaImageFile, CompressedVoxelsEndWithTheFile) {
  const std::string packed = zlib(ramp());
  const auto with = [&](const std::string &size, const std::string &data) {
    return meta_image("CompressedData = True\n" +
                      (size.empty() ? "" : "CompressedDataSize = " + size + "\n")) +
           data;
  };
  const auto plus = [&](int bytes) { return fmt::format("{}", int(packed.size()) + bytes); };
  for (const std::string &size : {plus(0), std::string(), std::string("0")}) {
    expect_read("a.mha", with(size, packed));
    expect_refused("a.mha", with(size, packed + "x"),
                   size == plus(0) ? "but the header says" : "follow it");
    expect_refused("a.mha", with(size, packed.substr(0, packed.size() - 1)),
                   size == plus(0) ? "but the header says" : "truncated");
  }
  expect_read("a.mha", with(fmt::format("{}", gzip(ramp()).size()), gzip(ramp())));
  for (const int bytes : {-1, 1, 1000})
    expect_refused("a.mha", with(plus(bytes), packed), "but the header says");
  expect_refused("a.mha", with("-5", packed), "CompressedDataSize");
  expect_refused("a.mha", with("1e2", packed), "CompressedDataSize");
  expect_refused("a.mha", with("", zlib(ramp() + "x")), "too long");
  expect_refused("a.mha", with("", zlib(ramp().substr(1))), "truncated");
  expect_refused("a.mha", with("", ramp()), "broken zlib stream");
  write_file(folder_ / "a.zraw", "12345" + packed);
  std::string detached = meta_image("CompressedData = True\nHeaderSize = 5\n");
  detached.replace(detached.find("LOCAL"), 5, "a.zraw");
  expect_read("a.mhd", detached);
}

TEST_F(MetaImageFile, WhereVoxelsBegin) {
  expect_read("a.mha", meta_image("HeaderSize = 0\n") + ramp());
  expect_read("a.mha", meta_image("HeaderSize = -1\n") + "any" + ramp());
  for (const char *size : {"1", "10", "-2", "1e2", "9223372036854775808", ""}) {
    expect_refused("a.mha", meta_image(fmt::format("HeaderSize = {}\n", size)) + ramp(),
                   "HeaderSize");
  }
  const std::string head = meta_image("HeaderSize = 200\n");
  expect_read("a.mha", head + std::string(200 - head.size(), '#') + ramp());
  expect_refused("a.mha", head + std::string(201 - head.size(), '#') + ramp(), "too long");
  expect_refused("a.mha", head + ramp().substr(30), "truncated");
  expect_refused("a.mha", meta_image("") + ramp() + "x", "too long");
  expect_refused("a.mha", meta_image("HeaderSize = -1\n") + ramp().substr(1), "truncated");
  expect_refused("a.mha", meta_image("HeaderSize = -1\nBinaryData = False\n") + ramp(),
                 "HeaderSize");
}

TEST_F(MetaImageFile, Numbers) {
  std::string numbers;
  for (int i = 1; i <= 59; ++i) numbers += fmt::format("{}\n", i);
  const std::string head = meta_image("BinaryData = False\n");
  expect_read("a.mha", head + numbers + "6e1");
  expect_refused("a.mha", head + numbers, "truncated");
  expect_refused("a.mha", head + numbers + "60 1", "too long");
  for (const char *word : {"x", "256", "-1", "0.5"})
    expect_refused("a.mha", head + numbers + word, "is no uint8 voxel");
}

TEST_F(MetaImageFile, RefusedHeaders) {
  const auto with = [](const std::string &fields) { return meta_image(fields) + ramp(); };
  EXPECT_EQ(error_of(folder_ / "a.mha", with("")), "");
  expect_refused("a.mha", "", "no 'ElementDataFile'");
  expect_refused("a.mha", "garbage\n", "line 1, 'garbage'");
  for (const char *axes :
       {"-1", "0", "11", "5000", "65536", "2147483648", "1e308", "3.0", "3 3", "nan", ""}) {
    for (const char *matrix : {"", "TransformMatrix = 1 0 0 0 1 0 0 0 1\n"}) {
      expect_refused(
          "a.mha",
          fmt::format(
              "NDims = {}\nDimSize = 3 4 5\nElementType = MET_UCHAR\n{}ElementDataFile = LOCAL\n",
              axes, matrix) +
              ramp(),
          "NDims");
    }
  }
  expect_refused("a.mha", with(std::string(300, 'k') + " = 1\n"), "is not like 'Key = Value'");
  expect_refused("a.mha", with("Offset = " + std::string(1 << 20, '1') + "\n"),
                 "'Offset' is too long");
  for (const char *value : {"yes", "1", "", "True False"}) {
    expect_refused("a.mha", with(fmt::format("CompressedData = {}\n", value)),
                   "must be True or False");
    expect_refused("a.mha", with(fmt::format("BinaryData = {}\n", value)), "must be True or False");
  }
  expect_refused("a.mha", with("CompressedData = False\nCompressedData = True\n"),
                 "'CompressedData' is given twice");
  expect_refused("a.mha", with("compresseddata = True\n"), "must be written 'CompressedData'");
  expect_refused("a.mha", with("CompressedData = True\nBinaryData = False\n"),
                 "not with BinaryData");
  expect_refused("a.mha", with("ElementByteOrderMSB = True\nBinaryDataByteOrderMSB = False\n"),
                 "says otherwise");
  expect_refused("a.mha", with("Offset = 1 2 3\nPosition = 1 2 4\n"), "says otherwise");
  expect_refused("a.mha", with("Offset = 1 2\n"), "Offset");
  expect_refused("a.mha", with("ID = one\n"), "ID");
  expect_refused("a.mha", with("ElementSpacing = 1 2 nan\n"), "ElementSpacing");
  expect_refused("a.mha", with("ElementSpacing = 1 2 0\n"), "spacing");
  expect_refused("a.mha", with("TransformMatrix = 1 0 0 0 1 0 0 0\n"), "TransformMatrix");
  expect_refused("a.mha", with("TransformMatrix = 1 0 0 0 1 0 0 0 0\n"), "singular");
  expect_refused("a.mha", with("ElementNumberOfChannels = 3\n"), "3 components");
  expect_refused("a.mha", with("ElementToIntensityFunctionSlope = 2\n"),
                 "ElementToIntensityFunctionSlope");
  expect_refused("a.mha", meta_image("", "STRING") + ramp(), "MET_STRING");
  std::string tube = with("");
  expect_refused("a.mha", tube.replace(tube.find("Image"), 5, "Tube"), "ObjectType");
  for (const char *sizes : {"3 4", "3 4 0", "3 4 -5", "3 4 5 6", "3 4 5.5", "3 4 4294967301",
                            "60000 60000 60000", "3 4 99999999999999999999"}) {
    std::string header = with("");
    EXPECT_NE(error_of(folder_ / "a.mha", header.replace(header.find("3 4 5"), 5, sizes)), "")
        << sizes;
  }
}

}  // namespace
}  // namespace isowave::core
