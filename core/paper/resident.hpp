#pragma once
// The floor that benchmarks compare with: the whole volume decoded in device memory, a frame in one
// launch. The picture is the pipelines', bit for bit; see kernels_cl/paper/resident.cl.

#include <optional>
#include <string>
#include <vector>

#include "core/frame/solvers.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/zfp_decode.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels/resident.hpp"

namespace isowave::core {

class Resident {
 public:
  /// The buffers that stay, beside those of the Macrocells.
  static ocl::BufferSizes sizes(std::uint64_t num_blocks, ImageSize size);

  /// Decodes the whole volume.
  ///
  /// device  must outlive this
  /// volume  need not
  /// Throws  Error: the device's memory does not suffice
  /// Waits   yes
  Resident(ocl::Device &device, const CompressedVolume &volume, ImageSize size,
           Solver solver = kDefaultSolver);

  /// Why the device cannot hold the decoded volume, in one line; nothing if it can.
  static std::optional<std::string> obstacle(const ocl::Device &device,
                                             const CompressedVolume &volume, ImageSize size);

  /// Draws one frame. The first frame of an isovalue also finds its blocks.
  ///
  /// Returns  wall clock from the camera to the finished hit buffer on the device [ms]
  /// Waits    yes
  double render(const Camera &camera, float isovalue);

  /// Returns  the hit buffer [height * width], row 0 at the top
  /// Waits    yes
  std::vector<HitRecord> hits() const { return hits_.read(); }

 private:
  /// stream: the compressed volume, which only decoding needs.
  Resident(ocl::Device &device, const CompressedVolume &volume, ImageSize size, Solver solver,
           const DeviceStream &stream, const ocl::BufferSizes &sizes);

  ocl::Device &device_;
  VolumeInfo info_;
  ImageSize size_;
  std::uint32_t num_blocks_;
  std::optional<float> selected_isovalue_;  ///< what masks and changing_ stand for
  Macrocells macrocells_;
  ocl::Buffer<float> values_;    ///< [num_blocks * 64]
  ocl::Buffer<ulong> inside_;    ///< [num_blocks]
  ocl::Buffer<ulong> changing_;  ///< [num_blocks]
  ocl::Buffer<HitRecord> hits_;  ///< [pixels]
  ocl::Kernel<kernels::resident_inside> inside_kernel_;
  ocl::Kernel<kernels::resident_changing> changing_kernel_;
  ocl::Kernel<kernels::resident> kernel_;
};

}  // namespace isowave::core
