/// zfp_encode.cl -- voxels -> zfp blocks, and how far the blocks are from the voxels.
#include "portable/block_bound.h"
#include "portable/two_float.h"
#include "portable/zfp_encode.h"

/// Voxels of block b of a grid of voxels, along each axis: 1..4.
typedef struct BlockPlace {
  uint x, y, z;                    ///< its first voxel
  uint count_x, count_y, count_z;  ///< fewer than 4 in partial blocks
} BlockPlace;

static BlockPlace place_of(uint b, uint nx, uint ny, uint nz) {
  const uint blocks_x = (nx + 3u) / 4u, blocks_y = (ny + 3u) / 4u;
  BlockPlace place;
  place.x = 4u * (b % blocks_x);
  place.y = 4u * (b / blocks_x % blocks_y);
  place.z = 4u * (b / blocks_x / blocks_y);
  place.count_x = min(nx - place.x, 4u);
  place.count_y = min(ny - place.y, 4u);
  place.count_z = min(nz - place.z, 4u);
  return place;
}

static uint num_blocks(uint nx, uint ny, uint nz) {
  return (nx + 3u) / 4u * ((ny + 3u) / 4u) * ((nz + 3u) / 4u);
}

/// One work-item per block of voxels [nz][ny][nx]: block b = bx + blocks_x * (by + blocks_y * bz)
/// goes to words [b * bits_per_block / 32 ..]. Grid-stride over the blocks.
kernel void zfp_encode(global const float *voxels, uint nx, uint ny, uint nz, uint bits_per_block,
                       global uint *words) {
  const uint count = num_blocks(nx, ny, nz);
  for (uint b = get_global_id(0); b < count; b += get_global_size(0)) {
    const BlockPlace place = place_of(b, nx, ny, nz);
    float values[ISO_BLOCK_VOXELS];
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v) {
      const uint x = place.x + padded_coordinate(v & 3u, place.count_x);
      const uint y = place.y + padded_coordinate(v >> 2 & 3u, place.count_y);
      const uint z = place.z + padded_coordinate(v >> 4, place.count_z);
      values[v] = voxels[((ulong)z * ny + y) * nx + x];
    }
    zfp_encode_block(values, bits_per_block, words + (ulong)b * (bits_per_block / 32u));
  }
}

/// One work-item per block of what zfp_encode wrote: the largest |decoded - voxel| at a place
/// (bound_place()) is errors [2 i] + errors [2 i + 1], exactly, with i = ISO_BOUND_PLACES b +
/// place. `words` has one word behind the last block. Grid-stride over the blocks.
kernel void zfp_encode_errors(global const float *voxels, uint nx, uint ny, uint nz,
                              uint bits_per_block, global const uint *words, global float *errors) {
  const uint count = num_blocks(nx, ny, nz);
  for (uint b = get_global_id(0); b < count; b += get_global_size(0)) {
    const BlockPlace place = place_of(b, nx, ny, nz);
    float values[ISO_BLOCK_VOXELS];
    TwoFloat largest[ISO_BOUND_PLACES];
    for (uint at = 0; at < ISO_BOUND_PLACES; ++at) largest[at] = two_float(0.0f);
    zfp_decode_block(words, (ulong)b * bits_per_block, bits_per_block, ISO_ALL_PLANES, values);
    for (uint z = 0; z < place.count_z; ++z) {
      for (uint y = 0; y < place.count_y; ++y) {
        for (uint x = 0; x < place.count_x; ++x) {
          const float voxel = voxels[((ulong)(place.z + z) * ny + place.y + y) * nx + place.x + x];
          const uint v = x + 4u * y + 16u * z, at = bound_place(v);
          TwoFloat error = two_sum(values[v], -voxel);
          if (error.hi < 0.0f) {
            error.hi = -error.hi;
            error.lo = -error.lo;
          }
          if (t_less(largest[at], error)) largest[at] = error;
        }
      }
    }
    for (uint at = 0; at < ISO_BOUND_PLACES; ++at) {
      const ulong i = ISO_BOUND_PLACES * (ulong)b + at;
      errors[2 * i] = largest[at].hi;
      errors[2 * i + 1] = largest[at].lo;
    }
  }
}
