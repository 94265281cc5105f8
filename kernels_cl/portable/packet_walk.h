/// packet_walk.h -- eight rays at a time through the macrocells, blocks and cells of a volume: the
/// hits of the scalar walk, bit for bit.
///
/// All rays of a packet first look for a macrocell with active blocks, then those that have found
/// one for such a block, then for a cell to look into; only when half of the rays stand at one, or
/// none walks any more, are cells tested, those of all rays together. A ray that leaves a block or
/// a macrocell on its way is looked after before that.
///
/// A ray keeps the crossing by which it entered the region that it is in, as axis and plane: the
/// moment follows from these when a cell is tested.
///
/// Portable: OpenCL C 1.2 and C++. The file that includes it defines before where blocks come from:
/// a type PacketField, and
///
///     /// The bits of macrocells (bit x + 4y + 16z: is the block active?), low and high half, into
///     /// those lanes. macrocells: x + columns * (y + rows * z).
///     void macrocell_bits(const PacketField *field, Ints macrocells, Mask lanes, Ints *low,
///                         Ints *high);
///     /// Lanes come to active blocks (at [3]: x, y, z). Gives them the bits of the cells to look
///     /// into. Returns the lanes that must wait for their blocks.
///     Mask open_blocks(const PacketField *field, const FrameParams *frame, const Ints *at,
///                      Mask lanes, Ints *low, Ints *high);
///     /// The corners [8] of cells (at [3]: x, y, z) of the blocks that lanes have opened last,
///     /// minus the isovalue, corner x + 2y + 4z. Returns the lanes that must wait for them.
///     Mask load_corners(const PacketField *field, const FrameParams *frame, const Ints *at,
///                       Mask lanes, Floats *w);
#ifndef ISOWAVE_PACKET_WALK_H
#define ISOWAVE_PACKET_WALK_H

#include "packet.h"

ISO_PACKET_NAMESPACE_BEGIN

// Regions, from the smallest on.
#define ISO_CELLS 0
#define ISO_BLOCKS 1
#define ISO_MACROCELLS 2
/// When so many lanes stand at cells, these are tested, though others still walk.
#define ISO_ENOUGH_STANDING 4
/// Voxels along the edge of a region of that level.
#define ISO_REGION_SIZE(level) (1 << (2 * (level)))

/// The regions of one size in which the rays are.
typedef struct PacketLevel {
  Floats far[3];   ///< planes by which they leave
  Ints place;      ///< number of the region in the larger one, x + 4y + 16z; macrocells: in the
                   ///< volume
  Ints stride[3];  ///< of place, by the ray's direction
  Ints low, high;  ///< 64 bits: which of the regions in the larger one are to be entered
} PacketLevel;

/// Cells in which rays hit, not yet refined.
typedef struct FoundCells {
  Mask lanes;
  Crossings enter, exit;
  Floats cell[3];
  Floats lo, hi;  ///< Bracket
} FoundCells;

typedef struct Packet {
  PacketRays rays;
  Floats last[3];        ///< planes at the domain's end; as all planes here, the whole volume's
  Floats end[3];         ///< planes by which rays leave the macrocells of the active box
  PacketLevel level[3];  ///< ISO_CELLS to ISO_MACROCELLS
  Mask at[3];            ///< lanes that walk among the regions of this size
  Mask waits;            ///< lanes that have come to a block that they must wait for
  FoundCells found;
} Packet;

/// Data that many packets share.
typedef struct PacketScene {
  const FrameParams *frame;
  const PacketField *field;
  int last[3];             ///< last_planes()
  int begin[3], end[3];    ///< planes of the box of active blocks, of the brick
  int first[3], final[3];  ///< its macrocells
  int columns, rows;       ///< macrocells of the volume along x and y
} PacketScene;

