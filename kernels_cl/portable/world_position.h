/// world_position.h -- positions of hits in the world, in double precision.
///
/// Portable: OpenCL C 1.2 with cl_khr_fp64, and C++. Sums and products alone, in one order, so that
/// devices and the host have the same bits.
#ifndef ISOWAVE_WORLD_POSITION_H
#define ISOWAVE_WORLD_POSITION_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

#define ISO_MAX_LEVELS 16u  ///< of detail

/// From index space to the world.
typedef struct WorldMap {
  double origin[3];
  double to_world[9];  ///< row-major
} WorldMap;
ISO_CHECK_SIZE(WorldMap, 96);

/// From a hit's cell to the world.
typedef struct HitMap {
  WorldMap map;
  uint blocks_x, blocks_y;       ///< blocks of the finest level
  uint num_levels;               ///< levels that may have hits
  uint is_float32;               ///< not 0: positions are rounded to float32
  uint begin_z[ISO_MAX_LEVELS];  ///< see LevelPlace
} HitMap;
ISO_CHECK_SIZE(HitMap, 176);

/// The voxel at the lowest corner of a hit's cell, in its level of detail.
typedef struct HitCell {
  uint x, y, z;
  uint level;  ///< 0: the finest
} HitCell;

/// A NaN with the same bits everywhere, unlike NAN.
ISO_INLINE double no_coordinate(void) {
#ifdef __OPENCL_C_VERSION__
  return as_double((ulong)0x7FF8000000000000ul);
#else
  return std::bit_cast<double>((ulong)0x7FF8000000000000ul);
#endif
}

ISO_INLINE double rounded_to_float(double value) {
#ifdef __OPENCL_C_VERSION__
  return (double)(float)value;
#else /* GCC 12 leaves out both conversions if it makes vectors of them. */
  const volatile float rounded = (float)value;
  return (double)rounded;
#endif
}

ISO_INLINE HitCell hit_cell(const HitMap *m, uint block_id, uint cell) {
  const uint layer = block_id / m->blocks_x / m->blocks_y;
  HitCell at;
  at.level = 0;
  while (at.level + 1 < m->num_levels && m->begin_z[at.level + 1] <= layer) ++at.level;
  at.x = 4 * (block_id % m->blocks_x) + (cell & 3u);
  at.y = 4 * (block_id / m->blocks_x % m->blocks_y) + (cell >> 2 & 3u);
  at.z = 4 * (layer - m->begin_z[at.level]) + (cell >> 4 & 3u);
  return at;
}

/// position [3]: the world's, of a position in index space.
ISO_INLINE void world_position(const WorldMap *map, uint is_float32, double x, double y, double z,
                               double *position) {
  int i;
  for (i = 0; i < 3; ++i) {
    const double *row = map->to_world + 3 * i;
    const double at = map->origin[i] + (row[0] * x + row[1] * y + row[2] * z);
    position[i] = is_float32 ? rounded_to_float(at) : at;
  }
}

/// position [3]: the hit's; NaN if there is none.
ISO_INLINE void hit_position(const HitMap *m, HitRecord hit, double *position) {
  HitCell at;
  double scale;
  if (hit.t == INFINITY) {
    position[0] = position[1] = position[2] = no_coordinate();
    return;
  }
  at = hit_cell(m, hit.block_id, hit.cell);
  /* Voxel k of a level lies where voxel 2k of the finer one does. */
  scale = (double)(1u << at.level);
  world_position(&m->map, m->is_float32, scale * ((double)at.x + (double)hit.x),
                 scale * ((double)at.y + (double)hit.y), scale * ((double)at.z + (double)hit.z),
                 position);
}

ISO_NAMESPACE_END

#endif
