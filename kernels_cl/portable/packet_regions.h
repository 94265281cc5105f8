/// packet_regions.h -- the macrocells, blocks and cells in which eight rays are, and how the rays
/// begin: at the box of active blocks, or at a block that they have come to before.
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
#ifndef ISOWAVE_PACKET_REGIONS_H
#define ISOWAVE_PACKET_REGIONS_H

#include "packet.h"

ISO_PACKET_NAMESPACE_BEGIN

// Regions, from the smallest on.
#define ISO_CELLS 0
#define ISO_BLOCKS 1
#define ISO_MACROCELLS 2
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
  const Ints bits = pick(level->place < 32, level->low, level->high),
             bit = bit_at(level->place & 31);
  return (bits & bit) == bit;
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
    RayEvent enter = border_event(ray.begin_t), exit = border_event(ray.end_t);
    settled.lanes[lane] = clip_to_box(&ray, begin, end, &enter, &exit) != 0 ? -1 : 0;
    settled.at.axis[lane] = enter.axis;
    if (enter.axis != ISO_AXIS_START) {
      settled.at.plane[lane] = whole_plane(
          axis_of_lane(&r->axis[enter.axis], lane),
          r->axis[enter.axis].up[lane] != 0 ? scene->begin[enter.axis] : scene->end[enter.axis]);
    }
  }
  return settled;
}

/// r->entered = the crossings by which rays enter the box of active blocks, or begin in it. Returns
/// the lanes that do.
ISO_INLINE Mask enter_box(PacketRays *r, const PacketScene *scene) {
  Floats near[3], exit = floats(ISO_NEVER);
  if (packet_has_end(r)) exit = smaller(exit, r->end_t);
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

ISO_PACKET_NAMESPACE_END

#endif
