#pragma once
// Rounds of ambient and shadow rays: how open hits are, and how lit (kernels_cl/ambient.cl).

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
  /// level         the finest level of detail that draws, whose grid is `info`
  /// num_surfaces  hits of surfaces of greater numbers have no rays
  /// Waits         if the rays differ from those of the frame before
  void begin(const VolumeInfo &info, std::size_t level, const LightRays &light_rays,
             std::uint32_t num_surfaces = 1);

  /// Counts the rays of round - 1 that met nothing, and makes the rays of a round, unless it is the
  /// last: the number of begin()'s rays.
  ///
  /// In     rays.hits of the frame; rays.given_hits of round - 1
  /// Out    rays.open_counts, num_ambient, num_shadow; rays.given
  /// Waits  no
  void operator()(Wavefront &rays, std::uint32_t round);

  /// Takes out the rays of the round that have met a surface, before they go to the next one.
  ///
  /// In, Out  rays.given, rays.given_hits
  /// Waits    no
  void block(Wavefront &rays);
  /// Moves the rays of the round to where they enter rays.clip, before they go to the first surface
  /// that it clips.
  ///
  /// In, Out  rays.given; nearest: hits that the rays have already, Bounce::nearest; may be null
  /// Waits    no
  void enter(Wavefront &rays, ocl::Buffer<HitRecord> *nearest = nullptr);

 private:
  ocl::Range range_;
  ocl::Buffer<AmbientDirection> directions_;
  LightRays light_rays_{};
  AmbientParams params_{};
  uint level_ = 0, num_surfaces_ = 1;
  LevelledKernel<kernels::ambient> kernel_;
  ocl::Kernel<kernels::ambient_block> block_;
  ocl::Kernel<kernels::ambient_enter> enter_;
};

}  // namespace isowave::core
