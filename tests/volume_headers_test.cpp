// NRRD, MetaImage and NIfTI: geometry in one world convention (LPS), and headers that must be refused.

#include "core/volume.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <cstring>
#include <numeric>

#include "core/error.hpp"
#include "tests/run_program.hpp"

namespace isowave {
namespace {

using test::TemporaryFolder;
using test::write_file;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr glm::uvec3 kDims(3, 4, 5);

std::string ramp_bytes() {
  std::string bytes(60, '\0');
  std::iota(bytes.begin(), bytes.end(), char(1));
  return bytes;
}

/// The voxels 1, 2, 3, ... read in two goes, as float.
void expect_ramp(VolumeReader &reader, std::size_t num_voxels = 60) {
  ASSERT_EQ(reader.info().num_voxels(), num_voxels);
  const std::size_t layer = kDims.x * kDims.y;
  std::vector<float> voxels(num_voxels), expected(num_voxels);
  std::iota(expected.begin(), expected.end(), 1.0f);
  reader.read_layers(0, 2, std::span(voxels).first(2 * layer));
  reader.read_layers(2, 3, std::span(voxels).subspan(2 * layer));
  EXPECT_EQ(voxels, expected);
}

glm::dvec3 world(const VolumeInfo &info, const glm::dvec3 &index) {
  return info.origin + info.index_to_world() * index;
}

void expect_near(const glm::dvec3 &a, const glm::dvec3 &b) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], 1e-5) << "axis " << axis;
}

std::string nrrd(const std::string &lines) {
  return "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 4 5\n" + lines;
}

/// The least NIfTI-1 file: uint8 voxels and an sform, which maps to RAS.
std::string nifti(const std::array<std::array<float, 4>, 3> &rows, std::int16_t nx = 3,
                  std::int16_t datatype = 2, std::int16_t bits = 8, float slope = 0) {
  std::string header(352, '\0');
  const auto put = [&](std::size_t at, auto value) {
    std::memcpy(header.data() + at, &value, sizeof(value));
  };
  put(0, std::int32_t(348));
  for (const auto &[i, n] :
       {std::pair(0, std::int16_t(3)), {1, nx}, {2, std::int16_t(4)}, {3, std::int16_t(5)}}) {
    put(40 + 2 * std::size_t(i), n);
  }
  for (std::size_t i = 4; i < 8; ++i) put(40 + 2 * i, std::int16_t(1));
  put(70, datatype);
  put(72, bits);
  put(76, 1.0f);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float spacing = std::hypot(rows[0][axis], rows[1][axis], rows[2][axis]);
    put(80 + 4 * axis, spacing);
  }
  put(108, 352.0f);
  put(112, slope);
  put(123, char(2));          // millimetres
  put(254, std::int16_t(1));  // sform_code
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) put(280 + 16 * row + 4 * column, rows[row][column]);
  }
  std::memcpy(header.data() + 344, "n+1", 4);
  return header;
}

/// RAS: x spacing 0.5, y flipped spacing 2, z spacing 3; voxel 0 at (10, 20, 30).
constexpr std::array<std::array<float, 4>, 3> kSform{{{0.5f, 0, 0, 10}, {0, -2, 0, 20}, {0, 0, 3, 30}}};

void expect_geometry(const VolumeInfo &info) {
  expect_near(info.spacing, {0.5, 2, 3});
  expect_near(world(info, {0, 0, 0}), {-10, -20, 30});  // LPS
  expect_near(world(info, {2, 1, 1}), {-11, -18, 33});
}

TEST(Nrrd, AttachedRawWithSpaceDirections) {
  const TemporaryFolder folder;
  const auto write = [&](const std::string &space, const std::string &directions, const std::string &origin) {
    write_file(folder / "a.nrrd", nrrd("space: " + space + "\nspace directions: " + directions +
                                       "\nspace origin: " + origin + "\nencoding: raw\n\n") +
                                      ramp_bytes());
  };
  write("right-anterior-superior", "(0.5,0,0) (0,-2,0) (0,0,3)", "(10,20,30)");
  auto reader = open_volume(folder / "a.nrrd");
  EXPECT_EQ(reader->info().type, VoxelType::kUint8);
  expect_geometry(reader->info());
  expect_ramp(*reader);
  write("left-posterior-superior", "(-0.5,0,0) (0,2,0) (0,0,3)", "(-10,-20,30)");
  expect_geometry(open_volume(folder / "a.nrrd")->info());
}

