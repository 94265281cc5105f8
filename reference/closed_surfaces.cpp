#include "reference/closed_surfaces.hpp"

#include <algorithm>
#include <cmath>

#include "core/volume/pyramid.hpp"

namespace isowave::core {

namespace {

using Vec = std::array<double, 3>;

constexpr double kCentre = 20.3;

double sphere(const Vec &p) {
  return 17 - std::hypot(p[0] - kCentre, p[1] - kCentre, p[2] - kCentre);
}

double torus(const Vec &p) {
  const double ring = std::hypot(p[0] - kCentre, p[1] - kCentre) - 12;
  return 5 - std::hypot(ring, p[2] - kCentre);
}

double gyroid_shell(const Vec &p) {
  const double k = 0.35;
  const double g = std::sin(k * p[0]) * std::cos(k * p[1]) +
                   std::sin(k * p[1]) * std::cos(k * p[2]) +
                   std::sin(k * p[2]) * std::cos(k * p[0]);
  return std::min(2 * (0.7 - std::abs(g)), sphere(p));
}

constexpr std::array<ClosedSurface, 3> kSurfaces = {
    {{"sphere", sphere}, {"torus", torus}, {"gyroid shell", gyroid_shell}}};

/// p: index space of the finest level.
double trilinear(const FrameParams &frame, std::span<const float> voxels, std::size_t level,
                 const Vec &p) {
  const std::array<std::size_t, 3> dims{frame.grid.dims_x, frame.grid.dims_y, frame.grid.dims_z};
  std::array<std::size_t, 3> c;
  Vec f;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double x = std::ldexp(p[axis], -static_cast<int>(level));
    c[axis] = std::min(static_cast<std::size_t>(x), dims[axis] - 2);
    f[axis] = x - static_cast<double>(c[axis]);
  }
  double sum = 0;
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const std::size_t x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
    sum += (x ? f[0] : 1 - f[0]) * (y ? f[1] : 1 - f[1]) * (z ? f[2] : 1 - f[2]) *
           double(voxels[c[0] + x + dims[0] * (c[1] + y + dims[1] * (c[2] + z))]);
  }
  return sum;
}

}  // namespace

std::span<const ClosedSurface> closed_surfaces() {
  return kSurfaces;
}

std::vector<float> sample_surface(const ClosedSurface &surface) {
  std::vector<float> voxels;
  for (std::uint32_t z = 0; z < kSurfaceEdge; ++z) {
    for (std::uint32_t y = 0; y < kSurfaceEdge; ++y) {
      for (std::uint32_t x = 0; x < kSurfaceEdge; ++x)
        voxels.push_back(static_cast<float>(surface.field({double(x), double(y), double(z)})));
    }
  }
  return voxels;
}

bool GridLevels::is_inside(const Vec &p) const {
  for (std::size_t level = 0; level < frames.size(); ++level) {
    if (trilinear(frames[level], voxels[level], level, p) < 1e-3) return false;
  }
  return true;
}

GridLevels surface_levels(const ClosedSurface &surface, std::size_t num_levels) {
  GridLevels levels;
  VolumeInfo info;
  info.dims = glm::uvec3(kSurfaceEdge);
  for (std::size_t level = 0; level < num_levels; ++level) {
    levels.frames.push_back(make_grid_params(info));
    levels.frames.back().view.t_scale = 1;
    levels.voxels.push_back(level == 0 ? sample_surface(surface)
                                       : downsample(2u * info.dims - 2u, levels.voxels.back()));
    info = coarser_level(info);
  }
  return levels;
}

}  // namespace isowave::core
