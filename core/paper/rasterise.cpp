#include "core/paper/rasterise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace isowave::core {

namespace {

/// Triangles that cover so much of the picture that all work-items share them. Those beyond the
/// list are drawn by a work-group each.
constexpr std::uint32_t kListed = 4096;

}  // namespace

RasterView make_raster_view(const View &view) {
  const glm::dmat3 rows =
      glm::transpose(glm::inverse(glm::dmat3(glm::dvec3(view.fwd_x, view.fwd_y, view.fwd_z),
                                             glm::dvec3(view.right_x, view.right_y, view.right_z),
                                             glm::dvec3(view.up_x, view.up_y, view.up_z))));
  const auto to_float = [](double x) { return static_cast<float>(x); };
  const double pixel = 2.0 * view.pixel_scale;  // step of u and v
  return {.forward_x = to_float(rows[0].x),
          .forward_y = to_float(rows[0].y),
          .forward_z = to_float(rows[0].z),
          .right_x = to_float(rows[1].x),
          .right_y = to_float(rows[1].y),
          .right_z = to_float(rows[1].z),
          .up_x = to_float(rows[2].x),
          .up_y = to_float(rows[2].y),
          .up_z = to_float(rows[2].z),
          .border_u = to_float(0.5 * pixel * view.width),
          .border_v = to_float(0.5 * pixel * view.height),
          .columns_per_u = to_float(1 / pixel),
          .centre_column = 0.5f * static_cast<float>(view.width - 1),
          .centre_row = 0.5f * static_cast<float>(view.height - 1),
          // The test rounds a corner's place on its plane once, by 2^-24 of what cancels there; the
          // projection rounds a quotient, which may be off by 2.5 ulp where a device does not
          // divide exactly, and its product with columns_per_u. In the picture, which is where it
          // matters, that is less than 2^-20 of the picture's larger side.
          .margin = to_float(0x1p-20 * std::max(view.width, view.height))};
}

ocl::BufferSizes Rasterise::sizes(std::uint64_t num_rays) {
  return {ocl::buffer_size<uint>("nearest depths", num_rays),
          ocl::buffer_size<uint>("nearest triangles", num_rays),
          ocl::buffer_size<uint>("large triangles", 1 + kListed)};
}

Rasterise::Rasterise(ocl::Device &device, std::uint64_t num_rays)
    : device_(device),
      depth_(device, sizes(num_rays)["nearest depths"]),
      triangles_(device, sizes(num_rays)["nearest triangles"]),
      listed_(device, sizes(num_rays)["large triangles"]),
      clear_(device, group_defines(ocl::kGroupSize)),
      part_(device, group_defines(ocl::kGroupSize)),
      list_(device, group_defines(ocl::kGroupSize)),
      hits_(device, group_defines(ocl::kGroupSize)) {}

void Rasterise::clear(Wavefront &rays) {
  const View &view = rays.frame.view;
  view_ = make_raster_view(view);
  pixels_range_ =
      ocl::Range::strided(std::uint64_t{view.width} * view.height, ocl::kGroupSize, device_);
  clear_(pixels_range_, rays.frame, depth_, triangles_, rays.hits);
}

void Rasterise::operator()(const ocl::Buffer<BlockVertex> &vertices, std::uint32_t num_triangles,
                           Wavefront &rays) {
  if (num_triangles > vertices.size() / 3) {
    throw std::invalid_argument(
        fmt::format("Rasterise: {} triangles of '{}', which has {} vertices", num_triangles,
                    vertices.name(), vertices.size()));
  }
  if (num_triangles == 0) return;
  const ocl::Range parts = ocl::Range::strided(num_triangles, ocl::kGroupSize, device_);
  for (const uint turn : {0u, 1u}) {
    listed_.fill(0, 0, 1);
    part_(parts, rays.frame, view_, num_triangles, turn, vertices, depth_, triangles_, kListed,
          listed_);
    list_(pixels_range_, rays.frame, view_, turn, vertices, depth_, triangles_, kListed, listed_);
  }
  hits_(pixels_range_, rays.frame, view_, vertices, triangles_, rays.hits);
}

}  // namespace isowave::core
