#pragma once
// The gradient that a hit is lit by, as kernels_cl/portable/smooth_gradient.h, which is C for
// OpenCL and not for CUDA: central differences at the corners of the hit's cell, trilinear between
// them. At the volume's border, a difference is one-sided.

#include "bench/gpu_peer/skips.h"

#ifdef __CUDA_ARCH__
#define PEER_ROLLED _Pragma("unroll 1")
#else
#define PEER_ROLLED
#endif

namespace isowave::core::bench {

/// The difference of the voxels before and behind one, along an axis [value per voxel].
template <int kAxis, class Reader>
PEER_BOTH float central_difference(const Reader &reader, const int dims[3], const int voxel[3]) {
  int before[3] = {voxel[0], voxel[1], voxel[2]}, behind[3] = {voxel[0], voxel[1], voxel[2]};
  before[kAxis] = voxel[kAxis] == 0 ? 0 : voxel[kAxis] - 1;
  behind[kAxis] = least(voxel[kAxis] + 1, dims[kAxis] - 1);
  const float scale = behind[kAxis] - before[kAxis] == 2 ? 0.5f : 1.0f;
  return scale * (reader.value(behind[0], behind[1], behind[2]) -
                  reader.value(before[0], before[1], before[2]));
}

/// Makes a hit's gradient smooth. If all differences vanish, the cell's own gradient stays.
///
/// Reader  as first_hit() takes it
/// at      the hit's place in the cell, [0,1]^3
template <class Reader>
PEER_BOTH void smooth_gradient(const Reader &reader, const int dims[3], const int cell[3],
                               const float at[3], float gradient[3]) {
  float x = 0.0f, y = 0.0f, z = 0.0f;
  PEER_ROLLED  // 48 reads of NanoVDB take minutes to compile
      for (int i = 0; i < 8; ++i) {
    const int dx = i >> 2, dy = i >> 1 & 1, dz = i & 1;
    const int voxel[3] = {cell[0] + dx, cell[1] + dy, cell[2] + dz};
    const float weight =
        (dx ? at[0] : 1.0f - at[0]) * (dy ? at[1] : 1.0f - at[1]) * (dz ? at[2] : 1.0f - at[2]);
    x += weight * central_difference<0>(reader, dims, voxel);
    y += weight * central_difference<1>(reader, dims, voxel);
    z += weight * central_difference<2>(reader, dims, voxel);
  }
  if (x == 0.0f && y == 0.0f && z == 0.0f) return;
  gradient[0] = x;
  gradient[1] = y;
  gradient[2] = z;
}

}  // namespace isowave::core::bench
