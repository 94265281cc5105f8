#pragma once
// Triangles -> hit buffer (kernels_cl/paper/rasterise.cl): what Block-Compressed Marching Cubes has
// drawn by the graphics pipeline, as OpenCL kernels, with the same bits on every device.

#include "core/stages/wavefront.hpp"
#include "core/view/frame.hpp"
#include "kernels/rasterise.hpp"
#include "kernels_cl/portable/raster.h"

namespace isowave::core {

/// A view as triangles are drawn by it.
RasterView make_raster_view(const View &view);

class Rasterise {
 public:
  static ocl::BufferSizes sizes(std::uint64_t num_rays);
  Rasterise(ocl::Device &device, std::uint64_t num_rays);

  /// Begins a picture: no pixel has a hit.
  ///
  /// In     rays.frame: its view is used, here and for what follows
  /// Out    rays.hits
  /// Waits  no
  void clear(Wavefront &rays);

  /// Draws the next part of a mesh. A hit is the nearest triangle that the pixel's ray meets; of
  /// equally near ones the first in the mesh.
  ///
  /// vertices  [3 * num_triangles]
  /// In        rays.frame: its view and grid
  /// Out       rays.hits; their gradients are directions alone: the triangles' normals
  /// Throws    std::invalid_argument: there are not so many vertices
  /// Waits     no
  void operator()(const ocl::Buffer<BlockVertex> &vertices, std::uint32_t num_triangles,
                  Wavefront &rays);

 private:
  ocl::Device &device_;
  ocl::Range pixels_range_;
  RasterView view_{};
  ocl::Buffer<uint> depth_, triangles_;  ///< [rays]
  ocl::Buffer<uint> listed_;             ///< how many large triangles, then these
  ocl::Kernel<kernels::raster_clear> clear_;
  ocl::Kernel<kernels::raster_part> part_;
  ocl::Kernel<kernels::raster_listed> list_;
  ocl::Kernel<kernels::raster_hits> hits_;
};

}  // namespace isowave::core
