/// hit_positions.cl -- hit buffer -> positions in the world, for devices with doubles.
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#include "portable/world_position.h"

/// In      hits [begin + count]
/// Out     bytes: double [count][3], see hit_position()
/// Launch  grid-stride over hits
kernel void hit_positions(const HitMap map, uint begin, uint count, global const HitRecord *hits,
                          global void *bytes) {
  global double *positions = (global double *)bytes;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    double position[3];
    hit_position(&map, hits[begin + i], position);
    for (uint axis = 0; axis < 3; ++axis) positions[3 * i + axis] = position[axis];
  }
}
