#include "core/zfp_file.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <type_traits>

#include "core/error.hpp"
#include "core/io/byte_source.hpp"
#include "core/io/file_bytes.hpp"
#include "core/level_bounds.hpp"
#include "core/libzfp.hpp"
#include "core/pyramid.hpp"
#include "core/zfp_accuracy.hpp"
#include "kernels_cl/block_bound.h"

namespace isowave {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::uint32_t kVersion = 1, kIndexedVersion = 2, kPyramidVersion = 4;
constexpr std::uint32_t kBoundlessPyramidVersion = 3;  ///< as before levels had bounds: is read, not written
constexpr std::array<char, 8> kMagic{'I', 'S', 'O', 'W', 'A', 'V', 'E', '\n'};
constexpr std::uint64_t kMaxJsonBytes = 1u << 20;
constexpr std::uint32_t kMinBlockBits = 9;  // "not empty" and the exponent; libzfp reads them at any rate
constexpr std::uint32_t kMaxBlockBits = 2048;

struct Footer {
  std::uint32_t version, json_bytes, stream_crc, json_crc;
  std::array<char, 8> magic;
};
static_assert(sizeof(Footer) == 24);

std::uint32_t update_crc(std::uint32_t crc, std::span<const std::byte> bytes) {
  if (bytes.empty()) return crc;  // zlib takes a null pointer for the wish to begin
  return std::uint32_t(::crc32_z(crc, reinterpret_cast<const Bytef *>(bytes.data()), bytes.size()));
}

std::uint32_t json_crc(std::string_view text, const Footer &footer) {
  const std::array<std::uint32_t, 3> numbers{footer.version, footer.json_bytes, footer.stream_crc};
  return update_crc(update_crc(0, std::as_bytes(std::span(text))), std::as_bytes(std::span(numbers)));
}

/// What stands between a stream and its trailer [bytes].
struct PartSizes {
  std::uint64_t index = 0, bounds = 0;
  bool bounds_count_casts = true;  ///< else they are of no use
};

json to_json(const CompressedVolume &volume, const PartSizes &sizes,
             std::span<const std::uint64_t> level_bytes) {
  const VolumeInfo &info = volume.info;
  json trailer;
  trailer["spacing"] = {info.spacing.x, info.spacing.y, info.spacing.z};
  trailer["origin"] = {info.origin.x, info.origin.y, info.origin.z};
  for (int column = 0; column < 3; ++column) {
    trailer["direction"].push_back(
        {info.direction[column].x, info.direction[column].y, info.direction[column].z});
  }
  trailer["type"] = to_string(info.type);
  if (std::isfinite(volume.value_range[0])) trailer["value_range"] = volume.value_range;
  if (volume.max_error) trailer["max_error"] = *volume.max_error;
  if (!fits_float32(info.type)) trailer["cast_counts"] = true;
  if (volume.is_indexed()) {
    trailer["payload_bits"] = volume.indexed_bits;
    trailer["index_bytes"] = sizes.index;
    trailer["whole_numbers"] = volume.error_bound.whole_numbers;
  }
  if (sizes.bounds != 0) {
    trailer["bounds_bytes"] = sizes.bounds;
    trailer["bounds_exponent"] = volume.bounds.exponent;
    if (volume.bounds.by_place) trailer["bounds_by_place"] = ISO_BOUND_PLACES_RULE;
  }
  if (!level_bytes.empty()) trailer["level_bytes"] = level_bytes;
  return trailer;
}

/// A number of the trailer. json would turn others than T has into some T.
template <typename T>
T number_from(const json &value) {
  if constexpr (std::is_unsigned_v<T>) {
    if (!value.is_number_unsigned()) throw Error("a count is a {}", value.type_name());
  } else if constexpr (std::is_integral_v<T>) {
    if (!value.is_number_integer() || value.get<std::int64_t>() != std::int64_t{value.get<T>()})
      throw Error("an integer is a {}, or too large", value.type_name());
  } else if (!value.is_number() ||
             !(std::abs(value.get<double>()) <= double{std::numeric_limits<T>::max()})) {
    throw Error("a number is a {}, or too large", value.type_name());
  }
  return value.get<T>();
}

glm::dvec3 vector_from(const json &value) {
  if (value.size() != 3) throw Error("{} numbers where 3 must be", value.size());
  return {number_from<double>(value.at(0)), number_from<double>(value.at(1)),
          number_from<double>(value.at(2))};
}

VoxelType type_from(const json &value) {
  const auto name = value.get<std::string>();
  if (!std::ranges::all_of(name, [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); }))
    throw Error("its voxels have no type");
  return voxel_type_from_string(name);
}

