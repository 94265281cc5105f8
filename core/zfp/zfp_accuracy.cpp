#include "core/zfp/zfp_accuracy.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/base/printed_bound.hpp"
#include "core/zfp/libzfp.hpp"

namespace isowave::core {

namespace {

constexpr double kMostLost = 0x1p-8;  // of the range of values: else the volume is another one
constexpr float kWholeEnd = 0x1p24f;  // all whole numbers below are float32

/// One block at a time: encoded by libzfp, and decoded again down to fewer of its bit planes.
class BlockCodec {
 public:
  explicit BlockCodec(std::int32_t min_exponent)
      : stream_(make_zfp_stream(0, min_exponent)),
        bits_(or_bad_alloc(stream_open(words_.data(), sizeof(words_))), &stream_close) {
    zfp_stream_set_bit_stream(stream_.get(), bits_.get());
  }

  /// Block number bx of a row; nx, layer: voxels in a row and a layer of the volume. Returns its
  /// length in bits.
  std::uint32_t encode(const BlockRow &row, std::uint32_t bx, std::ptrdiff_t nx,
                       std::ptrdiff_t layer) {
    const float *voxels = row.voxels + std::size_t{bx} * kBlockEdge;
    const std::size_t num_x =
        std::min<std::size_t>(kBlockEdge, std::size_t(nx) - std::size_t{bx} * kBlockEdge);
    zfp_stream_rewind(stream_.get());
    const std::size_t length =
        num_x == kBlockEdge && row.ny == kBlockEdge && row.nz == kBlockEdge
            ? zfp_encode_block_strided_float_3(stream_.get(), voxels, 1, nx, layer)
            : zfp_encode_partial_block_strided_float_3(stream_.get(), voxels, num_x, row.ny, row.nz,
                                                       1, nx, layer);
    stream_flush(bits_.get());
    if (length > ISO_MAX_BLOCK_BITS) throw std::logic_error("zfp: a block is longer than can be");
    return static_cast<std::uint32_t>(length);
  }
  std::span<const std::uint64_t> words() const { return words_; }

  /// The block's values with the bit planes of min_exponent: x + 4y + 16z.
  const std::array<float, ISO_BLOCK_VOXELS> &decode(std::int32_t min_exponent) {
    set_planes(min_exponent);
    zfp_stream_rewind(stream_.get());
    zfp_decode_block_float_3(stream_.get(), values_.data());
    return values_;
  }
  /// Encodes with the bit planes of min_exponent from now on.
  void set_planes(std::int32_t min_exponent) {
    zfp_stream_set_params(stream_.get(), ZFP_MIN_BITS, ZFP_MAX_BITS, ZFP_MAX_PREC, min_exponent);
  }

 private:
  std::array<std::uint64_t, (ISO_MAX_BLOCK_BITS + 63) / 64 + 2> words_{};
  std::array<float, ISO_BLOCK_VOXELS> values_{};
  ZfpStream stream_;
  ZfpBits bits_;
};

/// The error of block bx of a row, over its voxels with data. rounded: decoded values are rounded
/// to integers first.
BlockError error_of_block(const std::array<float, ISO_BLOCK_VOXELS> &decoded, const BlockRow &row,
                          std::uint32_t bx, std::ptrdiff_t nx, std::ptrdiff_t layer, bool rounded) {
  const std::uint32_t num_x =
      std::min(kBlockEdge, static_cast<std::uint32_t>(nx) - bx * kBlockEdge);
  BlockError error;
  for (std::uint32_t z = 0; z < row.nz; ++z) {
    for (std::uint32_t y = 0; y < row.ny; ++y) {
      const float *source = row.voxels + z * layer + y * nx + std::ptrdiff_t(bx) * kBlockEdge;
      for (std::uint32_t x = 0; x < num_x; ++x) {
        const std::uint32_t voxel = x + 4 * y + 16 * z;
        if ((row.no_data[bx] >> voxel & 1u) != 0) continue;
        const float value = rounded ? std::rint(decoded[voxel]) : decoded[voxel];
        error.add(voxel, std::abs(double{value} - double{source[x]}));
      }
    }
  }
  return error;
}

/// Bit planes that may do: candidate i ends at first + i, up to `last`.
struct Candidates {
  std::int32_t first = 0, last = -1;  ///< none
};

/// Largest errors of the whole volume with several numbers of bit planes at once.
class ErrorMeter : public ChunkCoder {
 public:
  /// At most kMaxCandidates. Those that exceed `limit` are given up.
  static constexpr std::int32_t kMaxCandidates = 8;
  ErrorMeter(const glm::uvec3 &dims, const Candidates &candidates, double limit, bool rounded,
             std::uint32_t num_threads)
      : nx_(dims.x),
        layer_(std::ptrdiff_t(dims.x) * dims.y),
        blocks_x_((dims.x + 3) / 4),
        first_(candidates.first),
        num_candidates_(std::size_t(candidates.last - candidates.first + 1)),
        limit_(limit),
        rounded_(rounded),
        errors_(thread_count(num_threads)),
        lost_(errors_.size()) {}