/// Returns 0 if no block is active.
ISO_INLINE int make_packet_scene(const FrameParams *frame, const PacketField *field,
                                 PacketScene *scene) {
  const Surface *surface = &frame->surface;
  const LastPlanes last = last_planes(frame);
  const int begin[3] = {surface->active_begin_x, surface->active_begin_y, surface->active_begin_z},
            end[3] = {surface->active_end_x, surface->active_end_y, surface->active_end_z};
  scene->frame = frame;
  scene->field = field;
  scene->last[0] = last.x;
  scene->last[1] = last.y;
  scene->last[2] = last.z;
  scene->columns = (int)((frame->grid.blocks_x + 3) / 4);
  scene->rows = (int)((frame->grid.blocks_y + 3) / 4);
  for (int axis = 0; axis < 3; ++axis) {
    if (begin[axis] >= end[axis]) return 0;
    scene->begin[axis] = 4 * begin[axis];
    scene->end[axis] = 4 * end[axis] < scene->last[axis] ? 4 * end[axis] : scene->last[axis];
    scene->first[axis] = begin[axis] / ISO_MACROCELL_BLOCKS;
    scene->final[axis] = (end[axis] - 1) / ISO_MACROCELL_BLOCKS;
  }
  return 1;
}

// ---- Regions

/// The numbers of the regions of a level along an axis, from their far planes. None is negative, so
/// that to_ints() is floor().
ISO_INLINE Ints regions(const Packet *p, int level, int axis) {
  const Floats far = p->level[level].far[axis];
  /* If the domain's end cuts the last region, the plane before its far one is still within it. */
  const PacketAxis *a = &p->rays.axis[axis];
  const Floats within = in_brick(a, pick(a->up, far - 1.0f, far));
  return to_ints(within * (1.0f / (float)ISO_REGION_SIZE(level)));
}

ISO_INLINE Floats far_planes(const Packet *p, int axis, int size, Ints region) {
  const Floats near = in_whole(&p->rays.axis[axis], to_floats(region * size)),
               end = near + (float)size;
  return pick(p->rays.axis[axis].up, smaller(end, p->last[axis]), near);
}

/// The blocks where rays are, x, y and z.
ISO_INLINE void blocks_at(const Packet *p, Ints *at) {
  ISO_EACH_OF_3(axis) at[axis] = regions(p, ISO_BLOCKS, axis);
}

/// Lanes whose region is to be entered.
ISO_INLINE Mask is_wanted(const PacketLevel *level) {
  const Ints bits = pick(level->place < 32, level->low, level->high);
  return -((bits >> (level->place & 31)) & 1);
}

/// A packet with the rays p->rays.axis, none of which walks yet.
ISO_INLINE void open_packet(Packet *p, const PacketScene *scene) {
  const Floats none = floats(0.0f);
  const Ints zero = ints(0);
  ISO_EACH_OF_3(axis) {
    const Mask up = p->rays.axis[axis].up;
    const Ints stride = ints(axis == 0 ? 1 : (axis == 1 ? 4 : 16)),
               coarse = ints(axis == 0 ? 1 : scene->columns * (axis == 1 ? 1 : scene->rows));
    p->last[axis] = in_whole(&p->rays.axis[axis], floats((float)scene->last[axis]));
    p->end[axis] = far_planes(p, axis, ISO_REGION_SIZE(ISO_MACROCELLS),
                              pick(up, ints(scene->final[axis]), ints(scene->first[axis])));
    ISO_EACH_OF_3(level) {
      const Ints of_level = level == ISO_MACROCELLS ? coarse : stride;
      p->level[level].stride[axis] = pick(up, of_level, -of_level);
      p->level[level].far[axis] = none;
    }
    p->found.cell[axis] = none;
  }
  ISO_EACH_OF_3(level) {
    p->level[level].place = p->level[level].low = p->level[level].high = zero;
    p->at[level] = zero;
  }
  p->waits = zero;
  p->found.lanes = p->found.enter.axis = p->found.exit.axis = zero;
  p->found.enter.plane = p->found.exit.plane = p->found.lo = p->found.hi = none;
}

