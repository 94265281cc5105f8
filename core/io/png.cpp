#include "core/io/png.hpp"

#include <png.h>
#include <zlib.h>

#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>

#include "core/base/error.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/input_file.hpp"
#include "core/platform/file.hpp"

namespace isowave::core {
namespace {

// Written by libpng's simplified interface, which reads other pixels than are in files with gamma,
// and wants memory for all that a header asks for. So reading takes the other one, which reports
// errors by longjmp. The functions that call setjmp hold no object with a destructor, return false,
// and leave the message in PngMessage; their callers own everything and throw.

constexpr std::size_t kSignatureBytes = 8;

struct PngMessage {
  char text[120] = "unknown error";
};

void on_error(png_structp png, png_const_charp text) {
  auto *message = static_cast<PngMessage *>(png_get_error_ptr(png));
  std::snprintf(message->text, sizeof message->text, "%s", text);
  png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

struct Reader {
  PngMessage message;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &message, on_error, on_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  Reader() {
    if (info == nullptr) throw std::bad_alloc();
  }
  Reader(const Reader &) = delete;
  Reader &operator=(const Reader &) = delete;
  ~Reader() { png_destroy_read_struct(&png, &info, nullptr); }
};

/// Reads everything before the pixels and asks for 8-bit RGB or RGBA. Texts, profiles and such are
/// passed over: they may be large, once they are unpacked.
bool read_header(Reader &reader, std::FILE *file) {
  png_structp png = reader.png;
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_init_io(png, file);
  png_set_sig_bytes(png, kSignatureBytes);
  constexpr int kAllThatNoPixelNeeds = -1;
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, kAllThatNoPixelNeeds);
  png_read_info(png, reader.info);
  png_set_expand(png);
  png_set_gray_to_rgb(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, reader.info);
  return true;
}

/// Whether the file holds all its pixels; they are lost. row: room for one row.
bool check_rows(Reader &reader, png_bytep row) {
  png_structp png = reader.png;
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  const png_uint_32 height = png_get_image_height(png, reader.info);
  const bool interlaced = png_get_interlace_type(png, reader.info) != PNG_INTERLACE_NONE;
  for (int pass = 0; pass < (interlaced ? PNG_INTERLACE_ADAM7_PASSES : 1); ++pass) {
    for (png_uint_32 y = 0; y < height; ++y) png_read_row(png, row, nullptr);
  }
  png_read_end(png, nullptr);
  return true;
}

bool read_rows(Reader &reader, png_bytepp rows) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  png_read_image(reader.png, rows);
  png_read_end(reader.png, nullptr);
  return true;
}

/// From the file's first byte to its first pixel.
void begin(Reader &reader, std::FILE *file, const std::string &where) {
  std::rewind(file);
  png_byte signature[kSignatureBytes];
  if (std::fread(signature, 1, sizeof signature, file) != sizeof signature ||
      png_sig_cmp(signature, 0, sizeof signature) != 0) {
    throw Error("{}: not a PNG file", where);
  }
  if (!read_header(reader, file)) throw Error("{}: broken PNG: {}", where, reader.message.text);
  if (png_get_bit_depth(reader.png, reader.info) != 8) {
    throw Error("{}: has {} bits per channel, only up to 8 are read", where,
                png_get_bit_depth(reader.png, reader.info));
  }
}

constexpr int kAsItIs = 0, kRowsFollowEachOther = 0;  ///< of libpng's simplified interface

png_image describe(const Image8 &image) {
  if (image.channels != 3 && image.channels != 4)
    throw std::invalid_argument("a PNG: channels is not 3 or 4");
  if (image.pixels.size() != std::size_t(image.width) * image.height * image.channels)
    throw std::invalid_argument("a PNG: pixels is not width * height * channels long");
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = image.width;
  png.height = image.height;
  png.format = image.channels == 4 ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB;
  return png;
}

// A text chunk before the last one, which is always the same: libpng's simplified interface writes
// no texts.
constexpr std::string_view kTextKey{"tEXtisowave cameras\0", 20};
constexpr std::size_t kEndBytes = 12, kMostTextBytes = 1u << 20;

std::string big_endian(std::size_t number) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(number >> shift & 0xff);
  return bytes;
}