  void code_row(const BlockRow &row, std::uint32_t thread) override {
    lost_[thread] = std::max(lost_[thread], *std::max_element(row.lost, row.lost + blocks_x_));
    if (num_candidates_ == 0) return;
    BlockCodec codec(first_);
    for (std::uint32_t bx = 0; bx < blocks_x_; ++bx) {
      codec.set_planes(first_);
      codec.encode(row, bx, nx_, layer_);
      for (std::size_t i = 0; i < num_candidates_; ++i) {
        if (given_up_[i].load(std::memory_order_relaxed)) continue;
        const double error = with_lost(
            error_of_block(codec.decode(first_ + std::int32_t(i)), row, bx, nx_, layer_, rounded_)
                .largest(),
            row.lost[bx]);
        errors_[thread][i] = std::max(errors_[thread][i], error);
        if (i > 0 && !(error <= limit_)) given_up_[i].store(true, std::memory_order_relaxed);
      }
    }
  }

  /// Adds what other processes have found.
  void merge(Team &team) {
    const std::size_t width = kMaxCandidates + 1;
    std::vector<double> own(width);
    for (std::size_t i = 0; i < num_candidates_; ++i)
      own[i] = given_up_[i].load() ? std::numeric_limits<double>::infinity() : error(i);
    own.back() = double{lost()};
    const std::vector<double> all = gather(team, own);
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (i % width < kMaxCandidates) {
        errors_[0][i % width] = std::max(errors_[0][i % width], all[i]);
      } else {
        lost_[0] = std::max(lost_[0], static_cast<float>(all[i]));
      }
    }
  }

  /// The coarsest within the limit, or none.
  std::optional<BlockPrecision> best() const {
    for (std::size_t i = num_candidates_; i-- > 0;) {
      if (!given_up_[i].load() && error(i) <= limit_)
        return BlockPrecision{first_ + std::int32_t(i), rounded_, error(i)};
    }
    return {};
  }

  /// The most that float32 loses of a voxel.
  float lost() const { return std::ranges::max(lost_); }

  double error(std::size_t candidate) const {
    double error = 0;
    for (const auto &of_thread : errors_) error = std::max(error, of_thread[candidate]);
    return error;
  }

