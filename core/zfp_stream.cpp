// Compression and decompression of whole volumes by libzfp, or compression by a device. With a whole number
// of bits per voxel a block is a whole number of 64-bit words, so rows of blocks are compressed apart, in
// parallel, and laid end to end: the same bytes as one call for the whole array. A device gets whole layers
// (zfp_encode); voxels are checked here in both cases.

#include "core/zfp_stream.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <future>
#include <limits>
#include <stdexcept>

#include "core/error.hpp"
#include "core/io/mapped_file.hpp"
#include "core/libzfp.hpp"
#include "core/parallel_for.hpp"
#include "core/zfp_encode.hpp"
#include "core/zfp_file.hpp"

namespace isowave {

namespace {

using Payload = std::span<const std::byte>;
using Sink = std::function<void(Payload)>;

/// What is learnt of a run of voxels while it is compressed.
struct Findings {
  std::uint64_t bad_count = 0, first_bad = ~std::uint64_t(0);  ///< NaN, Inf; linear voxel index
  std::uint64_t too_large_count = 0, first_too_large = ~std::uint64_t(0);
  float min = std::numeric_limits<float>::infinity(), max = -std::numeric_limits<float>::infinity();
  double max_error = 0;

  bool refused() const { return bad_count > 0 || too_large_count > 0; }

  void add(const Findings &other) {
    bad_count += other.bad_count;
    first_bad = std::min(first_bad, other.first_bad);
    too_large_count += other.too_large_count;
    first_too_large = std::min(first_too_large, other.first_too_large);
    min = std::min(min, other.min);
    max = std::max(max, other.max);
    max_error = std::max(max_error, other.max_error);
  }
};

/// Adds the range of `values` to `found` if each of them is compressed as it is. Else returns false. Made for
/// vector instructions: no branches, and the bits of floats as integers of the same order.
bool add_plain_values(std::span<const float> values, Findings &found) {
  constexpr std::int32_t kMagnitudeBits = 0x7FFFFFFF;
  constexpr auto kLeast = std::bit_cast<std::int32_t>(kMinMagnitude);
  constexpr auto kEnd = std::bit_cast<std::int32_t>(kMaxMagnitude);
  const auto ordered = [](std::int32_t bits) {
    return bits ^ ((bits >> 31) & kMagnitudeBits);
  };  // its own inverse
  std::int32_t min = std::numeric_limits<std::int32_t>::max(), max = std::numeric_limits<std::int32_t>::min();
  std::uint32_t others = 0;
  for (const float value : values) {
    const auto bits = std::bit_cast<std::int32_t>(value);
    const std::int32_t magnitude = bits & kMagnitudeBits, order = ordered(bits);
    others |= std::uint32_t(magnitude != 0) &
              (std::uint32_t(magnitude < kLeast) | std::uint32_t(magnitude >= kEnd));
    min = std::min(min, order);
    max = std::max(max, order);
  }
  if (others != 0) return false;
  found.min = std::min(found.min, std::bit_cast<float>(ordered(min)));
  found.max = std::max(found.max, std::bit_cast<float>(ordered(max)));
  return true;
}

/// Reads chunks of voxel layers, always one ahead of the chunk being compressed.
class Compressor {
 public:
  Compressor(VolumeReader &reader, const CompressOptions &options)
      : reader_(reader), options_(options), dims_(reader.info().dims) {
    const std::uint64_t slab_voxels = kBlock * layer_size();
    const std::uint64_t slabs = std::max<std::uint64_t>(1, kChunkVoxels / slab_voxels);
    chunk_layers_ = std::uint32_t(std::min<std::uint64_t>(slabs * kBlock, (dims_.z + 3u) / 4u * 4u));
    if (options.device) encoder_.emplace(*options.device, dims_, 64 * options.rate, options.measure_error);
  }