TEST(Nrrd, DetachedOldStyle) {
  const TemporaryFolder folder;
  write_file(folder / "a.raw", ramp_bytes());
  write_file(
      folder / "a.nhdr",
      std::string("NRRD0001\ndatafile: ./a.raw\ndimension: 3\nsizes: 3 4 5\nspacings: 1 2 3\ntype: uchar\n"
                  "encoding: raw\n"));
  const auto reader = open_volume(folder / "a.nhdr");
  EXPECT_EQ(reader->info().spacing, glm::dvec3(1, 2, 3));
  expect_ramp(*reader);
  EXPECT_EQ(
      open_volume(folder / "a.nhdr", {.dims = {}, .type = {}, .spacing = glm::dvec3(7)})->info().spacing,
      glm::dvec3(7));
  std::filesystem::remove(folder / "a.raw");
  EXPECT_THAT([&] { open_volume(folder / "a.nhdr"); }, ThrowsMessage<Error>(HasSubstr("a.raw")));
}

TEST(Nrrd, RefusedHeaders) {
  const TemporaryFolder folder;
  const auto open = [&](const std::string &text) {
    write_file(folder / "a.nrrd", text);
    const auto reader = open_volume(folder / "a.nrrd");
    std::vector<float> voxels(reader->info().num_voxels());
    reader->read_layers(0, reader->info().dims.z, voxels);
  };
  const std::string raw = "encoding: raw\n\n";
  EXPECT_NO_THROW(open(nrrd(raw) + ramp_bytes()));
  EXPECT_THAT([&] { open(nrrd(raw) + ramp_bytes().substr(20)); },
              ThrowsMessage<Error>(HasSubstr("truncated")));
  EXPECT_THROW(open("not a header"), Error);
  EXPECT_THROW(open(""), Error);
  EXPECT_THROW(open(nrrd("encoding: gzip\n\n") + ramp_bytes()), Error);
  EXPECT_THROW(open("NRRD0004\ntype: uint8\ndimension: 2\nsizes: 3 4\n" + raw + ramp_bytes()), Error);
  EXPECT_THROW(open("NRRD0004\ntype: int64\nendian: little\ndimension: 3\nsizes: 3 4 5\n" + raw +
                    std::string(480, 'x')),
               Error);
  EXPECT_THAT(
      [&] {
        open("NRRD0004\ntype: double\nendian: little\ndimension: 3\nsizes: 60000 60000 60000\n" + raw + "x");
      },
      ThrowsMessage<Error>(HasSubstr("truncated")));
  EXPECT_THAT([&] { open("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 4 9999999999\n" + raw + "x"); },
              ThrowsMessage<Error>(HasSubstr("must be 2 to")));
  EXPECT_THAT(
      [&] {
        open("NRRD0004\ntype: uint8\ndimension: 4\nsizes: 3 3 4 5\nkinds: RGB-color domain domain domain\n" +
             raw + std::string(180, 'x'));
      },
      ThrowsMessage<Error>(HasSubstr("3 components")));
  for (int i = 1; i <= 5; ++i) write_file(folder / fmt::format("slice{:03}.raw", i), std::string(12, 'x'));
  EXPECT_THAT([&] { open(nrrd("encoding: raw\ndata file: slice%03d.raw 1 5 1\n")); },
              ThrowsMessage<Error>(HasSubstr("several files")));
}

std::string meta_image(const std::string &lines) {
  return "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n" + lines;
}

TEST(MetaImage, FlippedDirectionRawAndCompressed) {
  const TemporaryFolder folder;
  const std::string grid =
      "TransformMatrix = -1 0 0 0 1 0 0 0 1\nOffset = -10 -20 30\nElementSpacing = 0.5 2 3\nDimSize = 3 4 5\n"
      "ElementType = MET_UCHAR\n";
  write_file(folder / "raw.mha",
             meta_image("CompressedData = False\n" + grid + "ElementDataFile = LOCAL\n") + ramp_bytes());
  std::string packed(200, '\0');
  uLongf length = packed.size();
  const std::string bytes = ramp_bytes();
  ASSERT_EQ(::compress(reinterpret_cast<Bytef *>(packed.data()), &length,
                       reinterpret_cast<const Bytef *>(bytes.data()), bytes.size()),
            Z_OK);
  packed.resize(length);
  write_file(folder / "packed.mha",
             meta_image(fmt::format("CompressedData = True\nCompressedDataSize = {}\n", length) + grid +
                        "ElementDataFile = LOCAL\n") +
                 packed);
  write_file(folder / "detached.mhd", meta_image(grid + "ElementDataFile = voxels.bin\n"));
  write_file(folder / "voxels.bin", bytes);
  for (const char *name : {"raw.mha", "packed.mha", "detached.mhd"}) {
    SCOPED_TRACE(name);
    const auto reader = open_volume(folder / name);
    expect_geometry(reader->info());
    expect_ramp(*reader);
  }
}

