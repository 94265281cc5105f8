// Synthetic fields: closed forms, every type, the same bytes for any number of threads.

#include "core/sources/generate.hpp"
#include "core/io/open_volume.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/base/error.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::TemporaryFolder;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::array kFields{Field::kSphere,      Field::kPlane,         Field::kSaddle,
                             Field::kGyroid,      Field::kMarschnerLobb, Field::kShell,
                             Field::kMixingLayer, Field::kTurbulence,    Field::kJet,
                             Field::kScan,        Field::kNoisyScan};

std::vector<float> generate(const GenerateOptions &options) {
  const auto reader = open_generated(options);
  std::vector<float> voxels(reader->info().num_voxels());
  reader->read_layers(0, options.dims.z, voxels);
  return voxels;
}

GenerateOptions make_options(Field field, const glm::uvec3 &dims, VoxelType type) {
  GenerateOptions options;
  options.field = field;
  options.dims = dims;
  options.type = type;
  return options;
}

TEST(Generate, Names) {
  for (const Field field : kFields) EXPECT_EQ(field_from_string(to_string(field)), field);
  EXPECT_THAT([] { field_from_string("cube"); }, ThrowsMessage<Error>(HasSubstr("gyroid")));
}

TEST(Generate, ClosedForms) {
  const glm::uvec3 dims(9, 7, 5);
  const auto at = [&](const std::vector<float> &voxels, std::uint32_t x, std::uint32_t y,
                      std::uint32_t z) { return voxels[(z * dims.y + y) * dims.x + x]; };
  const auto sphere = generate(make_options(Field::kSphere, dims, VoxelType::kFloat32));
  EXPECT_EQ(at(sphere, 4, 3, 2), 1.0f);
  EXPECT_FLOAT_EQ(at(sphere, 8, 3, 2), float(1 - 1 / std::sqrt(3.0)));
  EXPECT_FLOAT_EQ(at(sphere, 4, 0, 2), float(1 - 0.75 / std::sqrt(3.0)));
  const auto plane = generate(make_options(Field::kPlane, glm::uvec3(9), VoxelType::kFloat32));
  EXPECT_FLOAT_EQ(plane.front(), 0.0f);
  EXPECT_FLOAT_EQ(plane.back(), 1.0f);
  EXPECT_FLOAT_EQ(plane[1] - plane[0], float(0.25 * 0.36 / (2 * 1.64)));
  const auto saddle = generate(make_options(Field::kSaddle, dims, VoxelType::kFloat32));
  EXPECT_EQ(at(saddle, 4, 3, 2), 0.5f);
  EXPECT_FLOAT_EQ(at(saddle, 8, 6, 4), float(0.5 + (0.5 - 0.75) / 4));
  const auto marschner_lobb =
      generate(make_options(Field::kMarschnerLobb, glm::uvec3(9), VoxelType::kFloat32));
  EXPECT_FLOAT_EQ(marschner_lobb[(4 * 9 + 4) * 9 + 4],
                  float((1 + 0.25 * 2) / 2.5));  // r = 0: the cosine is 1
  const auto gyroid = generate(make_options(Field::kGyroid, glm::uvec3(9), VoxelType::kFloat32));
  EXPECT_FLOAT_EQ(gyroid[(4 * 9 + 4) * 9 + 4], 0.5f);
}

TEST(Generate, EveryFieldStaysInItsRange) {
  for (const Field field : kFields) {
    const auto voxels = generate(make_options(field, {33, 40, 35}, VoxelType::kFloat64));
    EXPECT_GE(*std::min_element(voxels.begin(), voxels.end()), 0.0f) << to_string(field);
    EXPECT_LE(*std::max_element(voxels.begin(), voxels.end()), 1.0f) << to_string(field);
  }
}

TEST(Generate, IntegersCoverTheirRangeRounded) {
  const glm::uvec3 dims(17);
  const auto exact = generate(make_options(Field::kPlane, dims, VoxelType::kFloat64));
  for (const auto &[type, max] : {std::pair(VoxelType::kUint8, 255.0),
                                  {VoxelType::kInt8, 127.0},
                                  {VoxelType::kUint16, 65535.0},
                                  {VoxelType::kInt16, 32767.0},
                                  {VoxelType::kUint32, 4294967295.0},
                                  {VoxelType::kInt32, 2147483647.0}}) {
    const auto voxels = generate(make_options(Field::kPlane, dims, type));
    EXPECT_EQ(voxels.front(), 0.0f);
    EXPECT_EQ(voxels.back(), float(max));
    for (std::size_t i = 0; i < voxels.size(); ++i) {
      // half a step of rounding, and the float32 rounding of both values
      ASSERT_NEAR(voxels[i], exact[i] * max, 0.5 + max * 0x1p-23)
          << to_string(type) << " voxel " << i;
    }
  }
}

TEST(Generate, AnyThreadCountAndTheReaderGiveTheFilesBytes) {
  const TemporaryFolder folder;
  for (const Field field : kFields) {
    GenerateOptions options = make_options(field, {37, 50, 23}, VoxelType::kUint16);
    options.num_threads = 1;
    const auto path = generate_to_file(options, folder.path());
    EXPECT_EQ(path.filename(), fmt::format("{}_37x50x23_uint16.raw", to_string(field)));
    options.num_threads = 7;
    const auto again = generate_to_file(options, folder / "again.raw");
    EXPECT_EQ(test::read_file(path), test::read_file(again)) << to_string(field);

    const auto file = open_volume(path);
    std::vector<float> voxels(file->info().num_voxels());
    file->read_layers(0, 23, voxels);
    EXPECT_EQ(voxels, generate(options)) << to_string(field);
  }
}

