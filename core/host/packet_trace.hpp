#pragma once
// Eight rays at a time through a HostField: the hits of the scalar walk, bit for bit. For
// host_packets.cpp alone, which compiles it for processors with AVX2.
//
// A packet has 4 x 2 rays of the picture. All of its rays first look for a macrocell with active
// blocks, then those that have found one for such a block, then for a cell that changes; only when
// no ray walks any more are cells tested, those of all rays together. A ray that leaves a block or
// a macrocell on its way is looked after before that.
//
// A ray keeps the crossing by which it entered the region that it is in, as axis and plane: the
// moment follows from these when a cell is tested. Until then, moments are float32, and lanes that
// these leave in doubt (grid_dda.h) ask the scalar functions.

#include <algorithm>
#include <cstddef>

#include "core/host/float8.hpp"
#include "core/host/host_loops.hpp"
#include "core/stages/solvers.hpp"
#include "kernels_cl/portable/cell_intersect.h"

namespace isowave::core::packets {

static_assert(kDefaultSolver.kind == ISO_SOLVER_BERNSTEIN, "there is no other here");

/// From the smallest on.
enum : int { kCells, kBlocks, kMacrocells, kNumLevels };
inline constexpr int kSizes[kNumLevels] = {1, 4, 4 * ISO_MACROCELL_BLOCKS};  ///< voxels

/// One axis of eight rays, as RayAxis. float_t() of a plane is (plane - from) * rate, also where d
/// = 0.
struct PacketAxis {
  Floats o, d, inv_hi, inv_lo, from, rate;
  Mask up;      ///< d > 0
  Floats sign;  ///< 1 or -1, by up
};

/// Where rays cross a plane; axis ISO_AXIS_START: where they start.
struct Crossings {
  Ints axis;
  Floats plane;
};

struct TwoFloats {
  Floats hi, lo;
};

/// Where the rays are among the regions of one size.
struct Level {
  Floats far[3];  ///< planes by which they leave
  Ints place;  ///< number of the region in the larger one, x + 4y + 16z; macrocells: in the volume
  Ints stride[3];  ///< of place, by the ray's direction
  Ints low, high;  ///< 64 bits: which of the regions in the larger one are to be entered
};

/// Cells in which rays hit, not yet refined.
struct FoundCells {
  Mask lanes;
  Crossings enter, exit;
  Floats cell[3];
  Floats lo, hi;  ///< Bracket
};

struct Packet {
  PacketAxis axis[3];
  Floats last[3];  ///< planes at the domain's end
  Floats end[3];   ///< planes by which rays leave the macrocells of the active box
  Level level[kNumLevels];
  Mask at[kNumLevels];  ///< lanes that walk among the regions of this size
  Crossings entered;    ///< by which rays entered the regions where they are
  FoundCells found;
};

/// What is the same for all packets of a tile.
struct PacketScene {
  const FrameParams *frame;
  const HostField *field;
  LastPlanes last;
  int begin[3], end[3];    ///< planes of the box of active blocks
  int first[3], final[3];  ///< its macrocells
  int columns, rows;       ///< macrocells of the volume along x and y
};

// ---- Pure functions, as those of the same name in kernels_cl/portable.

inline TwoFloats plane_t(Floats o, Floats inv_hi, Floats inv_lo, Floats plane) {
  const Floats s = plane - o;
  const Floats back = s - plane;
  const Floats e = (plane - (s - back)) - (o + back);
  const Floats h = s * inv_hi;
  const Floats l = fma(s, inv_hi, -h) + fma(s, inv_lo, e * inv_hi);
  TwoFloats t;
  t.hi = h + l;
  t.lo = l - (t.hi - h);
  return t;
}

inline Floats local_position(const PacketAxis &a, const TwoFloats &t, Floats c) {
  const Floats s = a.o - c;
  const Floats sb = a.o - s;
  const Floats se = (a.o - (s + sb)) + (sb - c);
  const Floats p = t.hi * a.d;
  const Floats pe = fma(t.lo, a.d, fma(t.hi, a.d, -p));
  const Floats r = s + p;
  const Floats rb = r - s;
  const Floats re = (s - (r - rb)) + (p - rb);
  const Floats x = r + (re + (pe + se));
  return select(x <= 0.0f, Floats{}, select(x >= 1.0f, eight(1.0f), x));
}

inline Floats lerp(Floats u, Floats a, Floats b) {
  return fma(u, b, fma(-u, a, a));
}

struct Cubics {
  Floats b0, b1, b2, b3;
};

inline Floats cubic_value(const Cubics &c, Floats s, Floats *derivative) {
  const Floats c0 = lerp(s, c.b0, c.b1), c1 = lerp(s, c.b1, c.b2), c2 = lerp(s, c.b2, c.b3);
  const Floats d0 = lerp(s, c0, c1), d1 = lerp(s, c1, c2);
  *derivative = 3.0f * (d1 - d0);
  return lerp(s, d0, d1);
}

inline Cubics segment_cubic(const Floats *w, const Floats *a, const Floats *b) {
  const Floats a00 = lerp(a[0], w[0], w[1]), a10 = lerp(a[0], w[2], w[3]);
  const Floats a01 = lerp(a[0], w[4], w[5]), a11 = lerp(a[0], w[6], w[7]);
  const Floats b00 = lerp(b[0], w[0], w[1]), b10 = lerp(b[0], w[2], w[3]);
  const Floats b01 = lerp(b[0], w[4], w[5]), b11 = lerp(b[0], w[6], w[7]);
  const Floats aa0 = lerp(a[1], a00, a10), aa1 = lerp(a[1], a01, a11);
  const Floats ab0 = lerp(b[1], a00, a10), ab1 = lerp(b[1], a01, a11);
  const Floats ba0 = lerp(a[1], b00, b10), ba1 = lerp(a[1], b01, b11);
  const Floats bb0 = lerp(b[1], b00, b10), bb1 = lerp(b[1], b01, b11);
  const float third = 1.0f / 3.0f;
  Cubics c;
  c.b0 = lerp(a[2], aa0, aa1);
  c.b1 = (lerp(a[2], ba0, ba1) + lerp(a[2], ab0, ab1) + lerp(b[2], aa0, aa1)) * third;
  c.b2 = (lerp(a[2], bb0, bb1) + lerp(b[2], ba0, ba1) + lerp(b[2], ab0, ab1)) * third;
  c.b3 = lerp(b[2], bb0, bb1);
  return c;
}

/// refine() of the default solver.
inline Floats refine(const Cubics &c, Floats lo, Floats hi, Mask lanes) {
  Floats derivative;
  const Mask in_lo = cubic_value(c, lo, &derivative) >= 0.0f;
  Mask going = lanes & (lo != hi);
  Floats s = 0.5f * (lo + hi);
  s = select((lo == 0.0f) & (hi == 1.0f), c.b0 / (c.b0 - c.b3), s);
  s = select(lo == hi, lo, s);
  for (int step = 0; step < kDefaultSolver.max_steps && any(going); ++step) {
    const Floats value = cubic_value(c, s, &derivative);
    const Mask before = (value >= 0.0f) == in_lo;
    lo = select(going & before, s, lo);
    hi = select(going & ~before, s, hi);
    Floats next = s - value / derivative;
    going &= ~(((derivative > 0.0f) != in_lo) & (fabs(next - s) < ISO_ROOT_STEP));
    next = select((next > lo) & (next < hi), next, 0.5f * (lo + hi));
    s = select(going, next, s);
  }
  return select(s > 0.0f, s, Floats{});
}

// ---- Rays

inline PacketAxis packet_axis(float o, Floats d) {
  PacketAxis a;
  const Mask still = fabs(d) < ISO_SMALLEST_DIRECTION;
  a.o = eight(o);
  a.d = select(still, Floats{}, d);
  a.inv_hi = select(still, Floats{}, 1.0f / a.d);
  a.inv_lo = select(still, Floats{}, fma(-a.inv_hi, a.d, eight(1.0f)) / a.d);
  a.from = select(still, eight(-ISO_NEVER), a.o);
  a.rate = select(still, eight(1.0f), a.inv_hi);
  a.up = a.d > 0.0f;
  a.sign = select(a.up, eight(1.0f), eight(-1.0f));
  return a;
}

inline void make_rays(const View &view, Ints column, Ints row, PacketAxis *axes) {
  const Floats u = to_floats(2 * column + 1 - static_cast<int>(view.width)) * view.pixel_scale;
  const Floats v = to_floats(static_cast<int>(view.height) - 1 - 2 * row) * view.pixel_scale;
  const Floats length = sqrt(fma(u, u, fma(v, v, eight(1.0f))));
  const auto direction = [&](float fwd, float right, float up) {
    return fma(v, eight(up), fma(u, eight(right), eight(fwd))) / length;
  };
  axes[0] = packet_axis(view.eye_x, direction(view.fwd_x, view.right_x, view.up_x));
  axes[1] = packet_axis(view.eye_y, direction(view.fwd_y, view.right_y, view.up_y));
  axes[2] = packet_axis(view.eye_z, direction(view.fwd_z, view.right_z, view.up_z));
}

inline RayAxis axis_of_lane(const PacketAxis &a, int lane) {
  return {a.o[lane], a.d[lane], {a.inv_hi[lane], a.inv_lo[lane]}};
}
inline Ray ray_of_lane(const Packet &p, int lane) {
  return {axis_of_lane(p.axis[0], lane), axis_of_lane(p.axis[1], lane),
          axis_of_lane(p.axis[2], lane)};
}
inline RayEvent event_of_lane(const Packet &p, int lane) {
  const int axis = p.entered.axis[lane];
  if (axis == ISO_AXIS_START) return start_event();
  return make_event(core::plane_t(axis_of_lane(p.axis[axis], lane), p.entered.plane[lane]), axis);
}

inline Floats float_t(const PacketAxis &a, Floats plane) {
  return (plane - a.from) * a.rate;
}

/// One number of each ray: that of the axis of its crossing.
inline Floats of_axis(Ints axis, Floats x, Floats y, Floats z) {
  return select(axis == 0, x, select(axis == 1, y, z));
}

// ---- Decisions. Those by float32 first; lanes in doubt by the scalar functions.

/// By the plane of which axis rays leave their regions.
struct Exits {
  Mask on[3];
};

__attribute__((noinline, cold)) inline Exits settle_exits(const Packet &p, const Floats *far,
                                                          Mask lanes, Exits exits) {
  for_each_lane(lanes, [&](int lane) {
    const Ray ray = ray_of_lane(p, lane);
    const int first = first_exit(&ray, far[0][lane], far[1][lane], far[2][lane]).axis;
    for_each_axis([&](int axis) { exits.on[axis][lane] = axis == first ? -1 : 0; });
  });
  return exits;
}

inline Exits find_exits(const Packet &p, const Floats *far, Mask lanes) {
  const Floats x = float_t(p.axis[0], far[0]), y = float_t(p.axis[1], far[1]),
               z = float_t(p.axis[2], far[2]);
  const Floats xy = smaller(x, y), first = smaller(xy, z),
               second = larger(xy, smaller(larger(x, y), z));
  Exits exits;
  exits.on[2] = (z < xy) & lanes;
  exits.on[1] = (y < x) & ~exits.on[2] & lanes;
  exits.on[0] = lanes & ~(exits.on[1] | exits.on[2]);
  const Mask doubt = lanes & (second - first <= ISO_FLOAT_DOUBT * fabs(second));
  if (__builtin_expect(any(doubt), 0)) return settle_exits(p, far, doubt, exits);
  return exits;
}

/// Regions along an axis, from first to last.
struct Range {
  Ints first, last;
};

__attribute__((noinline, cold)) inline Ints settle_places(const Packet &p, int axis, int size,
                                                          Range range, Mask lanes, Ints places) {
  for_each_lane(lanes, [&](int lane) {
    places[lane] = core::locate(axis_of_lane(p.axis[axis], lane), axis, event_of_lane(p, lane),
                                size, range.first[lane], range.last[lane]);
  });
  return places;
}

/// The regions along one axis that rays are in just after they crossed p.entered, about at t. Where
/// that is a plane of this axis, it says so itself. Else the position o + t d decides where it is
/// further from a plane than its error: 7.1 u |t d| of t (grid_dda.h) and u |o + t d| of rounding,
/// at most 8.2 u (|o + t d| + |o|).
inline Ints locate(const Packet &p, int axis, int size, Floats t, Range range, Mask lanes) {
  const PacketAxis &a = p.axis[axis];
  const Floats position = fma(t, a.d, a.o);
  const Mask on_plane = p.entered.axis == axis;
  const Floats x = select(on_plane, p.entered.plane, position) * (1.0f / static_cast<float>(size));
  const Floats region = select(on_plane & ~a.up, -floor(-x) - 1.0f, floor(x));
  const Ints places = smaller(larger(to_ints(region), range.first), range.last);
  const Floats distance = fabs(position - static_cast<float>(size) * nearest(x)),
               error = ISO_FLOAT_DOUBT * (fabs(position) + fabs(a.o));
  const Mask doubt = lanes & ~on_plane & (a.d != 0.0f) & (distance <= error);
  if (__builtin_expect(any(doubt), 0)) return settle_places(p, axis, size, range, doubt, places);
  return places;
}

__attribute__((noinline, cold)) inline Mask settle_entries(Packet &p, const PacketScene &scene,
                                                           Mask lanes, Mask enters) {
  const LastPlanes begin = {scene.begin[0], scene.begin[1], scene.begin[2]},
                   end = {scene.end[0], scene.end[1], scene.end[2]};
  for_each_lane(lanes, [&](int lane) {
    const Ray ray = ray_of_lane(p, lane);
    RayEvent enter;
    enters[lane] = box_entry(&ray, begin, end, &enter) != 0 ? -1 : 0;
    p.entered.axis[lane] = enter.axis;
    if (enter.axis == ISO_AXIS_START) return;
    const bool up = p.axis[enter.axis].up[lane] != 0;
    p.entered.plane[lane] =
        static_cast<float>(up ? scene.begin[enter.axis] : scene.end[enter.axis]);
  });
  return enters;
}

/// Where rays enter the box of active blocks, or start in it, into p.entered. Returns which do.
inline Mask enter_box(Packet &p, const PacketScene &scene) {
  Floats enter = {}, before = eight(-ISO_NEVER), exit = eight(ISO_NEVER);
  Mask beside = {};
  p.entered = Crossings{eight(ISO_AXIS_START), Floats{}};
  for_each_axis([&](int i) {
    const PacketAxis &a = p.axis[i];
    const Floats begin = eight(static_cast<float>(scene.begin[i])),
                 end = eight(static_cast<float>(scene.end[i]));
    const Floats near_plane = select(a.up, begin, end);
    const Mask still = a.d == 0.0f;
    const Floats near = select(still, eight(-ISO_NEVER), float_t(a, near_plane));
    const Mask later = near > enter;
    p.entered.axis = select(later, eight(i), p.entered.axis);
    p.entered.plane = select(later, near_plane, p.entered.plane);
    before = larger(before, smaller(enter, near));
    enter = larger(enter, near);
    exit = smaller(exit, float_t(a, select(a.up, end, begin)));
    beside |= still & ((a.o < begin) | (a.o > end));
  });
  const Mask doubt =
      ~beside & ((enter - before <= ISO_FLOAT_DOUBT * enter) |
                 (fabs(exit - enter) <= ISO_FLOAT_DOUBT * larger(fabs(exit), enter)));
  const Mask enters = ~beside & (enter < exit);
  return __builtin_expect(any(doubt), 0) ? settle_entries(p, scene, doubt, enters) : enters;
}

// ---- The walk

/// The numbers of the regions of a level along an axis, from their far planes.
inline Ints regions(const Packet &p, int level, int axis) {
  const PacketAxis &a = p.axis[axis];
  const Floats far = p.level[level].far[axis];
  // Where the domain's end cuts the last region, the plane before its far one is still within it.
  const Floats within = select(a.up, far - 1.0f, far);
  return to_ints(floor(within * (1.0f / static_cast<float>(kSizes[level]))));
}

inline Floats far_planes(const Packet &p, int axis, int size, Ints region) {
  const Floats near = to_floats(region * size);
  return select(p.axis[axis].up, smaller(near + static_cast<float>(size), p.last[axis]), near);
}

inline Floats entry_t(const Packet &p) {
  const auto number = [&](Floats PacketAxis::*member) {
    return of_axis(p.entered.axis, p.axis[0].*member, p.axis[1].*member, p.axis[2].*member);
  };
  const Floats t = (p.entered.plane - number(&PacketAxis::from)) * number(&PacketAxis::rate);
  return select(p.entered.axis == ISO_AXIS_START, Floats{}, t);
}

/// At the macrocells in which rays enter the box.
inline void start(Packet &p, const PacketScene &scene, Mask lanes) {
  constexpr int kSize = kSizes[kMacrocells];
  const Floats t = entry_t(p);
  const int strides[kNumLevels][3] = {
      {1, 4, 16}, {1, 4, 16}, {1, scene.columns, scene.columns * scene.rows}};
  p.level[kMacrocells].place = Ints{};
  for_each_axis([&](int axis) {
    const Ints up = p.axis[axis].up;
    const Ints first = eight(scene.first[axis]), final = eight(scene.final[axis]);
    const Ints place = locate(p, axis, kSize, t, {first, final}, lanes);
    p.level[kMacrocells].far[axis] = far_planes(p, axis, kSize, place);
    p.end[axis] = far_planes(p, axis, kSize, select(up, final, first));
    p.level[kMacrocells].place += place * strides[kMacrocells][axis];
    for (int level = 0; level < kNumLevels; ++level) {
      const Ints stride = eight(strides[level][axis]);
      p.level[level].stride[axis] = select(up, stride, -stride);
    }
  });
  p.at[kMacrocells] = lanes;
}

/// Lets lanes enter the regions of a level within those of the next larger one, where they are.
template <int kLevel>
inline void enter_regions(Packet &p, const PacketScene &scene, Mask lanes) {
  constexpr int kSize = kSizes[kLevel];
  const Floats t = entry_t(p);
  const int last[3] = {scene.last.x, scene.last.y, scene.last.z};
  Level &level = p.level[kLevel];
  Ints places = {};
  for_each_axis([&](int axis) {
    const Ints first = regions(p, kLevel + 1, axis) * 4,
               end = smaller(first + 3, eight((last[axis] - 1) / kSize));
    const Ints place = locate(p, axis, kSize, t, {first, end}, lanes);
    level.far[axis] = select(lanes, far_planes(p, axis, kSize, place), level.far[axis]);
    places += (place & 3) << (2 * axis);
  });
  level.place = select(lanes, places, level.place);
  p.at[kLevel] |= lanes;
  p.at[kLevel + 1] &= ~lanes;
}

/// Lets lanes leave their regions of a level, and each larger one that ends there, too.
template <int kLevel>
inline void leave_regions(Packet &p, Mask lanes, const Exits &exits) {
  constexpr float kSize = static_cast<float>(kSizes[kLevel]);
  Level &level = p.level[kLevel];
  Exits larger_exits;
  Mask left = {};
  for_each_axis([&](int axis) {
    const Mask on = exits.on[axis];
    const Floats far = level.far[axis];
    larger_exits.on[axis] =
        on &
        (far == (kLevel == kMacrocells ? p.end[axis]
                                       : p.level[std::min(kLevel + 1, kNumLevels - 1)].far[axis]));
    left |= larger_exits.on[axis];
    level.far[axis] = select(on, smaller(far + kSize * p.axis[axis].sign, p.last[axis]), far);
    level.place += on & level.stride[axis];
  });
  p.at[kLevel] = (p.at[kLevel] | lanes) & ~left;
  if constexpr (kLevel < kMacrocells) {
    if (any(left)) leave_regions<kLevel + 1>(p, left, larger_exits);
  }
}

/// Takes all lanes that walk among the regions of a level to the next one.
template <int kLevel>
inline void step(Packet &p) {
  const Mask lanes = p.at[kLevel];
  const Floats *far = p.level[kLevel].far;
  const Exits exits = find_exits(p, far, lanes);
  for_each_axis([&](int axis) {
    p.entered.axis = select(exits.on[axis], eight(axis), p.entered.axis);
    p.entered.plane = select(exits.on[axis], far[axis], p.entered.plane);
  });
  leave_regions<kLevel>(p, lanes, exits);
}

/// Lanes whose region is to be entered.
inline Mask is_wanted(const Level &level) {
  const Ints half = select(level.place < 32, level.low, level.high);
  return -((half >> (level.place & 31)) & 1);
}

inline void walk_macrocells(Packet &p, const PacketScene &scene) {
  while (any(p.at[kMacrocells])) {
    const Mask lanes = p.at[kMacrocells];
    Level &blocks = p.level[kBlocks];
    gather_halves(scene.field->masks, p.level[kMacrocells].place, lanes, &blocks.low, &blocks.high);
    const Mask wanted = lanes & ((blocks.low | blocks.high) != 0);
    if (any(wanted)) enter_regions<kBlocks>(p, scene, wanted);
    if (!any(p.at[kMacrocells])) return;
    step<kMacrocells>(p);
  }
}

/// HostField::open() for lanes: once for each block, of which there are few.
inline void open_blocks(const HostField &field, Ints block, Mask lanes) {
  for (unsigned left = bits_of(lanes); left != 0;) {
    const int number = block[std::countr_zero(left)];
    field.open(static_cast<uint>(number));
    left &= ~bits_of(block == number);
  }
}

inline void walk_blocks(Packet &p, const PacketScene &scene) {
  while (any(p.at[kBlocks])) {
    const Mask wanted = p.at[kBlocks] & is_wanted(p.level[kBlocks]);
    if (any(wanted)) {
      const BlockGrid &grid = scene.frame->grid;
      const Ints block =
          regions(p, kBlocks, 0) +
          static_cast<int>(grid.blocks_x) *
              (regions(p, kBlocks, 1) + static_cast<int>(grid.blocks_y) * regions(p, kBlocks, 2));
      open_blocks(*scene.field, block, wanted);
      gather_halves(scene.field->changing, block, wanted, &p.level[kCells].low,
                    &p.level[kCells].high);
      enter_regions<kCells>(p, scene, wanted);
    }
    if (!any(p.at[kBlocks])) return;
    step<kBlocks>(p);
  }
}

/// Returns the lanes that stand at a cell that changes.
inline Mask walk_cells(Packet &p) {
  Mask standing = {};
  while (any(p.at[kCells])) {
    const Mask wanted = p.at[kCells] & is_wanted(p.level[kCells]);
    standing |= wanted;
    p.at[kCells] &= ~wanted;
    if (!any(p.at[kCells])) break;
    step<kCells>(p);
  }
  return standing;
}

// ---- Cells

/// Rays on their way through a cell each.
struct Segments {
  TwoFloats enter, exit;
  Floats a[3], b[3];  ///< positions in the cell where rays enter and leave
  Floats w[8];        ///< corners minus the isovalue
};

inline TwoFloats crossing_t(const Packet &p, const Crossings &c) {
  const auto number = [&](Floats PacketAxis::*member) {
    return of_axis(c.axis, p.axis[0].*member, p.axis[1].*member, p.axis[2].*member);
  };
  TwoFloats t = plane_t(number(&PacketAxis::o), number(&PacketAxis::inv_hi),
                        number(&PacketAxis::inv_lo), c.plane);
  t.hi = select(c.axis == ISO_AXIS_START, Floats{}, t.hi);
  t.lo = select(c.axis == ISO_AXIS_START, Floats{}, t.lo);
  return t;
}

/// Blocks are one behind the other, so that a voxel's place is a sum of what its coordinates add.
inline void load_corners(const PacketScene &scene, const Floats *cell, Mask lanes, Floats *w) {
  const BlockGrid &grid = scene.frame->grid;
  const float *values = scene.field->values;
  const std::size_t row = std::size_t{ISO_BLOCK_VOXELS} * grid.blocks_x,
                    layer = row * grid.blocks_y;
  const Ints x = to_ints(cell[0]), y = to_ints(cell[1]), z = to_ints(cell[2]);
  for_each_lane(lanes, [&](int lane) {
    const auto place = [](int at, std::size_t block, int voxel) {
      const auto v = static_cast<std::size_t>(at);
      return (v >> 2) * block + static_cast<std::size_t>(voxel) * (v & 3);
    };
    const std::size_t xs[2] = {place(x[lane], ISO_BLOCK_VOXELS, 1),
                               place(x[lane] + 1, ISO_BLOCK_VOXELS, 1)},
                      ys[2] = {place(y[lane], row, 4), place(y[lane] + 1, row, 4)},
                      zs[2] = {place(z[lane], layer, 16), place(z[lane] + 1, layer, 16)};
    for (int corner = 0; corner < 8; ++corner)
      w[corner][lane] = values[xs[corner & 1] + ys[corner >> 1 & 1] + zs[corner >> 2]];
  });
  for (int corner = 0; corner < 8; ++corner) w[corner] -= scene.frame->surface.isovalue;
}

/// cell [3]: its least corner.
inline Segments segments_in(const Packet &p, const PacketScene &scene, const Crossings &enter,
                            const Crossings &exit, const Floats *cell, Mask lanes) {
  Segments s;
  s.enter = crossing_t(p, enter);
  s.exit = crossing_t(p, exit);
  for_each_axis([&](int i) {
    const PacketAxis &a = p.axis[i];
    const Floats near = select(a.up, Floats{}, eight(1.0f)), far = 1.0f - near;
    s.a[i] = select(enter.axis == i, near, local_position(a, s.enter, cell[i]));
    s.b[i] = select(exit.axis == i, far, local_position(a, s.exit, cell[i]));
  });
  for (Floats &corner : s.w) corner = Floats{};
  load_corners(scene, cell, lanes, s.w);
  return s;
}

/// The lanes whose cubic float32 coefficients cannot judge at once.
__attribute__((noinline)) inline Mask isolate_each(const Segments &s, const Cubics &c, Mask lanes,
                                                   Floats *lo, Floats *hi) {
  Mask found = {};
  for_each_lane(lanes, [&](int lane) {
    const Cubic cubic = {c.b0[lane], c.b1[lane], c.b2[lane], c.b3[lane]};
    Bracket bracket;
    int changes = isolate_bernstein(cubic, &bracket);
    if (changes == ISO_DOUBTFUL) {
      float w[8];
      for (int corner = 0; corner < 8; ++corner) w[corner] = s.w[corner][lane];
      const CellPoint a = {s.a[0][lane], s.a[1][lane], s.a[2][lane]},
                      b = {s.b[0][lane], s.b[1][lane], s.b[2][lane]};
      changes = isolate_precisely(precise_segment_cubic(w, a, b), cubic, &bracket);
    }
    if (changes == 0) return;
    found[lane] = -1;
    (*lo)[lane] = bracket.lo;
    (*hi)[lane] = bracket.hi;
  });
  return found;
}

/// change_in_cell() of the default solver.
inline Mask isolate(const Segments &s, Mask lanes, Floats *lo, Floats *hi) {
  const Cubics c = segment_cubic(s.w, s.a, s.b);
  const Mask in0 = c.b0 >= 0.0f, in1 = c.b1 >= 0.0f, in2 = c.b2 >= 0.0f, in3 = c.b3 >= 0.0f;
  const Mask differs = lanes & ((in0 ^ in1) | (in0 ^ in2) | (in0 ^ in3));
  const Mask hard = differs & (~(in0 ^ in3) | ((in1 ^ in0) & ~(in2 ^ in0)));
  *lo = Floats{};
  *hi = eight(1.0f);
  Mask found = differs & ~hard;
  if (any(hard)) found |= isolate_each(s, c, hard, lo, hi);
  return found;
}

/// Tests the cells where lanes stand. Those that find no hit walk on.
inline void test_cells(Packet &p, const PacketScene &scene, Mask lanes) {
  const Floats *far = p.level[kCells].far;
  const Exits exits = find_exits(p, far, lanes);
  const Crossings exit = {select(exits.on[0], Ints{}, select(exits.on[1], eight(1), eight(2))),
                          select(exits.on[0], far[0], select(exits.on[1], far[1], far[2]))};
  Floats cell[3];
  for_each_axis(
      [&](int axis) { cell[axis] = select(p.axis[axis].up, far[axis] - 1.0f, far[axis]); });
  const Segments s = segments_in(p, scene, p.entered, exit, cell, lanes);
  Floats lo, hi;
  const Mask hit = isolate(s, lanes, &lo, &hi);
  if (any(hit)) {
    FoundCells &found = p.found;
    found.lanes |= hit;
    found.enter.axis = select(hit, p.entered.axis, found.enter.axis);
    found.enter.plane = select(hit, p.entered.plane, found.enter.plane);
    found.exit.axis = select(hit, exit.axis, found.exit.axis);
    found.exit.plane = select(hit, exit.plane, found.exit.plane);
    for_each_axis([&](int axis) { found.cell[axis] = select(hit, cell[axis], found.cell[axis]); });
    found.lo = select(hit, lo, found.lo);
    found.hi = select(hit, hi, found.hi);
  }
  const Mask on = lanes & ~hit;
  if (!any(on)) return;
  p.entered.axis = select(on, exit.axis, p.entered.axis);
  p.entered.plane = select(on, exit.plane, p.entered.plane);
  leave_regions<kCells>(p, on, {{exits.on[0] & on, exits.on[1] & on, exits.on[2] & on}});
}

/// make_hit() of the cells that were found, into hits[id of the ray].
inline void write_hits(const Packet &p, const PacketScene &scene, Ints ray_ids, HitRecord *hits) {
  const FoundCells &found = p.found;
  const Segments at = segments_in(p, scene, found.enter, found.exit, found.cell, found.lanes);
  const Floats *w = at.w;
  const Floats s = refine(segment_cubic(w, at.a, at.b), found.lo, found.hi, found.lanes);
  const Floats length = (at.exit.hi - at.enter.hi) + (at.exit.lo - at.enter.lo);
  const Floats t = (at.enter.hi + fma(s, length, at.enter.lo)) * scene.frame->view.t_scale;
  const Floats x = lerp(s, at.a[0], at.b[0]), y = lerp(s, at.a[1], at.b[1]),
               z = lerp(s, at.a[2], at.b[2]);
  const Floats grad_x =
      lerp(z, lerp(y, w[1] - w[0], w[3] - w[2]), lerp(y, w[5] - w[4], w[7] - w[6]));
  const Floats grad_y =
      lerp(z, lerp(x, w[2] - w[0], w[3] - w[1]), lerp(x, w[6] - w[4], w[7] - w[5]));
  const Floats grad_z =
      lerp(y, lerp(x, w[4] - w[0], w[5] - w[1]), lerp(x, w[6] - w[2], w[7] - w[3]));
  const Ints cx = to_ints(found.cell[0]), cy = to_ints(found.cell[1]), cz = to_ints(found.cell[2]);
  for_each_lane(found.lanes, [&](int lane) {
    HitRecord &hit = hits[static_cast<uint>(ray_ids[lane])];
    hit.t = t[lane];
    hit.block_id = block_id_at(scene.frame, static_cast<uint>(cx[lane] >> 2),
                               static_cast<uint>(cy[lane] >> 2), static_cast<uint>(cz[lane] >> 2));
    hit.cell = static_cast<uint>((cx[lane] & 3) + 4 * (cy[lane] & 3) + 16 * (cz[lane] & 3));
    hit.x = x[lane];
    hit.y = y[lane];
    hit.z = z[lane];
    hit.grad_x = without_zero_sign(grad_x[lane]);
    hit.grad_y = without_zero_sign(grad_y[lane]);
    hit.grad_z = without_zero_sign(grad_z[lane]);
  });
}

/// Rays (column, row) of the frame, those of lanes. Returns how many hit something.
inline uint trace_packet(const PacketScene &scene, Ints column, Ints row, Mask lanes,
                         HitRecord *hits) {
  Packet p;
  make_rays(scene.frame->view, column, row, p.axis);
  const Mask enters = enter_box(p, scene) & lanes;
  if (!any(enters)) return 0;
  p.last[0] = eight(static_cast<float>(scene.last.x));
  p.last[1] = eight(static_cast<float>(scene.last.y));
  p.last[2] = eight(static_cast<float>(scene.last.z));
  for (Level &level : p.level) {
    for (Floats &far : level.far) far = Floats{};
    level.place = level.low = level.high = Ints{};
  }
  for (Mask &at : p.at) at = Mask{};
  p.found = FoundCells{};
  start(p, scene, enters);
  Mask standing = {};
  for (;;) {
    walk_macrocells(p, scene);
    walk_blocks(p, scene);
    if (any(p.at[kMacrocells])) continue;
    standing |= walk_cells(p);
    if (any(p.at[kMacrocells] | p.at[kBlocks])) continue;
    if (!any(standing)) break;
    test_cells(p, scene, standing);
    standing = Mask{};
  }
  if (!any(p.found.lanes)) return 0;
  write_hits(p, scene, column + static_cast<int>(scene.frame->view.width) * row, hits);
  return static_cast<uint>(std::popcount(bits_of(p.found.lanes)));
}

/// As trace_packets().
__attribute__((flatten)) inline uint trace_tile(const FrameParams &frame, const HostField &field,
                                                const RayTile &tile, HitRecord *hits) {
  const Surface &surface = frame.surface;
  const LastPlanes last = last_planes(&frame);
  const int begin[3] = {surface.active_begin_x, surface.active_begin_y, surface.active_begin_z},
            end[3] = {surface.active_end_x, surface.active_end_y, surface.active_end_z},
            ends[3] = {last.x, last.y, last.z};
  PacketScene scene{};
  scene.frame = &frame;
  scene.field = &field;
  scene.last = last;
  scene.columns = static_cast<int>((frame.grid.blocks_x + 3) / 4);
  scene.rows = static_cast<int>((frame.grid.blocks_y + 3) / 4);
  for (int axis = 0; axis < 3; ++axis) {
    if (begin[axis] >= end[axis]) return 0;
    scene.begin[axis] = 4 * begin[axis];
    scene.end[axis] = std::min(4 * end[axis], ends[axis]);
    scene.first[axis] = begin[axis] / ISO_MACROCELL_BLOCKS;
    scene.final[axis] = (end[axis] - 1) / ISO_MACROCELL_BLOCKS;
  }
  const Ints column_of_lane = {0, 1, 2, 3, 0, 1, 2, 3}, row_of_lane = {0, 0, 0, 0, 1, 1, 1, 1};
  uint num_hits = 0;
  for (uint y = tile.begin_y; y < tile.end_y; y += 2) {
    for (uint x = tile.begin_x; x < tile.end_x; x += 4) {
      const Ints column = static_cast<int>(x) + column_of_lane,
                 row = static_cast<int>(y) + row_of_lane;
      const Mask within =
          (column < static_cast<int>(tile.end_x)) & (row < static_cast<int>(tile.end_y));
      num_hits += trace_packet(scene, column, row, within, hits);
    }
  }
  return num_hits;
}

}  // namespace isowave::core::packets
