#pragma once
// Hit buffer -> arrays in host memory: picture, depth, normals, positions
// (core/frame/frame_arrays.hpp, kernels_cl/shade.cl).

#include <cstdint>

#include "core/frame/frame_arrays.hpp"
#include "core/frame/surfaces.hpp"
#include "core/stages/hit_positions.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/layers.hpp"
#include "kernels/shade.hpp"

namespace isowave::core {

class Shade {
 public:
  /// max_pixels: of a picture.
  static ocl::BufferSizes sizes(std::uint64_t max_pixels);
  Shade(ocl::Device &device, std::uint64_t max_pixels);

  /// Launches the kernels without a pixel to shade, see Device::Compiling. Positions' kernel is
  /// compiled when they are first wanted.
  ///
  /// layers  colours of rays; null: there will be none
  void compile(Wavefront &rays, const ocl::Buffer<RayColor> *layers = nullptr);

  /// The arrays of rays.hits; pictures with the ambient light that rays.open_counts lets through,
  /// or of layers.
  ///
  /// layers   colours of rays; null: the frame has none
  /// samples  rays a pixel along each axis
  /// map      for positions
  /// Waits    once
  FrameArrays operator()(const WantedArrays &wanted, const Shading &shading, const HitMap &map,
                         Wavefront &rays, const ocl::Buffer<RayColor> *layers,
                         std::uint32_t samples);
  /// The picture as RGBA, red in bits 0..7, see shade_pixel(). A is 0 if no ray of a pixel hits.
  ///
  /// Waits  yes
  HostArray<uint> packed(const Shading &shading, Wavefront &rays,
                         const ocl::Buffer<RayColor> *layers, std::uint32_t samples);

 private:
  template <class T>
  void shade(const Shading &shading, Wavefront &rays, const ocl::Buffer<RayColor> *layers,
             std::uint32_t samples, HostArray<T> &image);
  template <class T, class Launch>
  void copy_parts(HostArray<T> &values, std::size_t num_rays, const Launch &launch);

  ocl::Device &device_;
  /// The picture, or parts of other arrays, on their way to the host.
  ocl::Buffer<std::byte> staging_;
  ocl::Buffer<uint> color_map_;  ///< [ISO_MAP_COLORS] on_device_
  ColorTable on_device_{};
  ocl::Kernel<kernels::shade> shade_;
  ocl::Kernel<kernels::layers_shade> shade_layers_;
  ocl::Kernel<kernels::hit_depths> depths_;
  ocl::Kernel<kernels::hit_normals> normals_;
  HitPositions positions_;
  HostMemory memory_;
  cl::Event copied_;  ///< the end of the last copy to the host
};

}  // namespace isowave::core