// ---- The beginning of rays

typedef struct Entered {
  Mask lanes;
  Crossings at;
} Entered;

ISO_RARE Entered settle_box_entries(const PacketRays *r, const PacketScene *scene, Mask lanes,
                                    Entered entered) {
  Entered settled = entered;
  LastPlanes begin, end;
  begin.x = scene->begin[0];
  begin.y = scene->begin[1];
  begin.z = scene->begin[2];
  end.x = scene->end[0];
  end.y = scene->end[1];
  end.z = scene->end[2];
  ISO_EACH_LANE(lane, lanes) {
    const Ray ray = ray_of_lane(r, lane);
    RayEvent enter = start_event();
    settled.lanes[lane] = box_entry(&ray, begin, end, &enter) != 0 ? -1 : 0;
    settled.at.axis[lane] = enter.axis;
    if (enter.axis != ISO_AXIS_START) {
      settled.at.plane[lane] = whole_plane(
          axis_of_lane(&r->axis[enter.axis], lane),
          r->axis[enter.axis].up[lane] != 0 ? scene->begin[enter.axis] : scene->end[enter.axis]);
    }
  }
  return settled;
}

/// r->entered = the crossings by which rays enter the box of active blocks, or start in it. Returns
/// the lanes that do.
ISO_INLINE Mask enter_box(PacketRays *r, const PacketScene *scene) {
  Floats near[3], exit = floats(ISO_NEVER);
  Mask beside = ints(0);
  ISO_EACH_OF_3(axis) {
    const PacketAxis *a = &r->axis[axis];
    const Floats begin = in_whole(a, floats((float)scene->begin[axis])),
                 end = in_whole(a, floats((float)scene->end[axis])),
                 far_t = packet_float_t(a, pick(a->up, end, begin));
    near[axis] = pick(a->up, begin, end);
    exit = smaller(exit, far_t);
    beside |= (a->d == 0.0f) & ((a->o < begin) | (a->o > end));
  }
  const Entry entry = last_entry(r, near);
  const Floats length = fabs(exit - entry.t), exit_t = fabs(exit),
               largest = larger(exit_t, entry.t);
  const Mask doubt = ~beside & (entry_in_doubt(&entry) | (length <= ISO_FLOAT_DOUBT * largest));
  Entered entered;
  entered.lanes = ~beside & (entry.t < exit);
  entered.at = entry.at;
  if (ISO_UNLIKELY(any(doubt))) entered = settle_box_entries(r, scene, doubt, entered);
  r->entered = entered.at;
  return entered.lanes;
}

/// Puts lanes into the macrocells where they enter the box.
ISO_INLINE void begin_at_box(Packet *p, const PacketScene *scene, Mask lanes) {
  const int size = ISO_REGION_SIZE(ISO_MACROCELLS);
  PacketLevel *level = &p->level[ISO_MACROCELLS];
  const Floats t = entry_t(&p->rays);
  Ints place = ints(0);
  ISO_EACH_OF_3(axis) {
    Range range;
    range.first = ints(scene->first[axis]);
    range.last = ints(scene->final[axis]);
    const Ints at = packet_locate(&p->rays, axis, size, t, range, lanes);
    level->far[axis] = far_planes(p, axis, size, at);
    place += at * (axis == 0 ? 1 : scene->columns * (axis == 1 ? 1 : scene->rows));
  }
  level->place = place;
  p->at[ISO_MACROCELLS] = lanes;
}