/// Of types that float32 does not hold, errors in older files leave out the cast: nothing is known then.
bool counts_casts(const json &trailer, const VolumeInfo &info) {
  return fits_float32(info.type) || trailer.value("cast_counts", json(false)) == true;
}

void apply_errors(const json &trailer, CompressedVolume &volume) {
  if (trailer.contains("value_range")) {
    const json &range = trailer["value_range"];
    volume.value_range = {number_from<float>(range.at(0)), number_from<float>(range.at(1))};
    if (volume.value_range[0] > volume.value_range[1])
      throw Error("{} to {} is no range", volume.value_range[0], volume.value_range[1]);
  }
  if (trailer.contains("max_error")) {
    const auto max_error = number_from<double>(trailer["max_error"]);
    if (max_error < 0) throw Error("{} is no error", max_error);
    if (counts_casts(trailer, volume.info)) volume.max_error = max_error;
  }
  if (volume.is_indexed()) volume.error_bound.max_error = volume.max_error;
}

/// Sets level_bytes to those of the coarser levels.
PartSizes apply_json(const std::string &text, CompressedVolume &volume,
                     std::vector<std::uint64_t> &level_bytes) {
  const json trailer = json::parse(text);
  volume.info.spacing = vector_from(trailer.at("spacing"));
  volume.info.origin = vector_from(trailer.at("origin"));
  for (int column = 0; column < 3; ++column) {
    volume.info.direction[column] = vector_from(trailer.at("direction").at(std::size_t(column)));
  }
  volume.info.type = type_from(trailer.at("type"));
  apply_errors(trailer, volume);
  if (trailer.contains("level_bytes")) {
    for (const json &bytes : trailer["level_bytes"]) level_bytes.push_back(number_from<std::uint64_t>(bytes));
  }
  PartSizes sizes;
  sizes.bounds_count_casts = counts_casts(trailer, volume.info);
  if (trailer.contains("bounds_bytes")) {
    sizes.bounds = number_from<std::uint64_t>(trailer["bounds_bytes"]);
    volume.bounds.exponent = number_from<std::int32_t>(trailer.at("bounds_exponent"));
    // Of another rule, all voxels of a block have its whole bound.
    volume.bounds.by_place = trailer.value("bounds_by_place", json(0)) == ISO_BOUND_PLACES_RULE;
  }
  if (!volume.is_indexed()) return sizes;
  volume.indexed_bits = number_from<std::uint64_t>(trailer.at("payload_bits"));
  volume.error_bound.whole_numbers = trailer.at("whole_numbers").get<bool>();
  sizes.index = number_from<std::uint64_t>(trailer.at("index_bytes"));
  return sizes;
}

/// zlib's stream, closed whatever happens.
struct Inflater : z_stream {
  Inflater() : z_stream{} {
    if (::inflateInit(this) != Z_OK) throw std::bad_alloc();
  }
  ~Inflater() { ::inflateEnd(this); }
  Inflater(const Inflater &) = delete;
  Inflater &operator=(const Inflater &) = delete;
};
struct Deflater : z_stream {
  Deflater() : z_stream{} {
    if (::deflateInit(this, Z_DEFAULT_COMPRESSION) != Z_OK) throw std::bad_alloc();
  }
  ~Deflater() { ::deflateEnd(this); }
  Deflater(const Deflater &) = delete;
  Deflater &operator=(const Deflater &) = delete;
};

constexpr std::size_t kItemsAtOnce = 1u << 15;

/// A piece of a file.
struct FilePart {
  const FileBytes &file;
  std::uint64_t begin = 0, size = 0;
};

