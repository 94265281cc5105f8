// PNG images: round trips keep every byte; other, truncated and broken files are refused in one
// line.

#include "core/io/png.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdint>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "core/base/error.hpp"
#include "tests/volume_file.hpp"

namespace isowave::core {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class PngTest : public testing::Test {
 protected:
  static Image8 noise(std::uint32_t width, std::uint32_t height, std::uint32_t channels) {
    std::mt19937 random(width * 31 + height);
    Image8 image{width, height, channels, {}};
    for (std::uint32_t i = 0; i < width * height * channels; ++i) {
      image.pixels.push_back(static_cast<std::uint8_t>(random()));
    }
    return image;
  }

  std::filesystem::path write_bytes(const std::string &bytes) {
    std::filesystem::path path = folder_ / "image.png";
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

  static std::string bytes_of(const std::filesystem::path &path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  static std::string big_endian(std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xff);
    return bytes;
  }

  static std::string chunk(const std::string &type, const std::string &data) {
    const std::string body = type + data;
    const uLong crc =
        crc32(0, reinterpret_cast<const Bytef *>(body.data()), static_cast<uInt>(body.size()));
    return big_endian(static_cast<std::uint32_t>(data.size())) + body +
           big_endian(static_cast<std::uint32_t>(crc));
  }

  /// A PNG made by hand: `before` are chunks ahead of the pixels, `rows` filtered rows.
  static std::string png(std::uint32_t width, std::uint32_t height, int bits, int colour_type,
                         const std::string &before, const std::string &rows) {
    std::string header = big_endian(width) + big_endian(height);
    header += static_cast<char>(bits);
    header += static_cast<char>(colour_type);
    header += std::string(3, '\0');
    return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + before + chunk("IDAT", test::zlib(rows)) +
           chunk("IEND", "");
  }

  std::string refusal(const std::string &bytes) {
    try {
      read_png(write_bytes(bytes));
    } catch (const Error &error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("image.png"), Not(HasSubstr("\n"))));
      return error.what();
    }
    return "accepted";
  }

  test::TemporaryFolder folder_;
};

TEST_F(PngTest, KeepsEveryByte) {
  for (const std::uint32_t channels : {3u, 4u}) {
    for (const auto &[width, height] : {std::pair{1u, 1u}, {5u, 7u}, {320u, 200u}}) {
      const Image8 image = noise(width, height, channels);
      const std::filesystem::path path = folder_ / "image.png";
      write_png(image, path);
      const Image8 back = read_png(path);
      EXPECT_EQ(back.width, width);
      EXPECT_EQ(back.height, height);
      EXPECT_EQ(back.channels, channels);
      EXPECT_EQ(back.pixels, image.pixels);
      EXPECT_EQ(folder_.num_files(), 1u) << "a temporary file was left";
    }
  }
}

TEST_F(PngTest, WidensGreyAndPalettes) {
  using std::string;
  const Image8 grey = read_png(write_bytes(png(2, 1, 8, 0, "", string("\0\x10\xff", 3))));
  EXPECT_EQ(grey.channels, 3u);
  EXPECT_THAT(grey.pixels, ElementsAre(16, 16, 16, 255, 255, 255));
  const string palette =
      chunk("PLTE", "\x01\x02\x03\x04\x05\x06") + chunk("tRNS", string("\x80", 1));
  const Image8 indexed = read_png(write_bytes(png(2, 1, 1, 3, palette, string("\0\x40", 2))));
  EXPECT_EQ(indexed.channels, 4u);
  EXPECT_THAT(indexed.pixels, ElementsAre(1, 2, 3, 128, 4, 5, 6, 255));
}