ISO_RARE Crossings settle_block_entries(const PacketRays *r, const PacketScene *scene, Ints x,
                                        Ints y, Ints z, Mask lanes, Crossings entered) {
  Crossings settled = entered;
  ISO_EACH_LANE(lane, lanes) {
    const Ray ray = ray_of_lane(r, lane);
    const int at[3] = {x[lane], y[lane], z[lane]};
    const int axis = region_entry(&ray, at[0], at[1], at[2], 4, last_planes(scene->frame)).axis;
    settled.axis[lane] = axis;
    if (axis != ISO_AXIS_START) {
      const int near = 4 * (r->axis[axis].up[lane] != 0 ? at[axis] : at[axis] + 1);
      settled.plane[lane] = whole_plane(axis_of_lane(&r->axis[axis], lane),
                                        near < scene->last[axis] ? near : scene->last[axis]);
    }
  }
  return settled;
}

/// Puts lanes back into the active blocks (at [3]: x, y, z) that they have come to before.
ISO_INLINE void begin_at_blocks(Packet *p, const PacketScene *scene, const Ints *at, Mask lanes) {
  PacketLevel *blocks = &p->level[ISO_BLOCKS], *macrocells = &p->level[ISO_MACROCELLS];
  Floats near[3];
  Ints place = ints(0), coarse = ints(0);
  ISO_EACH_OF_3(axis) {
    const Floats begin = in_whole(&p->rays.axis[axis], to_floats(4 * at[axis])),
                 whole = begin + 4.0f, end = smaller(whole, p->last[axis]);
    const Mask up = p->rays.axis[axis].up;
    near[axis] = pick(up, begin, end);
    blocks->far[axis] = pick(up, end, begin);
    macrocells->far[axis] = far_planes(p, axis, ISO_REGION_SIZE(ISO_MACROCELLS), at[axis] >> 2);
    place += (at[axis] & 3) << (2 * axis);
    coarse += (at[axis] >> 2) * (axis == 0 ? 1 : scene->columns * (axis == 1 ? 1 : scene->rows));
  }
  blocks->place = place;
  macrocells->place = coarse;
  macrocell_bits(scene->field, coarse, lanes, &blocks->low, &blocks->high);
  const Entry entry = last_entry(&p->rays, near);
  const Mask doubt = lanes & entry_in_doubt(&entry);
  p->rays.entered = entry.at;
  if (ISO_UNLIKELY(any(doubt))) {
    p->rays.entered = settle_block_entries(&p->rays, scene, at[0], at[1], at[2], doubt, entry.at);
  }
  p->at[ISO_BLOCKS] = lanes;
}

// ---- The walk

/// Bits first to last, each of 0 to 3.
ISO_INLINE Ints bits_between(Ints first, Ints last) {
  return (ints(2) << last) - (ints(1) << first);
}

