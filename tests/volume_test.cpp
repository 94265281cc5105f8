// Raw files: names, sizes, types, gzip. The formats with headers are in volume_headers_test.cpp.

#include "core/volume/volume.hpp"
#include "core/io/open_volume.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/error.hpp"
#include "core/io/raw_reader.hpp"
#include "tests/volume_file.hpp"

namespace isowave::core {
namespace {

using test::gzip;
using test::read_all;
using test::TemporaryFolder;
using test::write_file;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(VoxelType, NamesAndSizes) {
  for (int i = 0; i < 8; ++i) {
    const auto type = VoxelType(i);
    EXPECT_EQ(voxel_type_from_string(to_string(type)), type);
  }
  EXPECT_EQ(size_of(VoxelType::kInt16), 2u);
  EXPECT_EQ(size_of(VoxelType::kFloat64), 8u);
  EXPECT_THAT([] { voxel_type_from_string("uint9"); }, ThrowsMessage<Error>(HasSubstr("float64")));
}

TEST(VolumeInfo, RefusesImpossibleGrids) {
  const auto check = [](auto change) {
    VolumeInfo info;
    info.dims = glm::uvec3(4, 5, 6);
    change(info);
    check_volume_info(info, "it");
  };
  EXPECT_NO_THROW(check([](VolumeInfo &) {}));
  EXPECT_NO_THROW(check([](VolumeInfo &info) { info.dims = {2, 65536, 2}; }));
  EXPECT_THROW(check([](VolumeInfo &info) { info.dims.y = 1; }), Error);
  EXPECT_THROW(check([](VolumeInfo &info) { info.dims.z = 65537; }), Error);
  EXPECT_THROW(check([](VolumeInfo &info) { info.spacing.x = 0; }), Error);
  EXPECT_THROW(check([](VolumeInfo &info) { info.spacing.x = -1; }), Error);
  EXPECT_THROW(check([](VolumeInfo &info) { info.spacing.z = NAN; }), Error);
  EXPECT_THROW(check([](VolumeInfo &info) { info.origin.y = INFINITY; }), Error);
  EXPECT_THROW(check([](VolumeInfo &info) { info.direction[2] = info.direction[0]; }), Error);
}

TEST(RawName, Pattern) {
  const auto name = parse_raw_name("my_head_256x255x113_uint16");
  ASSERT_TRUE(name);
  EXPECT_EQ(name->name, "my_head");
  EXPECT_EQ(name->dims, glm::uvec3(256, 255, 113));
  EXPECT_EQ(name->type, VoxelType::kUint16);
  for (const char *bad :
       {"", "head", "_2x2x2_uint8_", "head_2x2_uint8", "head_2x2x2", "head_2x2x2x2_uint8",
        "head_2x-2x2_uint8", "head_2x2x2_uint7", "head_2x2x 2_uint8", "head_99999999999x2x2_uint8",
        "head_x2x2_uint8", "2x2x2_uint8"}) {
    EXPECT_FALSE(parse_raw_name(bad)) << bad;
  }
}

template <class T>
class RawTypes : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::uint32_t,
                             std::int32_t, float, double>;
TYPED_TEST_SUITE(RawTypes, Types);

template <class T>
constexpr VoxelType voxel_type() {
  if constexpr (std::is_same_v<T, float>) return VoxelType::kFloat32;
  if constexpr (std::is_same_v<T, double>) return VoxelType::kFloat64;
  constexpr int kSize = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 2 : 4;
  return VoxelType(kSize + (std::is_signed_v<T> ? 1 : 0));
}

TYPED_TEST(RawTypes, EveryVoxelArrivesAsFloat) {
  std::vector<TypeParam> voxels(3 * 2 * 4);
  std::iota(voxels.begin(), voxels.end(), TypeParam(0));
  voxels[5] = std::numeric_limits<TypeParam>::max();
  voxels[7] = std::numeric_limits<TypeParam>::lowest();
  for (const bool gzipped : {false, true}) {
    const TemporaryFolder folder;
    const std::string_view bytes(reinterpret_cast<const char *>(voxels.data()),
                                 voxels.size() * sizeof(TypeParam));
    const auto path = folder / fmt::format("a_3x2x4_{}.raw{}", to_string(voxel_type<TypeParam>()),
                                           gzipped ? ".gz" : "");
    write_file(path, gzipped ? gzip(bytes) : std::string(bytes));
    const auto reader = open_volume(path);
    EXPECT_EQ(reader->info().dims, glm::uvec3(3, 2, 4));
    EXPECT_EQ(reader->info().type, voxel_type<TypeParam>());
    const std::vector<float> got = read_all(*reader);
    for (std::size_t i = 0; i < voxels.size(); ++i)
      EXPECT_EQ(got[i], static_cast<float>(voxels[i])) << i;
  }
}

TEST(RawReader, LayersInPiecesAndWithGaps) {
  const std::string path = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz";
  const std::vector<float> all = read_all(*open_volume(path));
  EXPECT_EQ(*std::max_element(all.begin(), all.end()), 228.0f);
  const std::size_t layer = 41 * 41;
  const auto reader = open_volume(path);
  for (const auto &[z, count] :
       {std::pair(0u, 1u), std::pair(1u, 4u), std::pair(9u, 2u), std::pair(38u, 3u)}) {
    std::vector<float> got(layer * count);
    reader->read_layers(z, count, got);
    EXPECT_TRUE(std::equal(got.begin(), got.end(), all.begin() + std::ptrdiff_t(layer * z)))
        << "layer " << z;
  }
  std::vector<float> again(layer);
  EXPECT_THROW(reader->read_layers(5, 1, again), std::invalid_argument);
}

TEST(RawReader, WrongSizesAreRefused) {
  const TemporaryFolder folder;
  const std::string right(4 * 4 * 4 * 2, 'x');
  const auto open = [&](const std::string &bytes) {
    write_file(folder / "a_4x4x4_int16.raw", bytes);
    open_volume(folder / "a_4x4x4_int16.raw");
  };
  EXPECT_NO_THROW(open(right));
  EXPECT_THAT(
      [&] { open(right.substr(1)); },
      ThrowsMessage<Error>(AllOf(HasSubstr("truncated"), HasSubstr("need 128 bytes, found 127"))));
  EXPECT_THAT(
      [&] { open(right + "x"); },
      ThrowsMessage<Error>(AllOf(HasSubstr("too long"), HasSubstr("need 128 bytes, found 129"))));

  const auto read_gzip = [&](const std::string &file) {
    write_file(folder / "a_4x4x4_int16.raw.gz", file);
    read_all(*open_volume(folder / "a_4x4x4_int16.raw.gz"));
  };
  EXPECT_NO_THROW(read_gzip(gzip(right)));
  EXPECT_THAT([&] { read_gzip(gzip(right.substr(1))); },
              ThrowsMessage<Error>(HasSubstr("need 128 bytes, found 127")));
  EXPECT_THAT([&] { read_gzip(gzip(right + std::string(1000, 'x'))); },
              ThrowsMessage<Error>(HasSubstr("need 128 bytes, found 1128")));
  std::string noise;
  for (int i = 0; i < 128; ++i) noise += char(i * i * 31 % 251);
  const std::string stream = gzip(noise);
  EXPECT_NO_THROW(read_gzip(stream));
  for (std::size_t length = 1; length < stream.size(); ++length) {
    EXPECT_THROW(read_gzip(stream.substr(0, length)), Error)
        << "cut to " << length << " of " << stream.size();
  }
  EXPECT_THAT([&] { read_gzip(noise); }, ThrowsMessage<Error>(HasSubstr("not a gzip file")));
  EXPECT_THROW(read_gzip(stream + gzip("y")), Error) << "a second member adds a byte";
  EXPECT_NO_THROW(read_gzip(stream + gzip("") + gzip("")));
  EXPECT_NO_THROW(read_gzip(gzip(noise.substr(0, 50)) + gzip(noise.substr(50))));
  for (const std::string &rest :
       {std::string(1, '\0'), std::string(512, '\0'), std::string("x"), std::string("\x1f")}) {
    EXPECT_THROW(read_gzip(stream + rest), Error);
  }
  std::string flipped = stream;
  flipped[stream.size() - 6] ^= 1;  // in the checksum
  EXPECT_THAT([&] { read_gzip(flipped); }, ThrowsMessage<Error>(HasSubstr("broken gzip stream")));
}

TEST(RawReader, CraftedDimsAreRefusedBeforeReading) {
  const TemporaryFolder folder;
  write_file(folder / "a_65536x65536x65536_float64.raw.gz", gzip("abc"));
  EXPECT_THAT([&] { open_volume(folder / "a_65536x65536x65536_float64.raw.gz"); },
              ThrowsMessage<Error>(HasSubstr("truncated")));
  for (const char *dims : {"0x4x4", "4x4x1", "65537x4x4"}) {
    const auto path = folder / fmt::format("a_{}_uint8.raw", dims);
    write_file(path, std::string_view("x"));
    EXPECT_THAT([&] { open_volume(path); }, ThrowsMessage<Error>(HasSubstr(dims)));
  }
}

TEST(RawReader, OverridesReplaceTheName) {
  const TemporaryFolder folder;
  write_file(folder / "head.raw", std::string(24, 'a'));
  EXPECT_THAT([&] { open_volume(folder / "head.raw"); },
              ThrowsMessage<Error>(HasSubstr("dims and type")));
  EXPECT_THROW(
      open_volume(folder / "head.raw", {.dims = glm::uvec3(2, 3, 4), .type = {}, .spacing = {}}),
      Error);
  const auto reader = open_volume(
      folder / "head.raw",
      {.dims = glm::uvec3(2, 3, 4), .type = VoxelType::kUint8, .spacing = glm::dvec3(1, 2, 3)});
  EXPECT_EQ(read_all(*reader), std::vector<float>(24, 97.0f));
  EXPECT_EQ(reader->info().index_to_world() * glm::dvec3(1, 1, 1), glm::dvec3(1, 2, 3));

  write_file(folder / "a_2x3x4_uint8.raw", std::string(48, 'a'));
  EXPECT_NO_THROW(open_volume(folder / "a_2x3x4_uint8.raw",
                              {.dims = {}, .type = VoxelType::kInt16, .spacing = {}}));
}

TEST(OpenVolume, UnknownOrMissingFiles) {
  const TemporaryFolder folder;
  write_file(folder / "a.png", std::string_view("x"));
  EXPECT_THAT([&] { open_volume(folder / "a.png"); },
              ThrowsMessage<Error>(HasSubstr("unknown kind")));
  EXPECT_THAT([&] { open_volume(folder / "b_2x2x2_uint8.raw"); },
              ThrowsMessage<Error>(HasSubstr("no such file")));
  EXPECT_THAT([&] { open_volume(folder.path()); },
              ThrowsMessage<Error>(HasSubstr("reads folders of TIFF and DICOM files, and zarr")));
  write_file(folder / "a.TIFF", std::string_view("x"));
  EXPECT_THAT([&] { open_volume(folder / "a.TIFF"); },
              ThrowsMessage<Error>(HasSubstr("reads such files: pip install 'isowave[files]'")));
}

}  // namespace
}  // namespace isowave::core