/// Calls take(items) with `total` items of a deflated piece of a file, a few at a time, until it returns false. Returns whether all of
/// that worked.
template <typename T, typename Take>
bool inflate_items(const FilePart &deflated, std::uint64_t total, const Take &take) {
  Inflater inflater;
  std::vector<std::byte> in(std::min<std::uint64_t>(deflated.size, 1u << 18));
  std::uint64_t in_done = 0;
  std::vector<T> items;
  for (std::uint64_t done = 0; done < total; done += items.size()) {
    items.resize(std::min<std::uint64_t>(kItemsAtOnce, total - done));
    inflater.next_out = reinterpret_cast<Bytef *>(items.data());
    inflater.avail_out = static_cast<uInt>(items.size() * sizeof(T));
    while (inflater.avail_out > 0) {
      if (inflater.avail_in == 0) {
        in.resize(std::min<std::uint64_t>(in.size(), deflated.size - in_done));
        deflated.file.read(deflated.begin + in_done, in);
        in_done += in.size();
        inflater.next_in = reinterpret_cast<Bytef *>(in.data());
        inflater.avail_in = static_cast<uInt>(in.size());
      }
      const int status = ::inflate(&inflater, Z_NO_FLUSH);
      if (status != Z_OK && inflater.avail_out > 0) return false;
    }
    if (!take(std::span<const T>(items))) return false;
  }
  return true;
}

/// Calls take(length) for so many blocks, whose lengths are deflated. Returns whether they are.
template <typename Take>
bool inflate_lengths(const FilePart &deflated, std::uint64_t num_blocks, const Take &take) {
  return inflate_items<std::uint16_t>(deflated, num_blocks, [&](std::span<const std::uint16_t> lengths) {
    for (const std::uint16_t length : lengths) {
      if (length < 1 || length > ISO_MAX_BLOCK_BITS) return false;
      take(length);
    }
    return true;
  });
}

/// A `.zfp` file being read: the checks in the order in which the file is trusted.
class ZfpFileReader {
 public:
  explicit ZfpFileReader(const fs::path &path)
      : path_(path), file_(std::make_shared<FileBytes>(path)), file_size_(file_->size()) {
    read_head();
  }

  CompressedVolume take_info() {
    for (ZfpFileReader &level : levels_) volume_.coarser.push_back(level.take_info());
    return std::move(volume_);
  }

  /// keep: the index and bounds, and the file.
  CompressedVolume take_checked(bool keep) {
    check_sum();
    return take(keep);
  }

 private:
  /// A level of detail: a file in the file.
  ZfpFileReader(const ZfpFileReader &finer, std::uint64_t begin, std::uint64_t size)
      : path_(finer.path_), file_(finer.file_), begin_(begin), file_size_(size), is_level_(true) {
    read_head();
    if (!has_trailer_ || volume_.info.dims != coarser_level(finer.volume_.info).dims) refuse_level();
    volume_.info = coarser_level(finer.volume_.info);
    sizes_.bounds_count_casts = finer.sizes_.bounds_count_casts;
  }

  [[noreturn]] void refuse_level() const {
    throw Error("{}: damaged: one of its levels of detail is none", path_.string());
  }

  void read_head() {
    read_header();
    read_trailer();
    check_volume_info(volume_.info, path_.string());
    if (level_bytes_.size() > (is_level_ ? 0 : max_levels(volume_.info.dims) - 1)) refuse_level();
    std::uint64_t begin = begin_ + stream_bytes_ + sizes_.index + sizes_.bounds;
    for (const std::uint64_t bytes : level_bytes_) {
      levels_.push_back(ZfpFileReader(levels_.empty() ? *this : levels_.back(), begin, bytes));
      begin += bytes;
    }
  }

  std::uint64_t bytes_before_trailer() const {
    return std::accumulate(level_bytes_.begin(), level_bytes_.end(),
                           stream_bytes_ + sizes_.index + sizes_.bounds);
  }

