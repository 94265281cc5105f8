/// block_grid.h -- block ids, their coordinates, and the blocks that make a dual grid.
#ifndef ISOWAVE_BLOCK_GRID_H
#define ISOWAVE_BLOCK_GRID_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

#define ISO_BLOCK_ABSENT 0xFFFFFFFFu  ///< instead of a cache slot: not in the cache
#define ISO_MAX_BLOCK_IDS 0x40000000u
#define ISO_MAX_CACHE_SLOTS \
  0x04000000u  ///< 16 GiB of values, whose numbers kernels count in 32 bits

typedef struct BlockCoords {
  uint x, y, z;
} BlockCoords;

/// Place of block (x,y,z) among those of its level of detail, as its stream and its ranges are
/// ordered.
ISO_INLINE uint level_block_at(const FrameParams *frame, uint x, uint y, uint z) {
  return x + frame->grid.blocks_x * (y + frame->grid.blocks_y * z);
}

/// Place among those of this level of the block with this id, of a frame with several levels;
/// ISO_INVALID_ID if it is another level's.
ISO_INLINE uint level_block_of(const FrameParams *frame, uint block_id) {
  const uint x = block_id % frame->place.blocks_x,
             y = block_id / frame->place.blocks_x % frame->place.blocks_y,
             z = block_id / frame->place.blocks_x / frame->place.blocks_y - frame->place.begin_z;
  return z < frame->grid.blocks_z ? level_block_at(frame, x, y, z)
                                  : ISO_INVALID_ID; /* finer: z has wrapped around */
}

/// The grid in which ids of blocks count: that of all levels of detail, one behind the other along
/// z, or of the only one.
ISO_INLINE uint id_blocks_x(const FrameParams *frame) {
  return ISO_LEVELS ? frame->place.blocks_x : frame->grid.blocks_x;
}
ISO_INLINE uint id_blocks_y(const FrameParams *frame) {
  return ISO_LEVELS ? frame->place.blocks_y : frame->grid.blocks_y;
}
/// Layer z of a level in that grid, and back.
ISO_INLINE uint id_layer(const FrameParams *frame, uint z) {
  return z + (ISO_LEVELS ? frame->place.begin_z : 0u);
}
ISO_INLINE uint layer_of_id(const FrameParams *frame, uint layer) {
  return layer - (ISO_LEVELS ? frame->place.begin_z : 0u);
}

/// Wraps around for blocks of finer levels than the frame's, and block_table.h takes that back.
ISO_INLINE BlockCoords block_coords(const FrameParams *frame, uint block_id) {
  const uint blocks_x = id_blocks_x(frame), blocks_y = id_blocks_y(frame);
  BlockCoords b;
  b.x = block_id % blocks_x;
  b.y = block_id / blocks_x % blocks_y;
  b.z = layer_of_id(frame, block_id / blocks_x / blocks_y);
  return b;
}

ISO_INLINE uint block_id_at(const FrameParams *frame, uint x, uint y, uint z) {
  return x + id_blocks_x(frame) * (y + id_blocks_y(frame) * id_layer(frame, z));
}

/// Is the block the brick's own? All of a volume's are that is not cut.
ISO_INLINE int is_own(const FrameParams *frame, BlockCoords b) {
  if (!ISO_BRICKS) return 1;
  return b.x >= frame->brick.before_x && b.x + frame->brick.behind_x < frame->grid.blocks_x &&
         b.y >= frame->brick.before_y && b.y + frame->brick.behind_y < frame->grid.blocks_y &&
         b.z >= frame->brick.before_z && b.z + frame->brick.behind_z < frame->grid.blocks_z;
}

/// The block that stands for `stride` blocks from `begin` on: any of them, by a hash. If the stride
/// is a multiple of the blocks along x, the first ones would all lie on one face of the volume.
ISO_INLINE uint sampled_block(uint begin, uint stride) {
  uint h = begin * 0x9E3779B1u;
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  return begin + (h ^ (h >> 13)) % stride;
}

/// The dual grid of block b needs b and its +x, +y, +z neighbours, as far as there are any: corner
/// x + 2y + 4z of 0..7 is the block (b.x + x, b.y + y, b.z + z), or ISO_INVALID_ID outside the
/// volume.
ISO_INLINE uint dual_grid_block(const FrameParams *frame, BlockCoords b, uint corner) {
  const uint x = b.x + (corner & 1u), y = b.y + (corner >> 1 & 1u), z = b.z + (corner >> 2);
  return x < frame->grid.blocks_x && y < frame->grid.blocks_y && z < frame->grid.blocks_z
             ? block_id_at(frame, x, y, z)
             : ISO_INVALID_ID;
}

/// Is there such a block, given that a ray has touched it? Rays of several levels of detail touch
/// only blocks of their own, which another level's frame does not know.
ISO_INLINE int exists_where_touched(const FrameParams *frame, BlockCoords b, uint corner) {
  return ISO_LEVELS || dual_grid_block(frame, b, corner) != ISO_INVALID_ID;
}

ISO_NAMESPACE_END

#endif
