// Compression and decompression of whole volumes by libzfp, or compression by a device. With a
// whole number of bits per voxel a block is a whole number of 64-bit words, so rows of blocks are
// compressed apart, in parallel, and laid end to end: the same bytes as one call for the whole
// array. A device gets whole layers (zfp_encode). Blocks of lengths of their own: zfp_accuracy.

#include "core/zfp/zfp_stream.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <stdexcept>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/io/input_file.hpp"
#include "core/volume/block_errors.hpp"
#include "core/volume/pyramid.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/libzfp.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "core/zfp/zfp_encode.hpp"
#include "core/zfp/zfp_file.hpp"

namespace isowave::core {

namespace {

using Payload = std::span<const std::byte>;
using Sink = std::function<void(Payload)>;

/// Compresses the voxels of a level.
class LevelCoder : public ChunkCoder {
 public:
  /// After the last chunk: hands over what is left, and completes `volume`. Returns what was to be
  /// kept of each block's errors, where they were measured.
  virtual std::vector<float> finish(CompressedVolume &volume) = 0;
  /// The last chunk's voxels as they are decoded, where errors are measured.
  virtual std::span<const float> decoded() const = 0;
};

/// Compresses rows of blocks by libzfp.
class FixedRateCoder : public LevelCoder {
 public:
  FixedRateCoder(const glm::uvec3 &dims, const CompressOptions &options, const Sink &sink,
                 bool keep)
      : dims_(dims), options_(options), sink_(sink), errors_(keep) {}

  void begin_chunk(const Chunk &chunk) override {
    words_.resize(chunk.num_rows * row_words());
    if (!options_.measure_error) return;
    errors_.begin(chunk.num_rows * blocks_x());
    chunk_ = chunk.voxels;
    decoded_.resize(chunk_.size());
  }

  void code_row(const BlockRow &row, std::uint32_t) override {
    const std::span<std::uint64_t> words =
        std::span(words_).subspan(row.index * row_words(), row_words());
    const ZfpStream stream = make_zfp_stream(64 * options_.rate);
    const ZfpBits bits(stream_open(words.data(), words.size_bytes()), &stream_close);
    zfp_stream_set_bit_stream(stream.get(), bits.get());
    const ZfpField field(
        zfp_field_3d(const_cast<float *>(row.voxels), zfp_type_float, dims_.x, row.ny, row.nz),
        &zfp_field_free);
    zfp_field_set_stride_3d(field.get(), 1, std::ptrdiff_t(dims_.x), layer_size());
    if (zfp_compress(stream.get(), field.get()) != words.size_bytes()) {
      throw std::logic_error("zfp: a row of blocks has not its fixed size");
    }
    if (!options_.measure_error) return;

    float *decoded = decoded_.data() + (row.voxels - chunk_.data());
    const ZfpField copy(zfp_field_3d(decoded, zfp_type_float, dims_.x, row.ny, row.nz),
                        &zfp_field_free);
    zfp_field_set_stride_3d(copy.get(), 1, std::ptrdiff_t(dims_.x), layer_size());
    zfp_stream_rewind(stream.get());
    if (zfp_decompress(stream.get(), copy.get()) == 0)
      throw std::logic_error("zfp: cannot decode its own blocks");
    BlockError *errors = errors_.some().data() + row.index * blocks_x();
    for (std::uint32_t z = 0; z < row.nz; ++z) {
      for (std::uint32_t y = 0; y < row.ny; ++y) {
        const std::ptrdiff_t begin = z * layer_size() + std::ptrdiff_t(y) * dims_.x;
        const float *source = row.voxels + begin, *value = decoded + begin;
        for (std::uint32_t x = 0; x < dims_.x; ++x)
          errors[x / 4].add(x % 4 + 4 * y + 16 * z, std::abs(double(value[x]) - double(source[x])));
      }
    }
  }

  void end_chunk(const Chunk &chunk) override {
    sink_(std::as_bytes(std::span(words_)));
    if (!options_.measure_error) return;
    errors_.add_lost(chunk.lost);
    errors_.end();
  }

