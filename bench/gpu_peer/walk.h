#pragma once
// A ray's walk through a volume's cells, and the first change on its way. For host and device, and
// for all kinds of storage.

#include "bench/gpu_peer/sides.hpp"
#include "bench/gpu_peer/skips.h"
#include "bench/gpu_peer/smooth_gradient.h"

namespace isowave::core::bench {

/// Index space; t as in core/view/frame.hpp.
struct WalkRay {
  float o[3], d[3];
};

/// make_ray() of kernels_cl/portable/grid_dda.h, of a pinhole.
PEER_BOTH WalkRay ray_of(const View &view, std::uint32_t column, std::uint32_t row) {
  const float u = float(2 * int(column) + 1 - int(view.width)) * view.pixel_scale;
  const float v = float(int(view.height) - 1 - 2 * int(row)) * view.pixel_scale;
  const float length = sqrtf(u * u + v * v + 1.0f);
  return {{view.eye_x, view.eye_y, view.eye_z},
          {(view.fwd_x + u * view.right_x + v * view.up_x) / length,
           (view.fwd_y + u * view.right_y + v * view.up_y) / length,
           (view.fwd_z + u * view.right_z + v * view.up_z) / length}};
}

/// The axis of the first of three planes. No index is computed from it: arrays of a kernel would be
/// in memory then.
struct Along {
  float t;
  bool is[3];  ///< of one axis alone

  PEER_BOTH explicit Along(const float at[3]) {
    t = fminf(at[0], fminf(at[1], at[2]));
    is[0] = at[0] == t;
    is[1] = !is[0] && at[1] == t;
    is[2] = !is[0] && !is[1];
  }
};

/// Where a ray is: in a cell, which it enters at t. Planes are crossed at moments that depend on
/// ray and plane alone, so that nothing adds up on the way.
class Walk {
 public:
  /// Goes to the volume. Returns whether the ray meets it.
  PEER_BOTH bool enter(const WalkRay &ray, const int dims[3]) {
    float end = INFINITY;
    bool beside = false;
    t = 0.0f;
    for (int a = 0; a < 3; ++a) {
      o_[a] = ray.o[a];
      d_[a] = ray.d[a];
      inv_[a] = 1.0f / ray.d[a];
      last_[a] = dims[a] - 1;
      const bool moves = d_[a] != 0.0f;
      const float low = -o_[a] * inv_[a], high = (float(last_[a]) - o_[a]) * inv_[a];
      t = fmaxf(t, moves ? fminf(low, high) : 0.0f);
      end = fminf(end, moves ? fmaxf(low, high) : INFINITY);
      beside = beside || (!moves && !(o_[a] >= 0.0f && o_[a] <= float(last_[a])));
    }
    for (int a = 0; a < 3; ++a) cell[a] = clamped(o_[a] + t * d_[a], 0, last_[a] - 1);
    return t < end && !beside;
  }

  /// Goes on behind the box of 2^log cells that the cell is in. Returns whether that is in the
  /// volume.
  PEER_BOTH bool leave(int log) {
    int base[3], end[3];
    float at[3];
    for (int a = 0; a < 3; ++a) {
      base[a] = cell[a] >> log << log;
      end[a] = least(base[a] + (1 << log), last_[a]);
      at[a] = moment(a, d_[a] > 0.0f ? end[a] : base[a]);
    }
    const Along along(at);
    t = fmaxf(t, along.t);
    bool is_in = true;
    for (int a = 0; a < 3; ++a) {
      const int behind = d_[a] > 0.0f ? end[a] : base[a] - 1;
      const int low = d_[a] < 0.0f ? base[a] : cell[a], high = d_[a] > 0.0f ? end[a] - 1 : cell[a];
      const int beside = clamped(o_[a] + t * d_[a], low, high);
      cell[a] = along.is[a] ? behind : beside;
      is_in = is_in && cell[a] >= 0 && cell[a] < last_[a];
    }
    return is_in;
  }

