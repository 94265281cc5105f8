#include "reference/grid_oracle.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/parallel_for.hpp"

namespace isowave::core {

namespace {

constexpr int kBrickCells = 8;

using Cell = VoxelField::Cell;

/// Takes a ray from box to box of a grid, each `size` cells wide.
class BoxWalk {
 public:
  /// t         where the ray enters the cells lower to upper - 1, which it stays in
  BoxWalk(const OracleRay &ray, double t, const Cell &lower, const Cell &upper, int size)
      : ray_(ray), size_(size) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      first_[axis] = lower[axis] / size;
      last_[axis] = (upper[axis] - 1) / size;
      const double place = std::floor((ray.origin[axis] + t * ray.direction[axis]) / size);
      at_[axis] = static_cast<int>(
          std::clamp(place, static_cast<double>(first_[axis]), static_cast<double>(last_[axis])));
    }
  }

  const Cell &at() const { return at_; }

  /// Goes on to the next box. Returns whether there is one.
  bool step() {
    std::size_t through = 0;
    double least = kInfinity;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (ray_.direction[axis] == 0) continue;
      const int plane = size_ * (at_[axis] + (ray_.direction[axis] > 0 ? 1 : 0));
      const double t = (plane - ray_.origin[axis]) / ray_.direction[axis];
      if (t < least) {
        least = t;
        through = axis;
      }
    }
    at_[through] += ray_.direction[through] > 0 ? 1 : -1;
    return at_[through] >= first_[through] && at_[through] <= last_[through];
  }

 private:
  const OracleRay &ray_;
  int size_;
  Cell first_{}, last_{}, at_{};
};

}  // namespace

GridOracle::GridOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims,
                       float isovalue)
    : field_(voxels, {}, dims, isovalue) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    bricks_[axis] = (std::size_t{dims[axis]} - 2) / kBrickCells + 1;
  active_.resize(bricks_[0] * bricks_[1] * bricks_[2]);
  parallel_for(bricks_[2], 0, [&](std::uint64_t z, std::uint32_t) {
    for (std::size_t y = 0; y < bricks_[1]; ++y) {
      for (std::size_t x = 0; x < bricks_[0]; ++x) {
        const Cell brick{static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)};
        Cell lower, upper;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          lower[axis] = kBrickCells * brick[axis];
          upper[axis] = std::min(lower[axis] + kBrickCells, static_cast<int>(dims[axis]) - 1);
        }
        active_[brick_at(brick)] = has_both_sides(lower, upper) ? 1 : 0;
      }
    }
  });
}

/// Whether the voxels lower to upper, both included, are on both sides.
bool GridOracle::has_both_sides(const Cell &lower, const Cell &upper) const {
  bool some_inside = false, some_outside = false;
  for (int z = lower[2]; z <= upper[2]; ++z) {
    for (int y = lower[1]; y <= upper[1]; ++y) {
      for (int x = lower[0]; x <= upper[0]; ++x) {
        const bool inside = field_.value(field_.voxel_at(x, y, z)) >= field_.isovalue();
        some_inside |= inside;
        some_outside |= !inside;
      }
    }
  }
  return some_inside && some_outside;
}

/// The first hit in the cells lower to upper - 1.
OracleHit GridOracle::hit_within(const OracleRay &ray, const Cell &lower, const Cell &upper,
                                 bool start_inside) const {
  const auto within = clip(ray, lower, upper);
  if (!within) return {};
  BoxWalk walk(ray, within->t_enter, lower, upper, 1);
  do {
    const Cell &cell = walk.at(), end{cell[0] + 1, cell[1] + 1, cell[2] + 1};
    if (!has_both_sides(cell, end)) continue;
    const auto segment = clip(ray, cell, end);
    if (!segment) continue;
    if (const auto t = field_.first_other_side(ray, cell, *segment, start_inside))
      return {true, *t, cell};
  } while (walk.step());
  return {};
}

OracleHit GridOracle::first_hit(const OracleRay &ray) const {
  bool enters = false;
  const bool start_inside = field_.starts_inside(ray, enters);
  if (!enters) return {};
  Cell last;
  for (std::size_t axis = 0; axis < 3; ++axis)
    last[axis] = static_cast<int>(field_.dims()[axis]) - 1;
  BoxWalk walk(ray, clip(ray, {0, 0, 0}, last)->t_enter, {0, 0, 0}, last, kBrickCells);
  do {
    const Cell &brick = walk.at();
    if (active_[brick_at(brick)] == 0) continue;
    Cell lower, upper;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower[axis] = kBrickCells * brick[axis];
      upper[axis] = std::min(lower[axis] + kBrickCells, last[axis]);
    }
    if (const OracleHit hit = hit_within(ray, lower, upper, start_inside); hit.hit) return hit;
  } while (walk.step());
  return {};
}

}  // namespace isowave::core
