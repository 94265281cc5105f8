#pragma once
// The gradient that a hit is lit by, as kernels_cl/portable/smooth_gradient.h, which is C for
// OpenCL and not for CUDA: central differences at the corners of the hit's cell, trilinear between
// them. At the volume's border, a difference is one-sided.

#include "bench/gpu_peer/cell_root.h"

#ifdef __CUDACC__
#define PEER_UNROLL _Pragma("unroll")
#else
#define PEER_UNROLL
#endif

namespace isowave::core::bench {

PEER_BOTH float between(float at, float low, float high) {
  return low + at * (high - low);
}

/// The derivative along an axis. Eight voxels beyond the cell are read.
///
/// Reader   as first_hit() takes it
/// corners  of the cell, minus the isovalue
/// at       the hit's place in the cell, [0,1]^3
template <int kAxis, class Reader>
PEER_BOTH float smooth_derivative(const Reader &reader, const int dims[3], const int cell[3],
                                  const Corners &corners, float isovalue, const float at[3]) {
  constexpr int kStep = 4 >> kAxis;  // from corner to corner along the axis
  const int before = cell[kAxis] == 0 ? 0 : -1, behind = cell[kAxis] + 2 == dims[kAxis] ? 0 : 1;
  const float low = before == 0 ? 1.0f : 0.5f, high = behind == 0 ? 1.0f : 0.5f;
  float d[8];
  PEER_UNROLL
  for (int i = 0; i < 8; ++i) {
    const bool is_low = (i & kStep) == 0;
    int voxel[3] = {cell[0] + (i >> 2), cell[1] + (i >> 1 & 1), cell[2] + (i & 1)};
    voxel[kAxis] += is_low ? before : behind;
    const float beyond = reader.value(voxel[0], voxel[1], voxel[2]) - isovalue;
    d[i] = is_low ? (corners.f[i | kStep] - beyond) * low : (beyond - corners.f[i & ~kStep]) * high;
  }
  const float face0 = between(at[1], between(at[2], d[0], d[1]), between(at[2], d[2], d[3]));
  const float face1 = between(at[1], between(at[2], d[4], d[5]), between(at[2], d[6], d[7]));
  return between(at[0], face0, face1);
}

/// Makes a hit's gradient smooth. If all differences vanish, the cell's own gradient stays.
template <class Reader>
PEER_BOTH void smooth_gradient(const Reader &reader, const int dims[3], const int cell[3],
                               const Corners &corners, float isovalue, const float at[3],
                               float gradient[3]) {
  const float x = smooth_derivative<0>(reader, dims, cell, corners, isovalue, at);
  const float y = smooth_derivative<1>(reader, dims, cell, corners, isovalue, at);
  const float z = smooth_derivative<2>(reader, dims, cell, corners, isovalue, at);
  if (x == 0.0f && y == 0.0f && z == 0.0f) return;
  gradient[0] = x;
  gradient[1] = y;
  gradient[2] = z;
}

}  // namespace isowave::core::bench
