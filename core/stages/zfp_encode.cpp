#include "core/stages/zfp_encode.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/base/error.hpp"
#include "core/zfp/pyramid_coder.hpp"

namespace isowave::core {

namespace {

constexpr std::uint32_t kBlock = 4;  // voxels along a block's edge

std::uint64_t block_count(const glm::uvec3 &dims) {
  const glm::uvec3 blocks = (dims + (kBlock - 1)) / kBlock;
  return std::uint64_t{blocks.x} * blocks.y * blocks.z;
}

std::uint64_t voxel_count(const glm::uvec3 &dims) {
  return std::uint64_t{dims.x} * dims.y * dims.z;
}

void check_sizes(std::size_t voxels, const glm::uvec3 &dims, std::uint32_t bits_per_block,
                 std::uint64_t needed_words, std::size_t words) {
  if (bits_per_block == 0 || bits_per_block % 32 != 0 || bits_per_block > 2048) {
    throw std::invalid_argument(fmt::format(
        "ZfpEncode: {} bits per block: give a multiple of 32 up to 2048", bits_per_block));
  }
  if (block_count(dims) > UINT32_MAX || voxel_count(dims) > voxels || needed_words > words) {
    throw std::invalid_argument(fmt::format(
        "ZfpEncode: {}x{}x{} voxels at {} bits per block do not fit {} voxels and {} words", dims.x,
        dims.y, dims.z, bits_per_block, voxels, words));
  }
}

/// Whole slabs of four layers as far as they fit, else rows of blocks of one slab.
glm::uvec3 largest_piece(const glm::uvec3 &dims) {
  const auto fitting = [](std::uint64_t limit, std::uint64_t unit, std::uint32_t all) {
    const std::uint64_t count = std::max<std::uint64_t>(1, limit / (unit * kBlock)) * kBlock;
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(count, all));
  };
  const std::uint64_t layer = std::uint64_t{dims.x} * dims.y;
  if (layer * kBlock <= LayerEncoder::kPieceVoxels) {
    return {dims.x, dims.y, fitting(LayerEncoder::kPieceVoxels, layer, dims.z)};
  }
  return {dims.x, fitting(LayerEncoder::kPieceVoxels / kBlock, dims.x, dims.y),
          std::min(dims.z, kBlock)};
}

}  // namespace

ZfpEncode::ZfpEncode(ocl::Device &device) : device_(device), encode_(device), measure_(device) {}

void ZfpEncode::compile(const ocl::Buffer<float> &voxels, ocl::Buffer<uint> &words,
                        ocl::Buffer<float> *errors) {
  const auto compiling = device_.compiling();
  encode_({1, ocl::kGroupSize}, voxels, 0, 0, 0, 0, words);
  if (errors != nullptr) measure_({1, ocl::kGroupSize}, voxels, 0, 0, 0, 0, words, *errors);
}

void ZfpEncode::operator()(const ocl::Buffer<float> &voxels, const glm::uvec3 &dims,
                           std::uint32_t bits_per_block, ocl::Buffer<uint> &words) {
  const std::uint64_t num_blocks = block_count(dims);
  check_sizes(voxels.size(), dims, bits_per_block, num_blocks * (bits_per_block / 32),
              words.size());
  encode_(ocl::Range::strided(num_blocks, ocl::kGroupSize, device_), voxels, dims.x, dims.y, dims.z,
          bits_per_block, words);
}

void ZfpEncode::measure_errors(const ocl::Buffer<float> &voxels, const glm::uvec3 &dims,
                               std::uint32_t bits_per_block, const ocl::Buffer<uint> &words,
                               ocl::Buffer<float> &errors) {
  const std::uint64_t num_blocks = block_count(dims);
  check_sizes(voxels.size(), dims, bits_per_block, num_blocks * (bits_per_block / 32) + 1,
              words.size());
  if (errors.size() < kErrorsPerBlock * num_blocks)
    throw std::invalid_argument(
        fmt::format("ZfpEncode: {} errors do not fit {} for each of {} blocks", errors.size(),
                    kErrorsPerBlock, num_blocks));
  measure_(ocl::Range::strided(num_blocks, ocl::kGroupSize, device_), voxels, dims.x, dims.y,
           dims.z, bits_per_block, words, errors);
}

ocl::BufferSizes LayerEncoder::sizes(const glm::uvec3 &dims, std::uint32_t bits_per_block,
                                     bool measure_error) {
  const glm::uvec3 piece = largest_piece(dims);
  const std::uint64_t blocks = block_count(piece);
  return {ocl::buffer_size<float>("voxels to encode", voxel_count(piece)),
          ocl::buffer_size<uint>("encoded words", blocks * (bits_per_block / 32) + 1),
          ocl::buffer_size<float>("encoding errors",
                                  measure_error ? ZfpEncode::kErrorsPerBlock * blocks : 0)};
}

LayerEncoder::LayerEncoder(ocl::Device &device, const glm::uvec3 &dims,
                           std::uint32_t bits_per_block, bool measure_error, BlockErrors errors)
    : device_(device),
      dims_(dims),
      piece_dims_(largest_piece(dims)),
      bits_per_block_(bits_per_block),
      measure_error_(measure_error),
      errors_(std::move(errors)),
      zfp_encode_(device),
      voxels_(device, own_sizes()["voxels to encode"]),
      words_(device, own_sizes()["encoded words"]),
      device_errors_(device, own_sizes()["encoding errors"]),
      current_(device),
      previous_(device) {
  zfp_encode_.compile(voxels_, words_, measure_error ? &device_errors_ : nullptr);
}