  /// Hands the payload to `sink`, in order. Throws Error on voxels that cannot be compressed, after
  /// all of them were looked at.
  Findings run(const Sink &sink) {
    Findings total;
    std::vector<float> current, next;
    std::future<void> pending = read_ahead(0, next);
    for (std::uint32_t z = 0; z < dims_.z; z += chunk_layers_) {
      pending.get();
      std::swap(current, next);
      pending = read_ahead(std::uint64_t(z) + chunk_layers_, next);
      total.add(compress_chunk(z, current));
      if (!total.refused()) {
        if (encoder_) {
          encoder_->encode(current, layers_at(z), sink);
        } else {
          sink(std::as_bytes(std::span(words_)));
        }
      }
      if (options_.progress) options_.progress(z + layers_at(z), dims_.z);
    }
    refuse_bad_voxels(total);
    if (encoder_) {
      encoder_->finish(sink);
      total.max_error = encoder_->max_error();
    }
    return total;
  }

 private:
  static constexpr std::uint32_t kBlock = 4;                 // voxels along a block's edge
  static constexpr std::uint64_t kChunkVoxels = 1ull << 22;  // enough to keep threads busy, 16 MiB

  std::uint64_t layer_size() const { return std::uint64_t(dims_.x) * dims_.y; }
  std::uint32_t layers_at(std::uint64_t z) const {
    return z < dims_.z ? std::uint32_t(std::min<std::uint64_t>(chunk_layers_, dims_.z - z)) : 0;
  }

  std::future<void> read_ahead(std::uint64_t z, std::vector<float> &voxels) {
    return std::async(std::launch::async, [this, z, &voxels] {
      const std::uint32_t layers = layers_at(z);
      voxels.resize(layer_size() * layers);
      if (layers > 0) reader_.read_layers(std::uint32_t(z), layers, voxels);
    });
  }

  /// Checks the layers in `voxels`, which start at layer z, and compresses them to words_ unless a device does
  /// that.
  Findings compress_chunk(std::uint32_t z, std::vector<float> &voxels) {
    const std::uint32_t layers = layers_at(z);
    const std::uint64_t rows_per_slab = (dims_.y + 3u) / 4u;
    const std::uint64_t num_rows = rows_per_slab * ((layers + 3u) / 4u);
    const std::uint64_t row_words = std::uint64_t((dims_.x + 3u) / 4u) * options_.rate;
    if (!encoder_) words_.resize(num_rows * row_words);
    std::vector<Findings> findings(thread_count(options_.num_threads));
    parallel_for(num_rows, options_.num_threads, [&](std::uint64_t row, std::uint32_t thread) {
      const auto slab = std::uint32_t(row / rows_per_slab), by = std::uint32_t(row % rows_per_slab);
      const Row where{by * kBlock, slab * kBlock, std::min(kBlock, dims_.y - by * kBlock),
                      std::min(kBlock, layers - slab * kBlock)};
      Findings &found = findings[thread];
      check_voxels(voxels, where, z, found);
      // One bad voxel refuses the volume: what follows is only counted.
      if (found.refused() || encoder_) return;
      code_row(voxels, where, std::span(words_).subspan(row * row_words, row_words), found);
    });
    Findings total;
    for (const Findings &found : findings) total.add(found);
    return total;
  }

  /// A row of blocks along x within a chunk: its first voxel row and layer, and how many of each it has.
  struct Row {
    std::uint32_t y, z, ny, nz;
  };

  std::uint64_t voxel_at(const Row &row, std::uint32_t y, std::uint32_t z) const {
    return (row.z + z) * layer_size() + std::uint64_t(row.y + y) * dims_.x;
  }