  /// That of everything before the trailer.
  void check_sum() const {
    if (!has_trailer_) return;
    std::vector<std::byte> piece(1u << 16);
    std::uint32_t crc = 0;
    for (std::uint64_t at = 0, end = bytes_before_trailer(); at < end; at += piece.size()) {
      piece.resize(std::min<std::uint64_t>(piece.size(), end - at));
      file_->read(at, piece);
      crc = update_crc(crc, piece);
    }
    if (crc != stream_crc_)
      throw Error("{}: damaged: the checksum of its stream does not match", path_.string());
  }

  CompressedVolume take(bool keep) {
    volume_.file = file_;
    volume_.file_first_bit = 8 * begin_ + header_bits_;
    if (volume_.is_indexed()) read_index(keep);
    if (sizes_.bounds != 0) read_bounds(keep);
    for (ZfpFileReader &level : levels_) volume_.coarser.push_back(level.take(keep));
    if (!keep) volume_.file.reset();
    return std::move(volume_);
  }

  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
    file_->read(begin_ + offset, bytes);
  }

  /// A file of zfp's own tool has no index: its blocks must be decoded to know where they are.
  void read_index(bool keep) {
    const std::uint64_t num_blocks = volume_.block_count();
    if (volume_.indexed_bits < num_blocks) {  // before memory is taken for them
      throw Error("{}: truncated: {} blocks cannot come from {} bytes", path_.string(), num_blocks,
                  file_size_);
    }
    BlockIndexBuilder index;
    if (keep) index.reserve(num_blocks);
    std::uint64_t end = 0;
    const auto take = [&](std::uint32_t bits, std::uint64_t count) {
      end += bits * count;
      for (std::uint64_t i = 0; keep && i < count; ++i) index.add(bits);
    };
    bool is_whole = true;
    if (has_trailer_) {
      is_whole = inflate_lengths({*file_, begin_ + stream_bytes_, sizes_.index}, num_blocks,
                                 [&](std::uint32_t bits) { take(bits, 1); });
    } else {
      find_block_lengths(volume_, path_.string(), take);
      const std::uint64_t used = (header_bits_ + end + 63) / 64 * 8;
      if (file_size_ > used) {
        throw Error("{}: damaged: {} unknown bytes after the zfp stream", path_.string(), file_size_ - used);
      }
    }
    if (!is_whole || (has_trailer_ && end != volume_.indexed_bits)) {
      throw Error("{}: damaged: the lengths of its blocks are not those of its stream", path_.string());
    }
    volume_.indexed_bits = end;
    if (keep) volume_.index = index.finish();
  }

  void read_bounds(bool keep) {
    const std::uint64_t num_blocks = volume_.block_count();
    std::vector<std::uint8_t> &codes = volume_.bounds.codes;
    const FilePart deflated{*file_, begin_ + stream_bytes_ + sizes_.index, sizes_.bounds};
    if (num_blocks / kMaxDeflateRatio > sizes_.bounds) refuse_bounds();
    if (keep) codes.reserve(num_blocks);
    const bool whole =
        inflate_items<std::uint8_t>(deflated, num_blocks, [&](std::span<const std::uint8_t> some) {
          codes.insert(codes.end(), some.begin(), some.end());
          if (!keep) codes = {std::ranges::max(codes)};
          return true;
        });
    const std::int32_t exponent = volume_.bounds.exponent;
    if (!whole || exponent < kMinBoundExponent || exponent > kMaxBoundExponent) refuse_bounds();
    if (!sizes_.bounds_count_casts) volume_.bounds = {};
  }

  [[noreturn]] void refuse_bounds() const {
    throw Error("{}: damaged: a level of detail has no bounds of its errors", path_.string());
  }

  void read_header() {
    std::array<std::uint64_t, (ZFP_HEADER_MAX_BITS + 63) / 64 + 1> buffer{};
    const std::size_t available = std::min<std::uint64_t>(file_size_, ZFP_HEADER_MAX_BITS / 8 + 1);
    read_at(0, std::as_writable_bytes(std::span(buffer)).first(available));

    const ZfpBits bits(stream_open(buffer.data(), sizeof(buffer)), &stream_close);
    const ZfpStream stream(zfp_stream_open(bits.get()), &zfp_stream_close);
    const ZfpField field(zfp_field_alloc(), &zfp_field_free);
    header_bits_ = zfp_read_header(stream.get(), field.get(), ZFP_HEADER_FULL);
    if (header_bits_ == 0 || header_bits_ > available * 8) {
      throw Error("{}: not a zfp file: no full zfp header (as `zfp -h` writes it)", path_.string());
    }
    check_kind(*stream, *field);
    volume_.info.dims = glm::uvec3(field->nx, field->ny, field->nz);
    volume_.info.type = VoxelType::kFloat32;
    const bool fixed_rate = zfp_stream_compression_mode(stream.get()) == zfp_mode_fixed_rate;
    volume_.bits_per_block = fixed_rate ? stream->maxbits : 0;
    if (!fixed_rate) volume_.error_bound.min_exponent = stream->minexp;
    volume_.value_range = {-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};

    if (!fixed_rate) {  // how long the stream is, a trailer tells, or else the file
      if (volume_.block_count() >= std::numeric_limits<std::uint32_t>::max()) {
        throw Error("{}: {}x{}x{} voxels: too many for blocks of lengths of their own", path_.string(),
                    field->nx, field->ny, field->nz);
      }
      stream_bytes_ = file_size_;
      volume_.indexed_bits = 8 * file_size_ - header_bits_;
      return;
    }
    const std::uint64_t total_bits = header_bits_ + volume_.block_count() * volume_.bits_per_block;
    stream_bytes_ = (total_bits + 63) / 64 * 8;
    // libzfp can be built with smaller words: its files may end before the 64-bit word does.
    const std::uint64_t least_bytes = (total_bits + 7) / 8;
    if (file_size_ < least_bytes) {
      throw Error("{}: truncated: {}x{}x{} voxels at {} bits per block need {} bytes, found {}",
                  path_.string(), field->nx, field->ny, field->nz, volume_.bits_per_block, least_bytes,
                  file_size_);
    }
    stream_bytes_ = std::min(stream_bytes_, file_size_);
  }

  void check_kind(const zfp_stream &stream, const zfp_field &field) const {
    constexpr std::array<const char *, 5> kTypes{"unknown", "int32", "int64", "float32", "float64"};
    if (field.type != zfp_type_float) {
      throw Error("{}: zfp values of type {}: only float32 is supported", path_.string(),
                  kTypes.at(field.type));
    }
    const unsigned axes = zfp_field_dimensionality(&field);
    if (axes != 3) throw Error("{}: a {}D zfp array: only 3D is supported", path_.string(), axes);
    constexpr std::array<const char *, 6> kModes{"unknown",         "expert",         "fixed rate",
                                                 "fixed precision", "fixed accuracy", "reversible"};
    const zfp_mode mode = zfp_stream_compression_mode(&stream);
    if (mode == zfp_mode_fixed_accuracy) return;
    if (mode != zfp_mode_fixed_rate) {
      throw Error("{}: zfp mode '{}': only fixed rate (zfp -r) and fixed accuracy (zfp -a) are supported",
                  path_.string(), kModes.at(mode));
    }
    if (stream.maxbits < kMinBlockBits || stream.maxbits > kMaxBlockBits) {
      throw Error("{}: {} bits per zfp block: only {} to {} are supported", path_.string(), stream.maxbits,
                  kMinBlockBits, kMaxBlockBits);
    }
  }

  void read_trailer() {
    if (!volume_.is_indexed() && file_size_ == stream_bytes_) return;
    const std::uint64_t trailer_bytes =
        file_size_ - (volume_.is_indexed() ? header_bits_ / 8 : stream_bytes_);
    Footer footer{};
    const auto footer_bytes = std::as_writable_bytes(std::span(&footer, 1));
    if (trailer_bytes >= sizeof(Footer)) read_at(file_size_ - sizeof(Footer), footer_bytes);
    if (footer.magic != kMagic) {
      if (volume_.is_indexed()) return;  // a file of zfp's own tool
      throw Error("{}: damaged: {} unknown bytes after the zfp stream", path_.string(), trailer_bytes);
    }
    const std::uint32_t known = volume_.is_indexed() ? kIndexedVersion : kVersion;
    if (footer.version != known && footer.version != kBoundlessPyramidVersion &&
        footer.version != kPyramidVersion) {
      throw Error("{}: its trailer has version {}, this program knows {} and {}", path_.string(),
                  footer.version, known, kPyramidVersion);
    }
    const std::uint64_t json_end = file_size_ - sizeof(Footer);
    std::string text;
    if (footer.json_bytes <= kMaxJsonBytes && footer.json_bytes + sizeof(Footer) <= trailer_bytes) {
      text.resize(footer.json_bytes);
      read_at(json_end - footer.json_bytes, std::as_writable_bytes(std::span(text)));
    }
    if (text.empty() || json_crc(text, footer) != footer.json_crc) {
      throw Error("{}: damaged: the checksum of its trailer does not match", path_.string());
    }
    try {
      sizes_ = apply_json(text, volume_, level_bytes_);
    } catch (const json::exception &error) {
      throw Error("{}: broken trailer: {}", path_.string(), error.what());
    } catch (const Error &error) {
      throw Error("{}: broken trailer: {}", path_.string(), error.what());
    }
    check_layout(json_end - footer.json_bytes);
    has_trailer_ = true;
    stream_crc_ = footer.stream_crc;
  }

  /// Header, payload, padding, index, bounds and levels end where the JSON text begins.
  void check_layout(std::uint64_t json_begin) {
    if (volume_.is_indexed()) {
      // Neither sum overflows: a block has at least a bit, and not too many.
      const std::uint64_t bits = volume_.indexed_bits, blocks = volume_.block_count();
      const bool possible = bits >= blocks && bits <= blocks * ISO_MAX_BLOCK_BITS;
      stream_bytes_ =
          possible ? (header_bits_ + bits + 63) / 64 * 8 : std::numeric_limits<std::uint64_t>::max();
    }
    std::uint64_t left = json_begin;
    const auto take = [&left](std::uint64_t bytes) {
      if (bytes > left) return false;
      left -= bytes;
      return true;
    };
    if (!take(stream_bytes_) || !take(sizes_.index) || !take(sizes_.bounds) ||
        !std::ranges::all_of(level_bytes_, take) || left != 0)
      throw Error("{}: damaged: its parts are not as long as its trailer says", path_.string());
  }

  fs::path path_;
  std::shared_ptr<const FileBytes> file_;
  std::uint64_t begin_ = 0;  ///< of this level in the file
  std::uint64_t file_size_ = 0, header_bits_ = 0;
  bool is_level_ = false;
  std::uint64_t stream_bytes_ = 0;  ///< header, payload and padding
  PartSizes sizes_;                 ///< behind them
  std::vector<std::uint64_t> level_bytes_;
  std::vector<ZfpFileReader> levels_;  ///< coarser ones
  bool has_trailer_ = false;
  std::uint32_t stream_crc_ = 0;
  CompressedVolume volume_;
};

