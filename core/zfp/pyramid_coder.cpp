// Compression of whole volumes by libzfp. With a whole number of bits per voxel a
// block is a whole number of 64-bit words, so rows of blocks are compressed apart, in parallel, and
// laid end to end: the same bytes as one call for the whole array. Blocks of lengths of their own:
// zfp_accuracy.

#include "core/zfp/pyramid_coder.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/error.hpp"
#include "core/volume/block_errors.hpp"
#include "core/zfp/libzfp.hpp"
#include "core/zfp/zfp_accuracy.hpp"

namespace isowave::core {

namespace {

/// Compresses rows of blocks by libzfp.
class FixedRateCoder : public LevelCoder {
 public:
  FixedRateCoder(const glm::uvec3 &dims, const CompressOptions &options, const PayloadSink &sink,
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
    const ZfpBits bits(or_bad_alloc(stream_open(words.data(), words.size_bytes())), &stream_close);
    zfp_stream_set_bit_stream(stream.get(), bits.get());
    for (std::uint32_t x = 0; x < dims_.x; x += 4) encode_block(*stream, row, x);
    stream_flush(bits.get());
    if (stream_size(bits.get()) != words.size_bytes())
      throw std::logic_error("zfp: a row of blocks has not its fixed size");
    if (!options_.measure_error) return;

    float *decoded = decoded_.data() + (row.voxels - chunk_.data());
    zfp_stream_rewind(stream.get());
    for (std::uint32_t x = 0; x < dims_.x; x += 4) decode_block(*stream, row, x, decoded + x);
    BlockError *errors = errors_.some().data() + row.index * blocks_x();
    for (std::uint32_t z = 0; z < row.nz; ++z) {
      for (std::uint32_t y = 0; y < row.ny; ++y) {
        const std::ptrdiff_t begin = z * layer_size() + std::ptrdiff_t(y) * dims_.x;
        const float *source = row.voxels + begin, *value = decoded + begin;
        for (std::uint32_t x = 0; x < dims_.x; ++x) {
          const std::uint32_t voxel = x % 4 + 4 * y + 16 * z;
          if ((row.no_data[x / 4] >> voxel & 1u) == 0)
            errors[x / 4].add(voxel, std::abs(double(value[x]) - double(source[x])));
        }
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
  // libzfp's functions for whole arrays would bring code for all types and dimensions.
  void encode_block(zfp_stream &stream, const BlockRow &row, std::uint32_t x) const {
    const float *voxels = row.voxels + x;
    const std::uint32_t nx = std::min(dims_.x - x, 4u);
    if (nx == 4 && row.ny == 4 && row.nz == 4) {
      zfp_encode_block_strided_float_3(&stream, voxels, 1, dims_.x, layer_size());
    } else {
      zfp_encode_partial_block_strided_float_3(&stream, voxels, nx, row.ny, row.nz, 1, dims_.x,
                                               layer_size());
    }
  }
  void decode_block(zfp_stream &stream, const BlockRow &row, std::uint32_t x, float *voxels) const {
    const std::uint32_t nx = std::min(dims_.x - x, 4u);
    if (nx == 4 && row.ny == 4 && row.nz == 4) {
      zfp_decode_block_strided_float_3(&stream, voxels, 1, dims_.x, layer_size());
    } else {
      zfp_decode_partial_block_strided_float_3(&stream, voxels, nx, row.ny, row.nz, 1, dims_.x,
                                               layer_size());
    }
  }

  std::uint32_t blocks_x() const { return (dims_.x + 3u) / 4u; }
  std::uint64_t row_words() const { return std::uint64_t{blocks_x()} * options_.rate; }
  std::ptrdiff_t layer_size() const { return std::ptrdiff_t(dims_.x) * dims_.y; }

  glm::uvec3 dims_;
  const CompressOptions &options_;
  const PayloadSink &sink_;
  std::vector<std::uint64_t> words_;  ///< of the present chunk
  std::span<const float> chunk_{};    ///< its voxels
  std::vector<float> decoded_{};      ///< and what becomes of them
  BlockErrors errors_;
};

/// Compresses blocks of lengths of their own.
class BoundedCoder : public LevelCoder {
 public:
  BoundedCoder(const glm::uvec3 &dims, const BlockPrecision &bound, const PayloadSink &sink,
               bool keep)
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

}  // namespace

InputOptions input_of(const CompressOptions &options) {
  InputOptions input = options.input;
  input.keeps_tiny = options.precision && options.precision->is_reversible();
  return input;
}

InputOptions input_of_coarser(const CompressOptions &options) {
  InputOptions input = input_of(options);
  input.map_nan.reset();
  input.no_data.reset();
  return input;
}

CompressedVolume describe_compressed(const VolumeInfo &info, const CompressOptions &options) {
  if (options.precision && options.encoder)
    throw Error(
        "a device compresses at a fixed rate only: leave out the device or the error bound");
  if (!options.precision && (options.rate < 1 || options.rate > 32))
    throw Error("rate {}: must be 1 to 32 bits per voxel", options.rate);
  check_volume_info(info, "volume");
  const glm::uvec3 dims = info.dims;
  const std::uint32_t num_levels = options.levels != 0 ? options.levels : max_levels(dims);
  if (num_levels > max_levels(dims)) {
    throw Error("{} levels of detail: a volume of {}x{}x{} voxels can have 1 to {}", num_levels,
                dims.x, dims.y, dims.z, max_levels(dims));
  }
  CompressedVolume volume;
  volume.info = info;
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

PyramidCoder::PyramidCoder(const CompressOptions &options,
                           std::span<CompressedVolume *const> volumes,
                           std::span<const PayloadSink> sinks, bool is_finest, bool keep_errors,
                           NextLevel next_level)
    : volume_(*volumes[0]), is_finest_(is_finest), no_data_(volumes[0]->info.dims) {
  const glm::uvec3 dims = volume_.info.dims;
  if (volume_.is_indexed()) {
    coder_ = std::make_unique<BoundedCoder>(dims, volume_.precision, sinks[0], keep_errors);
  } else if (options.encoder && is_finest) {
    coder_ = options.encoder(dims, options, sinks[0], keep_errors);
  } else {
    coder_ = std::make_unique<FixedRateCoder>(dims, options, sinks[0], keep_errors);
  }
  if (volumes.size() == 1) return;
  next_ =
      std::make_unique<PyramidCoder>(options, volumes.subspan(1), sinks.subspan(1), false, false);
  const glm::uvec3 coarse_dims = next_->volume_.info.dims;
  if (options.measure_error || volume_.is_indexed())
    bounds_.emplace(dims, coarse_dims, options.input.num_threads);
  downsampler_.emplace(dims, options.input.num_threads,
                       [this, &options, coarse_dims, next_level](const Chunk &chunk) {
                         if (next_level) next_level(chunk);
                         code_chunk(chunk, coarse_dims, input_of_coarser(options), *next_);
                         if (bounds_) bounds_->add_coarse(chunk.voxels, next_->coder_->decoded());
                       });
}

void PyramidCoder::end_chunk(const Chunk &chunk) {
  coder_->end_chunk(chunk);
  for (const std::uint64_t mask : chunk.no_data) no_data_.add(mask);
  clear_no_data(chunk, volume_.info.dims);  // what a coarser level is made of, and compared with
  if (!next_) return;
  if (bounds_) {
    bounds_->add_fine(chunk.voxels);
    if (is_finest_) keep_lost(chunk.lost);
  }
  downsampler_->add(chunk.voxels);
}

void PyramidCoder::finish(const LevelBounds::Off &off) {
  const std::vector<float> errors = finish_level();
  volume_.bounds = encode_bounds(errors.empty() ? off.decoded : errors);
  volume_.bounds.by_place = !errors.empty();
  if (next_) next_->finish(finish_bounds(off.made));
}

LevelBounds::Off PyramidCoder::finish_bounds(std::span<const float> made) {
  if (!bounds_) return {};
  if (!lost_.empty()) lost_.resize(num_blocks_);
  return bounds_->finish(is_finest_ ? std::span<const float>(lost_) : made);
}

void PyramidCoder::keep_lost(std::span<const float> lost) {
  if (std::ranges::any_of(lost, [](float of_block) { return of_block > 0; })) {
    lost_.resize(num_blocks_);
    lost_.insert(lost_.end(), lost.begin(), lost.end());
  }
  num_blocks_ += lost.size();
}

}  // namespace isowave::core
