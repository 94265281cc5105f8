#pragma once
// Light that ambient rays bring from the surface that they meet (kernels_cl/bounce.cl).

#include <cstdint>

#include "core/frame/ambient_rays.hpp"
#include "core/stages/levelled_kernel.hpp"
#include "kernels/bounce.hpp"

namespace isowave::core {

class Bounce {
 public:
  static ocl::BufferSizes sizes();
  /// levels: frames may have several levels of detail.
  Bounce(ocl::Device &device, std::uint64_t num_pixels, bool levels = false);

  /// Before the rounds of a frame; arguments as of Ambient::begin().
  ///
  /// Waits  if the rays differ from those of the frame before
  void begin(const VolumeInfo &info, std::size_t level, const LightRays &light_rays);

  /// Replaces the ambient rays of a round that have met the surface by rays towards the light, and
  /// takes out the others.
  ///
  /// In       rays.given_hits
  /// In, Out  rays.given, rays.open_counts, num_ambient
  /// Out      rays.bounced_next: what the new rays bring if they meet nothing
  /// Waits    no
  void go_to_light(Wavefront &rays, std::uint32_t round);

  /// Adds what these rays bring, and takes them out.
  ///
  /// In       rays.given_hits, rays.bounced_next
  /// In, Out  rays.given, rays.bounced, num_bounced
  /// Waits    no
  void add(Wavefront &rays, std::uint32_t round);

  /// Filters the light of all rounds.
  ///
  /// In       rays.hits of the frame
  /// In, Out  rays.bounced
  /// Out      rays.given: scratch
  /// Waits    no
  void filter(Wavefront &rays);

 private:
  ocl::Range range_;
  ocl::Buffer<AmbientDirection> directions_;  ///< towards the light
  LightRays light_rays_{};
  AmbientParams params_{};
  uint level_ = 0;
  LevelledKernel<kernels::bounce_rays> rays_;
  ocl::Kernel<kernels::add_bounced> add_;
  ocl::Kernel<kernels::place_hits> place_;
  ocl::Kernel<kernels::filter_bounced> filter_;
};

}  // namespace isowave::core
