/// level_borders.h -- a ray from one level of detail to the next (core/view/detail.hpp). OpenCL
/// C 1.2.
#ifndef ISOWAVE_LEVEL_BORDERS_H
#define ISOWAVE_LEVEL_BORDERS_H

#include "block_walk.h"
#include "portable/level_border.h"
#include "portable/no_data.h"
#include "ray_source.h"

/// The level of detail that has the block with this id, of those that draw a frame, frames
/// [num_frames], the finest first.
ISO_INLINE uint level_of(global const FrameParams *frames, uint num_frames, uint block_id) {
  const uint layer = block_id / (frames[0].place.blocks_x * frames[0].place.blocks_y);
  uint level = 0;
  while (level + 1 < num_frames && layer >= frames[level + 1].place.begin_z) ++level;
  return level;
}

/// The side on which a whole block is; unknown if it is active. See macrocells.cl: the range of one
/// that is not is on its side, too.
ISO_INLINE uint side_of_block(const FrameParams *frame, global const uint *macrocell_masks,
                              global const ushort *ranges, BlockCoords b) {
  if (is_active(frame, macrocell_masks, b)) return ISO_SIDE_UNKNOWN;
  const uint high = ranges[frame->place.ranges_begin + level_block_at(frame, b.x, b.y, b.z)] >> 8;
  const int is_inside = ISO_LABELS ? (int)(high >> frame->surface.isovalue_index & 1u)
                                   : high >= frame->surface.isovalue_index;
  return is_inside ? ISO_SIDE_INSIDE : ISO_SIDE_OUTSIDE;
}

/// Does the ray reach the border at t within the brick's own blocks? If so, *b is the one that it
/// is in just behind it.
ISO_LONG int block_at_border(const FrameParams *frame, const Ray *ray, float t, BlockCoords *b) {
  const LastPlanes last = last_planes(frame);
  if (!reaches_border(ray, last, t)) return 0;
  *b = region_at_border(ray, last, t, 4);
  return is_own(frame, *b);
}

/// Does the cell in which a ray is at the border at t, within the domain, lack data at a corner?
///
/// no_data  the table of no_data.h for all levels' blocks, in the order of their ranges; none if
///          ISO_NO_DATA is 0, or no_data_begin is ISO_INVALID_ID
ISO_INLINE int lacks_data_at_border(const FrameParams *frame, global const uint *no_data,
                                    uint no_data_begin, const Ray *ray, float t) {
  if (!ISO_NO_DATA || no_data_begin == ISO_INVALID_ID) return 0;
  const BlockCoords cell = region_at_border(ray, last_planes(frame), t, 1);
  for (uint corner = 0; corner < 8; ++corner) {
    const uint vx = cell.x + (corner & 1), vy = cell.y + (corner >> 1 & 1),
               vz = cell.z + (corner >> 2);
    const uint block = frame->place.ranges_begin + level_block_at(frame, vx >> 2, vy >> 2, vz >> 2);
    const uint voxel = (vx & 3) + 4 * (vy & 3) + 16 * (vz & 3);
    if ((no_data_mask(no_data + no_data_begin, block) >> voxel & 1u) != 0) return 1;
  }
  return 0;
}

/// The place at which a ray stands when it begins in a level; ISO_INVALID_ID: there is nothing for
/// it in its interval there. If the block in which it begins is not as a whole on the ray's side,
/// the ray stands there, with its side. Otherwise it stands at the next active block. The ray has
/// no side if data lack where it begins.
///
/// side     side on which the ray was before, or unknown
/// ranges   ranges of all levels' blocks
/// no_data  as lacks_data_at_border
/// found    [1] scratch
ISO_LONG uint begin_in_level(const FrameParams *frame, const Ray *ray,
                             global const uint *macrocell_masks, global const ushort *ranges,
                             global const uint *no_data, uint no_data_begin, uint side,
                             ISO_SCRATCH uint *found) {
  BlockCoords b;
  if (has_side(side) && block_at_border(frame, ray, ray->begin_t, &b) &&
      side_of_block(frame, macrocell_masks, ranges, b) != side &&
      !lacks_data_at_border(frame, no_data, no_data_begin, ray, ray->begin_t))
    return pack_stand(block_id_at(frame, b.x, b.y, b.z), side);
  uint block_id = first_block(frame, ray);
  return block_id != ISO_INVALID_ID &&
                 find_blocks(frame, macrocell_masks, ray, &block_id, 1, found, 1) != 0
             ? found[0]
             : ISO_INVALID_ID;
}