TEST(MetaImage, RefusedHeaders) {
  const TemporaryFolder folder;
  const auto open = [&](const std::string &text) {
    write_file(folder / "a.mha", text);
    const auto reader = open_volume(folder / "a.mha");
    std::vector<float> voxels(reader->info().num_voxels());
    reader->read_layers(0, reader->info().dims.z, voxels);
  };
  const std::string local = "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
  EXPECT_NO_THROW(open(meta_image("DimSize = 3 4 5\n" + local) + ramp_bytes()));
  EXPECT_THROW(open(""), Error);
  EXPECT_THROW(open("garbage\n"), Error);
  EXPECT_THROW(open(meta_image("DimSize = 3 4 5\n" + local) + "x"), Error);
  EXPECT_THROW(open(meta_image("DimSize = 3 4 0\n" + local) + ramp_bytes()), Error);
  EXPECT_THROW(open(meta_image("DimSize = 60000 60000 60000\n" + local) + ramp_bytes()), Error);
  EXPECT_THAT(
      [&] {
        open(meta_image("DimSize = 3 4 5\nElementNumberOfChannels = 3\n" + local) + std::string(180, 'x'));
      },
      ThrowsMessage<Error>(HasSubstr("3 components")));
  EXPECT_THAT(
      [&] {
        open(meta_image("DimSize = 3 4 5\nCompressedData = True\nCompressedDataSize = 60\n" + local) +
             ramp_bytes());
      },
      testing::Throws<Error>());
}

TEST(Nifti, RasBecomesLps) {
  const TemporaryFolder folder;
  write_file(folder / "a.nii", nifti(kSform) + ramp_bytes());
  gzFile file = ::gzopen((folder / "b.nii.gz").c_str(), "wb");
  const std::string bytes = nifti(kSform) + ramp_bytes();
  ::gzwrite(file, bytes.data(), unsigned(bytes.size()));
  ::gzclose(file);
  for (const char *name : {"a.nii", "b.nii.gz"}) {
    SCOPED_TRACE(name);
    const auto reader = open_volume(folder / name);
    expect_geometry(reader->info());
    EXPECT_EQ(reader->info().type, VoxelType::kUint8);
    expect_ramp(*reader);
  }
}

TEST(Nifti, ScaledVoxelsArriveScaled) {
  const TemporaryFolder folder;
  write_file(folder / "a.nii", nifti(kSform, 3, 2, 8, 2.0f) + ramp_bytes());
  const auto reader = open_volume(folder / "a.nii");
  std::vector<float> voxels(60);
  reader->read_layers(0, 5, voxels);
  EXPECT_EQ(voxels[0], 2.0f);
  EXPECT_EQ(voxels[59], 120.0f);
}

TEST(Nifti, RefusedHeaders) {
  const TemporaryFolder folder;
  const auto open = [&](const std::string &bytes) {
    write_file(folder / "a.nii", bytes);
    const auto reader = open_volume(folder / "a.nii");
    std::vector<float> voxels(reader->info().num_voxels());
    reader->read_layers(0, reader->info().dims.z, voxels);
  };
  EXPECT_NO_THROW(open(nifti(kSform) + ramp_bytes()));
  EXPECT_THROW(open(""), Error);
  EXPECT_THROW(open(std::string(352, 'x')), Error);
  EXPECT_THROW(open(nifti(kSform) + "x"), Error);
  EXPECT_THROW(open(nifti(kSform, -3) + ramp_bytes()), Error);
  EXPECT_THROW(open(nifti(kSform, 32767) + ramp_bytes()), Error);
  EXPECT_THROW(open(nifti(kSform, 3, 128, 24) + std::string(180, 'x')), Error) << "RGB";
  EXPECT_THROW(open(nifti(kSform, 3, 1024, 64) + std::string(480, 'x')), Error) << "int64";
}

}  // namespace
}  // namespace isowave