std::uint32_t version_of(const CompressedVolume &volume, bool has_levels) {
  return has_levels ? kPyramidVersion : volume.is_indexed() ? kIndexedVersion : kVersion;
}

}  // namespace

ZfpFileWriter::ZfpFileWriter(const fs::path &path, const CompressedVolume &volume) {
  for (std::size_t level = 0; level <= volume.coarser.size(); ++level) {
    const CompressedVolume &at = level == 0 ? volume : volume.coarser[level - 1];
    const ZfpHeader header = make_zfp_header(at.info.dims, at.bits_per_block, at.error_bound.min_exponent);
    parts_.emplace_back(path).write(std::as_bytes(std::span(header)));
  }
}

void ZfpFileWriter::write(std::span<const std::byte> payload, std::size_t level) {
  parts_[level].write(payload);
}

void ZfpFileWriter::commit(const CompressedVolume &volume) {
  Part &all = parts_.front();
  const PartSizes sizes{all.write_index(volume), all.write_bounds(volume)};
  std::vector<std::uint64_t> level_bytes;
  for (std::size_t level = 1; level < parts_.size(); ++level) {
    Part &part = parts_[level];
    const CompressedVolume &coarse = volume.coarser[level - 1];
    const PartSizes part_sizes{part.write_index(coarse), part.write_bounds(coarse)};
    part.write_trailer(to_json(coarse, part_sizes, {}).dump(), version_of(coarse, false));
    level_bytes.push_back(part.size);
    part.file.read_back([&all](std::span<const std::byte> bytes) { all.write(bytes); });
  }
  all.write_trailer(to_json(volume, sizes, level_bytes).dump(), version_of(volume, !level_bytes.empty()));
  all.file.commit();
}