TEST(Generate, MixingLayerIsTheSameEverywhere) {
  const TemporaryFolder folder;
  GenerateOptions options = make_options(Field::kMixingLayer, {48, 64, 40}, VoxelType::kUint16);
  const std::string bytes = test::read_file(generate_to_file(options, folder / "a.raw"));
  EXPECT_EQ(::crc32_z(0, reinterpret_cast<const Bytef *>(bytes.data()), bytes.size()), 1828420260u);
  options.seed = 2;
  EXPECT_NE(bytes, test::read_file(generate_to_file(options, folder / "b.raw")));
}

TEST(Generate, FieldsOfNoiseAreTheSameEverywhere) {
  const TemporaryFolder folder;
  for (const auto &[field, checksum] : {std::pair(Field::kTurbulence, 2648135395u),
                                        {Field::kJet, 1974121093u},
                                        {Field::kScan, 3276317315u},
                                        {Field::kNoisyScan, 2860903464u}}) {
    SCOPED_TRACE(to_string(field));
    GenerateOptions options = make_options(field, {48, 64, 40}, VoxelType::kUint16);
    const std::string bytes = test::read_file(generate_to_file(options, folder / "a.raw"));
    EXPECT_EQ(::crc32_z(0, reinterpret_cast<const Bytef *>(bytes.data()), bytes.size()), checksum);
    EXPECT_TRUE(has_seed(field));
    options.seed = 2;
    EXPECT_NE(bytes, test::read_file(generate_to_file(options, folder / "b.raw")));
  }
  EXPECT_FALSE(has_seed(Field::kSphere));
}

TEST(Generate, MixingLayerMixesOnlyInTheMiddle) {
  const glm::uvec3 dims(96);
  const auto voxels = generate(make_options(Field::kMixingLayer, dims, VoxelType::kFloat32));
  std::size_t crossings = 0;  // sign changes along y; a mere wavy surface has one per column
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t x = 0; x < dims.x; ++x) {
      const auto at = [&](std::uint32_t y) {
        return voxels[(z * dims.y + y) * dims.x + x] >= 0.5f;
      };
      EXPECT_FALSE(at(0));
      EXPECT_TRUE(at(95));
      for (std::uint32_t y = 1; y < dims.y; ++y) crossings += at(y) != at(y - 1);
    }
  }
  EXPECT_GT(double(crossings) / (96 * 96), 1.3) << "the surface should fold over";
}

TEST(Generate, ShellIsTheSameSmoothSurfaceAtAnySize) {
  const auto surface = [](const glm::dvec3 &p) {  // d of generate.hpp
    return 0.8 - glm::length(p) +
           0.02 * (std::sin(5 * p.x + 1) + std::sin(6 * p.y + 2) + std::sin(7 * p.z + 3));
  };
  for (const std::uint32_t edge : {33u, 65u, 129u}) {
    SCOPED_TRACE(edge);
    const auto voxels = generate(make_options(Field::kShell, glm::uvec3(edge), VoxelType::kUint8));
    const auto at = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
      return voxels[(std::size_t{z} * edge + y) * edge + x];
    };
    EXPECT_EQ(at(edge / 2, edge / 2, edge / 2), 255.0f);
    const double voxel = 2.0 / (edge - 1);
    std::size_t crossings = 0;
    for (std::uint32_t z = 0; z < edge; ++z) {
      for (std::uint32_t y = 0; y < edge; ++y) {
        for (std::uint32_t x = 0; x < edge; ++x) {
          const double d = surface(glm::dvec3(x, y, z) * voxel - 1.0);
          // 128 is the surface: beside it the step rises by 127 * 1.5 / 0.12 per unit, which 8 bits
          // can tell.
          const float value = at(x, y, z);
          if (std::abs(d) > 0.001) {
            ASSERT_EQ(value >= 128.0f, d > 0) << x << " " << y << " " << z;
          }
          if (std::abs(d) > 0.121) {
            ASSERT_EQ(value, d > 0 ? 255.0f : 1.0f);
          }
          const bool border =
              x == 0 || y == 0 || z == 0 || x + 1 == edge || y + 1 == edge || z + 1 == edge;
          ASSERT_FALSE(border && value >= 128.0f) << "closed: no surface at the border";
          if (x > 0) crossings += (value >= 128.0f) != (at(x - 1, y, z) >= 128.0f);
        }
      }
    }
    // Convex enough that a line along x crosses twice or never: twice the area of the silhouette,
    // pi * (0.4 edges)^2 bent.
    EXPECT_NEAR(double(crossings) / (edge * edge), 2 * 3.14159265 * 0.16, 0.1);
  }
}

TEST(Generate, RefusesBadRequests) {
  const TemporaryFolder folder;
  const GenerateOptions good = make_options(Field::kSphere, {8, 8, 8}, VoxelType::kUint8);
  EXPECT_THROW(open_generated(make_options(Field::kSphere, {8, 0, 8}, VoxelType::kUint8)), Error);
  EXPECT_THROW(generate_to_file(good, folder / "a.txt"), Error);
  EXPECT_THROW(generate_to_file(good, folder / "a_8x8x9_uint8.raw"), Error);
  EXPECT_THROW(generate_to_file(good, folder / "a_8x8x8_int8.raw"), Error);
  EXPECT_THROW(generate_to_file(good, folder / "missing" / "a_8x8x8_uint8.raw"), Error);
  EXPECT_EQ(folder.num_files(), 0u);
}

}  // namespace
}  // namespace isowave::core
