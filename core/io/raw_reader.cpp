#include "core/io/raw_reader.hpp"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <limits>
#include <system_error>
#include <vector>

#include "core/error.hpp"

namespace isowave {
namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little,
              "raw files are little endian, and so must the host be");

namespace {

/// Voxel bytes in file order.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  /// Reads up to bytes.size() bytes; fewer only at the end of the data.
  virtual std::size_t read(std::span<std::byte> bytes) = 0;
};

class FileSource : public ByteSource {
 public:
  explicit FileSource(const fs::path &path)
      : path_(path), file_(std::fopen(path.c_str(), "rb"), &std::fclose) {
    if (!file_) throw Error("{}: cannot open: {}", path.string(), std::strerror(errno));
  }
  std::size_t read(std::span<std::byte> bytes) override {
    const std::size_t count = std::fread(bytes.data(), 1, bytes.size(), file_.get());
    if (count < bytes.size() && std::ferror(file_.get())) {
      throw Error("{}: cannot read: {}", path_.string(), std::strerror(errno));
    }
    return count;
  }

 private:
  fs::path path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE *)> file_;
};

class GzipSource : public ByteSource {
 public:
  explicit GzipSource(const fs::path &path) : path_(path), file_(::gzopen(path.c_str(), "rb"), &::gzclose) {
    if (!file_) throw Error("{}: cannot open: {}", path.string(), std::strerror(errno));
    ::gzbuffer(file_.get(), 1u << 18);
    // zlib passes through what is not gzip; here that is a wrong file.
    if (::gzdirect(file_.get()) != 0) throw Error("{}: not a gzip file, despite its name", path.string());
  }
  std::size_t read(std::span<std::byte> bytes) override {
    std::size_t done = 0;
    while (done < bytes.size()) {
      const auto part = unsigned(std::min<std::size_t>(bytes.size() - done, 1u << 30));
      const int count = ::gzread(file_.get(), bytes.data() + done, part);
      int code = Z_OK;
      const char *reason = ::gzerror(file_.get(), &code);
      if (code == Z_BUF_ERROR) throw Error("{}: truncated: the gzip stream ends too early", path_.string());
      if (count < 0 || code < 0) throw Error("{}: broken gzip stream ({})", path_.string(), reason);
      done += std::size_t(count);
      if (unsigned(count) < part) break;
    }
    return done;
  }

 private:
  fs::path path_;
  std::unique_ptr<gzFile_s, int (*)(gzFile)> file_;
};

class RawReader : public VolumeReader {
 public:
  RawReader(const fs::path &path, const VolumeInfo &info, std::unique_ptr<ByteSource> source)
      : path_(path), source_(std::move(source)) {
    info_ = info;
  }

  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    read_as(z_begin, num_layers, out, &convert_to_float);
  }
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<double> out) override {
    read_as(z_begin, num_layers, out, &convert_to_double);
  }

 private:
  static constexpr std::size_t kPieceVoxels = 1u << 17;

  template <class Value, class Convert>
  void read_as(std::uint32_t z_begin, std::uint32_t num_layers, std::span<Value> out,
               const Convert &convert) {
    const std::uint64_t layer_size = std::uint64_t(info_.dims.x) * info_.dims.y;
    if (z_begin < next_layer_ || num_layers > info_.dims.z || z_begin > info_.dims.z - num_layers ||
        out.size() != layer_size * num_layers) {
      throw std::invalid_argument(
          "RawReader: layers not ascending, outside the volume, or out of a wrong size");
    }
    skip(layer_size * (z_begin - next_layer_));
    read_voxels(out, convert);
    next_layer_ = z_begin + num_layers;
    if (next_layer_ == info_.dims.z && !std::exchange(end_checked_, true)) check_end();
  }

  /// Reads the next voxels piece by piece, so that the raw bytes need no buffer of the size of `out`.
  template <class Value, class Convert>
  void read_voxels(std::span<Value> out, const Convert &convert) {
    piece_.resize(kPieceVoxels * size_of(info_.type));
    while (!out.empty()) {
      const std::size_t count = std::min(kPieceVoxels, out.size());
      const std::span bytes = std::span(piece_).first(count * size_of(info_.type));
      read_exactly(bytes);
      convert(info_.type, bytes, out.first(count));
      out = out.subspan(count);
    }
  }

  void skip(std::uint64_t num_voxels) {
    piece_.resize(kPieceVoxels * size_of(info_.type));
    while (num_voxels > 0) {
      const auto count = std::size_t(std::min<std::uint64_t>(kPieceVoxels, num_voxels));
      read_exactly(std::span(piece_).first(count * size_of(info_.type)));
      num_voxels -= count;
    }
  }

  void read_exactly(std::span<std::byte> bytes) {
    const std::size_t count = source_->read(bytes);
    bytes_read_ += count;
    if (count < bytes.size()) fail_size("truncated");
  }

  /// After the last layer nothing may follow. Also makes zlib check the stream's checksum.
  void check_end() {
    std::vector<std::byte> rest(1u << 18);
    const std::uint64_t expected = bytes_read_;
    while (const std::size_t count = source_->read(rest)) bytes_read_ += count;
    if (bytes_read_ != expected) fail_size("too long");
  }

  [[noreturn]] void fail_size(std::string_view how) const {
    throw Error("{}: {}: {}x{}x{} {} voxels need {} bytes, found {}", path_.string(), how, info_.dims.x,
                info_.dims.y, info_.dims.z, to_string(info_.type), info_.num_voxels() * size_of(info_.type),
                bytes_read_);
  }

  fs::path path_;
  std::unique_ptr<ByteSource> source_;
  std::vector<std::byte> piece_;
  std::uint64_t bytes_read_ = 0;
  std::uint32_t next_layer_ = 0;
  bool end_checked_ = false;
};