/// The side of the whole block in which a ray is at the end of a level's band; unknown if it is not
/// in the domain there, the block is active, or data lack.
ISO_INLINE uint side_at_end(const FrameParams *frame, global const uint *macrocell_masks,
                            global const ushort *ranges, global const uint *no_data,
                            uint no_data_begin, uint pixel) {
  const Ray ray = make_ray(frame, pixel);
  BlockCoords b;
  return block_at_border(frame, &ray, frame->band.end_t, &b) &&
                 !lacks_data_at_border(frame, no_data, no_data_begin, &ray, frame->band.end_t)
             ? side_of_block(frame, macrocell_masks, ranges, b)
             : ISO_SIDE_UNKNOWN;
}

/// The place at which a ray stands after it has left the band of frames[level], in a band behind:
/// begin_in_level() of the first that has one.
///
/// clip  as ray_of()
/// side  side on which the ray left; unknown: the border is in a block that is as a whole on one
///       side, or in a cell without data
ISO_LONG uint cross_borders(global const FrameParams *frames, uint num_frames,
                            global const ClipParams *clip, global const uint *macrocell_masks,
                            global const ushort *ranges, global const uint *no_data,
                            uint no_data_begin, uint pixel, uint level, uint side,
                            ISO_SCRATCH uint *found) {
  uint stand = ISO_INVALID_ID;
  for (; ISO_BANDS && level + 1 < num_frames && stand == ISO_INVALID_ID; ++level) {
    const FrameParams behind = frames[level + 1];
    const Ray ray = camera_ray(&behind, clip, pixel);
    BlockCoords b;
    if (ISO_CLIP && ray.cut_by != ISO_NOT_CUT) {
      side = side_where_cut(clip, &ray);
    } else if (side == ISO_SIDE_UNKNOWN && block_at_border(&behind, &ray, ray.begin_t, &b)) {
      const FrameParams before = frames[level];
      side = side_at_end(&before, macrocell_masks, ranges, no_data, no_data_begin, pixel);
    }
    if (!ISO_CLIP || has_interval(&ray))
      stand = begin_in_level(&behind, &ray, macrocell_masks, ranges, no_data, no_data_begin, side,
                             found);
    side = ISO_SIDE_UNKNOWN;
  }
  return stand;
}

/// `frame`: that of the level which has block block_id, as a copy of the work-item's own.
#if ISO_LEVELS
#define ISO_FRAME_OF(frame, block_id)                                                \
  const FrameParams frame##_params = frames[level_of(frames, num_frames, block_id)]; \
  const FrameParams *frame = &frame##_params
#else
#define ISO_FRAME_OF(frame, block_id) \
  const FrameParams *frame = ((void)frames, (void)num_frames, &frame_params)
#endif

/// block_behind() the block where a ray stands. If the ray stands at a hit where it begins, the box
/// of active blocks may lie behind.
ISO_INLINE uint block_behind_stand(const FrameParams *frame, const Ray *ray, BlockCoords b,
                                   uint side, LastPlanes last) {
  return is_at_hit(side) && !is_in_box(frame, (int)b.x, (int)b.y, (int)b.z)
             ? first_block(frame, ray)
             : block_behind(frame, ray, b, last);
}

/// find_blocks() for a ray that stands at block *block_id. A ray with a side, or at a hit, which
/// may be a cap or at a border, looks into this block even if the block is not active.
ISO_LONG uint find_blocks_from(const FrameParams *frame, global const uint *macrocell_masks,
                               const Ray *ray, uint side, uint *block_id, uint wanted,
                               ISO_SCRATCH uint *found) {
  uint first = 0;
  if (has_side(side) || is_at_hit(side)) {
    found[0] = *block_id;
    first = 1;
    *block_id =
        block_behind_stand(frame, ray, block_coords(frame, *block_id), side, last_planes(frame));
    if (wanted == 1 || *block_id == ISO_INVALID_ID) return 1;
  }
  return first + find_blocks(frame, macrocell_masks, ray, block_id, wanted - first,
                             found + first * ISO_SCRATCH_STRIDE, ISO_SCRATCH_STRIDE);
}

#endif