TEST_F(PngTest, RefusesWhatIsNotPng) {
  EXPECT_THROW(read_png(folder_ / "absent.png"), Error);
  EXPECT_THROW(read_png(folder_.path()), Error);
  EXPECT_THAT(refusal(""), HasSubstr("not a PNG file"));
  EXPECT_THAT(refusal("\x93NUMPY\x01"), HasSubstr("not a PNG file"));
  EXPECT_THAT(refusal(png(1, 1, 16, 2, "", std::string(7, '\0'))), HasSubstr("16 bits"));
}

TEST_F(PngTest, RefusesTruncatedAndBrokenFiles) {
  write_png(noise(16, 16, 3), folder_ / "image.png");
  const std::string good = bytes_of(folder_ / "image.png");
  EXPECT_EQ(refusal(good), "accepted");
  for (std::size_t length = 0; length < good.size(); ++length) {
    EXPECT_NE(refusal(good.substr(0, length)), "accepted") << length << " bytes";
  }
  std::string flipped = good;
  flipped[good.size() / 2] = static_cast<char>(flipped[good.size() / 2] ^ 0x10);
  EXPECT_THAT(refusal(flipped), HasSubstr("broken PNG"));
}

/// Peak memory of `isowave compare` of a file with itself [MiB].
long peak_of_compare(const std::filesystem::path &path) {
  return test::peak_of_isowave({"compare", path.string(), path.string()});
}

TEST_F(PngTest, TakesNoMoreMemoryThanItsPixelsNeed) {
  constexpr long kMostMib = 400;  // the program alone takes 9
  const std::string pixel("\0abc", 4);
  // 3 GB by a header in a file of 70 bytes; and 14 GB, where the file is as long as it could hold
  // with blank pixels.
  write_bytes(png(32000, 32000, 8, 2, "", pixel));
  EXPECT_LT(peak_of_compare(folder_ / "image.png"), kMostMib);
  const std::string transparent = chunk("tRNS", std::string("\0\1", 2));
  write_bytes(png(60000, 60000, 1, 0, transparent, pixel) + std::string(1u << 19, '\0'));
  EXPECT_LT(peak_of_compare(folder_ / "image.png"), kMostMib);
  // Texts that unpack to 8 MB each.
  const std::string packed = test::zlib(std::string(7900000, 'x'));
  std::string texts;
  for (int i = 0; i < 100; ++i) texts += chunk("zTXt", std::string("key\0\0", 5) + packed);
  EXPECT_EQ(refusal(png(1, 1, 8, 2, texts, pixel)), "accepted");
  EXPECT_LT(peak_of_compare(folder_ / "image.png"), kMostMib);
}

TEST_F(PngTest, ReadsInterlacedPictures) {
  // Adam7's passes 1, 6 and 7 of 2 x 2 pixels hold (0,0), (1,0) and the row below.
  std::string file = png(2, 2, 8, 2, "", std::string("\0abc\0def\0ghijkl", 15));
  constexpr std::size_t kHeaderAt = 8, kHeaderBytes = 25, kDataAt = 16, kDataBeforeInterlace = 12;
  file.replace(kHeaderAt, kHeaderBytes,
               chunk("IHDR", file.substr(kDataAt, kDataBeforeInterlace) + '\1'));
  const Image8 image = read_png(write_bytes(file));
  EXPECT_EQ(std::string(image.pixels.begin(), image.pixels.end()), "abcdefghijkl");
}

TEST_F(PngTest, LeavesNothingBehindWhenItCannotWrite) {
  EXPECT_THROW(write_png(noise(2, 2, 3), folder_ / "no/such/folder.png"), Error);
  EXPECT_THROW(write_png(Image8{0, 0, 3, {}}, folder_ / "image.png"), Error);
  EXPECT_THROW(write_png(Image8{2, 2, 3, {1}}, folder_ / "image.png"), std::invalid_argument);
  EXPECT_THROW(write_png(Image8{1, 1, 2, {1, 2}}, folder_ / "image.png"), std::invalid_argument);
  EXPECT_EQ(folder_.num_files(), 0u);
}

}  // namespace
}  // namespace isowave::core
