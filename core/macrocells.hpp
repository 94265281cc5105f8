#pragma once
// Which blocks may hold the isosurface (Sec. 3.1): value ranges of blocks and of coarse macrocells of 4^3
// blocks, built once per volume from decoded data, and one bit per block for the isovalue at hand. See
// kernels_cl/macrocells.cl.

#include <array>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "core/device_counts.hpp"
#include "core/device_stream.hpp"
#include "core/ocl/kernel.hpp"

namespace isowave {

/// Of one level of detail or of several, one behind the other: FrameParams::ranges_begin, masks_begin.
struct MacrocellBuffers {
  MacrocellBuffers(ocl::Device &device, std::uint64_t num_blocks, std::uint64_t num_macrocells)
      : ranges(device, "block ranges", num_blocks), masks(device, "macrocell masks", 2 * num_macrocells) {}
  ocl::Buffer<cl_ushort> ranges;
  ocl::Buffer<uint> masks;
};

class Macrocells {
 public:
  /// Decodes every block once, beside a sample for the quantile table, and waits.
  /// frame  its dims and blocks are used. Scratch during the build: 128 bytes per block of one z layer.
  /// buffers: shared with other levels; none: its own.
  Macrocells(ocl::Device &device, const FrameParams &frame, const DeviceStream &stream,
             std::shared_ptr<MacrocellBuffers> buffers = {});

  /// Bytes that building needs beside what stays.
  static std::uint64_t setup_scratch_bytes(const glm::uvec3 &num_blocks);

  /// Rebuilds masks() for frame.isovalue, where voxels may be value_error from those that the ranges were made of. moved: the stream,
  /// if its layout raises or lowers voxels as it did not when the ranges were made.
  void select(const FrameParams &frame, double value_error = 0, const DeviceStream *moved = nullptr);
  /// Sets what a frame of the isovalue selected last needs: its isovalue_index ...
  void set_index(FrameParams &frame) const { frame.isovalue_index = isovalue_index_; }
  /// ... and its active box, for which the first call waits.
  void set_active_box(FrameParams &frame);

  /// [2 * coarse macrocells]: bit x + 4y + 16z of each block in its macrocell, 32 bits a word.
  const ocl::Buffer<uint> &masks() const { return buffers_->masks; }
  /// [blocks]: low in bits 0..7, high in bits 8..15, indices into thresholds(); low > high: owns no dual
  /// cell.
  const ocl::Buffer<cl_ushort> &ranges() const { return buffers_->ranges; }
  /// [256], ascending from -inf to +inf.
  const std::vector<float> &thresholds() const { return thresholds_; }

 private:
  struct ValueRange {
    float min, max;
  };
  using PartialsKernel =
      ocl::Kernel<FrameParams, ocl::In<uint>, ocl::In<uint>, ocl::In<uint>, ocl::In<uint>, ocl::In<uint>,
                  StreamLayout, uint, uint, uint, uint, ocl::Out<ValueRange>>;
  /// Decodes blocks sampled_block(first + i * stride, stride), i in [0, count): partials [8 * count].
  struct Partials {
    void operator()(std::uint32_t first, std::uint32_t stride, std::uint32_t count,
                    ocl::Buffer<ValueRange> &partials);
    ocl::Device &device;
    const FrameParams &frame;
    const DeviceStream &stream;
    PartialsKernel kernel;
  };

  void build(ocl::Device &device, const FrameParams &frame, const DeviceStream &stream);
  std::vector<float> sample_thresholds(ocl::Device &device, std::uint32_t num_blocks, Partials &decode);

  std::uint32_t num_coarse_;
  ocl::Range coarse_range_;
  std::shared_ptr<MacrocellBuffers> buffers_;
  ocl::Buffer<cl_ushort> coarse_ranges_;
  ocl::Buffer<uint> limits_;
  ocl::Buffer<int> box_;
  /// begin x, y, z, end x, y, z [macrocells]; none: still on the device.
  std::optional<std::array<int, 6>> active_box_;
  std::uint32_t isovalue_index_ = 0;
  std::vector<float> thresholds_;
  ocl::Kernel<FrameParams, uint, ocl::In<cl_ushort>, ocl::In<cl_ushort>, ocl::In<uint>, uint, ocl::In<uint>,
              uint, ocl::Out<uint>, ocl::Out<int>>
      masks_kernel_;
};

}  // namespace isowave
