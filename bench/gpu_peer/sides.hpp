#pragma once
// The sides that gpu_peer compares with isowave: a volume in one kind of storage, drawn by one
// kernel that walks its cells. No CUDA here: what CUDA's compiler compiles is behind GridSide.

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/frame/normals.hpp"
#include "kernels_cl/portable/shade.h"

namespace isowave::core::bench {

/// Where a side keeps its volume, and draws. The host is for checks: it runs the same code.
enum class Place { kHost, kDevice };

/// Voxels of a volume as [z][y][x].
struct GridVolume {
  std::array<std::uint32_t, 3> dims{};
  std::span<const float> values;
  bool is_uint8 = false;  ///< all values are whole numbers of 0..255
};

/// The first change of a pixel's ray.
struct alignas(16) GridHit {
  float t;                       ///< distance from the eye [world units]; INFINITY: none
  float grad_x, grad_y, grad_z;  ///< gradient, of the kind asked for [value per voxel]
};

/// What a side costs beside its frames.
struct GridCosts {
  std::uint64_t bytes = 0;     ///< its buffers, without those of pictures
  double build_ms = 0;         ///< wall clock from voxels in host memory
  double max_voxel_error = 0;  ///< largest |stored - voxel|
};

class GridSide {
 public:
  virtual ~GridSide() = default;
  GridSide(const GridSide &) = delete;
  GridSide &operator=(const GridSide &) = delete;

  virtual GridCosts costs() const = 0;
  /// Finds out what rays can skip. Returns ms, as draw().
  virtual double set_isovalue(float isovalue) = 0;
  /// Draws the hits of a view, with the gradients of cells, and leaves them where the side is.
  /// Returns the ms of the kernel, by CUDA events; on the host, by the wall clock. Waits.
  virtual double draw(const View &view) = 0;
  /// The hits of the last draw() [height][width].
  virtual std::vector<GridHit> hits() const = 0;
  /// Draws a view, shaded as isowave's. Returns RGB [height][width][3] in host memory, until the
  /// next call. Waits.
  virtual std::span<const std::uint8_t> picture(const View &view, const ShadeParams &shading,
                                                Normals normals) = 0;

 protected:
  GridSide() = default;
};

struct NamedSide {
  std::string name;
  std::unique_ptr<GridSide> side;
};

/// Names of sides to make; empty: all.
using WantedSides = std::vector<std::string>;
inline bool is_wanted(const WantedSides &wanted, const std::string &name) {
  return wanted.empty() || std::find(wanted.begin(), wanted.end(), name) != wanted.end();
}

/// Textures of every voxel, as 8-bit integers (of such volumes alone) and float. Rays skip by value
/// ranges of bricks.
///
/// max_pixels  of all views
/// Throws      std::runtime_error: CUDA refuses something
std::vector<NamedSide> make_texture_sides(Place place, const GridVolume &volume,
                                          std::uint64_t max_pixels, const WantedSides &wanted);
/// NanoVDB's grids of every voxel: float, Fp8, FpN with errors of at most max_error, and integers
/// of 8 bits (of such volumes alone). Each once with a bit for each cell, and once with value
/// ranges of leaves. Otherwise as make_texture_sides().
std::vector<NamedSide> make_nanovdb_sides(Place place, const GridVolume &volume,
                                          std::uint64_t max_pixels, float max_error,
                                          const WantedSides &wanted);

/// The GPU that CUDA uses, and its memory.
struct GpuInfo {
  std::string name;
  int driver = 0, runtime = 0;  ///< versions of CUDA, 1000 * major + 10 * minor
  std::uint64_t used_bytes = 0;
};
/// Throws  std::runtime_error: there is none
GpuInfo gpu_info();

}  // namespace isowave::core::bench