 private:
  std::ptrdiff_t nx_, layer_;
  std::uint32_t blocks_x_;
  std::int32_t first_;
  std::size_t num_candidates_;
  double limit_;
  bool rounded_;
  std::vector<std::array<double, kMaxCandidates>> errors_;  ///< of each thread
  std::vector<float> lost_;                                 ///< of each thread
  std::array<std::atomic<bool>, kMaxCandidates> given_up_{};
};

/// Ends of bit planes that are worth a look.
Candidates candidates_for(VoxelType type, double tolerance) {
  constexpr std::int32_t kNumFewer = 6, kAllPlanes = ISO_ALL_PLANES + 1;
  // Values that became 0 may have taken nearly all of it.
  if (tolerance <= 4 * double{kMinMagnitude}) return {kAllPlanes, kAllPlanes};
  // zfp's error is 2^promised at most. No voxel has planes beyond kLastPlane, and not all exponents
  // fit a file's header.
  constexpr std::int32_t kLastPlane = 130;
  const std::int32_t promised = std::min(std::ilogb(tolerance), kLastPlane);
  // If the cast to float32, or to 0, may have taken a part of the tolerance, half of the rest is
  // enough: a block that does not have all its planes by then has lost a quarter at most.
  const bool may_lose = !fits_float32(type) || tolerance < 0x1p-80;
  return {promised - (may_lose ? 1 : 0), promised + kNumFewer};
}

ValueRange measure(VolumeReader &reader, const InputOptions &options, ErrorMeter &meter) {
  const ValueRange range = read_in_chunks(reader, options, meter);
  if (options.part != nullptr) meter.merge(*options.part->team);
  return range;
}

BlockPrecision choose_by_tolerance(VolumeReader &reader, double tolerance,
                                   const InputOptions &options) {
  if (!(tolerance > 0 && std::isfinite(tolerance)))
    throw Error("tolerance {}: must be above 0 and finite", tolerance);
  const VolumeInfo &info = reader.info();
  ErrorMeter meter(info.dims, candidates_for(info.type, tolerance), tolerance, false,
                   options.num_threads);
  measure(reader, options, meter);
  const std::optional<BlockPrecision> best = meter.best();
  if (!best) {
    throw Error(
        "a tolerance of {} cannot be kept: voxels are stored as float32, and with all bit planes "
        "off by up to {}; give at least that",
        tolerance, printed_bound(meter.error(0)));
  }
  return *best;
}

/// All that float32 holds.
BlockPrecision choose_closest(VolumeReader &reader, bool exact, const InputOptions &options) {
  const BlockPrecision reversible{ISO_REVERSIBLE, false, {}};
  const VolumeInfo &info = reader.info();
  const bool may_be_whole = is_integer(info.type);
  if (fits_float32(info.type) && !may_be_whole && !exact) return reversible;
  // An error of a quarter at most is rounded away.
  const Candidates candidates = may_be_whole ? Candidates{-2, 4} : Candidates{};
  ErrorMeter meter(info.dims, candidates, 0, true, options.num_threads);
  InputOptions keeping = options;
  keeping.keeps_tiny = true;
  const ValueRange range = measure(reader, keeping, meter);
  if (may_be_whole && std::max(-range.coded[0], range.coded[1]) < kWholeEnd) {
    const std::optional<BlockPrecision> best = meter.best();
    if (best) return *best;
  }
  const auto lost = double{meter.lost()};
  if (exact && lost > 0) {
    throw Error(
        "exact compression is for values that float32 holds, and voxels of type {} would be off by "
        "up to {}: leave it out, or give a tolerance",
        to_string(info.type), printed_bound(lost));
  }
  const auto [least, largest] = range.source;
  if (least < largest && lost > kMostLost * (largest - least)) {
    throw Error(
        "voxels of type {} are from {} to {}, and float32 holds them within {} only: subtract an "
        "offset, or scale them",
        to_string(info.type), least, largest, printed_bound(lost));
  }
  return reversible;
}

}  // namespace

BlockPrecision choose_precision(VolumeReader &reader, const ErrorGoal &goal,
                                const InputOptions &options) {
  return goal.tolerance ? choose_by_tolerance(reader, *goal.tolerance, options)
                        : choose_closest(reader, goal.exact, options);
}

void BlockIndexBuilder::note_begin() {
  const std::uint64_t place = count_ % ISO_INDEX_BLOCKS;
  if (place == 0) {
    group_begin_ = position_;
    index_.resize(index_.size() + ISO_INDEX_WORDS);
    index_[index_.size() - ISO_INDEX_WORDS] = static_cast<std::uint32_t>(position_);
    index_[index_.size() - ISO_INDEX_WORDS + 1] = static_cast<std::uint32_t>(position_ >> 32);
  }
  index_[index_.size() - ISO_INDEX_WORDS + 2 + place / 2] |=
      static_cast<std::uint32_t>(position_ - group_begin_) << (16 * (place % 2));
}

void BlockIndexBuilder::add(std::uint32_t bits) {
  note_begin();
  position_ += bits;
  ++count_;
}

std::vector<std::uint32_t> BlockIndexBuilder::finish() {
  note_begin();
  return std::move(index_);
}

void BitAppender::push(std::uint64_t bits, std::uint32_t count) {
  buffer_ |= bits << filled_;
  if (filled_ + count < 64) {
    filled_ += count;
    return;
  }
  words.push_back(buffer_);
  buffer_ = filled_ == 0 ? 0 : bits >> (64 - filled_);
  filled_ = filled_ + count - 64;
}

void BitAppender::append(std::span<const std::uint64_t> source, std::uint64_t count) {
  for (std::uint64_t i = 0; i < count / 64; ++i) push(source[i], 64);
  const auto left = static_cast<std::uint32_t>(count % 64);
  if (left != 0) push(source[count / 64] & ((std::uint64_t{1} << left) - 1), left);
}

std::uint32_t BitAppender::pad() {
  const std::uint32_t bits = filled_;
  if (bits != 0) push(0, 64 - bits);
  return bits;
}

ErrorBoundCoder::ErrorBoundCoder(const glm::uvec3 &dims, const BlockPrecision &bound,
                                 const Sink &sink, std::optional<BlockErrors> errors)
    : dims_(dims), bound_(bound), sink_(sink), errors_(std::move(errors)) {}