  std::vector<float> finish(CompressedVolume &volume) override {
    if (options_.measure_error) volume.max_voxel_error = errors_.max();
    return errors_.take();
  }

  std::span<const float> decoded() const override { return decoded_; }

 private:
  std::uint32_t blocks_x() const { return (dims_.x + 3u) / 4u; }
  std::uint64_t row_words() const { return std::uint64_t{blocks_x()} * options_.rate; }
  std::ptrdiff_t layer_size() const { return std::ptrdiff_t(dims_.x) * dims_.y; }

  glm::uvec3 dims_;
  const CompressOptions &options_;
  const Sink &sink_;
  std::vector<std::uint64_t> words_;  ///< of the present chunk
  std::span<const float> chunk_{};    ///< its voxels
  std::vector<float> decoded_{};      ///< and what becomes of them
  BlockErrors errors_;
};

/// Has a device compress whole chunks; what they become is not read back.
class DeviceCoder : public LevelCoder {
 public:
  DeviceCoder(const glm::uvec3 &dims, const CompressOptions &options, const Sink &sink, bool keep)
      : encoder_(*options.device, dims, 64 * options.rate, options.measure_error,
                 BlockErrors(keep)),
        measure_error_(options.measure_error),
        sink_(sink) {}

  void end_chunk(const Chunk &chunk) override {
    if (measure_error_) encoder_.errors().add_lost(chunk.lost);
    encoder_.encode(chunk.voxels, chunk.num_layers, sink_);
  }

  std::vector<float> finish(CompressedVolume &volume) override {
    encoder_.finish(sink_);
    if (measure_error_) volume.max_voxel_error = encoder_.errors().max();
    return encoder_.errors().take();
  }

  std::span<const float> decoded() const override { return {}; }

 private:
  LayerEncoder encoder_;
  bool measure_error_;
  const Sink &sink_;
};

/// Compresses blocks of lengths of their own.
class BoundedCoder : public LevelCoder {
 public:
  BoundedCoder(const glm::uvec3 &dims, const BlockPrecision &bound, const Sink &sink, bool keep)
      : coder_(dims, bound, sink,
               keep || !bound.max_voxel_error ? std::optional(BlockErrors(keep)) : std::nullopt) {}
  void begin_chunk(const Chunk &chunk) override { coder_.begin_chunk(chunk); }
  void code_row(const BlockRow &row, std::uint32_t thread) override {
    coder_.code_row(row, thread);
  }
  void end_chunk(const Chunk &chunk) override { coder_.end_chunk(chunk); }
  std::vector<float> finish(CompressedVolume &volume) override {
    volume.index = coder_.finish();
    volume.indexed_bits = volume.block_begin(static_cast<std::uint32_t>(volume.block_count()));
    std::optional<BlockErrors> &errors = coder_.errors();
    if (!volume.precision.max_voxel_error) volume.precision.max_voxel_error = errors->max();
    volume.max_voxel_error = volume.precision.max_voxel_error;
    return errors ? errors->take() : std::vector<float>();
  }
  std::span<const float> decoded() const override { return coder_.decoded(); }