void ZfpFileWriter::Part::write(std::span<const std::byte> bytes) {
  file.write(bytes);
  crc = update_crc(crc, bytes);
  size += bytes.size();
}

void ZfpFileWriter::Part::write_trailer(const std::string &text, std::uint32_t version) {
  Footer footer{version, std::uint32_t(text.size()), crc, 0, kMagic};
  footer.json_crc = json_crc(text, footer);
  write(std::as_bytes(std::span(text)));
  write(std::as_bytes(std::span(&footer, 1)));
}

/// Deflates what next() returns, again and again, until that is empty; returns its size.
template <typename T>
std::uint64_t ZfpFileWriter::Part::write_deflated(const std::function<std::span<const T>()> &next) {
  const std::uint64_t begin = size;
  Deflater deflater;
  std::vector<std::byte> out(1u << 16);
  for (bool last = false; !last;) {
    const std::span<const T> items = next();
    last = items.empty();
    deflater.next_in = const_cast<Bytef *>(reinterpret_cast<const Bytef *>(items.data()));
    deflater.avail_in = static_cast<uInt>(items.size_bytes());
    do {
      deflater.next_out = reinterpret_cast<Bytef *>(out.data());
      deflater.avail_out = static_cast<uInt>(out.size());
      ::deflate(&deflater, last ? Z_FINISH : Z_NO_FLUSH);
      write(std::span(out).first(out.size() - deflater.avail_out));
    } while (deflater.avail_out == 0);
  }
  return size - begin;
}