void ErrorBoundCoder::begin_chunk(const Chunk &chunk) {
  rows_.assign(chunk.num_rows, {});
  if (!errors_) return;
  errors_->begin(chunk.num_rows * ((dims_.x + 3) / 4));
  chunk_ = chunk.voxels;
  decoded_.resize(chunk_.size());
}

void ErrorBoundCoder::code_row(const BlockRow &row, std::uint32_t) {
  CodedRow &coded = rows_[row.index];
  BlockCodec codec(bound_.min_exponent);
  const std::ptrdiff_t layer = std::ptrdiff_t(dims_.x) * dims_.y;
  const std::uint32_t blocks_x = (dims_.x + 3) / 4;
  coded.lengths.reserve(blocks_x);
  for (std::uint32_t bx = 0; bx < blocks_x; ++bx) {
    const std::uint32_t length = codec.encode(row, bx, dims_.x, layer);
    coded.lengths.push_back(static_cast<std::uint16_t>(length));
    coded.bits.append(codec.words(), length);
    if (!errors_) continue;
    const auto &decoded = codec.decode(bound_.min_exponent);
    errors_->some()[row.index * blocks_x + bx] =
        error_of_block(decoded, row, bx, dims_.x, layer, bound_.whole_numbers);
    float *out = decoded_.data() + (row.voxels - chunk_.data()) + std::ptrdiff_t(bx) * kBlockEdge;
    const std::uint32_t num_x = std::min(kBlockEdge, dims_.x - bx * kBlockEdge);
    for (std::uint32_t z = 0; z < row.nz; ++z) {
      for (std::uint32_t y = 0; y < row.ny; ++y)
        std::copy_n(decoded.data() + 4 * y + 16 * z, num_x,
                    out + z * layer + std::ptrdiff_t(y) * dims_.x);
    }
  }
  coded.bits.pad();
}

void ErrorBoundCoder::end_chunk(const Chunk &chunk) {
  if (errors_) {
    errors_->add_lost(chunk.lost);
    errors_->end();
  }
  for (const CodedRow &row : rows_) {
    std::uint64_t bits = 0;
    for (const std::uint16_t length : row.lengths) {
      index_.add(length);
      bits += length;
    }
    payload_.append(row.bits.words, bits);
  }
  sink_(std::as_bytes(std::span(payload_.words)));
  payload_.words.clear();
}

std::vector<std::uint32_t> ErrorBoundCoder::finish() {
  const std::uint32_t left = payload_.pad();
  sink_(std::as_bytes(std::span(payload_.words)).first((left + 31) / 32 * sizeof(std::uint32_t)));
  return index_.finish();
}

namespace {

/// The number of zeros from bit `bit` on, up to the first 1 or the end of the word.
std::uint32_t zeros_at(std::span<const std::uint32_t> words, std::uint64_t bit) {
  const auto left = static_cast<std::uint32_t>(32 - bit % 32);
  return std::min(static_cast<std::uint32_t>(std::countr_zero(words[bit / 32] >> bit % 32)), left);
}

}  // namespace

void find_block_lengths(const CompressedVolume &volume, const std::string &what,
                        const std::function<void(const FoundBlocks &)> &take) {
  constexpr std::uint64_t kChunkBits = 1u << 23;
  const std::uint64_t num_blocks = volume.block_count();
  std::array<float, ISO_BLOCK_VOXELS> values;
  std::vector<std::uint32_t> words((kChunkBits + ISO_MAX_BLOCK_BITS) / 32 + 4);
  for (std::uint64_t begin = 0, block = 0; block < num_blocks;) {
    volume.read_words(begin, words);  // with zeros behind its end, which libzfp does not know of
    const ZfpStream stream = make_zfp_stream(0, volume.precision.min_exponent);
    const ZfpBits bits(
        or_bad_alloc(stream_open(words.data(), words.size() * sizeof(std::uint32_t))),
        &stream_close);
    zfp_stream_set_bit_stream(stream.get(), bits.get());
    std::uint64_t at = 0;
    while (at < kChunkBits && block < num_blocks) {
      FoundBlocks found{std::min<std::uint64_t>(zeros_at(words, at), num_blocks - block), 1, {}};
      if (found.count == 0) {  // not empty
        stream_rseek(bits.get(), at);
        const std::size_t length = zfp_decode_block_float_3(stream.get(), values.data());
        found = {1, static_cast<std::uint32_t>(length), values};
      }
      at += found.bits * found.count;
      block += found.count;
      if (begin + at > volume.payload_bits())
        throw Error("{}: truncated: its stream ends in block {} of {}", what, block, num_blocks);
      take(found);
    }
    begin += at;
  }
}

}  // namespace isowave::core
