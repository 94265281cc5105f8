/// packet_bands.h -- eight rays at a time through the band of one level of detail, and over its
/// borders (march_packets.cl). OpenCL C 1.2. As core/host/host_bands.hpp.
///
/// The first pass of a frame has a launch for each band. Between two launches, a word for each
/// packet says which of its rays go on: BandPacket.
#ifndef ISOWAVE_PACKET_BANDS_H
#define ISOWAVE_PACKET_BANDS_H

#include "level_borders.h"
#include "portable/packet_clip.h"
#include "portable/packet_walk.h"

/// Macrocells whose sides a work-item knows. Neighbouring packets come to the same macrocells.
#define ISO_KNOWN_SIDES 8u
#define ISO_NO_MACROCELL 0xFFFFFFFFu

/// The voxels of cached block b that are inside, a bit for each.
ISO_INLINE ulong inside_of(const CacheReader *cache, const FrameParams *frame, BlockCoords b) {
  return cache->inside[slot_by_now(frame, cache->table, b)];
}

/// Lanes at `bits`, low and high half, of their numbers, 0 to 63.
ISO_INLINE Mask has_bit(uint low, uint high, Ints numbers) {
  return -((pick(numbers < 32, ints((int)low), ints((int)high)) >> (numbers & 31)) & 1);
}

/// The side on which a whole macrocell is; unknown if one of its blocks is active. Blocks without
/// active ones between them are on one side, as they share voxels.
///
/// number  x + columns * (y + rows * z) of the macrocell
/// place   its place in field->macrocell_sides: number << 2 | side
/// b       one of its blocks
ISO_INLINE uint side_of_macrocell(const PacketField *field, const FrameParams *frame, uint number,
                                  uint place, BlockCoords b) {
  global const uint *mask = field->macrocell_masks + 2 * number;
  uint known = field->macrocell_sides[place];
  if (known >> 2 != number) {
    known = number << 2 |
            ((mask[0] | mask[1]) != 0 ? ISO_SIDE_UNKNOWN
                                      : side_of_block(frame, field->all_masks, field->ranges, b));
    field->macrocell_sides[place] = known;
  }
  return known & 3u;
}

/// sides_in_cells() of lanes in macrocells without active blocks. Returns the other lanes.
ISO_INLINE Mask sides_in_macrocells(const PacketField *field, const FrameParams *frame,
                                    const Ints *at, Mask lanes, Ints *sides) {
  const int columns = (int)(frame->grid.blocks_x + 3) / 4,
            rows = (int)(frame->grid.blocks_y + 3) / 4;
  const Ints x = at[0] >> 4, y = at[1] >> 4, z = at[2] >> 4, numbers = x + columns * (y + rows * z),
             places = (x & 1) + 2 * (y & 1) + 4 * (z & 1);
  Mask left = lanes, others = ints(0);
  while (any(left)) {
    const uint first = first_lane(bits_of(left));
    const BlockCoords b = {(uint)at[0][first] >> 2, (uint)at[1][first] >> 2,
                           (uint)at[2][first] >> 2};
    const Mask here = left & (numbers == numbers[first]);
    const uint side = side_of_macrocell(field, frame, (uint)numbers[first], (uint)places[first], b);
    left &= ~here;
    if (side != ISO_SIDE_UNKNOWN)
      *sides = pick(here, ints((int)side), *sides);
    else
      others |= here;
  }
  return others;
}

