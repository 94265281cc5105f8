#pragma once
// A pixel's colour from its hit, as shade_ray() of kernels_cl/portable/shade.h, which is C for
// OpenCL and not for CUDA.

#include "bench/gpu_peer/walk.h"

namespace isowave::core::bench {

PEER_BOTH float rows_times(const float *row, const float v[3]) {
  return row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
}

PEER_BOTH float dot3(const float a[3], const float b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

PEER_BOTH std::uint8_t byte_of(float color) {
  return static_cast<std::uint8_t>(fminf(fmaxf(color, 0.0f), 1.0f) * 255.0f + 0.5f);
}

PEER_BOTH void shade_hit(const View &view, const ShadeParams &p, const WalkRay &ray,
                         const GridHit &hit, std::uint8_t *rgb) {
  if (hit.t == INFINITY) {
    rgb[0] = byte_of(p.background_r);
    rgb[1] = byte_of(p.background_g);
    rgb[2] = byte_of(p.background_b);
    return;
  }
  const float gradient[3] = {hit.grad_x, hit.grad_y, hit.grad_z};
  const float up_index[3] = {view.up_x, view.up_y, view.up_z};
  float normal[3], toward[3], up[3];
  for (int a = 0; a < 3; ++a) {
    normal[a] = rows_times(p.normal + 3 * a, gradient);
    toward[a] = rows_times(p.view + 3 * a, ray.d);
    up[a] = rows_times(p.view + 3 * a, up_index);
  }
  const float length = sqrtf(dot3(normal, normal));
  const float with_view = length * sqrtf(dot3(toward, toward));
  const float with_up = length * sqrtf(dot3(up, up));
  const float facing = with_view > 0.0f ? -dot3(normal, toward) / with_view : 1.0f;
  const float cosine = fabsf(facing);
  const float rise = with_up > 0.0f ? dot3(normal, up) / with_up : 0.0f;
  const float slope = (rise * facing / fmaxf(cosine, ISO_GRAZING) + cosine) * 0.70710678f;
  float highlight = cosine;
  for (int i = 0; i < 5; ++i) highlight *= highlight;
  const float light = p.diffuse * cosine + p.ambient + p.above * fmaxf(slope, 0.0f);
  rgb[0] = byte_of(p.surface_r * light + p.specular * highlight);
  rgb[1] = byte_of(p.surface_g * light + p.specular * highlight);
  rgb[2] = byte_of(p.surface_b * light + p.specular * highlight);
}

}  // namespace isowave::core::bench