/// Lets lanes enter the regions of a level within their region of the next larger level, except
/// lanes on whose way there is no region to enter.
///
/// A ray's way is within the box of the regions in which it enters and leaves the larger one. The
/// region in which it leaves need not be known exactly: positions are off by less than `error`
/// (packet_locate()), which makes the box larger.
ISO_INLINE void enter_regions(Packet *p, const PacketScene *scene, int level, Mask lanes) {
  const int size = ISO_REGION_SIZE(level);
  PacketLevel *l = &p->level[level];
  const PacketAxis *axes = p->rays.axis;
  const Floats *far = p->level[level + 1].far;
  const Floats t = entry_t(&p->rays), x_t = packet_float_t(&axes[0], far[0]),
               y_t = packet_float_t(&axes[1], far[1]), z_t = packet_float_t(&axes[2], far[2]),
               xy_t = smaller(x_t, y_t), exit_t = smaller(xy_t, z_t);
  Ints place[3], bits[3], places = ints(0);
  ISO_EACH_OF_3(axis) {
    const PacketAxis *a = &axes[axis];
    Range range;
    range.first = regions(p, level + 1, axis) * 4;
    const Ints end = range.first + 3, last = ints((scene->last[axis] - 1) / size);
    range.last = smaller(end, last);
    place[axis] = packet_locate(&p->rays, axis, size, t, range, lanes);
    const Floats exit = fma(exit_t, a->d, a->o),
                 error = ISO_FLOAT_DOUBT * (fabs(exit) + fabs(a->o));
    const Floats at = in_brick(a, exit + error * a->sign);
    const Ints farthest = to_ints(at * (1.0f / (float)size)), /* below 0: range.first, then */
        at_least = larger(farthest, range.first), to = smaller(at_least, range.last);
    bits[axis] = bits_between(pick(a->up, place[axis], to) & 3, pick(a->up, to, place[axis]) & 3);
    places += (place[axis] & 3) << (2 * axis);
  }
  const Ints x = bits[0] | bits[0] << 4, row = x | x << 8, y = bits[1], z = bits[2];
  const Ints rows = row & (((y & 1) | (y & 2) << 3 | (y & 4) << 6 | (y & 8) << 9) * 15),
             layers = rows | rows << 16;
  const Ints low = l->low & layers & ((-(z & 1) & 0xFFFF) | -(z >> 1 & 1) << 16),
             high = l->high & layers & ((-(z >> 2 & 1) & 0xFFFF) | -(z >> 3) << 16);
  const Mask enters = lanes & ((low | high) != 0);
  if (!any(enters)) return;
  ISO_EACH_OF_3(axis) {
    l->far[axis] = pick(enters, far_planes(p, axis, size, place[axis]), l->far[axis]);
  }
  l->low = pick(enters, low, l->low);
  l->high = pick(enters, high, l->high);
  l->place = pick(enters, places, l->place);
  p->at[level] |= enters;
  p->at[level + 1] &= ~enters;
}

/// Lets lanes leave their regions of a level. Returns those that leave the larger one, too, and
/// leaves their exits in *exits.
ISO_INLINE Mask leave_regions(Packet *p, int level, Mask lanes, Exits *exits) {
  const float size = (float)ISO_REGION_SIZE(level);
  PacketLevel *l = &p->level[level];
  Mask left = ints(0);
  ISO_EACH_OF_3(axis) {
    const Mask on = exits->on[axis];
    const Floats far = l->far[axis],
                 end = level == ISO_MACROCELLS
                           ? p->end[axis]
                           : p->level[level == ISO_MACROCELLS ? level : level + 1].far[axis],
                 next = far + size * p->rays.axis[axis].sign;
    exits->on[axis] = on & (far == end);
    left |= exits->on[axis];
    l->far[axis] = pick(on, smaller(next, p->last[axis]), far);
    l->place += on & l->stride[axis];
  }
  p->at[level] = (p->at[level] | lanes) & ~left;
  return left;
}

/// Lets lanes leave their regions of a level by `exits`, and each larger one that ends there, too.
ISO_INLINE void leave_by(Packet *p, int level, Mask lanes, Exits exits) {
  Exits by = exits;
  Mask left = leave_regions(p, level, lanes, &by);
  if (level < ISO_BLOCKS && any(left)) left = leave_regions(p, ISO_BLOCKS, left, &by);
  if (level < ISO_MACROCELLS && any(left)) leave_regions(p, ISO_MACROCELLS, left, &by);
}

/// Takes all lanes that walk among the regions of a level to the next one.
ISO_INLINE void step_to_next(Packet *p, int level) {
  const Mask lanes = p->at[level];
  const Floats *far = p->level[level].far;
  const Exits exits = find_exits(&p->rays, far, lanes);
  ISO_EACH_OF_3(axis) {
    p->rays.entered.axis = pick(exits.on[axis], ints(axis), p->rays.entered.axis);
    p->rays.entered.plane = pick(exits.on[axis], far[axis], p->rays.entered.plane);
  }
  leave_by(p, level, lanes, exits);
}