  /// Maps NaN, flushes tiny values, and notes range and voxels that cannot be compressed.
  void check_voxels(std::vector<float> &voxels, const Row &row, std::uint32_t z_begin,
                    Findings &found) const {
    for (std::uint32_t z = 0; z < row.nz; ++z) {
      for (std::uint32_t y = 0; y < row.ny; ++y) {
        const std::uint64_t begin = voxel_at(row, y, z);
        if (add_plain_values(std::span(voxels).subspan(begin, dims_.x), found)) continue;
        for (std::uint32_t x = 0; x < dims_.x; ++x) {
          float &value = voxels[begin + x];
          if (!std::isfinite(value)) {
            if (!options_.map_nan) {
              ++found.bad_count;
              found.first_bad = std::min(found.first_bad, z_begin * layer_size() + begin + x);
              continue;
            }
            value = *options_.map_nan;
          }
          found.min = std::min(found.min, value);
          found.max = std::max(found.max, value);
          const float magnitude = std::abs(value);
          if (magnitude < kMinMagnitude) {
            value = 0.0f;
          } else if (magnitude >= kMaxMagnitude) {
            ++found.too_large_count;
            found.first_too_large = std::min(found.first_too_large, z_begin * layer_size() + begin + x);
          }
        }
      }
    }
  }

  /// Compresses one row of blocks to `words`, and decodes it again when the error is asked for.
  void code_row(std::vector<float> &voxels, const Row &row, std::span<std::uint64_t> words,
                Findings &found) const {
    const ZfpStream stream = make_zfp_stream(64 * options_.rate);
    const ZfpBits bits(stream_open(words.data(), words.size_bytes()), &stream_close);
    zfp_stream_set_bit_stream(stream.get(), bits.get());
    const ZfpField field(
        zfp_field_3d(voxels.data() + voxel_at(row, 0, 0), zfp_type_float, dims_.x, row.ny, row.nz),
        &zfp_field_free);
    zfp_field_set_stride_3d(field.get(), 1, std::ptrdiff_t(dims_.x), std::ptrdiff_t(layer_size()));
    if (zfp_compress(stream.get(), field.get()) != words.size_bytes()) {
      throw std::logic_error("zfp: a row of blocks has not its fixed size");
    }
    if (!options_.measure_error) return;

    std::vector<float> decoded(std::size_t(dims_.x) * row.ny * row.nz);
    const ZfpField copy(zfp_field_3d(decoded.data(), zfp_type_float, dims_.x, row.ny, row.nz),
                        &zfp_field_free);
    zfp_stream_rewind(stream.get());
    if (zfp_decompress(stream.get(), copy.get()) == 0)
      throw std::logic_error("zfp: cannot decode its own blocks");
    const float *value = decoded.data();
    for (std::uint32_t z = 0; z < row.nz; ++z) {
      for (std::uint32_t y = 0; y < row.ny; ++y) {
        const float *source = voxels.data() + voxel_at(row, y, z);
        for (std::uint32_t x = 0; x < dims_.x; ++x, ++value) {
          found.max_error = std::max(found.max_error, std::abs(double(*value) - double(source[x])));
        }
      }
    }
  }

  std::string position(std::uint64_t voxel) const {
    return fmt::format("({},{},{})", voxel % dims_.x, voxel / dims_.x % dims_.y, voxel / layer_size());
  }

  void refuse_bad_voxels(const Findings &found) const {
    if (found.bad_count > 0) {
      throw Error(
          "{} of {} voxels are NaN or infinite, the first at {}: give a value for them with --map-nan",
          found.bad_count, reader_.info().num_voxels(), position(found.first_bad));
    }
    if (found.too_large_count > 0) {
      throw Error(
          "{} of {} voxels are beyond +-{:.4g}, the first at {}: zfp cannot hold them, scale the volume down",
          found.too_large_count, reader_.info().num_voxels(), kMaxMagnitude, position(found.first_too_large));
    }
  }

