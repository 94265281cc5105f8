#pragma once
// Which blocks may hold the isosurface (Sec. 3.1): value ranges of blocks and of coarse macrocells of 4^3
// blocks, built once per volume from decoded data, and one bit per block for the isovalue at hand. See
// kernels_cl/macrocells.cl.

#include <vector>

#include "core/device_counts.hpp"
#include "core/ocl/kernel.hpp"

namespace isowave {

class Macrocells {
 public:
  /// Decodes every block once, beside a sample for the quantile table, and waits.
  /// frame  its dims and blocks are used. Scratch during the build: 128 bytes per block of one z layer.
  Macrocells(ocl::Device &device, ocl::Buffer<FrameParams> &frame, const FrameParams &params,
             const ocl::Buffer<uint> &words, std::uint32_t bits_per_block);

  /// The first threshold at or above the isovalue: FrameParams::isovalue_index.
  std::uint32_t isovalue_index(float isovalue) const;

  /// Rebuilds masks() for frame.isovalue_index. Asynchronous.
  void select(ocl::Buffer<FrameParams> &frame);

  /// [2 * coarse macrocells]: bit x + 4y + 16z of each block in its macrocell, 32 bits a word.
  const ocl::Buffer<uint> &masks() const { return masks_; }
  /// [blocks]: low in bits 0..7, high in bits 8..15, indices into thresholds(); low > high: owns no dual
  /// cell.
  const ocl::Buffer<cl_ushort> &ranges() const { return ranges_; }
  /// [256], ascending from -inf to +inf.
  const std::vector<float> &thresholds() const { return thresholds_; }

 private:
  struct ValueRange {
    float min, max;
  };
  using PartialsKernel =
      ocl::Kernel<ocl::In<FrameParams>, ocl::In<uint>, uint, uint, uint, uint, ocl::Out<ValueRange>>;

  std::vector<float> sample_thresholds(ocl::Device &device, ocl::Buffer<FrameParams> &frame,
                                       const FrameParams &params, const ocl::Buffer<uint> &words,
                                       std::uint32_t bits_per_block, PartialsKernel &partials_kernel);

  std::uint32_t num_coarse_;
  ocl::Range coarse_range_;
  ocl::Buffer<cl_ushort> ranges_, coarse_ranges_;
  ocl::Buffer<uint> masks_;
  std::vector<float> thresholds_;
  ocl::Kernel<ocl::In<FrameParams>, uint, ocl::In<cl_ushort>, ocl::In<cl_ushort>, ocl::Out<uint>>
      masks_kernel_;
};

}  // namespace isowave