/// As packet_sides.h says.
ISO_INLINE void sides_in_cells(const PacketField *field, const FrameParams *frame, const Ints *at,
                               Mask lanes, Mask certain, Ints *sides) {
  const Ints numbers = (at[0] & 3) + 4 * (at[1] & 3) + 16 * (at[2] & 3), x = at[0] >> 2,
             y = at[1] >> 2, z = at[2] >> 2;
  if (ISO_NO_DATA && field->no_data_begin != ISO_INVALID_ID) return;
  Mask left = sides_in_macrocells(field, frame, at, lanes, sides);
  while (any(left)) {
    const uint first = first_lane(bits_of(left));
    const Mask here = left & (x == x[first]) & (y == y[first]) & (z == z[first]);
    const BlockCoords b = {(uint)x[first], (uint)y[first], (uint)z[first]};
    const uint side = side_of_block(frame, field->all_masks, field->ranges, b);
    left &= ~here;
    if (side != ISO_SIDE_UNKNOWN) {
      *sides = pick(here, ints((int)side), *sides);
    } else if (any(here & certain)) {
      const OpenedBlock *opened = find_opened(field, frame, b, 0);
      if ((opened->have & ISO_OPENED_CACHED) != 0) {
        const ulong inside = inside_of(&field->cache, frame, b);
        const Mask known =
            here & certain & ~has_bit(opened->cells_low, opened->cells_high, numbers);
        *sides = pick(known,
                      pick(has_bit((uint)inside, (uint)(inside >> 32), numbers),
                           ints((int)ISO_SIDE_INSIDE), ints((int)ISO_SIDE_OUTSIDE)),
                      *sides);
      }
    }
  }
}

#include "portable/packet_sides.h"

/// find_sides(), which must not burden those that walk.
ISO_SELDOM Ints sides_at(const PacketScene *scene, const PacketRays *r, Floats t, Mask lanes) {
  return find_sides(scene, r, t, lanes);
}

/// The corners of a cell minus the isovalue. Returns 0 if a block is missing.
ISO_INLINE int open_cell(const PacketField *field, const FrameParams *frame, BlockCoords cell,
                         float *w) {
  const BlockCoords b = {cell.x >> 2, cell.y >> 2, cell.z >> 2};
  const int x = (int)(cell.x & 3), y = (int)(cell.y & 3), z = (int)(cell.z & 3);
  const uint corners = cell_blocks(x, y, z);
  const OpenedBlock *opened = find_opened(field, frame, b, corners);
  if ((corners & ~opened->have) != 0) return 0;
  vstore8(cell_corners(opened->voxels + x + 5 * y + 25 * z) - frame->surface.isovalue, 0, w);
  return 1;
}

/// The side on which a ray is at the border at t, which is in *cell; unknown if it does not come to
/// the border, or is in a cell without data there; ISO_SIDE_NOT_CERTAIN if a block is missing.
ISO_SELDOM uint side_at_border(const PacketField *field, const FrameParams *frame, const Ray *ray,
                               float t, BlockCoords *cell) {
  const LastPlanes last = last_planes(frame);
  float w[8];
  if (!reaches_border(ray, last, t)) return ISO_SIDE_UNKNOWN;
  *cell = region_at_border(ray, last, t, 1);
  const BlockCoords b = {cell->x >> 2, cell->y >> 2, cell->z >> 2};
  if (lacks_data_at_border(frame, field->no_data, field->no_data_begin, ray, t))
    return ISO_SIDE_UNKNOWN;
  const uint side = side_of_block(frame, field->all_masks, field->ranges, b);
  if (side != ISO_SIDE_UNKNOWN) return side;
  if (!open_cell(field, frame, *cell, w)) return ISO_SIDE_NOT_CERTAIN;
  return inside_at(ray, w, border_event(t), (int)cell->x, (int)cell->y, (int)cell->z, 0)
             ? ISO_SIDE_INSIDE
             : ISO_SIDE_OUTSIDE;
}

/// The hit of a ray where it begins, in that cell. Returns 0 if a block is missing.
ISO_SELDOM int hit_at_border(const PacketField *field, const FrameParams *frame,
                             global const ClipParams *clip, const Ray *ray, BlockCoords cell,
                             global HitRecord *hit) {
  const int x = (int)cell.x, y = (int)cell.y, z = (int)cell.z;
  const GridWalk walk = walk_from(ray, x, y, z, 1, last_planes(frame));
  float w[8];
  if (!open_cell(field, frame, cell, w)) return 0;
  HitRecord found =
      make_hit(frame, ray, w, x, y, z, ray_begin(ray), ray_exit(ray, walk_exit(&walk, ray)), 0.0f);
  mark_beginning(clip, ray, &found);
  *hit = found;
  return 1;
}