ISO_INLINE void walk_macrocells(Packet *p, const PacketScene *scene) {
  while (any(p->at[ISO_MACROCELLS])) {
    const Mask lanes = p->at[ISO_MACROCELLS];
    PacketLevel *blocks = &p->level[ISO_BLOCKS];
    macrocell_bits(scene->field, p->level[ISO_MACROCELLS].place, lanes, &blocks->low,
                   &blocks->high);
    const Mask wanted = lanes & ((blocks->low | blocks->high) != 0);
    if (any(wanted)) enter_regions(p, scene, ISO_BLOCKS, wanted);
    if (!any(p->at[ISO_MACROCELLS])) return;
    step_to_next(p, ISO_MACROCELLS);
  }
}

ISO_INLINE void walk_blocks(Packet *p, const PacketScene *scene) {
  while (any(p->at[ISO_BLOCKS])) {
    const Mask wanted = p->at[ISO_BLOCKS] & is_wanted(&p->level[ISO_BLOCKS]);
    if (any(wanted)) {
      Ints at[3];
      blocks_at(p, at);
      const Mask waits = open_blocks(scene->field, scene->frame, at, wanted,
                                     &p->level[ISO_CELLS].low, &p->level[ISO_CELLS].high);
      p->waits |= waits;
      p->at[ISO_BLOCKS] &= ~waits;
      enter_regions(p, scene, ISO_CELLS, wanted & ~waits);
    }
    if (!any(p->at[ISO_BLOCKS])) return;
    step_to_next(p, ISO_BLOCKS);
  }
}

/// Returns the lanes that stand at a cell to look into.
ISO_INLINE Mask walk_cells(Packet *p) {
  Mask standing = ints(0);
  while (any(p->at[ISO_CELLS])) {
    const Mask wanted = p->at[ISO_CELLS] & is_wanted(&p->level[ISO_CELLS]);
    standing |= wanted;
    p->at[ISO_CELLS] &= ~wanted;
    if (!any(p->at[ISO_CELLS])) break;
    step_to_next(p, ISO_CELLS);
  }
  return standing;
}

// ---- Cells

/// Rays on their way through a cell each.
typedef struct Segments {
  TwoFloats enter, exit;
  Floats a[3], b[3];  ///< positions in the cell where rays enter and leave
  Floats w[8];        ///< corners minus the isovalue
} Segments;

/// Finds where rays are in their cells (cell [3]: its least corner, in the whole volume).
ISO_INLINE void find_segments(const PacketRays *r, Crossings enter, Crossings exit,
                              const Floats *cell, Segments *s) {
  s->enter = crossing_t(r, enter);
  s->exit = crossing_t(r, exit);
  ISO_EACH_OF_3(axis) {
    const PacketAxis *a = &r->axis[axis];
    const Floats near = pick(a->up, floats(0.0f), floats(1.0f)), far = 1.0f - near;
    s->a[axis] = pick(enter.axis == axis, near, packet_local_position(a, s->enter, cell[axis]));
    s->b[axis] = pick(exit.axis == axis, far, packet_local_position(a, s->exit, cell[axis]));
  }
}

/// The lanes that have a change of inside, and its bracket.
typedef struct Brackets {
  Mask lanes;
  Floats lo, hi;
} Brackets;

/// The lanes whose cubic float32 coefficients cannot judge at once.
ISO_SELDOM Brackets isolate_each(const Segments *s, Cubics c, Mask lanes, Brackets before) {
  Brackets found = before;
  ISO_EACH_LANE(lane, lanes) {
    Cubic cubic;
    Bracket bracket;
    cubic.b0 = c.b0[lane];
    cubic.b1 = c.b1[lane];
    cubic.b2 = c.b2[lane];
    cubic.b3 = c.b3[lane];
    int changes = isolate_bernstein(cubic, &bracket);
    if (changes == ISO_DOUBTFUL) {
      float w[8];
      CellPoint a, b;
      for (int corner = 0; corner < 8; ++corner) w[corner] = s->w[corner][lane];
      a.x = s->a[0][lane];
      a.y = s->a[1][lane];
      a.z = s->a[2][lane];
      b.x = s->b[0][lane];
      b.y = s->b[1][lane];
      b.z = s->b[2][lane];
      changes = isolate_precisely(precise_segment_cubic(w, a, b), cubic, &bracket);
    }
    if (changes != 0) {
      found.lanes[lane] = -1;
      found.lo[lane] = bracket.lo;
      found.hi[lane] = bracket.hi;
    }
  }
  return found;
}