void LayerEncoder::encode(std::span<const float> voxels, std::uint32_t num_layers,
                          const Sink &sink) {
  const std::uint64_t layer = std::uint64_t{dims_.x} * dims_.y;
  if (voxels.size() != layer * num_layers)
    throw std::invalid_argument("LayerEncoder: not whole layers");
  encode_pieces(
      num_layers,
      [&](const glm::uvec3 &begin, const glm::uvec3 &dims) {
        const std::uint64_t rows = std::uint64_t{dims.x} * dims.y;
        // Waits for the piece before, which still reads the buffer.
        if (rows == layer) return voxels_.write(voxels.subspan(begin.z * layer, layer * dims.z));
        for (std::uint32_t i = 0; i < dims.z; ++i) {
          voxels_.write(
              voxels.subspan((begin.z + i) * layer + std::uint64_t{begin.y} * dims.x, rows),
              i * rows);
        }
      },
      sink);
}

void LayerEncoder::encode(VoxelsInPlace &voxels, const Sink &sink, const Progress &progress) {
  encode_pieces(
      dims_.z,
      [&](const glm::uvec3 &begin, const glm::uvec3 &dims) {
        voxels.make(begin, dims, voxels_);  // behind the kernels of the piece before
        if (progress && begin.y + dims.y == dims_.y) progress(begin.z + dims.z, dims_.z);
      },
      sink);
}

template <class Fill>
void LayerEncoder::encode_pieces(std::uint32_t num_layers, const Fill &fill, const Sink &sink) {
  for (std::uint32_t z = 0; z < num_layers; z += piece_dims_.z) {
    for (std::uint32_t y = 0; y < dims_.y; y += piece_dims_.y) {
      const glm::uvec3 dims(dims_.x, std::min(piece_dims_.y, dims_.y - y),
                            std::min(piece_dims_.z, num_layers - z));
      fill(glm::uvec3(0, y, z), dims);
      const bool has_previous = std::exchange(in_flight_, true);
      std::swap(*current_, *previous_);
      enqueue_piece(dims);
      if (has_previous) hand_over(*previous_, sink);
    }
  }
}

void LayerEncoder::finish(const Sink &sink) {
  if (!std::exchange(in_flight_, false)) return;
  hand_over(*current_, sink);
}

void LayerEncoder::enqueue_piece(const glm::uvec3 &dims) {
  const auto stage = device_.timer().stage("zfp_encode");
  const std::uint64_t num_blocks = block_count(dims);
  zfp_encode_(voxels_, dims, bits_per_block_, words_);
  current_->words.resize(num_blocks * (bits_per_block_ / 32));
  if (measure_error_) {
    zfp_encode_.measure_errors(voxels_, dims, bits_per_block_, words_, device_errors_);
    current_->errors.resize(ZfpEncode::kErrorsPerBlock * num_blocks);
    device_errors_.read_async(current_->errors, current_->done);
  }
  words_.read_async(current_->words, current_->done);
}

void LayerEncoder::hand_over(const Result &result, const Sink &sink) {
  try {
    result.done.wait();
  } catch (const cl::Error &error) {
    throw Error("device '{}' failed to encode voxels: {}: {}", device_.info().name, error.what(),
                ocl::error_name(error.err()));
  }
  const float *pair = result.errors.data();
  for (BlockError &error : errors_.begin(result.errors.size() / ZfpEncode::kErrorsPerBlock)) {
    for (double &largest : error.at_place) {
      largest = double{pair[0]} + double{pair[1]};
      pair += 2;
    }
  }
  errors_.end();
  sink(std::as_bytes(std::span<const uint>(result.words)));
}

namespace {

/// Has a device compress whole chunks; what they become is not read back.
class DeviceCoder : public LevelCoder {
 public:
  DeviceCoder(ocl::Device &device, const glm::uvec3 &dims, const CompressOptions &options,
              const PayloadSink &sink, bool keep)
      : device_(device),
        encoder_(device, dims, 64 * options.rate, options.measure_error, BlockErrors(keep)),
        measure_error_(options.measure_error),
        progress_(options.input.progress),
        sink_(sink) {}

  void end_chunk(const Chunk &chunk) override {
    if (measure_error_) encoder_.errors().add_lost(chunk.lost);
    encoder_.encode(chunk.voxels, chunk.num_layers, sink_);
  }

  std::optional<std::array<float, 2>> code_made(DeviceVoxels &voxels) override {
    auto *in_place = dynamic_cast<VoxelsInPlace *>(&voxels);
    if (in_place == nullptr) return {};
    encoder_.encode(*in_place, sink_, progress_);
    return in_place->range();
  }

  std::vector<float> finish(CompressedVolume &volume) override {
    encoder_.finish(sink_);
    device_.timer().collect();  // the stage times belong to no frame
    if (measure_error_) volume.max_voxel_error = encoder_.errors().max();
    return encoder_.errors().take();
  }

  std::span<const float> decoded() const override { return {}; }

 private:
  ocl::Device &device_;
  LayerEncoder encoder_;
  bool measure_error_;
  Progress progress_;
  const PayloadSink &sink_;
};

}  // namespace

CoderMaker encoder_on(ocl::Device &device) {
  return [&device](const glm::uvec3 &dims, const CompressOptions &options, const PayloadSink &sink,
                   bool keep_errors) {
    return std::make_unique<DeviceCoder>(device, dims, options, sink, keep_errors);
  };
}

}  // namespace isowave::core
