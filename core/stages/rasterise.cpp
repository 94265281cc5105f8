#include "core/stages/rasterise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace isowave::core {

namespace {

/// Triangles that cover so much of the picture that all work-items share them. Those beyond the
/// list are drawn by a work-group each.
constexpr std::uint32_t kListed = 4096;

}  // namespace

RasterView make_raster_view(const View &view) {
  const Projection projection = make_projection(view);
  const glm::dmat3 rows = glm::transpose(projection.to_view);
  // A corner is off by 2^-23 of its largest coordinate where it is rounded, the test's plane by
  // 2^-22 through the ray's slopes and by 2^-24 through its own rounding, view coordinates by 2^-22
  // of their largest product: together less than 2^-20, in the largest row.
  double largest_row = 0;
  for (int row = 0; row < 3; ++row)
    largest_row = std::max(largest_row,
                           std::abs(rows[row].x) + std::abs(rows[row].y) + std::abs(rows[row].z));
  // Columns are computed from u with a few roundings, of numbers below twice the picture's size.
  const double rounding = 0x1p-20 * std::max(view.width, view.height);
  const glm::dvec2 margin = projection.margin + rounding,
                   border = 1.0001 * (projection.border + projection.pixel * margin);
  const auto to_float = [](double x) { return static_cast<float>(x); };
  return {.forward_x = to_float(rows[0].x),
          .forward_y = to_float(rows[0].y),
          .forward_z = to_float(rows[0].z),
          .right_x = to_float(rows[1].x),
          .right_y = to_float(rows[1].y),
          .right_z = to_float(rows[1].z),
          .up_x = to_float(rows[2].x),
          .up_y = to_float(rows[2].y),
          .up_z = to_float(rows[2].z),
          .border_u = to_float(border.x),
          .border_v = to_float(border.y),
          .columns_per_u = to_float(1 / projection.pixel),
          .centre_column = 0.5f * static_cast<float>(view.width - 1),
          .centre_row = 0.5f * static_cast<float>(view.height - 1),
          .margin_x = to_float(margin.x),
          .margin_y = to_float(margin.y),
          .doubt = to_float(0x1p-20 * largest_row)};
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
      clear_(device, "rasterise", "raster_clear", group_defines(ocl::kGroupSize)),
      part_(device, "rasterise", "raster_part", group_defines(ocl::kGroupSize)),
      list_(device, "rasterise", "raster_listed", group_defines(ocl::kGroupSize)),
      hits_(device, "rasterise", "raster_hits", group_defines(ocl::kGroupSize)) {}

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
  hits_(pixels_range_, rays.frame, vertices, triangles_, rays.hits);
}

}  // namespace isowave::core
