#pragma once
// Closed surfaces for the watertight tests, as grids of voxels with coarser levels, and what is
// inside of them.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/view/frame.hpp"

namespace isowave::core {

struct ClosedSurface {
  const char *name;
  double (*field)(const std::array<double, 3> &
                      p);  ///< index space; the surface at 0, positive inside, well within the grid
};
inline constexpr std::uint32_t kSurfaceEdge = 42;  ///< voxels along each axis; not a multiple of 4
/// Sphere, torus, gyroid shell.
std::span<const ClosedSurface> closed_surfaces();

/// [z][y][x] of a surface's grid.
std::vector<float> sample_surface(const ClosedSurface &surface);

/// A grid, and coarser levels of it.
struct GridLevels {
  std::vector<FrameParams> frames;
  std::vector<std::vector<float>> voxels;

  /// Whether the point, in index space of the finest, is inside at every level, and further from
  /// the surface than float32 rays are from the point: of the fields between the voxels, which are
  /// what must be closed: trilinear, in double.
  bool is_inside(const std::array<double, 3> &p) const;
};
/// num_levels: by downsample().
GridLevels surface_levels(const ClosedSurface &surface, std::size_t num_levels);

}  // namespace isowave::core
