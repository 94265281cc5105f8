// Reads `.zfp` files, trusting nothing that they say. The functions are declared in zfp_stream.hpp.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "core/base/error.hpp"
#include "core/io/byte_source.hpp"
#include "core/volume/pyramid.hpp"
#include "core/zfp/cut_blocks.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/libzfp.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "core/zfp/zfp_trailer.hpp"
#include "kernels_cl/portable/block_bound.h"

namespace isowave::core {
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kMaxJsonBytes = 1u << 20;
constexpr std::uint32_t kMinBlockBits =
    9;  // "not empty" and the exponent; libzfp reads them at any rate
constexpr std::uint32_t kMaxBlockBits = 2048;

/// Calls take(items) with `total` items of a deflated part of a file, a few at a time, until it
/// returns false. Returns whether all of that worked, and the part has no more items.
template <typename T, typename Take>
bool inflate_items(const FileSource &part, std::uint64_t total, const Take &take) {
  constexpr std::uint64_t kMostItems = 1u << 15;
  InflateSource source(part, Packing::kZlib);
  std::vector<T> items;
  for (std::uint64_t done = 0; done < total; done += items.size()) {
    items.resize(std::min(kMostItems, total - done));
    const auto bytes = std::as_writable_bytes(std::span(items));
    if (source.read(bytes) != bytes.size() || !take(std::span<const T>(items))) return false;
  }
  std::byte another{};
  return source.read(std::span(&another, 1)) == 0;
}

/// Calls take(length) for so many blocks, whose lengths are deflated. Returns whether they are.
template <typename Take>
bool inflate_lengths(const FileSource &deflated, std::uint64_t num_blocks, const Take &take) {
  return inflate_items<std::uint16_t>(deflated, num_blocks,
                                      [&](std::span<const std::uint16_t> lengths) {
                                        for (const std::uint16_t length : lengths) {
                                          if (length < 1 || length > ISO_MAX_BLOCK_BITS)
                                            return false;
                                          take(length);
                                        }
                                        return true;
                                      });
}

/// A `.zfp` file being read: the checks in the order in which the file is trusted.
class ZfpFileReader {
 public:
  explicit ZfpFileReader(const fs::path &path)
      : file_(std::make_shared<InputFile>(path)), file_size_(file_->size()) {
    read_head();
  }

  CompressedVolume take_info() {
    for (ZfpFileReader &level : levels_) volume_.coarser_levels.push_back(level.take_info());
    return std::move(volume_);
  }

  /// A box of each of the first levels.
  CompressedVolume take_blocks(std::span<const BlockBox> boxes, bool with_bounds) {
    CompressedVolume cut = cut_box(boxes.front(), with_bounds);
    for (std::size_t i = 1; i < boxes.size(); ++i)
      cut.coarser_levels.push_back(levels_.at(i - 1).cut_box(boxes[i], with_bounds));
    return cut;
  }

  /// keep: the index and bounds, and the file.
  CompressedVolume take_checked(bool keep) {
    check_sum();
    return take(keep);
  }

 private:
  /// A level of detail: a file in the file.
  ZfpFileReader(const ZfpFileReader &finer, std::uint64_t begin, std::uint64_t size)
      : file_(finer.file_), begin_(begin), file_size_(size), is_level_(true) {
    read_head();
    // Means of integers are not rounded.
    if (!has_trailer_ || volume_.info.dims != coarser_level(finer.volume_.info).dims ||
        volume_.precision.whole_numbers)
      refuse_level();
    // The grid and range of values that a level states are not read, so they cannot be wrong.
    volume_.info = coarser_level(finer.volume_.info);
    volume_.value_range = kUnknownRange;
    layout_.counts_casts = finer.layout_.counts_casts;
  }

  const std::string &what() const { return file_->what(); }

  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> reason, Args &&...args) const {
    throw Error("{}: {}", what(), fmt::format(reason, std::forward<Args>(args)...));
  }

  [[noreturn]] void refuse_level() const { fail("damaged: one of its levels of detail is none"); }

