#pragma once
// Light that ambient rays bring from the surface that they meet (kernels_cl/bounce.cl).

#include <cstdint>

#include "core/frame/ambient_rays.hpp"
#include "core/stages/levelled_kernel.hpp"
#include "kernels/bounce.hpp"

namespace isowave::core {

class Bounce {
 public:
  /// layer_rays: rays of a frame of layers; 0: there are no such frames.
  static ocl::BufferSizes sizes(std::uint64_t layer_rays);
  /// levels: frames may have several levels of detail.
  Bounce(ocl::Device &device, std::uint64_t num_pixels, bool levels = false,
         std::uint64_t layer_rays = 0);

  /// Before the rounds of a frame; arguments as of Ambient::begin().
  ///
  /// Waits  if the rays differ from those of the frame before
  void begin(const VolumeInfo &info, std::size_t level, const LightRays &light_rays,
             std::uint32_t num_surfaces = 1);

  /// In frames of layers: takes the nearer of what ambient rays have met into `nearest`.
  ///
  /// surface  that they have met, clipped by rays.clip
  /// In       rays.given, given_hits
  /// Waits    no
  void take_nearest(const Wavefront &rays, std::uint32_t surface);

  /// Replaces the ambient rays of a round that have met the surface by rays towards the light, and
  /// takes out the others.
  ///
  /// met      rays.given_hits; in frames of layers `nearest`, and rays.clip has no planes
  /// In, Out  rays.given, rays.open_counts, num_ambient
  /// Out      rays.bounced_next: what the new rays bring if they meet nothing
  /// Waits    no
  void go_to_light(Wavefront &rays, std::uint32_t round, const ocl::Buffer<HitRecord> &met);

  /// Adds what these rays bring, and takes them out.
  ///
  /// In       rays.given_hits, rays.bounced_next
  /// In, Out  rays.given, rays.bounced, num_bounced
  /// Waits    no
  void add(Wavefront &rays, std::uint32_t round);
  /// The same in frames of layers, by the colours of the surfaces in `nearest`.
  ///
  /// layers   [1]
  /// has_map  of the frame's ShadeParams
  void add_colored(Wavefront &rays, std::uint32_t round, const ocl::Buffer<LayerParams> &layers,
                   uint has_map);

  /// Filters the light of all rounds.
  ///
  /// num_sums  of each ray: 1, or of a layer ISO_LAYER_SUMS
  /// In       rays.hits of the frame, or of the layer
  /// In, Out  rays.bounced
  /// Out      rays.given: scratch
  /// Waits    no
  void filter(Wavefront &rays, std::uint32_t num_sums = 1);

  ocl::Buffer<HitRecord> nearest;  ///< [layer_rays] by pixel: what ambient rays have met

 private:
  ocl::Range range_;
  ocl::Buffer<AmbientDirection> directions_;  ///< towards the light
  LightRays light_rays_{};
  AmbientParams params_{};
  uint level_ = 0, num_surfaces_ = 1;
  ocl::Kernel<kernels::bounce_nearest> nearest_;
  LevelledKernel<kernels::bounce_rays> rays_;
  ocl::Kernel<kernels::add_bounced> add_;
  ocl::Kernel<kernels::add_colored> add_colored_;
  ocl::Kernel<kernels::place_hits> place_;
  ocl::Kernel<kernels::filter_bounced> filter_;
};

}  // namespace isowave::core
