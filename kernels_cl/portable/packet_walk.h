/// packet_walk.h -- eight rays at a time through the macrocells, blocks and cells of a volume: the
/// hits of the scalar walk, bit for bit.
///
/// All rays of a packet first look for a macrocell with active blocks, then those that have found
/// one for such a block, then for a cell to look into; only when half of the rays stand at one, or
/// none walks any more, are cells tested, those of all rays together. A ray that leaves a block or
/// a macrocell on its way is looked after before that.
///
/// Portable: OpenCL C 1.2 and C++. packet_regions.h says what the file that includes it defines.
#ifndef ISOWAVE_PACKET_WALK_H
#define ISOWAVE_PACKET_WALK_H

#include "packet_regions.h"

ISO_PACKET_NAMESPACE_BEGIN

/// When so many lanes stand at cells, these are tested, though others still walk.
#define ISO_ENOUGH_STANDING 4

/// Bits first to last, each of 0 to 3.
ISO_INLINE Ints bits_between(Ints first, Ints last) {
  return 2 * bit_at(last) - bit_at(first);
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

/// Lanes that have entered their regions behind the end of their interval, by float32 without
/// doubt. test_cells() finds the others.
ISO_INLINE Mask behind_end(const PacketRays *r, Mask lanes) {
  return lanes & (entry_t(r) > r->end_t + 2.0f * ISO_FLOAT_DOUBT * r->end_t);
}

/// Takes all lanes that walk among the regions of a level to the next one, unless their interval
/// ends before.
ISO_INLINE void step_to_next(Packet *p, int level) {
  const Mask lanes = p->at[level];
  const Floats *far = p->level[level].far;
  const Exits exits = find_exits(&p->rays, far, lanes);
  ISO_EACH_OF_3(axis) {
    p->rays.entered.axis = pick(exits.on[axis], ints(axis), p->rays.entered.axis);
    p->rays.entered.plane = pick(exits.on[axis], far[axis], p->rays.entered.plane);
  }
  leave_by(p, level, lanes, exits);
  if (level != ISO_CELLS && packet_has_end(&p->rays)) {
    const Mask behind = behind_end(&p->rays, lanes);
    ISO_EACH_OF_3(of) p->at[of] &= ~behind;
  }
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

/// Crossings that may be behind the end of the rays' intervals, by float32.
ISO_INLINE Mask may_pass_end(const PacketRays *r, Crossings c) {
  return crossing_float_t(r, c) >= r->end_t - 2.0f * ISO_FLOAT_DOUBT * r->end_t;
}

/// passes_border() at the end of the rays' intervals.
ISO_INLINE Mask passes_end(const PacketRays *r, Crossings c) {
  const TwoFloats t = crossing_t(r, c);
  return (t.hi > r->end_t) | ((t.hi == r->end_t) & (t.lo > 0.0f));
}

/// Tests the cells where lanes stand, up to the end of their intervals. Those that find no hit walk
/// on.
ISO_INLINE void test_cells(Packet *p, const PacketScene *scene, Mask standing) {
  const Floats *far = p->level[ISO_CELLS].far;
  Floats cell[3];
  Segments s;
  ISO_EACH_OF_3(axis) cell[axis] = pick(p->rays.axis[axis].up, far[axis] - 1.0f, far[axis]);
  const Mask waits = load_cells(p, scene, cell, standing, s.w);
  Mask lanes = standing & ~waits, ends = ints(0);
  p->waits |= waits;
  const Exits exits = find_exits(&p->rays, far, lanes);
  Crossings exit;
  exit.axis = pick(exits.on[0], ints(0), pick(exits.on[1], ints(1), ints(2)));
  exit.plane = pick(exits.on[0], far[0], pick(exits.on[1], far[1], far[2]));
  if (packet_has_end(&p->rays) && any(lanes & may_pass_end(&p->rays, exit))) {
    lanes &= ~passes_end(&p->rays, p->rays.entered);
    ends = lanes & passes_end(&p->rays, exit);
    exit.axis = pick(ends, ints(ISO_AXIS_END), exit.axis);
  }
  find_segments(&p->rays, p->rays.entered, exit, cell, &s);
  const Brackets found = packet_isolate(&s, lanes);
  if (any(found.lanes)) keep_found(&p->found, found, p->rays.entered, exit, cell);
  const Mask on = lanes & ~(found.lanes | ends);
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