  void read_head() {
    read_header();
    read_trailer();
    check_volume_info(volume_.info, what());
    if (layout_.level_bytes.size() > (is_level_ ? 0 : max_levels(volume_.info.dims) - 1))
      refuse_level();
    std::uint64_t begin = begin_ + bytes_before_levels();
    for (const std::uint64_t bytes : layout_.level_bytes) {
      levels_.push_back(ZfpFileReader(levels_.empty() ? *this : levels_.back(), begin, bytes));
      begin += bytes;
    }
  }

  std::uint64_t bytes_before_trailer() const {
    return std::accumulate(layout_.level_bytes.begin(), layout_.level_bytes.end(),
                           bytes_before_levels());
  }
  std::uint64_t bytes_before_levels() const {
    return stream_bytes_ + layout_.index_bytes + layout_.bounds_bytes + layout_.no_data_bytes;
  }

  /// Checks the checksum of everything before the trailer.
  void check_sum() const {
    if (!has_trailer_) return;
    std::vector<std::byte> piece(1u << 16);
    std::uint32_t crc = 0;
    for (std::uint64_t at = 0, end = bytes_before_trailer(); at < end; at += piece.size()) {
      piece.resize(std::min<std::uint64_t>(piece.size(), end - at));
      file_->read(at, piece);
      crc = update_crc(crc, piece);
    }
    if (crc != stream_crc_) fail("damaged: the checksum of its stream does not match");
  }

