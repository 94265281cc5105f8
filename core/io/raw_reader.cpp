#include "core/io/raw_reader.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/byte_source.hpp"
#include "core/io/text_voxels.hpp"

namespace isowave::core {
namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little,
              "raw files are little endian, and so must the host be");

namespace {

void swap_bytes(std::span<std::byte> bytes, std::size_t voxel_bytes) {
  for (; !bytes.empty(); bytes = bytes.subspan(voxel_bytes))
    std::ranges::reverse(bytes.first(voxel_bytes));
}

std::uint64_t num_bytes(const VolumeInfo &info, const VoxelLayout &voxels) {
  return info.num_voxels() * size_of(voxels.type);
}

/// A number of each step, for all of them: at most 2^62, more than any file has.
std::uint64_t of_all_steps(std::uint64_t number, const VoxelLayout &voxels) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 62;
  return number > kMost / voxels.num_steps ? kMost : number * voxels.num_steps;
}

[[noreturn]] void fail_size(const VolumeInfo &info, const VoxelLayout &voxels, std::string_view how,
                            std::string_view needed, std::string_view found) {
  const std::string steps =
      voxels.num_steps > 1 ? fmt::format("{} steps of ", voxels.num_steps) : std::string();
  throw Error("{}: {}: {}{}x{}x{} {} voxels need {} bytes, found {}", voxels.file->what(), how,
              steps, info.dims.x, info.dims.y, info.dims.z, to_string(voxels.type), needed, found);
}

/// The values of stored voxels, exact.
void to_double(const VoxelLayout &voxels, std::span<const std::byte> bytes, std::span<double> out) {
  convert_to_double(voxels.type, bytes, out);
  if (!voxels.is_scaled()) return;
  for (double &value : out) value = value * voxels.slope + voxels.intercept;
}

/// The same, rounded to float32.
void to_float(const VoxelLayout &voxels, std::span<const std::byte> bytes, std::span<float> out) {
  if (!voxels.is_scaled()) return convert_to_float(voxels.type, bytes, out);
  std::vector<double> values(out.size());
  to_double(voxels, bytes, values);
  std::ranges::transform(values, out.begin(),
                         [](double value) { return static_cast<float>(value); });
}

/// Reads the voxels of a layout from a source that begins with them.
class RawReader : public VolumeReader {
 public:
  RawReader(const VolumeHeader &header, std::unique_ptr<ByteSource> source)
      : voxels_(header.voxels), source_(std::move(source)) {
    info_ = header.info;
    notices_ = header.notices;
  }

  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    read_as(z_begin, num_layers, out, &to_float);
  }
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override {
    read_as(z_begin, num_layers, out, &to_double);
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
    if (!std::exchange(begun_, true)) skip_bytes(voxels_.bytes_to_skip);
    skip(layer_size * (z_begin - next_layer_));
    read_voxels(out, convert);
    next_layer_ = z_begin + num_layers;
    if (next_layer_ == info_.dims.z && !std::exchange(end_checked_, true)) check_end();
  }

  /// Reads the next voxels piece by piece, so that the raw bytes need no buffer of the size of
  /// `out`.
  template <class Value, class Convert>
  void read_voxels(std::span<Value> out, const Convert &convert) {
    piece_.resize(kPieceVoxels * size_of(voxels_.type));
    while (!out.empty()) {
      const std::size_t count = std::min(kPieceVoxels, out.size());
      const std::span bytes = std::span(piece_).first(count * size_of(voxels_.type));
      read_exactly(bytes);
      if (voxels_.big_endian) swap_bytes(bytes, size_of(voxels_.type));
      convert(voxels_, bytes, out.first(count));
      out = out.subspan(count);
    }
  }

  void skip(std::uint64_t num_voxels) {
    piece_.resize(kPieceVoxels * size_of(voxels_.type));
    while (num_voxels > 0) {
      const auto count = std::size_t(std::min<std::uint64_t>(kPieceVoxels, num_voxels));
      read_exactly(std::span(piece_).first(count * size_of(voxels_.type)));
      num_voxels -= count;
    }
  }

  /// Bytes that stand before the voxels.
  void skip_bytes(std::uint64_t count) {
    piece_.resize(kPieceVoxels * size_of(voxels_.type));
    while (count > 0) {
      const std::span bytes =
          std::span(piece_).first(std::min<std::uint64_t>(piece_.size(), count));
      if (source_->read(bytes) < bytes.size()) fail_size("truncated");
      count -= bytes.size();
    }
  }

  void read_exactly(std::span<std::byte> bytes) {
    const std::size_t count = source_->read(bytes);
    bytes_read_ += count;
    if (count < bytes.size()) fail_size("truncated");
  }

  /// After the file's last layer nothing may follow. Also makes zlib check the stream's checksum.
  void check_end() {
    if (voxels_.step + 1 < voxels_.num_steps) return;
    std::vector<std::byte> rest(1u << 18);
    const std::size_t count = source_->read(rest);
    bytes_read_ += count;
    if (count > 0) fail_size("too long", count == rest.size() ? "at least " : "");
  }

  [[noreturn]] void fail_size(std::string_view how, std::string_view at_least = "") const {
    isowave::core::fail_size(
        info_, voxels_, how, fmt::format("{}", of_all_steps(num_bytes(info_, voxels_), voxels_)),
        fmt::format("{}{}", at_least, num_bytes(info_, voxels_) * voxels_.step + bytes_read_));
  }

  VoxelLayout voxels_;
  std::unique_ptr<ByteSource> source_;
  std::vector<std::byte> piece_;
  std::uint64_t bytes_read_ = 0;
  std::uint32_t next_layer_ = 0;
  bool begun_ = false, end_checked_ = false;
};