/// Behind the padding of the payload; returns its size, 0 at a fixed rate.
std::uint64_t ZfpFileWriter::Part::write_index(const CompressedVolume &volume) {
  const std::array<std::byte, 8> zeros{};
  write(std::span(zeros).first((8 - size % 8) % 8));
  if (!volume.is_indexed()) return 0;
  const std::uint64_t num_blocks = volume.block_count();
  std::uint64_t done = 0;
  std::vector<std::uint16_t> lengths;
  return write_deflated<std::uint16_t>([&] {
    lengths.resize(std::min<std::uint64_t>(kItemsAtOnce, num_blocks - done));
    for (std::uint16_t &length : lengths)
      length = static_cast<std::uint16_t>(volume.block_bits(static_cast<std::uint32_t>(done++)));
    return std::span<const std::uint16_t>(lengths);
  });
}

/// Behind the index; returns its size, 0 where there are none.
std::uint64_t ZfpFileWriter::Part::write_bounds(const CompressedVolume &volume) {
  std::span<const std::uint8_t> left = volume.bounds.codes;
  if (left.empty()) return 0;
  return write_deflated<std::uint8_t>([&] {
    const std::span<const std::uint8_t> some = left.first(std::min(kItemsAtOnce, left.size()));
    left = left.subspan(some.size());
    return some;
  });
}

CompressedVolume read_zfp_file(const fs::path &path) {
  CompressedVolume volume = open_zfp_file(path);
  std::vector<std::uint32_t> words(volume.word_count());
  volume.read_words(0, words);
  volume.words = std::move(words);
  volume.file.reset();
  return volume;
}
CompressedVolume open_zfp_file(const fs::path &path) {
  return ZfpFileReader(path).take_checked(true);
}
CompressedVolume check_zfp_file(const fs::path &path) {
  return ZfpFileReader(path).take_checked(false);
}
CompressedVolume read_zfp_file_info(const fs::path &path) {
  return ZfpFileReader(path).take_info();
}

}  // namespace isowave
