#pragma once
// Voxels -> zfp blocks at a fixed rate, on a device.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/ocl/in_flight.hpp"
#include "core/volume/block_errors.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels/zfp_encode.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

class ZfpEncode {
 public:
  explicit ZfpEncode(ocl::Device &device);

  /// Launches the kernels without a block to work on, that which measures only with `errors`.
  ///
  /// Waits  yes
  void compile(const ocl::Buffer<float> &voxels, ocl::Buffer<uint> &words,
               ocl::Buffer<float> *errors);

  /// Encodes voxels [dims.z][dims.y][dims.x], block (bx,by,bz) to the bits_per_block / 32 words at
  /// index bx + blocks_x * (by + blocks_y * bz) of them. Bit-exact with libzfp, partial blocks too.
  /// Every magnitude is 0 or in [2^-97, 2^126).
  ///
  /// Throws  std::invalid_argument unless bits_per_block is a multiple of 32 in 32..2048 and both
  ///         buffers are large enough
  /// Waits   no
  void operator()(const ocl::Buffer<float> &voxels, const glm::uvec3 &dims,
                  std::uint32_t bits_per_block, ocl::Buffer<uint> &words);

  static constexpr std::size_t kErrorsPerBlock = 2 * ISO_BOUND_PLACES;
  /// The largest |decoded - voxel| at each place (bound_place()) of each block b of what operator()
  /// wrote, exactly: errors[2 i] + errors[2 i + 1], i = ISO_BOUND_PLACES b + place. `words` has one
  /// word behind the last block. Else as operator().
  void measure_errors(const ocl::Buffer<float> &voxels, const glm::uvec3 &dims,
                      std::uint32_t bits_per_block, const ocl::Buffer<uint> &words,
                      ocl::Buffer<float> &errors);

 private:
  ocl::Device &device_;
  ocl::Kernel<kernels::zfp_encode> encode_;
  ocl::Kernel<kernels::zfp_encode_errors> measure_;
};

/// Voxels that the encoder's device makes.
class VoxelsInPlace : public DeviceVoxels {
 public:
  /// Makes voxels [dims.z][dims.y][dims.x] from `begin` on, which are whole numbers below 2^24.
  ///
  /// Waits  no
  virtual void make(const glm::uvec3 &begin, const glm::uvec3 &dims,
                    ocl::Buffer<float> &voxels) = 0;
  /// The least and the greatest of all that were made.
  ///
  /// Waits  yes
  virtual std::array<float, 2> range() = 0;
};

/// Encodes a volume from its first layer to its last, in pieces of bounded size: while the device
/// works on one, the caller prepares the next.
class LayerEncoder {
 public:
  /// Voxels on the device at a time, or a row of blocks if a row has more.
  static constexpr std::uint64_t kPieceVoxels = 1ull << 22;
  /// Takes the payload in order.
  using Sink = std::function<void(std::span<const std::byte>)>;

  static ocl::BufferSizes sizes(const glm::uvec3 &dims, std::uint32_t bits_per_block,
                                bool measure_error);

  /// dims: of the whole volume. bits_per_block: a multiple of 64.
  LayerEncoder(ocl::Device &device, const glm::uvec3 &dims, std::uint32_t bits_per_block,
               bool measure_error, BlockErrors errors = BlockErrors(false));
  LayerEncoder(const LayerEncoder &) = delete;
  LayerEncoder &operator=(const LayerEncoder &) = delete;

  /// Encodes the next voxels [num_layers][ny][nx]; num_layers is a multiple of 4 but at the
  /// volume's end. Done with `voxels` when it returns. The pieces before the last one enqueued go
  /// to `sink`, called from this thread.
  void encode(std::span<const float> voxels, std::uint32_t num_layers, const Sink &sink);
  /// Encodes all layers of a volume whose voxels the device makes.
  ///
  /// progress  called with layers that were enqueued, and all; or none
  void encode(VoxelsInPlace &voxels, const Sink &sink, const Progress &progress);
  /// Hands the last piece to `sink`.
  void finish(const Sink &sink);

  /// The errors of the blocks that `sink` got; none unless measured.
  BlockErrors &errors() { return errors_; }

 private:
  /// A piece as the device sends it back.
  struct Result {
    std::vector<uint> words;
    std::vector<float> errors;
    cl::Event done;
  };

  ocl::BufferSizes own_sizes() const { return sizes(dims_, bits_per_block_, measure_error_); }
  /// Calls fill(begin, dims) for the pieces of so many layers, and encodes what voxels_ has then.
  template <class Fill>
  void encode_pieces(std::uint32_t num_layers, const Fill &fill, const Sink &sink);
  void enqueue_piece(const glm::uvec3 &dims);
  void hand_over(const Result &result, const Sink &sink);

  ocl::Device &device_;
  glm::uvec3 dims_, piece_dims_;  ///< of the volume; of the largest piece
  std::uint32_t bits_per_block_;
  bool measure_error_;
  BlockErrors errors_;
  ZfpEncode zfp_encode_;
  ocl::Buffer<float> voxels_;
  ocl::Buffer<uint> words_;
  ocl::Buffer<float> device_errors_;
  /// The piece at work, and the one before it.
  ocl::InFlight<Result> current_, previous_;
  bool in_flight_ = false;  ///< current_ is to come
};

/// CompressOptions::encoder by a device, which must outlive it.
CoderMaker encoder_on(ocl::Device &device);

}  // namespace isowave::core