 private:
  ErrorBoundCoder coder_;
};

/// Compresses a level, and makes the voxels of the next from its own.
class PyramidCoder : public ChunkCoder {
 public:
  /// volumes, sinks: of this level and all coarser ones. Those are compressed on the host, since
  /// they are needed as they are decoded, and are a seventh.
  PyramidCoder(const CompressOptions &options, std::span<CompressedVolume *const> volumes,
               std::span<const Sink> sinks, bool is_finest = true)
      : volume_(*volumes[0]), is_finest_(is_finest) {
    const glm::uvec3 dims = volume_.info.dims;
    const bool keep = is_finest && volumes.size() > 1;
    if (volume_.is_indexed()) {
      coder_ = std::make_unique<BoundedCoder>(dims, volume_.precision, sinks[0], keep);
    } else if (options.device && is_finest) {
      coder_ = std::make_unique<DeviceCoder>(dims, options, sinks[0], keep);
    } else {
      coder_ = std::make_unique<FixedRateCoder>(dims, options, sinks[0], keep);
    }
    if (volumes.size() == 1) return;
    next_ = std::make_unique<PyramidCoder>(options, volumes.subspan(1), sinks.subspan(1), false);
    const glm::uvec3 coarse_dims = next_->volume_.info.dims;
    if (options.measure_error || volume_.is_indexed())
      bounds_.emplace(dims, coarse_dims, options.input.num_threads);
    downsampler_.emplace(dims, options.input.num_threads,
                         [this, &options, coarse_dims](const Chunk &chunk) {
                           code_chunk(chunk, coarse_dims, options.input, *next_);
                           if (bounds_) bounds_->add_coarse(chunk.voxels, next_->coder_->decoded());
                         });
  }
  void begin_chunk(const Chunk &chunk) override { coder_->begin_chunk(chunk); }
  void code_row(const BlockRow &row, std::uint32_t thread) override {
    coder_->code_row(row, thread);
  }
  void end_chunk(const Chunk &chunk) override {
    coder_->end_chunk(chunk);
    if (!next_) return;
    if (bounds_) {
      bounds_->add_fine(chunk.voxels);
      if (is_finest_) keep_lost(chunk.lost);
    }
    downsampler_->add(chunk.voxels);
  }
  /// off: how far a coarser level's blocks are from the source.
  void finish(const LevelBounds::Off &off = {}) {
    const std::vector<float> errors = coder_->finish(volume_);
    volume_.bounds = encode_bounds(errors.empty() ? off.decoded : errors);
    volume_.bounds.by_place = !errors.empty();
    if (!next_) return;
    if (!lost_.empty()) lost_.resize(num_blocks_);
    next_->finish(bounds_ ? bounds_->finish(is_finest_ ? lost_ : off.made) : LevelBounds::Off{});
  }

 private:
  /// Takes no memory as long as nothing was lost.
  void keep_lost(std::span<const float> lost) {
    if (std::ranges::any_of(lost, [](float of_block) { return of_block > 0; })) {
      lost_.resize(num_blocks_);
      lost_.insert(lost_.end(), lost.begin(), lost.end());
    }
    num_blocks_ += lost.size();
  }

