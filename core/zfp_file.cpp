#include "core/zfp_file.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>

#include "core/error.hpp"
#include "core/io/mapped_file.hpp"
#include "core/libzfp.hpp"

namespace isowave {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::uint32_t kVersion = 1;
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
  return std::uint32_t(::crc32_z(crc, reinterpret_cast<const Bytef *>(bytes.data()), bytes.size()));
}

std::uint32_t json_crc(std::string_view text, const Footer &footer) {
  const std::array<std::uint32_t, 3> numbers{footer.version, footer.json_bytes, footer.stream_crc};
  return update_crc(update_crc(0, std::as_bytes(std::span(text))), std::as_bytes(std::span(numbers)));
}

json to_json(const CompressedVolume &volume) {
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
  return trailer;
}

glm::dvec3 vector_from(const json &value) {
  const auto numbers = value.get<std::array<double, 3>>();
  return {numbers[0], numbers[1], numbers[2]};
}

void apply_json(const std::string &text, CompressedVolume &volume) {
  const json trailer = json::parse(text);
  volume.info.spacing = vector_from(trailer.at("spacing"));
  volume.info.origin = vector_from(trailer.at("origin"));
  for (int column = 0; column < 3; ++column) {
    volume.info.direction[column] = vector_from(trailer.at("direction").at(std::size_t(column)));
  }
  volume.info.type = voxel_type_from_string(trailer.at("type").get<std::string>());
  if (trailer.contains("value_range"))
    volume.value_range = trailer["value_range"].get<std::array<float, 2>>();
  if (trailer.contains("max_error")) volume.max_error = trailer["max_error"].get<double>();
}

/// A `.zfp` file being read: the checks in the order in which the file is trusted.
class ZfpFileReader {
 public:
  explicit ZfpFileReader(const fs::path &path)
      : path_(path), file_(std::fopen(path.c_str(), "rb"), &std::fclose) {
    if (!file_) throw Error("{}: cannot open: {}", path.string(), std::strerror(errno));
    std::error_code error;
    file_size_ = fs::file_size(path, error);
    if (error) throw Error("{}: cannot open: {}", path.string(), error.message());
    read_header();
    read_trailer();
    check_volume_info(volume_.info, path_.string());
  }

  CompressedVolume take_info() { return std::move(volume_); }

  CompressedVolume take_mapped() {
    volume_.file = std::make_shared<MappedFile>(path_, stream_bytes_);
    volume_.file_first_bit = header_bits_;
    if (has_trailer_ && update_crc(0, volume_.file->bytes()) != stream_crc_) {
      throw Error("{}: damaged: the checksum of its stream does not match", path_.string());
    }
    return std::move(volume_);
  }

 private:
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) {
    if (::fseeko(file_.get(), off_t(offset), SEEK_SET) != 0 ||
        std::fread(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) {
      throw Error("{}: cannot read {} bytes at {}", path_.string(), bytes.size(), offset);
    }
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
    volume_.bits_per_block = stream->maxbits;
    volume_.value_range = {-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};

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
    if (mode != zfp_mode_fixed_rate) {
      throw Error("{}: zfp mode '{}': only fixed rate is supported (zfp -r)", path_.string(),
                  kModes.at(mode));
    }
    if (stream.maxbits < kMinBlockBits || stream.maxbits > kMaxBlockBits) {
      throw Error("{}: {} bits per zfp block: only {} to {} are supported", path_.string(), stream.maxbits,
                  kMinBlockBits, kMaxBlockBits);
    }
  }

  void read_trailer() {
    if (file_size_ == stream_bytes_) return;
    const std::uint64_t trailer_bytes = file_size_ - stream_bytes_;
    Footer footer{};
    const auto footer_bytes = std::as_writable_bytes(std::span(&footer, 1));
    if (trailer_bytes >= sizeof(Footer)) read_at(file_size_ - sizeof(Footer), footer_bytes);
    if (footer.magic != kMagic) {
      throw Error("{}: damaged: {} unknown bytes after the zfp stream", path_.string(), trailer_bytes);
    }
    if (footer.version != kVersion) {
      throw Error("{}: its trailer has version {}, this program knows {}", path_.string(), footer.version,
                  kVersion);
    }
    std::string text;
    if (footer.json_bytes <= kMaxJsonBytes && footer.json_bytes + sizeof(Footer) == trailer_bytes) {
      text.resize(footer.json_bytes);
      read_at(stream_bytes_, std::as_writable_bytes(std::span(text)));
    }
    if (text.empty() || json_crc(text, footer) != footer.json_crc) {
      throw Error("{}: damaged: the checksum of its trailer does not match", path_.string());
    }
    try {
      apply_json(text, volume_);
    } catch (const json::exception &error) {
      throw Error("{}: broken trailer: {}", path_.string(), error.what());
    }
    has_trailer_ = true;
    stream_crc_ = footer.stream_crc;
  }

  fs::path path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE *)> file_;
  std::uint64_t file_size_ = 0, header_bits_ = 0;
  std::uint64_t stream_bytes_ = 0;  ///< header, payload and padding
  bool has_trailer_ = false;
  std::uint32_t stream_crc_ = 0;
  CompressedVolume volume_;
};

}  // namespace

ZfpFileWriter::ZfpFileWriter(const fs::path &path, const CompressedVolume &volume) : file_(path) {
  const ZfpHeader header = make_zfp_header(volume.info.dims, volume.bits_per_block);
  write(std::as_bytes(std::span(header)));
}

void ZfpFileWriter::write(std::span<const std::byte> payload) {
  file_.write(payload);
  crc_ = update_crc(crc_, payload);
  size_ += payload.size();
}

void ZfpFileWriter::commit(const CompressedVolume &volume) {
  const std::array<std::byte, 8> zeros{};
  write(std::span(zeros).first((8 - size_ % 8) % 8));
  const std::string text = to_json(volume).dump();
  Footer footer{kVersion, std::uint32_t(text.size()), crc_, 0, kMagic};
  footer.json_crc = json_crc(text, footer);
  file_.write(text);
  file_.write(std::as_bytes(std::span(&footer, 1)));
  file_.commit();
}

CompressedVolume read_zfp_file(const fs::path &path) {
  CompressedVolume volume = map_zfp_file(path);
  std::vector<std::uint32_t> words(volume.word_count());
  volume.file->check();
  volume.read_words(0, words);
  volume.words = std::move(words);
  volume.file.reset();
  return volume;
}
CompressedVolume map_zfp_file(const fs::path &path) {
  return ZfpFileReader(path).take_mapped();
}
CompressedVolume read_zfp_file_info(const fs::path &path) {
  return ZfpFileReader(path).take_info();
}

}  // namespace isowave