/// Lists a ray that waits at a block of a cell, with its side.
ISO_INLINE void wait_in_cell(const FrameParams *frame, BlockCoords cell, uint side, uint log_ahead,
                             uint pixel, const LaunchRays *rays) {
  rays->ray_block_ids[pixel] =
      pack_stand(block_id_at(frame, cell.x >> 2, cell.y >> 2, cell.z >> 2), side);
  rays->waiting[atomic_inc(rays->num_waiting)] = pack_entry(pixel, log_ahead, 0);
}

/// Lanes that may hit where they begin, since they were on another side before, do so, or wait for
/// a block there. Returns those that go on.
ISO_SELDOM Mask cross_border(const PacketScene *scene, global const ClipParams *clip,
                             const PacketRays *r, Ints ray_ids, Ints before, Mask lanes,
                             LaunchRays *rays) {
  const FrameParams *frame = scene->frame;
  Mask on = ints(0);
  ISO_EACH_LANE(lane, lanes) {
    const Ray ray = ray_of_lane(r, (int)lane);
    const uint pixel = (uint)ray_ids[lane], from = (uint)before[lane];
    BlockCoords cell = {0, 0, 0};
    const uint side = side_at_border(scene->field, frame, &ray, ray.begin_t, &cell);
    if (side == ISO_SIDE_UNKNOWN || side == from) {
      on[lane] = -1;
    } else if (side != ISO_SIDE_NOT_CERTAIN &&
               hit_at_border(scene->field, frame, clip, &ray, cell, &rays->hits[pixel])) {
      ++rays->num_hits;
      rays->ray_block_ids[pixel] = 0;
    } else {
      wait_in_cell(frame, cell, from, ISO_BORDER_LOG_AHEAD, pixel, rays);
    }
  }
  return on;
}

/// The sides of lanes at the end of their band. Those that miss a block there wait, and go through
/// it again: ISO_SIDE_NOT_CERTAIN.
ISO_SELDOM Ints sides_of_each(const PacketScene *scene, const PacketRays *r, Ints ray_ids,
                              Mask lanes, Ints sides, const LaunchRays *rays) {
  Ints found = sides;
  ISO_EACH_LANE(lane, lanes) {
    const Ray ray = ray_of_lane(r, (int)lane);
    BlockCoords cell = {0, 0, 0};
    found[lane] = (int)side_at_border(scene->field, scene->frame, &ray, ray.end_t, &cell);
    if (found[lane] == (int)ISO_SIDE_NOT_CERTAIN)
      wait_in_cell(scene->frame, cell, ISO_SIDE_UNKNOWN, ISO_FIRST_LOG_AHEAD, (uint)ray_ids[lane],
                   rays);
  }
  return found;
}

// ---- What a packet keeps between launches

/// The rays of a packet that go on to the next band. A word: bits 0..7: lanes, 8..15: met, 16..23
/// and 24..31: bits 0 and 1 of the sides.
typedef struct BandPacket {
  Mask lanes;
  Mask met;    ///< have come to an active block
  Ints sides;  ///< on which they left their band: ISO_SIDE_*
} BandPacket;

ISO_INLINE uint pack_band_packet(BandPacket packet) {
  return bits_of(packet.lanes) | bits_of(packet.met) << 8 | bits_of(-(packet.sides & 1)) << 16 |
         bits_of(-(packet.sides >> 1 & 1)) << 24;
}

ISO_INLINE BandPacket unpack_band_packet(uint word) {
  const Ints bits = ints((int)word) >> (int8)(0, 1, 2, 3, 4, 5, 6, 7);
  BandPacket packet;
  packet.lanes = -(bits & 1);
  packet.met = -(bits >> 8 & 1);
  packet.sides = (bits >> 16 & 1) | (bits >> 23 & 2);
  return packet;
}

#endif
