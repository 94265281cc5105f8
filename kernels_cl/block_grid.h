/// block_grid.h -- block ids, their coordinates, and the blocks that make a dual grid.
#ifndef ISOWAVE_BLOCK_GRID_H
#define ISOWAVE_BLOCK_GRID_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

#define ISO_BLOCK_ABSENT 0xFFFFFFFFu  ///< instead of a cache slot: not in the cache
#define ISO_MAX_CACHE_SLOTS 0x40000000u

typedef struct BlockCoords {
  uint x, y, z;
} BlockCoords;

ISO_INLINE BlockCoords block_coords(const FrameParams *frame, uint block_id) {
  BlockCoords b;
  b.x = block_id % frame->blocks_x;
  b.y = block_id / frame->blocks_x % frame->blocks_y;
  b.z = block_id / frame->blocks_x / frame->blocks_y;
  return b;
}

ISO_INLINE uint block_id_at(const FrameParams *frame, uint x, uint y, uint z) {
  return x + frame->blocks_x * (y + frame->blocks_y * z);
}

/// The block that stands for `stride` blocks from `begin` on: any of them, by a hash. Always the first would be blind where the
/// stride is a multiple of the blocks along x: all on one face of the volume.
ISO_INLINE uint sampled_block(uint begin, uint stride) {
  uint h = begin * 0x9E3779B1u;
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  return begin + (h ^ (h >> 13)) % stride;
}

/// The dual grid of block b needs b and its +x, +y, +z neighbours, as far as there are any: corner x + 2y +
/// 4z of 0..7 is the block (b.x + x, b.y + y, b.z + z), or ISO_INVALID_ID outside the volume.
ISO_INLINE uint dual_grid_block(const FrameParams *frame, BlockCoords b, uint corner) {
  const uint x = b.x + (corner & 1u), y = b.y + (corner >> 1 & 1u), z = b.z + (corner >> 2);
  return x < frame->blocks_x && y < frame->blocks_y && z < frame->blocks_z ? block_id_at(frame, x, y, z)
                                                                           : ISO_INVALID_ID;
}

ISO_NAMESPACE_END

#endif