bool is_compressed(VoxelEncoding encoding) {
  return encoding == VoxelEncoding::kGzip || encoding == VoxelEncoding::kGzipOrZlib;
}

/// The place in the file at which voxels of all steps, or the compressed data that holds them,
/// begin.
std::uint64_t find_begin(const VolumeHeader &header) {
  const VoxelLayout &voxels = header.voxels;
  const std::shared_ptr<const InputFile> &file = voxels.file;
  const std::uint64_t bytes = of_all_steps(num_bytes(header.info, voxels), voxels);
  std::uint64_t begin = std::min(voxels.offset, file->size());
  if (voxels.from_end) {
    if (file->size() - begin < bytes)
      fail_size(header.info, voxels, "truncated", fmt::format("{}", bytes),
                fmt::format("{}", file->size() - begin));
    return file->size() - bytes;
  }
  CharacterSource characters(file, begin);
  for (std::uint64_t line = 0; line < voxels.lines_to_skip; ++line) {
    std::optional<char> c;
    do {
      c = characters.next();
      if (!c)
        throw Error("{}: truncated: {} {} to skip, found {}", file->what(), voxels.lines_to_skip,
                    plural(voxels.lines_to_skip, "line", "lines"), line);
      ++begin;
    } while (*c != '\n');
  }
  if (is_compressed(voxels.encoding)) return begin;
  return begin + std::min(voxels.bytes_to_skip, file->size() - begin);
}

/// Refuses at once what cannot be right: `found` bytes of the file from where voxels begin.
void check_size(const VolumeHeader &header, std::uint64_t found) {
  const VoxelLayout &voxels = header.voxels;
  const std::uint64_t bytes = of_all_steps(num_bytes(header.info, voxels), voxels);
  std::uint64_t least = bytes;
  if (voxels.encoding == VoxelEncoding::kHex) least = bytes * 2;
  if (voxels.encoding == VoxelEncoding::kText)
    least = of_all_steps(header.info.num_voxels(), voxels) * 2 - 1;  // a digit each, and spaces
  if (is_compressed(voxels.encoding)) {
    least = bytes / kMaxDeflateRatio;
    if (voxels.packed_bytes && *voxels.packed_bytes != found) {
      throw Error("{}: {} bytes of compressed voxels, but the header says {}", voxels.file->what(),
                  found, *voxels.packed_bytes);
    }
  }
  const bool is_raw = voxels.encoding == VoxelEncoding::kRaw;
  if (found >= least && (!is_raw || found == least)) return;
  fail_size(header.info, voxels, found < least ? "truncated" : "too long",
            fmt::format("{}{}", is_raw ? "" : "at least ", least), fmt::format("{}", found));
}

/// A source, and the bytes of it that stand before the voxels.
struct OpenedFile {
  std::unique_ptr<ByteSource> source;
  std::uint64_t to_skip = 0;
};

