#include "core/io/npy.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "core/base/error.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/byte_source.hpp"

namespace isowave::core {
namespace {

static_assert(std::endian::native == std::endian::little,
              "'<f4' is written and read as it lies in memory");

// File: magic, version (2 bytes), length of the header (2 bytes in format 1, 4 bytes later),
// header, voxels.
constexpr std::string_view kNpyMagic = "\x93NUMPY";
constexpr std::size_t kPreamble = kNpyMagic.size() + 4;
constexpr std::size_t kAlignment = 64;          ///< numpy starts the voxels at a multiple of this
constexpr std::uint32_t kMaxHeader = 1u << 20;  ///< no header of a plain array comes near

/// The text after `'key':` in the header, a Python dictionary in text, up to the end of the header.
std::string_view value_of(std::string_view header, std::string_view key, const std::string &where) {
  std::size_t at = header.find(key);
  if (at != header.npos) at = header.find(':', at + key.size());
  if (at != header.npos) at = header.find_first_not_of(" \t", at + 1);
  if (at == header.npos) throw Error("{}: broken .npy header: no {}", where, key);
  const std::string_view name =
      key.substr(1, key.size() - 2);  // Python takes quotes of either kind
  if (header.find(name, header.find(name) + 1) != header.npos)
    throw Error("{}: broken .npy header: {} is given twice", where, key);
  return header.substr(at);
}

/// The entries of "(3, 4), ...".
std::vector<std::uint64_t> parse_shape(std::string_view text, const std::string &where) {
  const std::size_t close = text.find(')');
  if (!text.starts_with('(') || close == text.npos)
    throw Error("{}: broken .npy header: bad shape", where);
  text = text.substr(1, close - 1);
  std::vector<std::uint64_t> shape;
  for (;;) {
    text.remove_prefix(std::min(text.find_first_not_of(" ,"), text.size()));
    if (text.empty()) return shape;
    std::uint64_t extent = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), extent);
    if (error != std::errc()) throw Error("{}: broken .npy header: bad shape", where);
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    shape.push_back(extent);
  }
}

}  // namespace

void write_npy(const FloatImage &image, const std::filesystem::path &path) {
  if (image.pixels.size() != std::size_t(image.width) * image.height) {
    throw std::invalid_argument("write_npy: pixels is not width * height long");
  }
  std::string header = fmt::format(
      "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", image.height, image.width);
  header.append(kAlignment - 1 - (kPreamble + header.size()) % kAlignment, ' ');
  header += '\n';
  const auto length = static_cast<std::uint16_t>(header.size());
  const char preamble[] = {1, 0, static_cast<char>(length & 0xff), static_cast<char>(length >> 8)};

  AtomicFile out(path);
  out.write(kNpyMagic);
  out.write(std::string_view(preamble, sizeof preamble));
  out.write(header);
  out.write(std::as_bytes(std::span(image.pixels)));
  out.commit();
}

FloatImage read_npy(const std::filesystem::path &path) {
  const std::string where = path.string();
  FileSource in(std::make_shared<const InputFile>(path), 0);
  const auto get = [&in](void *to, std::size_t bytes) {
    return in.read(std::span(static_cast<std::byte *>(to), bytes)) == bytes;
  };

  char magic[kNpyMagic.size()];
  std::uint8_t version[2], length[4] = {};
  if (!get(magic, sizeof magic) || std::string_view(magic, sizeof magic) != kNpyMagic) {
    throw Error("{}: not a .npy file", where);
  }
  if (!get(version, sizeof version)) throw Error("{}: truncated .npy header", where);
  if (version[0] < 1 || version[0] > 3)
    throw Error("{}: .npy format {} is unknown", where, version[0]);
  if (!get(length, version[0] == 1 ? 2 : 4)) throw Error("{}: truncated .npy header", where);
  const std::uint32_t header_length = length[0] | std::uint32_t(length[1]) << 8 |
                                      std::uint32_t(length[2]) << 16 |
                                      std::uint32_t(length[3]) << 24;
  if (header_length > kMaxHeader)
    throw Error("{}: broken .npy header: {} bytes long", where, header_length);
  std::string header(header_length, '\0');
  if (!get(header.data(), header.size())) throw Error("{}: truncated .npy header", where);

  const std::string_view descr = value_of(header, "'descr'", where);
  if (!descr.starts_with("'<f4'")) {
    constexpr std::size_t kMostShown = 40;  // a file may name its type by its whole header
    throw Error("{}: holds {}, not '<f4' (little-endian float32)", where,
                descr.substr(0, std::min(descr.find(','), kMostShown)));
  }
  if (!value_of(header, "'fortran_order'", where).starts_with("False")) {
    throw Error("{}: is in Fortran order; save it with numpy.ascontiguousarray", where);
  }
  const std::vector<std::uint64_t> shape = parse_shape(value_of(header, "'shape'", where), where);
  constexpr std::uint64_t kMax = std::numeric_limits<std::uint32_t>::max();
  if (shape.size() != 2) throw Error("{}: has {} dimensions, an image has 2", where, shape.size());
  if (shape[0] > kMax || shape[1] > kMax) throw Error("{}: shape is too large for an image", where);

  // Compared with the file before memory is asked for: the shape of a broken header may be
  // anything. 64 bits hold the product of two 32-bit extents, and its fourfold is compared by
  // division.
  const std::uint64_t bytes = in.left();
  if (bytes % sizeof(float) != 0 || bytes / sizeof(float) != shape[0] * shape[1]) {
    throw Error("{}: shape ({}, {}) needs {} float32 values, the file has {} bytes of them", where,
                shape[0], shape[1], shape[0] * shape[1], bytes);
  }
  FloatImage image{static_cast<std::uint32_t>(shape[1]), static_cast<std::uint32_t>(shape[0]), {}};
  image.pixels.resize(shape[0] * shape[1]);
  in.read(std::as_writable_bytes(std::span(image.pixels)));
  return image;
}

}  // namespace isowave::core