/// change_in_cell() of solver `bernstein`.
ISO_INLINE Brackets packet_isolate(const Segments *s, Mask lanes) {
  const Cubics c = packet_segment_cubic(s->w, s->a, s->b);
  const Mask in0 = c.b0 >= 0.0f, in1 = c.b1 >= 0.0f, in2 = c.b2 >= 0.0f, in3 = c.b3 >= 0.0f;
  const Mask differs = lanes & ((in0 ^ in1) | (in0 ^ in2) | (in0 ^ in3));
  const Mask hard = differs & (~(in0 ^ in3) | ((in1 ^ in0) & ~(in2 ^ in0)));
  Brackets found;
  found.lo = floats(0.0f);
  found.hi = floats(1.0f);
  found.lanes = differs & ~hard;
  if (any(hard)) {
    const Brackets each = isolate_each(s, c, hard, found); /* a copy: see settle_exits() */
    found.lanes = each.lanes;
    found.lo = each.lo;
    found.hi = each.hi;
  }
  return found;
}

ISO_INLINE void keep_found(FoundCells *found, Brackets brackets, Crossings enter, Crossings exit,
                           const Floats *cell) {
  const Mask hit = brackets.lanes;
  found->lanes |= hit;
  found->enter.axis = pick(hit, enter.axis, found->enter.axis);
  found->enter.plane = pick(hit, enter.plane, found->enter.plane);
  found->exit.axis = pick(hit, exit.axis, found->exit.axis);
  found->exit.plane = pick(hit, exit.plane, found->exit.plane);
  ISO_EACH_OF_3(axis) found->cell[axis] = pick(hit, cell[axis], found->cell[axis]);
  found->lo = pick(hit, brackets.lo, found->lo);
  found->hi = pick(hit, brackets.hi, found->hi);
}

/// Cells, from their least corners in the whole volume.
ISO_INLINE void cells_at(const Packet *p, const Floats *cell, Ints *at) {
  ISO_EACH_OF_3(axis) at[axis] = to_ints(in_brick(&p->rays.axis[axis], cell[axis]));
}

ISO_INLINE Mask load_cells(const Packet *p, const PacketScene *scene, const Floats *cell,
                           Mask lanes, Floats *w) {
  Ints at[3];
  cells_at(p, cell, at);
  return load_corners(scene->field, scene->frame, at, lanes, w);
}

/// Tests the cells where lanes stand. Those that find no hit walk on.
ISO_INLINE void test_cells(Packet *p, const PacketScene *scene, Mask standing) {
  const Floats *far = p->level[ISO_CELLS].far;
  Floats cell[3];
  Segments s;
  ISO_EACH_OF_3(axis) cell[axis] = pick(p->rays.axis[axis].up, far[axis] - 1.0f, far[axis]);
  const Mask waits = load_cells(p, scene, cell, standing, s.w), lanes = standing & ~waits;
  p->waits |= waits;
  const Exits exits = find_exits(&p->rays, far, lanes);
  Crossings exit;
  exit.axis = pick(exits.on[0], ints(0), pick(exits.on[1], ints(1), ints(2)));
  exit.plane = pick(exits.on[0], far[0], pick(exits.on[1], far[1], far[2]));
  find_segments(&p->rays, p->rays.entered, exit, cell, &s);
  const Brackets found = packet_isolate(&s, lanes);
  if (any(found.lanes)) keep_found(&p->found, found, p->rays.entered, exit, cell);
  const Mask on = lanes & ~found.lanes;
  if (!any(on)) return;
  Exits on_exits;
  ISO_EACH_OF_3(axis) on_exits.on[axis] = exits.on[axis] & on;
  p->rays.entered.axis = pick(on, exit.axis, p->rays.entered.axis);
  p->rays.entered.plane = pick(on, exit.plane, p->rays.entered.plane);
  leave_by(p, ISO_CELLS, on, on_exits);
}