/// before: bytes of voxels that are left out at the begin
OpenedFile open_file(const VolumeHeader &header, std::uint64_t before) {
  const VoxelLayout &voxels = header.voxels;
  const std::shared_ptr<const InputFile> &file = voxels.file;
  const std::uint64_t begin = find_begin(header);
  check_size(header, file->size() - begin);
  const std::uint64_t packed_before =
      before + (is_compressed(voxels.encoding) ? voxels.bytes_to_skip : 0);
  switch (voxels.encoding) {
    case VoxelEncoding::kRaw:
      return {std::make_unique<FileSource>(file, begin + before)};
    case VoxelEncoding::kGzip:
      return {std::make_unique<InflateSource>(FileSource(file, begin), Packing::kGzip),
              packed_before};
    case VoxelEncoding::kGzipOrZlib:
      return {std::make_unique<InflateSource>(FileSource(file, begin), Packing::kGzipOrZlib),
              packed_before};
    case VoxelEncoding::kHex:
      return {std::make_unique<HexSource>(file, begin), packed_before};
    case VoxelEncoding::kText:
      return {std::make_unique<NumberSource>(file, begin, voxels.type), packed_before};
  }
  throw std::invalid_argument("open_file: no such encoding");
}

/// The voxels of VoxelLayout::files, one file after the other. Refuses a file that does not end
/// with its voxels.
class FilesSource : public ByteSource {
 public:
  /// Looks at all files.
  ///
  /// before  bytes of voxels that are left out at the begin
  FilesSource(const VolumeHeader &header, std::uint64_t before) : part_(header) {
    VoxelLayout &voxels = part_.voxels;
    bytes_each_ = voxels.files->voxels_each() * size_of(voxels.type);
    voxels.step = 0;
    set_part_dims();
    for (std::uint64_t i = 0; i < voxels.files->size(); ++i) open_part(i);
    next_file_ = before / bytes_each_;
    to_skip_ = before % bytes_each_;
  }

  /// Bytes of this source before the first voxel that is wanted.
  std::uint64_t to_skip() const { return to_skip_; }

  std::size_t read(std::span<std::byte> bytes) override {
    std::size_t done = 0;
    while (done < bytes.size()) {
      if (left_ == 0 && !begin_next_file()) break;
      const auto count = std::size_t(std::min<std::uint64_t>(bytes.size() - done, left_));
      if (opened_.source->read(bytes.subspan(done, count)) < count) fail("truncated");
      done += count;
      left_ -= count;
      if (left_ == 0) check_file_end();
    }
    return done;
  }

 private:
  /// The grid and steps of a file, for messages and the check of its size.
  void set_part_dims() {
    const std::uint64_t count = part_.voxels.files->voxels_each();
    const glm::uvec3 dims = part_.info.dims;
    const std::uint64_t row = dims.x, layer = row * dims.y, volume = layer * dims.z;
    part_.voxels.num_steps = std::uint32_t(std::max<std::uint64_t>(count / volume, 1));
    if (count >= volume) return;
    part_.info.dims = count >= layer ? glm::uvec3(dims.x, dims.y, count / layer)
                      : count >= row ? glm::uvec3(dims.x, count / row, 1)
                                     : glm::uvec3(count, 1, 1);
  }

  void open_part(std::uint64_t index) {
    part_.voxels.file = part_.voxels.files->open(index);
    opened_ = open_file(part_, 0);
  }

  /// Goes to the first voxel of the next file. Returns whether there is one.
  bool begin_next_file() {
    if (next_file_ == part_.voxels.files->size()) return false;
    open_part(next_file_++);
    std::vector<std::byte> skipped(1u << 16);
    while (opened_.to_skip > 0) {
      const std::span piece =
          std::span(skipped).first(std::min<std::uint64_t>(skipped.size(), opened_.to_skip));
      if (opened_.source->read(piece) < piece.size()) fail("truncated");
      opened_.to_skip -= piece.size();
    }
    left_ = bytes_each_;
    return true;
  }

  void check_file_end() {
    std::vector<std::byte> rest(size_of(part_.voxels.type));
    if (opened_.source->read(rest) > 0) fail("too long");
  }

  [[noreturn]] void fail(std::string_view how) const {
    throw Error("{}: {}: {} bytes of voxels are its share", part_.voxels.file->what(), how,
                bytes_each_);
  }

