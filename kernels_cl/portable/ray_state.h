/// ray_state.h -- what a ray keeps between passes: an entry in the list of rays at work, and where
/// it stands. A word each.
///
/// Portable: OpenCL C 1.2 and C++.
///
/// entry  active_ray_ids [active_count]; pixel: bits 0..27, log_ahead: 28..30, in_doubt: 31
/// stand  ray_block_ids [pixel]; block_id: bits 0..29, side: 30, 31. ISO_INVALID_ID: the ray has
///        left the volume
#ifndef ISOWAVE_RAY_STATE_H
#define ISOWAVE_RAY_STATE_H

#include "block_grid.h"

ISO_NAMESPACE_BEGIN

#define ISO_PIXEL_BITS 28
#define ISO_BLOCK_ID_BITS 30
#define ISO_MAX_RAYS (1u << ISO_PIXEL_BITS)
#if ISO_MAX_BLOCK_IDS != 1 << ISO_BLOCK_ID_BITS
#error "a stand has another number of bits for block ids than there are ids"
#endif

#define ISO_MAX_LOG_AHEAD 6u     ///< log2 of ISO_MAX_SPECULATION
#define ISO_FIRST_LOG_AHEAD 2u   ///< of a new ray of pipeline `rays`
#define ISO_BORDER_LOG_AHEAD 3u  ///< of one that crosses a border of levels of detail

#define ISO_SIDE_UNKNOWN 0u
#define ISO_SIDE_OUTSIDE 1u
#define ISO_SIDE_INSIDE 2u
#define ISO_SIDE_NOT_CERTAIN 3u  ///< besides: it has not been found out
#define ISO_AT_HIT 3u            ///< instead of a side: the ray stands at its last hit

// What a launch of march_packets begins with, if not with a list of rays.
#define ISO_BEGINS_FRAME 1u  ///< with the rays of the picture
#define ISO_BEGINS_BAND 2u   ///< with those that go on to the next band of their frame

/// A ray at work.
typedef struct RayEntry {
  uint pixel;      ///< column + width * row, below ISO_MAX_RAYS
  uint log_ahead;  ///< log2 of the blocks that it looks ahead by itself, 0..ISO_MAX_LOG_AHEAD
  uint in_doubt;   ///< 0 or 1: where it stands, its next march must settle a doubt
} RayEntry;

/// The place where a ray stands, and goes on from.
typedef struct RayStand {
  uint block_id;
  uint side;  ///< if it stands behind a border of levels of detail, where it was before:
              ///< ISO_SIDE_*; or ISO_AT_HIT
} RayStand;

ISO_INLINE uint pack_entry(uint pixel, uint log_ahead, uint in_doubt) {
  return pixel | log_ahead << ISO_PIXEL_BITS | in_doubt << 31;
}

ISO_INLINE RayEntry unpack_entry(uint entry) {
  RayEntry ray;
  ray.pixel = entry & (ISO_MAX_RAYS - 1u);
  ray.log_ahead = entry >> ISO_PIXEL_BITS & 7u;
  ray.in_doubt = entry >> 31;
  return ray;
}

ISO_INLINE uint pack_stand(uint block_id, uint side) {
  return block_id | side << ISO_BLOCK_ID_BITS;
}

/// stand: not ISO_INVALID_ID, or what comes out means nothing.
ISO_INLINE RayStand unpack_stand(uint stand) {
  RayStand at;
  at.block_id = stand & (ISO_MAX_BLOCK_IDS - 1u);
  at.side = stand >> ISO_BLOCK_ID_BITS;
  return at;
}

/// Blocks that a ray looks ahead by itself.
ISO_INLINE uint own_ahead(RayEntry ray) {
  return 1u << ray.log_ahead;
}

/// log_ahead of a ray that has moved on since it looked ahead: twice as many blocks.
ISO_INLINE uint further_ahead(uint log_ahead) {
  return log_ahead < ISO_MAX_LOG_AHEAD ? log_ahead + 1u : ISO_MAX_LOG_AHEAD;
}

ISO_NAMESPACE_END

#endif