/// Walks on until each lane has a hit (p->found), waits (p->waits) or has left.
ISO_INLINE void walk_packet(Packet *p, const PacketScene *scene) {
  Mask standing = ints(0);
  for (;;) {
    walk_macrocells(p, scene);
    walk_blocks(p, scene);
    if (any(p->at[ISO_MACROCELLS])) continue;
    standing |= walk_cells(p);
    if (any(p->at[ISO_MACROCELLS] | p->at[ISO_BLOCKS]) &&
        popcount(bits_of(standing)) < ISO_ENOUGH_STANDING)
      continue;
    if (!any(standing)) break;
    test_cells(p, scene, standing);
    standing = ints(0);
  }
}

/// make_hit() of the cells that were found, into hits[id of the ray].
ISO_INLINE void write_hits(const Packet *p, const PacketScene *scene, Ints ray_ids, int max_steps,
                           ISO_GLOBAL HitRecord *hits) {
  const FoundCells *found = &p->found;
  Segments at;
  load_cells(p, scene, found->cell, found->lanes, at.w);
  find_segments(&p->rays, found->enter, found->exit, found->cell, &at);
  const Floats *w = at.w;
  const Floats s = packet_refine(packet_segment_cubic(w, at.a, at.b), found->lo, found->hi,
                                 found->lanes, max_steps);
  const Floats length = (at.exit.hi - at.enter.hi) + (at.exit.lo - at.enter.lo);
  const Floats t = (at.enter.hi + fma(s, length, at.enter.lo)) * scene->frame->view.t_scale;
  const Floats x = packet_lerp(s, at.a[0], at.b[0]), y = packet_lerp(s, at.a[1], at.b[1]),
               z = packet_lerp(s, at.a[2], at.b[2]);
  const Floats grad_x = packet_lerp(z, packet_lerp(y, w[1] - w[0], w[3] - w[2]),
                                    packet_lerp(y, w[5] - w[4], w[7] - w[6]));
  const Floats grad_y = packet_lerp(z, packet_lerp(x, w[2] - w[0], w[3] - w[1]),
                                    packet_lerp(x, w[6] - w[4], w[7] - w[5]));
  const Floats grad_z = packet_lerp(y, packet_lerp(x, w[4] - w[0], w[5] - w[1]),
                                    packet_lerp(x, w[6] - w[2], w[7] - w[3]));
  Ints c[3];
  cells_at(p, found->cell, c);
  const Ints cx = c[0], cy = c[1], cz = c[2];
  ISO_EACH_LANE(lane, found->lanes) {
    ISO_GLOBAL HitRecord *hit = &hits[(uint)ray_ids[lane]];
    hit->t = t[lane];
    hit->block_id = block_id_at(scene->frame, (uint)(cx[lane] >> 2), (uint)(cy[lane] >> 2),
                                (uint)(cz[lane] >> 2));
    hit->cell = (uint)((cx[lane] & 3) + 4 * (cy[lane] & 3) + 16 * (cz[lane] & 3));
    hit->x = x[lane];
    hit->y = y[lane];
    hit->z = z[lane];
    hit->grad_x = without_zero_sign(grad_x[lane]);
    hit->grad_y = without_zero_sign(grad_y[lane]);
    hit->grad_z = without_zero_sign(grad_z[lane]);
  }
}

ISO_PACKET_NAMESPACE_END

#endif