  CompressedVolume &volume_;
  bool is_finest_;
  std::unique_ptr<LevelCoder> coder_;
  std::unique_ptr<PyramidCoder> next_;
  std::optional<Downsampler> downsampler_;
  std::optional<LevelBounds> bounds_;  ///< of the next level
  std::vector<float> lost_;     ///< of the finest level's blocks (Chunk::lost); empty: nothing
  std::size_t num_blocks_ = 0;  ///< that lost_ is known of
};

/// All but what the voxels decide.
CompressedVolume describe(const VolumeReader &reader, const CompressOptions &options) {
  if (options.precision && options.device)
    throw Error("a device compresses at a fixed rate only: leave the device, or the error bound");
  if (!options.precision && (options.rate < 1 || options.rate > 32))
    throw Error("rate {}: must be 1 to 32 bits per voxel", options.rate);
  check_volume_info(reader.info(), "volume");
  const glm::uvec3 dims = reader.info().dims;
  const std::uint32_t num_levels = options.levels != 0 ? options.levels : max_levels(dims);
  if (num_levels > max_levels(dims)) {
    throw Error("{} levels of detail: a volume of {}x{}x{} voxels can have 1 to {}", num_levels,
                dims.x, dims.y, dims.z, max_levels(dims));
  }
  CompressedVolume volume;
  volume.info = reader.info();
  if (options.precision) {
    volume.precision = *options.precision;
  } else {
    volume.bits_per_block = 64 * options.rate;
  }
  for (CompressedVolume level = volume; volume.coarser_levels.size() + 1 < num_levels;) {
    level.info = coarser_level(level.info);
    level.precision.whole_numbers = false;  // means of integers are none
    level.precision.max_voxel_error.reset();
    volume.coarser_levels.push_back(level);
  }
  return volume;
}

/// The volume and its coarser levels.
std::vector<CompressedVolume *> all_levels(CompressedVolume &volume) {
  std::vector<CompressedVolume *> levels = {&volume};
  for (CompressedVolume &level : volume.coarser_levels) levels.push_back(&level);
  return levels;
}

/// Hands the payload of each level to its sink, in order, and completes `volume`.
void run(VolumeReader &reader, const CompressOptions &options, std::span<const Sink> sinks,
         CompressedVolume &volume) {
  PyramidCoder coder(options, all_levels(volume), sinks);
  volume.value_range = read_in_chunks(reader, options.input, coder).coded;
  coder.finish();
}

}  // namespace

std::uint64_t CompressedVolume::payload_bits() const {
  return is_indexed() ? indexed_bits : block_count() * bits_per_block;
}

std::uint64_t CompressedVolume::block_begin(std::uint64_t block_id) const {
  // Blocks of lengths of their own are fewer than 2^32.
  return is_indexed()
             ? isowave::core::block_begin(index.data(), static_cast<std::uint32_t>(block_id))
             : block_id * bits_per_block;
}

std::uint32_t CompressedVolume::block_bits(std::uint64_t block_id) const {
  if (!is_indexed()) return bits_per_block;
  return static_cast<std::uint32_t>(block_begin(block_id + 1) - block_begin(block_id));
}

std::uint64_t CompressedVolume::word_count() const {
  return words.empty() ? (payload_bits() + 31) / 32 + 2 : words.size();
}

void CompressedVolume::read_words(std::uint64_t bit, std::span<std::uint32_t> out) const {
  const std::uint64_t end = payload_bits(), left = bit < end ? end - bit : 0;
  const std::uint64_t count = std::min(32 * std::uint64_t{out.size()}, left);
  if (!file) return copy_bits(std::as_bytes(std::span(words)), bit, count, out);
  const std::uint64_t first = file_first_bit + bit, num_bytes = (first % 8 + count + 7) / 8;
  std::array<std::byte, ISO_MAX_BLOCK_BITS / 8 + 2> of_block{};
  std::vector<std::byte> of_many(num_bytes > of_block.size() ? num_bytes : 0);
  const std::span<std::byte> bytes =
      std::span(of_many.empty() ? std::span<std::byte>(of_block) : std::span(of_many))
          .first(num_bytes);
  file->read(first / 8, bytes);
  copy_bits(bytes, first % 8, count, out);
}

void copy_bits(std::span<const std::byte> bytes, std::uint64_t bit, std::uint64_t count,
               std::span<std::uint32_t> out) {
  const std::uint64_t num_words = count / 32, left = count % 32, shift = bit % 8;
  const std::byte *source = bytes.data() + bit / 8;
  if (shift == 0) {
    std::memcpy(out.data(), source, num_words * sizeof(std::uint32_t));
  } else {
    for (std::uint64_t i = 0; i < num_words; ++i) {  // of every word, the fifth byte holds bits too
      std::uint64_t five = 0;
      std::memcpy(&five, source + i * sizeof(std::uint32_t), 5);
      out[i] = std::uint32_t(five >> shift);
    }
  }
  if (num_words == out.size()) return;
  std::uint64_t last = 0;
  if (left != 0) {
    std::memcpy(&last, source + num_words * sizeof(std::uint32_t), (shift + left + 7) / 8);
    last = last >> shift & ((1ull << left) - 1);
  }
  out[num_words] = std::uint32_t(last);
  std::ranges::fill(out.subspan(num_words + 1), 0u);
}

void set_spacing(CompressedVolume &volume, const glm::dvec3 &spacing) {
  volume.info.spacing = spacing;
  glm::dvec3 of_level = spacing;
  for (CompressedVolume &level : volume.coarser_levels) level.info.spacing = of_level *= 2.0;
}

CompressedVolume compress(VolumeReader &reader, const CompressOptions &options) {
  CompressedVolume volume = describe(reader, options);
  std::vector<Sink> sinks;
  for (CompressedVolume *level : all_levels(volume)) {
    level->words.reserve(level->is_indexed() ? 0 : level->word_count());
    sinks.emplace_back([&words = level->words](Payload payload) {
      const std::size_t begin = words.size();
      words.resize(begin + payload.size() / sizeof(std::uint32_t));
      std::ranges::copy(payload, std::as_writable_bytes(std::span(words).subspan(begin)).begin());
    });
  }
  run(reader, options, sinks, volume);
  for (CompressedVolume *level : all_levels(volume))
    level->words.resize((level->payload_bits() + 31) / 32 + kDecoderAhead);
  return volume;
}

CompressedVolume compress_to_file(VolumeReader &reader, const CompressOptions &options,
                                  const std::filesystem::path &path) {
  CompressedVolume volume = describe(reader, options);
  ZfpFileWriter file(path, volume);
  std::vector<Sink> sinks;
  for (std::size_t level = 0; level <= volume.coarser_levels.size(); ++level)
    sinks.emplace_back([&file, level](Payload payload) { file.write(payload, level); });
  run(reader, options, sinks, volume);
  file.commit(volume);
  return volume;
}

BlockPrecision with_fewer_planes(const BlockPrecision &bound, double voxel_error) {
  if (!(voxel_error >= 0) || !std::isfinite(voxel_error))
    throw Error("a value error of {} cannot be allowed: give 0 or more", voxel_error);
  const std::int32_t min_exponent = voxel_error > 0 ? std::ilogb(voxel_error) : ISO_ALL_PLANES;
  if (min_exponent <= bound.min_exponent) return bound;
  return {min_exponent, false, {}};  // rounding would only add to the error
}

/// A block with fewer bits has no exponent.
constexpr std::uint32_t kExponentEnd = 9;

std::vector<float> decode_with_libzfp(const CompressedVolume &volume, double voxel_error) {
  // libzfp reads whole 64-bit words: four of 32 bits more keep its last read inside.
  std::vector<std::uint32_t> words(volume.word_count() + 4);
  volume.read_words(0, words);
  const glm::uvec3 dims = volume.info.dims, blocks = volume.num_blocks();
  const BlockPrecision bound = with_fewer_planes(volume.precision, voxel_error);
  const ZfpStream stream = make_zfp_stream(volume.bits_per_block, bound.min_exponent);
  const ZfpBits bits(stream_open(words.data(), words.size() * sizeof(std::uint32_t)),
                     &stream_close);
  zfp_stream_set_bit_stream(stream.get(), bits.get());
  std::vector<float> voxels(volume.info.num_voxels());
  float *voxel = voxels.data();
  for (std::uint32_t id = 0; id < volume.block_count(); ++id) {
    const glm::uvec3 at =
        4u * glm::uvec3(id % blocks.x, id / blocks.x % blocks.y, id / blocks.x / blocks.y);
    const glm::uvec3 size = glm::min(dims - at, glm::uvec3(4));
    stream_rseek(bits.get(),
                 volume.block_begin(id));  // a block may have more bits than are decoded
    const std::uint32_t length = volume.block_bits(id);
    if (length < kExponentEnd) continue;  // an empty block: zeros
    // A lying index may end a block before its bits do.
    if (volume.is_indexed())
      zfp_stream_set_params(stream.get(), ZFP_MIN_BITS, length, ZFP_MAX_PREC, bound.min_exponent);
    const auto layer = std::ptrdiff_t{dims.x} * dims.y;
    zfp_decode_partial_block_strided_float_3(
        stream.get(), voxel + at.x + std::ptrdiff_t{dims.x} * at.y + layer * at.z, size.x, size.y,
        size.z, 1, dims.x, layer);
  }
  if (bound.whole_numbers) {
    for (float &value : voxels) value = std::rint(value) + 0.0f;  // as the kernels do
  }
  return voxels;
}

}  // namespace isowave::core