  CompressedVolume take(bool keep) {
    volume_.file = file_;
    volume_.file_first_bit = 8 * begin_ + header_bits_;
    if (volume_.is_indexed()) {
      read_index(keep);
    } else if (!has_trailer_) {
      check_block_exponents();
    }
    if (layout_.bounds_bytes != 0) read_bounds(keep);
    if (layout_.no_data_bytes != 0) {
      NoData no_data = read_no_data();
      if (keep) volume_.no_data = std::move(no_data);
    }
    check_errors(volume_);
    for (ZfpFileReader &level : levels_) volume_.coarser_levels.push_back(level.take(keep));
    if (!keep) volume_.file.reset();
    return std::move(volume_);
  }

  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
    file_->read(begin_ + offset, bytes);
  }

  /// Refuses magnitudes that cannot be drawn (kMaxMagnitude) in another writer's blocks of a fixed
  /// rate, by the exponent that they begin with.
  void check_block_exponents() const {
    constexpr std::uint64_t kBlocksAtOnce = 1u << 12;
    const std::uint64_t num_blocks = volume_.block_count(), bits = volume_.bits_per_block;
    std::vector<std::uint32_t> words;
    for (std::uint64_t first = 0; first < num_blocks; first += kBlocksAtOnce) {
      const std::uint64_t count = std::min(kBlocksAtOnce, num_blocks - first);
      words.resize((count * bits + 31) / 32);
      volume_.read_words(first * bits, words);
      for (std::uint64_t block = 0; block < count; ++block) {
        std::array<std::uint32_t, 1> head{};  // 1 "not all zero", 8 exponent + 127
        copy_bits(std::as_bytes(std::span(words)), block * bits, kMinBlockBits, head);
        if ((head[0] & 1u) == 0 || (head[0] >> 1u) < 127u + 127u) continue;
        fail("block {} has values from {:.4g} on: they cannot be drawn, scale the volume down",
             first + block, kMaxMagnitude);
      }
    }
  }

  /// The voxels without data of another writer's block, which are NaN. Refuses voxels that cannot
  /// be drawn.
  std::uint64_t judge_voxels(std::uint64_t block, std::span<const float> values) const {
    std::uint64_t missing = 0, refused = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      missing |= std::uint64_t{std::isnan(values[i])} << i;
      refused |= std::uint64_t{std::abs(values[i]) >= kMaxMagnitude} << i;
    }
    if ((missing | refused) == 0) return 0;
    const std::uint64_t voxels = voxels_of_block(volume_.info.dims, block);
    if ((refused & voxels) == 0) return missing & voxels;
    const auto voxel = static_cast<std::uint32_t>(std::countr_zero(refused & voxels));
    const glm::u64vec3 blocks(volume_.num_blocks());
    const glm::u64vec3 at =
        std::uint64_t{4} * glm::u64vec3(block % blocks.x, block / blocks.x % blocks.y,
                                        block / blocks.x / blocks.y) +
        glm::u64vec3(voxel & 3u, voxel >> 2u & 3u, voxel >> 4u);
    if (std::isinf(values[voxel])) {
      fail(
          "voxel x={}, y={}, z={} is infinite: decode the file by zfp -h -z, and compress its "
          "voxels "
          "with a value for those without data, or in place of NaN",
          at.x, at.y, at.z);
    }
    fail(
        "voxel x={}, y={}, z={} is {:.4g}: voxels beyond +-{:.4g} cannot be drawn, scale the "
        "volume down",
        at.x, at.y, at.z, values[voxel], kMaxMagnitude);
  }

  /// A file of zfp's own tool has no index: its blocks must be decoded to know where they are. What
  /// is NaN in them has no data.
  void read_index(bool keep) {
    const std::uint64_t num_blocks = volume_.block_count();
    if (volume_.indexed_bits < num_blocks) {  // before memory is taken for them
      fail("truncated: {} blocks cannot come from {} bytes", num_blocks, file_size_);
    }
    BlockIndexBuilder index;
    if (keep) index.reserve(num_blocks);
    std::uint64_t end = 0;
    const auto take = [&](std::uint32_t bits) {
      end += bits;
      if (keep) index.add(bits);
    };
    bool is_whole = true;
    if (has_trailer_) {
      is_whole =
          inflate_lengths({file_, begin_ + stream_bytes_, layout_.index_bytes}, num_blocks, take);
    } else {
      NoDataBuilder no_data(volume_.info.dims);
      std::uint64_t block = 0, num_missing = 0;
      find_block_lengths(volume_, what(), [&](const FoundBlocks &found) {
        const std::uint64_t missing = judge_voxels(block, found.values);
        block += found.count;
        num_missing += static_cast<std::uint64_t>(std::popcount(missing));
        end += found.bits * found.count;
        for (std::uint64_t i = 0; keep && i < found.count; ++i) {
          index.add(found.bits);
          no_data.add(missing);
        }
      });
      volume_.no_data = keep ? no_data.finish() : NoData(num_missing);
      const std::uint64_t used = (header_bits_ + end + 63) / 64 * 8;
      if (file_size_ > used) {
        fail("damaged: {} unknown bytes after the zfp stream", file_size_ - used);
      }
    }
    if (!is_whole || (has_trailer_ && end != volume_.indexed_bits)) {
      fail("damaged: the lengths of its blocks are not those of its stream");
    }
    volume_.indexed_bits = end;
    if (keep) volume_.index = index.finish();
  }

  CompressedVolume cut_box(const BlockBox &box, bool with_bounds) {
    volume_.file = file_;
    volume_.file_first_bit = 8 * begin_ + header_bits_;
    if (volume_.is_indexed() && !has_trailer_)
      fail(
          "a file of zfp's own tool does not say where its blocks begin: decode it by zfp -h -z, "
          "and convert its voxels");
    CompressedVolume cut = volume_.is_indexed() ? cut_indexed(box) : cut_blocks(volume_, box);
    if (with_bounds && layout_.bounds_bytes != 0) {
      BoundsCutter bounds(volume_.num_blocks(), box);
      inflate_bounds([&](std::span<const std::uint8_t> some) { bounds.add(some); });
      if (layout_.counts_casts) cut.bounds = bounds.finish(volume_.bounds);
    }
    if (layout_.no_data_bytes != 0)
      cut.no_data = cut_no_data(read_no_data(), volume_.num_blocks(), box, cut.info.dims);
    check_errors(cut);
    return cut;
  }

  /// A block's bound is that of its voxels' errors: the largest is not below theirs. Nor is it
  /// above their quotient by the smallest share, and a step between codes.
  void check_errors(const CompressedVolume &volume) const {
    if (is_level_ || volume.bounds.codes.empty() || !volume.max_voxel_error) return;
    const double largest = double{largest_bound(volume.bounds)};
    if (*volume.max_voxel_error > largest) {
      fail("broken trailer: a voxel is off by {}, and no block by more than {}",
           *volume.max_voxel_error, largest);
    }
    constexpr double kStep = 17.0 / 16.0 * (1 + 0x1p-20);
    const double most = kStep * *volume.max_voxel_error / double{bound_share(0)};
    if (volume.bounds.by_place && volume.bounds.exponent > kMinBoundExponent && largest > most) {
      fail("broken trailer: no voxel is off by more than {}, and a block by {}",
           *volume.max_voxel_error, largest);
    }
  }

  /// Keeps the lengths of a row at a time.
  CompressedVolume cut_indexed(const BlockBox &box) {
    const glm::u64vec3 blocks(volume_.num_blocks()), from(box.begin), to(box.end);
    BlockCutter cutter(volume_, box);
    std::vector<std::uint32_t> lengths;
    std::uint64_t block = 0, end = 0, first_bit = 0;
    const bool is_whole =
        inflate_lengths({file_, begin_ + stream_bytes_, layout_.index_bytes}, volume_.block_count(),
                        [&](std::uint32_t bits) {
                          const std::uint64_t x = block % blocks.x, y = block / blocks.x % blocks.y,
                                              z = block / blocks.x / blocks.y;
                          ++block;
                          end += bits;
                          if (end > volume_.indexed_bits || x < from.x || x >= to.x || y < from.y ||
                              y >= to.y || z < from.z || z >= to.z)
                            return;
                          if (x == from.x) first_bit = end - bits;
                          lengths.push_back(bits);
                          if (x + 1 < to.x) return;
                          cutter.add_row(first_bit, lengths);
                          lengths.clear();
                        });
    if (!is_whole || end != volume_.indexed_bits)
      fail("damaged: the lengths of its blocks are not those of its stream");
    return cutter.finish();
  }

  void read_bounds(bool keep) {
    std::vector<std::uint8_t> &codes = volume_.bounds.codes;
    inflate_bounds([&](std::span<const std::uint8_t> some) {
      if (keep) codes.reserve(volume_.block_count());
      codes.insert(codes.end(), some.begin(), some.end());
      if (!keep) codes = {std::ranges::max(codes)};
    });
    if (!layout_.counts_casts) volume_.bounds = {};
  }

  /// Calls take(codes) with those of all blocks, some at a time.
  template <typename Take>
  void inflate_bounds(const Take &take) const {
    const std::uint64_t num_blocks = volume_.block_count();
    const FileSource deflated(file_, begin_ + stream_bytes_ + layout_.index_bytes,
                              layout_.bounds_bytes);
    if (num_blocks / kMaxDeflateRatio > layout_.bounds_bytes) refuse_bounds();
    const bool whole =
        inflate_items<std::uint8_t>(deflated, num_blocks, [&](std::span<const std::uint8_t> some) {
          take(some);
          return true;
        });
    const std::int32_t exponent = volume_.bounds.exponent;
    if (!whole || exponent < kMinBoundExponent || exponent > kMaxBoundExponent) refuse_bounds();
  }

  /// Bits of all groups, then the masks that they promise (kernels_cl/portable/no_data.h).
  NoData read_no_data() const {
    const auto refuse = [this] {
      fail("damaged: its voxels without data are not those of its stream");
    };
    const std::uint64_t num_blocks = volume_.block_count(),
                        num_groups = (num_blocks + ISO_NO_DATA_BLOCKS - 1) / ISO_NO_DATA_BLOCKS;
    if (8 * num_groups / kMaxDeflateRatio > layout_.no_data_bytes) refuse();
    InflateSource source(
        {file_, begin_ + bytes_before_levels() - layout_.no_data_bytes, layout_.no_data_bytes},
        Packing::kZlib);
    std::vector<std::uint32_t> groups(2 * num_groups);
    const auto bytes = std::as_writable_bytes(std::span(groups));
    if (source.read(bytes) != bytes.size()) refuse();
    NoDataBuilder no_data(volume_.info.dims);
    for (std::uint64_t block = 0; block < 32 * num_groups; ++block) {
      const bool some = (groups[2 * (block / 32)] >> (block % 32) & 1u) != 0,
                 all = (groups[2 * (block / 32) + 1] >> (block % 32) & 1u) != 0;
      std::uint64_t mask = all ? ~std::uint64_t{0} : 0;
      if (some && source.read(std::as_writable_bytes(std::span(&mask, 1))) != sizeof(mask))
        refuse();
      const bool is_there = block < num_blocks;
      const std::uint64_t voxels = is_there && some ? voxels_of_block(volume_.info.dims, block) : 0;
      if ((some && (all || (mask & ~voxels) != 0 || mask == 0 || mask == voxels)) ||
          (all && !is_there))
        refuse();
      if (is_there) no_data.add(mask);
    }
    std::byte another{};
    NoData result = no_data.finish();
    if (source.read(std::span(&another, 1)) != 0 ||
        result.num_voxels() != volume_.no_data.num_voxels())
      refuse();
    return result;
  }

  [[noreturn]] void refuse_bounds() const {
    fail("damaged: the bounds of its blocks are not those of its stream");
  }

  void read_header() {
    std::array<std::uint64_t, (ZFP_HEADER_MAX_BITS + 63) / 64 + 1> buffer{};
    const std::size_t available = std::min<std::uint64_t>(file_size_, ZFP_HEADER_MAX_BITS / 8 + 1);
    read_at(0, std::as_writable_bytes(std::span(buffer)).first(available));

    const ZfpBits bits(or_bad_alloc(stream_open(buffer.data(), sizeof(buffer))), &stream_close);
    const ZfpStream stream(or_bad_alloc(zfp_stream_open(bits.get())), &zfp_stream_close);
    const ZfpField field(or_bad_alloc(zfp_field_alloc()), &zfp_field_free);
    header_bits_ = zfp_read_header(stream.get(), field.get(), ZFP_HEADER_FULL);
    if (header_bits_ == 0 || header_bits_ > available * 8) {
      fail("not a zfp file: no full zfp header (as `zfp -h` writes it)");
    }
    check_kind(*stream, *field);
    volume_.info.dims = glm::uvec3(field->nx, field->ny, field->nz);
    volume_.info.type = VoxelType::kFloat32;
    const bool fixed_rate = zfp_stream_compression_mode(stream.get()) == zfp_mode_fixed_rate;
    volume_.bits_per_block = fixed_rate ? stream->maxbits : 0;
    if (!fixed_rate) volume_.precision.min_exponent = stream->minexp;
    volume_.errors_are_stated = true;

    if (!fixed_rate) {  // how long the stream is, a trailer tells, or else the file
      if (volume_.block_count() >= std::numeric_limits<std::uint32_t>::max()) {
        fail("{}x{}x{} voxels: too many for blocks of lengths of their own", field->nx, field->ny,
             field->nz);
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
      fail("truncated: {}x{}x{} voxels at {} bits per block need {} bytes, found {}", field->nx,
           field->ny, field->nz, volume_.bits_per_block, least_bytes, file_size_);
    }
    stream_bytes_ = std::min(stream_bytes_, file_size_);
  }

  void check_kind(const zfp_stream &stream, const zfp_field &field) const {
    constexpr std::array<const char *, 5> kTypes{"unknown", "int32", "int64", "float32", "float64"};
    if (field.type != zfp_type_float) {
      fail("zfp values of type {}: only float32 is supported", kTypes.at(field.type));
    }
    const unsigned axes = zfp_field_dimensionality(&field);
    if (axes != 3) fail("a {}D zfp array: only 3D is supported", axes);
    constexpr std::array<const char *, 6> kModes{"unknown",         "expert",         "fixed rate",
                                                 "fixed precision", "fixed accuracy", "reversible"};
    const zfp_mode mode = zfp_stream_compression_mode(&stream);
    if (mode == zfp_mode_fixed_accuracy || mode == zfp_mode_reversible) return;
    if (mode != zfp_mode_fixed_rate) {
      fail(
          "zfp mode '{}': only fixed rate (zfp -r), fixed accuracy (zfp -a) and reversible (zfp "
          "-R) are supported",
          kModes.at(mode));
    }
    if (stream.maxbits < kMinBlockBits || stream.maxbits > kMaxBlockBits) {
      fail("{} bits per zfp block: only {} to {} are supported", stream.maxbits, kMinBlockBits,
           kMaxBlockBits);
    }
  }

  void read_trailer() {
    if (!volume_.is_indexed() && file_size_ == stream_bytes_) return;
    const std::uint64_t trailer_bytes =
        file_size_ - (volume_.is_indexed() ? header_bits_ / 8 : stream_bytes_);
    ZfpFooter footer{};
    const auto footer_bytes = std::as_writable_bytes(std::span(&footer, 1));
    if (trailer_bytes >= sizeof(ZfpFooter)) read_at(file_size_ - sizeof(ZfpFooter), footer_bytes);
    if (footer.magic != kZfpFooterMagic) {
      if (volume_.is_indexed()) return;  // a file of zfp's own tool
      fail("damaged: {} unknown bytes after the zfp stream", trailer_bytes);
    }
    const std::uint32_t known = volume_.is_indexed() ? kIndexedVersion : kVersion;
    if (footer.version != known && footer.version != kBoundlessPyramidVersion &&
        footer.version != kPyramidVersion && footer.version != kNoDataVersion) {
      fail("its trailer has version {}, this program knows {}, {}, {} and {}", footer.version,
           known, kBoundlessPyramidVersion, kPyramidVersion, kNoDataVersion);
    }
    const std::uint64_t json_end = file_size_ - sizeof(ZfpFooter);
    std::string text;
    if (footer.json_bytes <= kMaxJsonBytes &&
        footer.json_bytes + sizeof(ZfpFooter) <= trailer_bytes) {
      text.resize(footer.json_bytes);
      read_at(json_end - footer.json_bytes, std::as_writable_bytes(std::span(text)));
    }
    if (text.empty() || json_crc(text, footer) != footer.json_crc) {
      fail("damaged: the checksum of its trailer does not match");
    }
    try {
      layout_ = apply_zfp_trailer(text, volume_);
    } catch (const Error &error) {
      fail("broken trailer: {}", error.what());
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
      stream_bytes_ = possible ? (header_bits_ + bits + 63) / 64 * 8
                               : std::numeric_limits<std::uint64_t>::max();
    }
    std::uint64_t left = json_begin;
    const auto take = [&left](std::uint64_t bytes) {
      if (bytes > left) return false;
      left -= bytes;
      return true;
    };
    if (!take(stream_bytes_) || !take(layout_.index_bytes) || !take(layout_.bounds_bytes) ||
        !take(layout_.no_data_bytes) || !std::ranges::all_of(layout_.level_bytes, take) ||
        left != 0)
      fail("damaged: its parts are not as long as its trailer says");
  }

  std::shared_ptr<const InputFile> file_;
  std::uint64_t begin_ = 0;  ///< of this level in the file
  std::uint64_t file_size_ = 0, header_bits_ = 0;
  bool is_level_ = false;
  std::uint64_t stream_bytes_ = 0;     ///< header, payload and padding
  ZfpLayout layout_;                   ///< of what is behind them
  std::vector<ZfpFileReader> levels_;  ///< coarser ones
  bool has_trailer_ = false;
  std::uint32_t stream_crc_ = 0;
  CompressedVolume volume_;
};

}  // namespace

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
CompressedVolume read_zfp_blocks(const fs::path &path, std::span<const BlockBox> boxes,
                                 bool with_bounds) {
  return ZfpFileReader(path).take_blocks(boxes, with_bounds);
}

}  // namespace isowave::core
