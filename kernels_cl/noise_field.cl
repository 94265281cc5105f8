/// noise_field.cl -- synthetic volumes of gradient noise, for devices with doubles.
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#include "portable/noise.h"

/* By -D: the type of voxels, and what 1 becomes there; 0 for types that hold the value itself. */
#ifndef ISO_VOXEL
#define ISO_VOXEL uchar
#define ISO_LARGEST_VOXEL 255.0
#endif

#define RUN 4u /* voxels along x of a work-item: at least one cell of the finest octave */

/// Adds octave o to sums [RUN] of voxels (x..x+3, y, z).
static void add_octave(NoiseOctave o, uint x, uint y, uint z, double *sums) {
  const double at_y = y * o.cells_per_voxel + o.shift, at_z = z * o.cells_per_voxel + o.shift;
  const double cell_y = floor(at_y), cell_z = floor(at_z);
  const double local_y = at_y - cell_y, local_z = at_z - cell_z;
  NoiseLine left, right;
  uint cell = 0;
  for (uint i = 0; i < RUN; ++i) {
    const double at = (x + i) * o.cells_per_voxel + o.shift, begin = floor(at);
    if (i == 0 || (uint)begin != cell) {
      cell = (uint)begin;
      left = noise_line(o.amplitude, o.seed, cell, (uint)cell_y, (uint)cell_z, local_y, local_z);
      right =
          noise_line(o.amplitude, o.seed, cell + 1, (uint)cell_y, (uint)cell_z, local_y, local_z);
    }
    sums[i] += noise_between(left, right, at - begin, noise_fade(at - begin));
  }
}

/// Voxels (x..x+3, y, z) as they are stored.
static void noise_run(global const NoiseOctave *octaves, const NoiseShape shape, uint x, uint y,
                      uint z, ISO_VOXEL *voxels) {
  double a[RUN], b[RUN];
  for (uint j = 0; j < RUN; ++j) {
    a[j] = noise_begin(shape, y);
    b[j] = 0;
  }
  for (uint o = 0; o < shape.begin_b; ++o) add_octave(octaves[o], x, y, z, a);
  for (uint o = shape.begin_b; o < shape.end; ++o) add_octave(octaves[o], x, y, z, b);
  for (uint j = 0; j < RUN; ++j) {
    const double value = noise_value(shape, x + j, y, z, a[j], b[j]);
    voxels[j] = ISO_LARGEST_VOXEL != 0 ? (ISO_VOXEL)floor(value * ISO_LARGEST_VOXEL + 0.5)
                                       : (ISO_VOXEL)value;
  }
}

/// Voxels [num_layers][ny][nx] of the layers from z_begin on. Grid-stride over runs of four voxels.
///
/// bytes  of the voxels
kernel void noise_field(global const NoiseOctave *octaves, NoiseShape shape, uint nx, uint ny,
                        uint z_begin, uint num_layers, global void *bytes) {
  global ISO_VOXEL *voxels = (global ISO_VOXEL *)bytes;
  const uint runs = (nx + RUN - 1u) / RUN, count = runs * ny * num_layers;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    const uint x = RUN * (i % runs), row = i / runs;
    ISO_VOXEL run[RUN];
    noise_run(octaves, shape, x, row % ny, z_begin + row / ny, run);
    for (uint j = 0; j < RUN && x + j < nx; ++j) voxels[(ulong)row * nx + x + j] = run[j];
  }
}

/// Voxels [nz][ny][nx] from voxel (x_begin, y_begin, z_begin) on, as float32: of types whose values
/// are ints. Grid-stride over runs of four voxels.
///
/// range  [2]: becomes the least and the greatest of it and of the voxels
kernel void noise_in_place(global const NoiseOctave *octaves, NoiseShape shape, uint nx, uint ny,
                           uint nz, uint x_begin, uint y_begin, uint z_begin, global float *voxels,
                           global int *range) {
  local int group_least, group_greatest;
  const uint runs = (nx + RUN - 1u) / RUN, count = runs * ny * nz;
  int least = INT_MAX, greatest = INT_MIN;
  if (get_local_id(0) == 0) {
    group_least = INT_MAX;
    group_greatest = INT_MIN;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    const uint x = RUN * (i % runs), row = i / runs;
    ISO_VOXEL run[RUN];
    noise_run(octaves, shape, x_begin + x, y_begin + row % ny, z_begin + row / ny, run);
    for (uint j = 0; j < RUN && x + j < nx; ++j) {
      voxels[(ulong)row * nx + x + j] = (float)run[j];
      least = min(least, (int)run[j]);
      greatest = max(greatest, (int)run[j]);
    }
  }
  atomic_min(&group_least, least);
  atomic_max(&group_greatest, greatest);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) {
    atomic_min(&range[0], group_least);
    atomic_max(&range[1], group_greatest);
  }
}