  /// Begins to go cell by cell.
  PEER_BOTH void begin_cells() {
    for (int a = 0; a < 3; ++a) next_[a] = moment(a, cell[a] + (d_[a] > 0.0f));
  }
  /// When the ray leaves the cell.
  PEER_BOTH float cell_end() const { return fmaxf(t, fminf(next_[0], fminf(next_[1], next_[2]))); }
  /// Goes on to the next cell. Returns whether that is in the same brick.
  PEER_BOTH bool next_cell() {
    const Along along(next_);
    t = fmaxf(t, along.t);
    bool same = true;
    for (int a = 0; a < 3; ++a) {
      const int before = cell[a];
      cell[a] += along.is[a] ? (d_[a] > 0.0f ? 1 : -1) : 0;
      next_[a] = along.is[a] ? moment(a, cell[a] + (d_[a] > 0.0f)) : next_[a];
      same = same && before >> kBrickLog == cell[a] >> kBrickLog && cell[a] < last_[a];
    }
    return same;
  }
  PEER_BOTH bool is_in() const {
    bool in = true;
    for (int a = 0; a < 3; ++a) in = in && cell[a] >= 0 && cell[a] < last_[a];
    return in;
  }
  /// The way through the cell, until then.
  PEER_BOTH Segment way(float end) const {
    Segment segment;
    for (int a = 0; a < 3; ++a) {
      segment.from[a] = in_cell(a, t);
      segment.step[a] = in_cell(a, end) - segment.from[a];
    }
    return segment;
  }

  int cell[3];
  float t;

 private:
  PEER_BOTH float moment(int a, int plane) const {
    return d_[a] == 0.0f ? INFINITY : (float(plane) - o_[a]) * inv_[a];
  }
  PEER_BOTH float in_cell(int a, float at) const {
    return fminf(fmaxf(o_[a] - float(cell[a]) + at * d_[a], 0.0f), 1.0f);
  }
  PEER_BOTH static int clamped(float at, int low, int high) {
    const int cell = static_cast<int>(floorf(at));
    return cell < low ? low : (cell > high ? high : cell);
  }

  float o_[3], d_[3], inv_[3], next_[3];
  int last_[3];  ///< planes at the end of the volume
};

/// The sides of a ray: none is known before the first cell that changes, and all cells before it
/// are on the side where the ray begins in that cell.
struct RaySide {
  bool known = false, inside = false;
};

/// The first change in a cell: when, and where in the cell. Returns whether there is one.
PEER_BOTH bool hit_in_cell(const Walk &walk, const Corners &corners, RaySide &side, float *t,
                           float at[3]) {
  const float end = walk.cell_end();
  const Segment way = walk.way(end);
  const FieldCubic cubic = cubic_along(corners, way);
  if (!side.known) side.inside = cubic.c[0] >= 0.0f;
  side.known = true;
  float s;
  if (!first_change(cubic, side.inside, &s)) return false;
  for (int a = 0; a < 3; ++a) at[a] = way.from[a] + s * way.step[a];
  *t = walk.t + s * (end - walk.t);
  return true;
}

/// The first change of `inside := f >= isovalue` along a ray.
///
/// kMasks   whether `skips` has a bit for each cell
/// kSmooth  whether the hit's gradient is smooth, or the one of the cell's field
/// Reader   enter(cell): the next cells are in the brick of that one; corners(cell, f): the values
///          of its corners, [4 x + 2 y + z]; value(x, y, z): a voxel's
template <bool kMasks, bool kSmooth, class Reader>
PEER_BOTH GridHit first_hit(const Skips &skips, const WalkRay &ray, Reader reader, float isovalue,
                            float t_scale) {
  const GridHit none{INFINITY, 0.0f, 0.0f, 0.0f};
  Walk walk;
  RaySide side;
  if (!walk.enter(ray, skips.dims)) return none;
  for (;;) {
    for (;;) {
      const int log = skips.macro_changes(walk.cell) ? kBrickLog : kMacroLog;
      if (log == kBrickLog && skips.brick_changes(walk.cell)) break;
      if (!walk.leave(log)) return none;
    }
    const std::uint32_t *mask = nullptr;
    if (kMasks) mask = skips.masks + kMaskWords * skips.slots[skips.brick_of(walk.cell)];
    reader.enter(walk.cell);
    walk.begin_cells();
    do {
      if (kMasks) {
        const int x = walk.cell[0] & 7, y = walk.cell[1] & 7, z = walk.cell[2] & 7;
        if ((mask[2 * x + (y >> 2)] >> (8 * (y & 3) + z) & 1u) == 0) continue;
      }
      Corners corners;
      reader.corners(walk.cell, corners.f);
      for (int i = 0; i < 8; ++i) corners.f[i] -= isovalue;
      if (!kMasks && !changes(corners)) continue;
      float t, at[3], gradient[3];
      if (!hit_in_cell(walk, corners, side, &t, at)) continue;
      gradient_at(corners, at, gradient);
      if (kSmooth) smooth_gradient(reader, skips.dims, walk.cell, at, gradient);
      return {t * t_scale, gradient[0], gradient[1], gradient[2]};
    } while (walk.next_cell());
    if (!walk.is_in()) return none;
  }
}

}  // namespace isowave::core::bench
