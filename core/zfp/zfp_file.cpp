#include "core/zfp/zfp_file.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <new>
#include <string>
#include <utility>

#include "core/base/error.hpp"
#include "core/zfp/libzfp.hpp"
#include "core/zfp/zfp_trailer.hpp"

namespace isowave::core {
namespace fs = std::filesystem;

/// zlib's stream, closed whatever happens.
struct Deflater::Stream : z_stream {
  Stream() : z_stream{} {
    if (::deflateInit(this, Z_DEFAULT_COMPRESSION) != Z_OK) throw std::bad_alloc();
  }
  ~Stream() { ::deflateEnd(this); }
  Stream(const Stream &) = delete;
  Stream &operator=(const Stream &) = delete;
};

Deflater::Deflater(Sink sink)
    : sink_(std::move(sink)), stream_(std::make_unique<Stream>()), out_(1u << 16) {}

Deflater::~Deflater() = default;

void Deflater::deflate(std::span<const std::byte> bytes, bool last) {
  stream_->next_in = const_cast<Bytef *>(reinterpret_cast<const Bytef *>(bytes.data()));
  stream_->avail_in = static_cast<uInt>(bytes.size());
  do {
    stream_->next_out = reinterpret_cast<Bytef *>(out_.data());
    stream_->avail_out = static_cast<uInt>(out_.size());
    ::deflate(stream_.get(), last ? Z_FINISH : Z_NO_FLUSH);
    sink_(std::span(out_).first(out_.size() - stream_->avail_out));
  } while (stream_->avail_out == 0);
}

std::uint32_t zfp_version(const CompressedVolume &volume, bool has_levels) {
  if (!volume.no_data.empty()) return kNoDataVersion;
  return has_levels ? kPyramidVersion : volume.is_indexed() ? kIndexedVersion : kVersion;
}

ZfpFileWriter::ZfpFileWriter(const fs::path &path, const CompressedVolume &volume) {
  for (std::size_t level = 0; level <= volume.coarser_levels.size(); ++level) {
    const CompressedVolume &at = level == 0 ? volume : volume.coarser_levels[level - 1];
    const ZfpHeader header =
        make_zfp_header(at.info.dims, at.bits_per_block, at.precision.min_exponent);
    parts_.emplace_back(path).write(std::as_bytes(std::span(header)));
  }
}

void ZfpFileWriter::write(std::span<const std::byte> payload, std::size_t level) {
  parts_[level].write(payload);
}

void ZfpFileWriter::commit(const CompressedVolume &volume) {
  finish(volume);
  parts_.front().file.commit();
}

void ZfpFileWriter::read_back(const CompressedVolume &volume, const PayloadSink &take) {
  finish(volume);
  parts_.front().file.read_back(take);
}

void ZfpFileWriter::finish(const CompressedVolume &volume) {
  Part &all = parts_.front();
  ZfpLayout layout = all.write_parts(volume);
  for (std::size_t level = 1; level < parts_.size(); ++level) {
    Part &part = parts_[level];
    const CompressedVolume &coarse = volume.coarser_levels[level - 1];
    const ZfpLayout part_layout = part.write_parts(coarse);
    part.write_trailer(zfp_trailer_text(coarse, part_layout), zfp_version(coarse, false));
    layout.level_bytes.push_back(part.size);
    part.file.read_back([&all](std::span<const std::byte> bytes) { all.write(bytes); });
  }
  all.write_trailer(zfp_trailer_text(volume, layout),
                    zfp_version(volume, !layout.level_bytes.empty()));
}

void ZfpFileWriter::Part::write(std::span<const std::byte> bytes) {
  file.write(bytes);
  crc = update_crc(crc, bytes);
  size += bytes.size();
}

void ZfpFileWriter::Part::write_trailer(const std::string &text, std::uint32_t version) {
  ZfpFooter footer{version, std::uint32_t(text.size()), crc, 0, kZfpFooterMagic};
  footer.json_crc = json_crc(text, footer);
  write(std::as_bytes(std::span(text)));
  write(std::as_bytes(std::span(&footer, 1)));
}

/// Behind the padding of the payload; returns its size, 0 at a fixed rate.
std::uint64_t ZfpFileWriter::Part::write_index(const CompressedVolume &volume) {
  const std::array<std::byte, 8> zeros{};
  write(std::span(zeros).first((8 - size % 8) % 8));
  if (!volume.is_indexed()) return 0;
  const std::uint64_t num_blocks = volume.block_count(), begin = size;
  Deflater deflater([this](std::span<const std::byte> bytes) { write(bytes); });
  std::vector<std::uint16_t> lengths;
  for (std::uint64_t done = 0; done < num_blocks;) {
    lengths.resize(std::min<std::uint64_t>(kDeflatedAtOnce, num_blocks - done));
    for (std::uint16_t &length : lengths)
      length = static_cast<std::uint16_t>(volume.block_bits(static_cast<std::uint32_t>(done++)));
    deflater.add(std::as_bytes(std::span(lengths)));
  }
  deflater.finish();
  return size - begin;
}

/// Writes the bounds behind the index; returns their size, 0 if there are none.
std::uint64_t ZfpFileWriter::Part::write_bounds(const CompressedVolume &volume) {
  std::span<const std::uint8_t> left = volume.bounds.codes;
  if (left.empty()) return 0;
  const std::uint64_t begin = size;
  Deflater deflater([this](std::span<const std::byte> bytes) { write(bytes); });
  for (; !left.empty(); left = left.subspan(std::min(kDeflatedAtOnce, left.size())))
    deflater.add(std::as_bytes(left.first(std::min(kDeflatedAtOnce, left.size()))));
  deflater.finish();
  return size - begin;
}

/// Writes the table of voxels without data behind the bounds; returns its size, 0 if there is none.
std::uint64_t ZfpFileWriter::Part::write_no_data(const CompressedVolume &volume) {
  const std::span<const std::uint32_t> table = volume.no_data.table();
  if (table.empty()) return 0;
  const std::uint64_t begin = size;
  Deflater deflater([this](std::span<const std::byte> bytes) { write(bytes); });
  std::vector<std::uint32_t> some;
  const auto add = [&](std::uint32_t word) {
    some.push_back(word);
    if (some.size() < kDeflatedAtOnce) return;
    deflater.add(std::as_bytes(std::span(some)));
    some.clear();
  };
  for (const std::uint32_t word : no_data_groups(table, volume.block_count())) add(word);
  for (const std::uint32_t word : no_data_masks(table, volume.block_count())) add(word);
  deflater.add(std::as_bytes(std::span(some)));
  deflater.finish();
  return size - begin;
}

/// All that is between the payload and the levels of detail.
ZfpLayout ZfpFileWriter::Part::write_parts(const CompressedVolume &volume) {
  ZfpLayout layout;
  layout.index_bytes = write_index(volume);
  layout.bounds_bytes = write_bounds(volume);
  layout.no_data_bytes = write_no_data(volume);
  return layout;
}

namespace {

/// Writes all payload of a volume.
void write_payload(const CompressedVolume &volume, const fs::path &path, ZfpFileWriter &file) {
  if (volume.bits_per_block % 64 != 0) {
    throw Error("{}: blocks of {} bits are no whole number of bits a voxel: copy the file instead",
                path.string(), volume.bits_per_block);
  }
  std::vector<std::uint32_t> words;
  for (std::size_t i = 0; i <= volume.coarser_levels.size(); ++i) {
    const CompressedVolume &level = i == 0 ? volume : volume.coarser_levels[i - 1];
    const std::uint64_t num_words = (level.payload_bits() + 31) / 32;
    for (std::uint64_t begin = 0; begin < num_words; begin += words.size()) {
      words.resize(std::min<std::uint64_t>(kDeflatedAtOnce, num_words - begin));
      level.read_words(32 * begin, words);
      file.write(std::as_bytes(std::span(words)), i);
    }
  }
}

}  // namespace

void write_zfp_file(const CompressedVolume &volume, const fs::path &path) {
  ZfpFileWriter file(path, volume);
  write_payload(volume, path, file);
  file.commit(volume);
}

void give_zfp_file(const CompressedVolume &volume, const fs::path &path, const PayloadSink &take) {
  ZfpFileWriter file(path, volume);
  write_payload(volume, path, file);
  file.read_back(volume, take);
}

}  // namespace isowave::core