std::string text_chunk(std::string_view text) {
  const std::string body = std::string(kTextKey) + std::string(text);
  const auto *bytes = reinterpret_cast<const Bytef *>(body.data());
  return big_endian(body.size() - 4) + body + big_endian(::crc32_z(0, bytes, body.size()));
}

}  // namespace

std::vector<std::uint8_t> encode_png(const Image8 &image, std::string_view cameras) {
  png_image png = describe(image);
  png_alloc_size_t num_bytes = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::vector<std::uint8_t> bytes(num_bytes);
  if (png_image_write_to_memory(&png, bytes.data(), &num_bytes, kAsItIs, image.pixels.data(),
                                kRowsFollowEachOther, nullptr) == 0) {
    throw Error("cannot make a PNG of the picture: {}", png.message);
  }
  bytes.resize(num_bytes);
  const std::string text = cameras.empty() ? std::string() : text_chunk(cameras);
  bytes.insert(bytes.end() - std::ptrdiff_t{kEndBytes}, text.begin(), text.end());
  return bytes;
}

void write_png(const Image8 &image, const std::filesystem::path &path, std::string_view cameras) {
  AtomicFile out(path);
  png_image png = describe(image);
  if (png_image_write_to_stdio(&png, out.stream(), kAsItIs, image.pixels.data(),
                               kRowsFollowEachOther, nullptr) == 0) {
    throw Error("{}: cannot write the PNG: {}", path.string(), png.message);
  }
  constexpr auto kBack = -static_cast<long>(kEndBytes);
  if (!cameras.empty() && std::fseek(out.stream(), kBack, SEEK_END) == 0) {  // not in pipes
    out.write(text_chunk(cameras));
    out.write(std::string_view("\0\0\0\0IEND\xae\x42\x60\x82", kEndBytes));
  }
  out.commit();
}

std::optional<std::string> cameras_of_png(const std::filesystem::path &path) {
  check_input_file(path);
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error("{}: cannot open", path.string());
  in.seekg(kSignatureBytes);
  for (std::array<char, 8> head{}; in.read(head.data(), head.size());) {
    std::size_t length = 0;
    for (std::size_t i = 0; i < 4; ++i)
      length = length << 8 | static_cast<unsigned char>(head.at(i));
    std::string body(head.data() + 4, 4);
    if (body != kTextKey.substr(0, 4) || length > kMostTextBytes) {
      in.seekg(static_cast<std::streamoff>(length) + 4, std::ios::cur);
      continue;
    }
    body.resize(4 + length);
    if (!in.read(body.data() + 4, static_cast<std::streamsize>(length))) break;
    if (body.starts_with(kTextKey)) return body.substr(kTextKey.size());
    in.seekg(4, std::ios::cur);
  }
  return std::nullopt;
}

Image8 read_png(const std::filesystem::path &path) {
  const std::string where = path.string();
  check_input_file(path);
  const std::unique_ptr<std::FILE, int (*)(std::FILE *)> file(platform::open_stream(path),
                                                              &std::fclose);
  if (!file) throw Error("{}: cannot open", where);
  {  // A broken header may ask for any size. So nothing is asked for before the file has shown that
     // it holds as much.
    Reader reader;
    begin(reader, file.get(), where);
    std::vector<png_byte> row(png_get_rowbytes(reader.png, reader.info));
    if (!check_rows(reader, row.data()))
      throw Error("{}: broken PNG: {}", where, reader.message.text);
  }
  Reader reader;
  begin(reader, file.get(), where);
  Image8 image;
  image.width = png_get_image_width(reader.png, reader.info);
  image.height = png_get_image_height(reader.png, reader.info);
  image.channels = png_get_channels(reader.png, reader.info);
  const std::size_t row_bytes = png_get_rowbytes(reader.png, reader.info);
  image.pixels.resize(row_bytes * image.height);
  std::vector<png_bytep> rows(image.height);
  for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = image.pixels.data() + y * row_bytes;
  if (!read_rows(reader, rows.data()))
    throw Error("{}: broken PNG: {}", where, reader.message.text);
  return image;
}

}  // namespace isowave::core