template <class T, class Value>
void convert(std::span<const std::byte> voxels, std::span<Value> out) {
  for (std::size_t i = 0; i < out.size(); ++i) {
    T value;
    std::memcpy(&value, voxels.data() + i * sizeof(T), sizeof(T));
    out[i] = static_cast<Value>(value);
  }
}

template <class Value>
void convert_voxels(VoxelType type, std::span<const std::byte> voxels, std::span<Value> out) {
  if (voxels.size() != out.size() * size_of(type))
    throw std::invalid_argument("convert_voxels: sizes differ");
  switch (type) {
    case VoxelType::kUint8:
      return convert<std::uint8_t>(voxels, out);
    case VoxelType::kInt8:
      return convert<std::int8_t>(voxels, out);
    case VoxelType::kUint16:
      return convert<std::uint16_t>(voxels, out);
    case VoxelType::kInt16:
      return convert<std::int16_t>(voxels, out);
    case VoxelType::kUint32:
      return convert<std::uint32_t>(voxels, out);
    case VoxelType::kInt32:
      return convert<std::int32_t>(voxels, out);
    case VoxelType::kFloat32:
      return convert<float>(voxels, out);
    case VoxelType::kFloat64:
      return convert<double>(voxels, out);
  }
}

/// Parses a whole string as an unsigned number.
std::optional<std::uint32_t> parse_uint(std::string_view text) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

void convert_to_float(VoxelType type, std::span<const std::byte> voxels, std::span<float> out) {
  convert_voxels(type, voxels, out);
}
void convert_to_double(VoxelType type, std::span<const std::byte> voxels, std::span<double> out) {
  convert_voxels(type, voxels, out);
}

std::optional<RawName> parse_raw_name(std::string_view stem) {
  const std::size_t type_at = stem.rfind('_');
  if (type_at == std::string_view::npos || type_at == 0) return std::nullopt;
  const std::size_t dims_at = stem.rfind('_', type_at - 1);
  if (dims_at == std::string_view::npos) return std::nullopt;

  RawName result;
  result.name = stem.substr(0, dims_at);
  try {
    result.type = voxel_type_from_string(stem.substr(type_at + 1));
  } catch (const Error &) {
    return std::nullopt;
  }
  std::string_view dims = stem.substr(dims_at + 1, type_at - dims_at - 1);
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t end = axis < 2 ? dims.find('x') : dims.size();
    if (end == std::string_view::npos) return std::nullopt;
    const std::optional<std::uint32_t> count = parse_uint(dims.substr(0, end));
    if (!count) return std::nullopt;
    result.dims[axis] = *count;
    dims.remove_prefix(std::min(end + 1, dims.size()));
  }
  return result;
}

std::unique_ptr<VolumeReader> open_raw(const fs::path &path, const RawOverrides &overrides) {
  const bool gzipped = path.extension() == ".gz";
  const fs::path stem = gzipped ? path.stem().stem() : path.stem();
  const std::optional<RawName> name = parse_raw_name(stem.string());
  if (!name && !(overrides.dims && overrides.type)) {
    throw Error(
        "{}: the name does not end in _XxYxZ_TYPE (as in head_256x256x113_uint16.raw): give --dims and "
        "--type",
        path.string());
  }
  VolumeInfo info;
  info.dims = overrides.dims ? *overrides.dims : name->dims;
  info.type = overrides.type ? *overrides.type : name->type;
  info.spacing = overrides.spacing.value_or(glm::dvec3(1.0));
  check_volume_info(info, path.string());

  const std::uint64_t expected = info.num_voxels() * size_of(info.type);
  std::error_code error;
  const std::uint64_t file_size = fs::file_size(path, error);
  if (error) throw Error("{}: cannot open: {}", path.string(), error.message());
  if (!gzipped && file_size != expected) {
    throw Error("{}: {}: {}x{}x{} {} voxels need {} bytes, found {}", path.string(),
                file_size < expected ? "truncated" : "too long", info.dims.x, info.dims.y, info.dims.z,
                to_string(info.type), expected, file_size);
  }
  if (gzipped && file_size < expected / kMaxDeflateRatio) {
    throw Error("{}: truncated: {}x{}x{} {} voxels need {} bytes, which cannot come from {} gzipped ones",
                path.string(), info.dims.x, info.dims.y, info.dims.z, to_string(info.type), expected,
                file_size);
  }
  std::unique_ptr<ByteSource> source;
  if (gzipped) {
    source = std::make_unique<GzipSource>(path);
  } else {
    source = std::make_unique<FileSource>(path);
  }
  return std::make_unique<RawReader>(path, info, std::move(source));
}

}  // namespace isowave
