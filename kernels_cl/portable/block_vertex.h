/// block_vertex.h -- vertices of triangles as Block-Compressed Marching Cubes keeps them [Usher and
/// Pascucci 2020]: 8 bytes each, three for every triangle. Portable: OpenCL C 1.2 and C++.
///
/// A block's cells reach from its first voxel to the next block's, 4 voxels further along each
/// axis. A coordinate counts 1023 steps of that way in 10 bits. A vertex that two blocks have lies
/// for both on the same place of the lattice of the whole volume, 1023 block + step, so nothing
/// tears.
#ifndef ISOWAVE_BLOCK_VERTEX_H
#define ISOWAVE_BLOCK_VERTEX_H

#include "block_grid.h"

ISO_NAMESPACE_BEGIN

#define ISO_BLOCK_STEPS 1023u                     ///< along an axis of a block
#define ISO_STEPS_PER_VOXEL 255.75f               ///< ISO_BLOCK_STEPS / 4
#define ISO_VOXELS_PER_STEP 0x1.0040100p-8f       ///< 4 / ISO_BLOCK_STEPS, as a float32 ...
#define ISO_VOXELS_PER_STEP_LOW 0x1.0040100p-38f  ///< ... and what it lacks

typedef struct BlockVertex {
  uint steps;     ///< z: bits 0..9, y: 10..19, x: 20..29
  uint block_id;  ///< whose cell the triangle is in, the same for all three of its vertices
} BlockVertex;
ISO_CHECK_SIZE(BlockVertex, 8);

/// A place on the lattice of steps of the whole volume: below 2^24 along each axis, so that float32
/// has it exactly.
typedef struct LatticePoint {
  uint x, y, z;
} LatticePoint;

/// Steps from a block's first voxel. voxels: 0 to 4.
ISO_INLINE uint block_steps(float voxels) {
  return (uint)fma(voxels, ISO_STEPS_PER_VOXEL, 0.5f);
}

/// x, y, z: voxels from the block's first one, 0 to 4.
ISO_INLINE uint pack_steps(float x, float y, float z) {
  return block_steps(x) << 20 | block_steps(y) << 10 | block_steps(z);
}

/// The point of a vertex of block b.
ISO_INLINE LatticePoint lattice_point(BlockCoords b, uint steps) {
  LatticePoint p;
  p.x = ISO_BLOCK_STEPS * b.x + (steps >> 20);
  p.y = ISO_BLOCK_STEPS * b.y + (steps >> 10 & 1023u);
  p.z = ISO_BLOCK_STEPS * b.z + (steps & 1023u);
  return p;
}

ISO_NAMESPACE_END

#endif
