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

/// Voxels [num_layers][ny][nx] of the layers from z_begin on. Grid-stride over runs of four voxels.
///
/// bytes  of the voxels
kernel void noise_field(global const NoiseOctave *octaves, NoiseShape shape, uint nx, uint ny,
                        uint z_begin, uint num_layers, global void *bytes) {
  global ISO_VOXEL *voxels = (global ISO_VOXEL *)bytes;
  const uint runs = (nx + RUN - 1u) / RUN, count = runs * ny * num_layers;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    const uint x = RUN * (i % runs), row = i / runs, y = row % ny, z = z_begin + row / ny;
    double a[RUN], b[RUN];
    for (uint j = 0; j < RUN; ++j) {
      a[j] = noise_begin(shape, y);
      b[j] = 0;
    }
    for (uint o = 0; o < shape.begin_b; ++o) add_octave(octaves[o], x, y, z, a);
    for (uint o = shape.begin_b; o < shape.end; ++o) add_octave(octaves[o], x, y, z, b);
    for (uint j = 0; j < RUN && x + j < nx; ++j) {
      const double value = noise_value(shape, x + j, y, z, a[j], b[j]);
      voxels[(ulong)row * nx + x + j] = ISO_LARGEST_VOXEL != 0
                                            ? (ISO_VOXEL)floor(value * ISO_LARGEST_VOXEL + 0.5)
                                            : (ISO_VOXEL)value;
    }
  }
}
