// .npy images: every bit kept, and every broken file refused in one line.

#include "core/io/npy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>

#include "core/base/error.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Lt;
using testing::Not;
using testing::SizeIs;

class NpyTest : public testing::Test {
 protected:
  std::filesystem::path write_bytes(const std::string &bytes) {
    std::filesystem::path path = folder_ / "image.npy";
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

  std::string bytes_of(const std::filesystem::path &path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  /// A file of the given format version, header text and number of zero bytes as data.
  static std::string file(int version, const std::string &header, std::size_t data_bytes) {
    std::string bytes = "\x93NUMPY";
    bytes += static_cast<char>(version);
    bytes += '\0';
    for (int byte = 0; byte < (version == 1 ? 2 : 4); ++byte) {
      bytes += static_cast<char>(header.size() >> (8 * byte) & 0xff);
    }
    return bytes + header + std::string(data_bytes, '\0');
  }

  std::string refusal(const std::string &bytes) {
    try {
      read_npy(write_bytes(bytes));
    } catch (const Error &error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("image.npy"), Not(HasSubstr("\n"))));
      return error.what();
    }
    return "accepted";
  }

  test::TemporaryFolder folder_;
};

TEST_F(NpyTest, KeepsEveryBit) {
  std::mt19937 random(20231);
  for (const auto &[width, height] : {std::pair{1u, 1u}, {7u, 3u}, {640u, 360u}}) {
    FloatImage image{width, height, {}};
    for (std::uint32_t i = 0; i < width * height; ++i) {
      image.pixels.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(random())));
    }
    image.pixels[0] = std::numeric_limits<float>::infinity();
    const std::filesystem::path path = folder_ / "image.npy";
    write_npy(image, path);
    const FloatImage back = read_npy(path);
    EXPECT_EQ(back.width, width);
    EXPECT_EQ(back.height, height);
    ASSERT_EQ(back.pixels.size(), image.pixels.size());
    EXPECT_EQ(
        std::memcmp(back.pixels.data(), image.pixels.data(), image.pixels.size() * sizeof(float)),
        0);
    EXPECT_TRUE(std::isinf(back.pixels[0]) && back.pixels[0] > 0);
    EXPECT_EQ(folder_.num_files(), 1u) << "a temporary file was left";
  }
}

TEST_F(NpyTest, WritesWhatNumpyWrites) {
  // The bytes of numpy.save(file, numpy.array([[1, 2, inf]], dtype='<f4')).
  std::string expected = std::string("\x93NUMPY\x01\x00\x76\x00", 10) +
                         "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3), }";
  expected += std::string(127 - expected.size(), ' ') + '\n';
  expected += std::string("\x00\x00\x80\x3f\x00\x00\x00\x40\x00\x00\x80\x7f", 12);
  write_npy({3, 1, {1.0f, 2.0f, std::numeric_limits<float>::infinity()}}, folder_ / "image.npy");
  EXPECT_EQ(bytes_of(folder_ / "image.npy"), expected);
}

TEST_F(NpyTest, ReadsOtherWritersOfTheFormat) {
  // No padding, other order and spacing of keys, later format versions.
  const std::string header = "{'shape':(2,3),'descr':'<f4','fortran_order':False}\n";
  for (const int version : {1, 2, 3}) {
    const FloatImage image = read_npy(write_bytes(file(version, header, 24)));
    EXPECT_EQ(image.width, 3u);
    EXPECT_EQ(image.height, 2u);
  }
  EXPECT_TRUE(
      read_npy(write_bytes(file(1, "{'shape':(0,3),'descr':'<f4','fortran_order':False}\n", 0)))
          .pixels.empty());
}

TEST_F(NpyTest, RefusesWrongAndTruncatedFiles) {
  EXPECT_THROW(read_npy(folder_ / "absent.npy"), Error);
  EXPECT_THROW(read_npy(folder_.path()), Error);
  EXPECT_THAT(refusal(""), HasSubstr("not a .npy file"));
  EXPECT_THAT(refusal("\x89PNG\r\n\x1a\n----------"), HasSubstr("not a .npy file"));
  EXPECT_THAT(refusal(file(9, "{}", 0)), HasSubstr("format 9"));

  const std::string good =
      file(1, "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n", 24);
  EXPECT_EQ(refusal(good), "accepted");
  for (std::size_t length = 0; length < good.size(); ++length) {
    EXPECT_NE(refusal(good.substr(0, length)), "accepted") << length << " bytes";
  }
  EXPECT_THAT(refusal(good + "x"), HasSubstr("25 bytes"));
}

TEST_F(NpyTest, RefusesOtherArrays) {
  const auto with = [](const std::string &descr, const std::string &fortran,
                       const std::string &shape) {
    return file(
        1, "{'descr': " + descr + ", 'fortran_order': " + fortran + ", 'shape': " + shape + ", }\n",
        24);
  };
  EXPECT_EQ(refusal(with("'<f4'", "False", "(2, 3)")), "accepted");
  EXPECT_THAT(refusal(with("'<f8'", "False", "(1, 3)")), HasSubstr("'<f8'"));
  EXPECT_THAT(refusal(with("'>f4'", "False", "(2, 3)")), HasSubstr("'>f4'"));
  EXPECT_THAT(refusal(with(std::string(10000, 'x'), "False", "(2, 3)")), SizeIs(Lt(300u)));
  EXPECT_THAT(refusal(with("'<f4'", "True", "(2, 3)")), HasSubstr("Fortran"));
  EXPECT_THAT(refusal(with("'<f4'", "False", "(6,)")), HasSubstr("1 dimensions"));
  EXPECT_THAT(refusal(with("'<f4'", "False", "(1, 2, 3)")), HasSubstr("3 dimensions"));
  EXPECT_THAT(refusal(with("'<f4'", "False", "(2, x)")), HasSubstr("bad shape"));
  EXPECT_THAT(refusal(with("'<f4'", "False", "(-2, 3)")), HasSubstr("bad shape"));
  EXPECT_THAT(refusal(with("'<f4'", "False", "(2, 3")), HasSubstr("bad shape"));
  EXPECT_THAT(refusal(with("'<f4'", "False", "(4294967295, 4294967295)")), HasSubstr("needs"));
  EXPECT_THAT(refusal(with("'<f4'", "False", "(4294967296, 0)")), HasSubstr("too large"));
  EXPECT_THAT(refusal(file(1, "{'descr': '<f4', 'shape': (2, 3)}\n", 24)),
              HasSubstr("fortran_order"));
  EXPECT_THAT(refusal(with("'<f4'", "False", "(2, 3), \"shape\": (3, 2)")),
              HasSubstr("'shape' is given twice"));
}

TEST_F(NpyTest, LeavesNothingBehindWhenItCannotWrite) {
  EXPECT_THROW(write_npy({1, 1, {0.0f}}, folder_ / "no/such/folder.npy"), Error);
  EXPECT_THROW(write_npy({2, 2, {0.0f}}, folder_ / "image.npy"), std::invalid_argument);
  EXPECT_EQ(folder_.num_files(), 0u);
}

}  // namespace
}  // namespace isowave::core