  VolumeHeader part_;
  OpenedFile opened_{};
  std::uint64_t bytes_each_ = 0, left_ = 0, next_file_ = 0, to_skip_ = 0;
};

/// Throws  Error: float64 does not hold the integer
template <class T>
void check_held_by_double(T voxel) {
  if constexpr (std::is_integral_v<T> && sizeof(T) == 8) {
    using Unsigned = std::make_unsigned_t<T>;
    const auto magnitude =
        voxel < T{0} ? Unsigned{0} - static_cast<Unsigned>(voxel) : static_cast<Unsigned>(voxel);
    if (magnitude == 0 || std::bit_width(magnitude) - std::countr_zero(magnitude) <=
                              std::numeric_limits<double>::digits)
      return;
    throw Error("a voxel is {}: integers of 64 bits are read if float64 holds them", voxel);
  }
}

template <class Value>
void convert_voxels(VoxelType type, std::span<const std::byte> voxels, std::span<Value> out) {
  if (voxels.size() != out.size() * size_of(type))
    throw std::invalid_argument("convert_voxels: sizes differ");
  with_voxel_type(type, [&]<class T>(T voxel) {
    for (std::size_t i = 0; i < out.size(); ++i) {
      std::memcpy(&voxel, voxels.data() + i * sizeof(T), sizeof(T));
      check_held_by_double(voxel);
      out[i] = static_cast<Value>(voxel);
    }
  });
}

}  // namespace

void convert_to_float(VoxelType type, std::span<const std::byte> voxels, std::span<float> out) {
  convert_voxels(type, voxels, out);
}
void convert_to_double(VoxelType type, std::span<const std::byte> voxels, std::span<double> out) {
  convert_voxels(type, voxels, out);
}

std::optional<std::uint32_t> parse_index(std::string_view name, std::string_view text) {
  if (text.empty()) return {};
  constexpr std::string_view kAxis = "t=";
  const auto step =
      text.starts_with(kAxis) ? parse_all<std::uint32_t>(text.substr(kAxis.size())) : std::nullopt;
  if (!step) throw Error("{} {}: give t=N, counted from 0, such as t=3", name, text);
  return step;
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
    const std::optional<std::uint32_t> count = parse_all<std::uint32_t>(dims.substr(0, end));
    if (!count) return std::nullopt;
    result.dims[axis] = *count;
    dims.remove_prefix(std::min(end + 1, dims.size()));
  }
  return result;
}

std::unique_ptr<VolumeReader> open_voxels(const VolumeHeader &header) {
  const VoxelLayout &voxels = header.voxels;
  const std::uint64_t before = num_bytes(header.info, voxels) * voxels.step;
  VolumeHeader remaining = header;
  if (voxels.encoding == VoxelEncoding::kText) remaining.voxels.big_endian = false;
  if (voxels.files) {
    auto source = std::make_unique<FilesSource>(header, before);
    remaining.voxels.bytes_to_skip = source->to_skip();
    return std::make_unique<RawReader>(remaining, std::move(source));
  }
  OpenedFile file = open_file(header, before);
  remaining.voxels.bytes_to_skip = file.to_skip;
  return std::make_unique<RawReader>(remaining, std::move(file.source));
}

std::unique_ptr<VolumeReader> open_raw(const std::shared_ptr<const InputFile> &file,
                                       bool is_gzipped, const RawOverrides &overrides) {
  const fs::path stem = is_gzipped ? file->path().stem().stem() : file->path().stem();
  const std::optional<RawName> name = parse_raw_name(stem.string());
  if (!name && !(overrides.dims && overrides.type)) {
    throw Error(
        "{}: the name does not end in _XxYxZ_TYPE (as in head_256x256x113_uint16.raw): give dims "
        "and type",
        file->what());
  }
  VolumeHeader header;
  header.info.dims = overrides.dims ? *overrides.dims : name->dims;
  header.info.type = overrides.type ? *overrides.type : name->type;
  header.info.spacing = overrides.spacing.value_or(glm::dvec3(1.0));
  check_volume_info(header.info, file->what());
  header.voxels.file = file;
  header.voxels.encoding = is_gzipped ? VoxelEncoding::kGzip : VoxelEncoding::kRaw;
  header.voxels.type = header.info.type;
  return open_voxels(header);
}

}  // namespace isowave::core