  VolumeReader &reader_;
  const CompressOptions &options_;
  glm::uvec3 dims_;
  std::uint32_t chunk_layers_ = 0;
  std::vector<std::uint64_t> words_;     ///< of the present chunk
  std::optional<LayerEncoder> encoder_;  ///< where a device encodes
};

void check_options(const VolumeReader &reader, const CompressOptions &options) {
  if (options.rate < 1 || options.rate > 32)
    throw Error("rate {}: must be 1 to 32 bits per voxel", options.rate);
  if (options.map_nan && !(std::abs(*options.map_nan) < kMaxMagnitude)) {
    throw Error("--map-nan {}: must be finite and below {:.4g}", *options.map_nan, kMaxMagnitude);
  }
  check_volume_info(reader.info(), "volume");
}

CompressedVolume describe(const VolumeReader &reader, const CompressOptions &options) {
  CompressedVolume volume;
  volume.info = reader.info();
  volume.bits_per_block = 64 * options.rate;
  return volume;
}

void add_findings(CompressedVolume &volume, const CompressOptions &options, const Findings &found) {
  // Not -0: of equal values, the one met first would depend on the threads.
  volume.value_range = {found.min + 0.0f, found.max + 0.0f};
  if (options.measure_error) volume.max_error = found.max_error;
}

}  // namespace

std::uint64_t CompressedVolume::word_count() const {
  return words.empty() ? (block_count() * bits_per_block + 31) / 32 + 2 : words.size();
}

void CompressedVolume::read_words(std::uint64_t bit, std::span<std::uint32_t> out) const {
  const std::uint64_t end = block_count() * bits_per_block;
  const std::uint64_t asked = 32 * std::uint64_t{out.size()},
                      bits = bit < end ? std::min(asked, end - bit) : 0;
  const std::span<const std::byte> bytes = file ? file->bytes() : std::as_bytes(std::span(words));
  const std::uint64_t first = (file ? file_first_bit : 0) + bit, shift = first % 8;
  const std::byte *source = bytes.data() + first / 8;
  const std::uint64_t num_words = bits / 32;
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
  const std::uint64_t left = bits % 32;
  if (left != 0) {
    std::memcpy(&last, source + num_words * sizeof(std::uint32_t), (shift + left + 7) / 8);
    last = last >> shift & ((1ull << left) - 1);
  }
  out[num_words] = std::uint32_t(last);
  std::ranges::fill(out.subspan(num_words + 1), 0u);
}

CompressedVolume compress(VolumeReader &reader, const CompressOptions &options) {
  check_options(reader, options);
  CompressedVolume volume = describe(reader, options);
  volume.words.resize(volume.block_count() * volume.bits_per_block / 32 + 2);
  std::size_t begin = 0;
  const Findings found = Compressor(reader, options).run([&](Payload payload) {
    std::memcpy(volume.words.data() + begin, payload.data(), payload.size());
    begin += payload.size() / sizeof(std::uint32_t);
  });
  add_findings(volume, options, found);
  return volume;
}

CompressedVolume compress_to_file(VolumeReader &reader, const CompressOptions &options,
                                  const std::filesystem::path &path) {
  check_options(reader, options);
  CompressedVolume volume = describe(reader, options);
  ZfpFileWriter file(path, volume);
  const Findings found = Compressor(reader, options).run([&](Payload payload) { file.write(payload); });
  add_findings(volume, options, found);
  file.commit(volume);
  return volume;
}

std::vector<float> decode_with_libzfp(const CompressedVolume &volume) {
  // libzfp reads whole 64-bit words: four of 32 bits more keep its last read inside.
  std::vector<std::uint32_t> words(volume.word_count() + 4);
  if (volume.file) volume.file->check();
  volume.read_words(0, words);
  const glm::uvec3 dims = volume.info.dims;
  std::vector<float> voxels(volume.info.num_voxels());
  const ZfpStream stream = make_zfp_stream(volume.bits_per_block);
  const ZfpBits bits(stream_open(words.data(), words.size() * sizeof(std::uint32_t)), &stream_close);
  zfp_stream_set_bit_stream(stream.get(), bits.get());
  const ZfpField field(zfp_field_3d(voxels.data(), zfp_type_float, dims.x, dims.y, dims.z), &zfp_field_free);
  if (zfp_decompress(stream.get(), field.get()) == 0) throw std::logic_error("zfp: cannot decode");
  return voxels;
}

}  // namespace isowave
