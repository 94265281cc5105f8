#pragma once
// Rounds of ambient rays: how open hits are (kernels_cl/ambient.cl).

#include <cstdint>

#include "core/frame/ambient_rays.hpp"
#include "core/stages/levelled_kernel.hpp"
#include "kernels/ambient.hpp"

namespace isowave::core {

class Ambient {
 public:
  static ocl::BufferSizes sizes();
  /// levels: frames may have several levels of detail.
  /// placed: rays.hits are placed_hit()s.
  Ambient(ocl::Device &device, std::uint64_t num_pixels, bool levels = false, bool placed = false);

  /// Before the rounds of a frame.
  ///
  /// level  the finest level of detail that draws, whose grid is `info`
  /// Waits  if the number of rays differs from that of the frame before
  void begin(const VolumeInfo &info, std::size_t level, std::uint32_t num_rays);

  /// Counts the rays of round - 1 that met nothing, and makes the rays of a round, unless it is the
  /// last: begin()'s num_rays.
  ///
  /// In     rays.hits of the frame; rays.given_hits of round - 1
  /// Out    rays.open_counts, num_ambient; rays.given
  /// Waits  no
  void operator()(Wavefront &rays, std::uint32_t round);

 private:
  ocl::Range range_;
  ocl::Buffer<AmbientDirection> directions_;
  std::uint32_t num_rays_ = 0;
  AmbientParams params_{};
  uint level_ = 0;
  LevelledKernel<kernels::ambient> kernel_;
};

}  // namespace isowave::core
