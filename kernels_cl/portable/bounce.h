/// bounce.h -- light that comes from the scene's light by way of another place of the surface.
///
/// Portable: OpenCL C 1.2 and C++.
///
/// A hit's ambient ray (ambient.h) that meets the surface brings light from there. A matt surface
/// sends it off alike in all directions: as much as it gets from the light, which is the cosine of
/// the light's direction with the normal, or nothing if a ray from there towards the light meets
/// the surface. Since ambient rays are distributed by their cosine, the mean over a hit's rays is
/// the light that it gets, as a share of the light's own. Shading gives it the surface's colour,
/// once for each of the two places (shade.h).
///
/// In frames of several surfaces, an ambient ray brings light from the nearest opaque surface that
/// it meets. That surface's colour goes into the sums (sent_on() of layers.h), and the light of
/// each layer is filtered by itself.
///
/// The mean of a few rays is noisy. So the light of neighbours is averaged, in steps whose taps lie
/// farther and farther apart (Dammertz et al., "Edge-Avoiding A-Trous Wavelet Transform for fast
/// Global Illumination Filtering", HPG 2010). Neighbours count less the more their normals differ,
/// and the farther they lie off the hit's tangent plane. Light has not got the hit's colour yet, so
/// edges between colours stay as they are.
#ifndef ISOWAVE_BOUNCE_H
#define ISOWAVE_BOUNCE_H

#include "ambient.h"

ISO_NAMESPACE_BEGIN

#define ISO_BOUNCE_STEPS 4u  ///< of the filter, an even number: taps are 1, 2, 4, 8 rays apart

/// The ray towards the light from where an ambient ray has met the surface; none if the side that
/// is met faces away from the light.
///
/// given   the ambient ray
/// placed  what it has met, see placed_hit()
/// light   direction towards the light, world space
/// cosine  gets that of the light with the normal
ISO_INLINE GivenRay bounce_ray(const AmbientParams *p, GivenRay given, HitRecord placed,
                               AmbientDirection light, float *cosine) {
  const Ray ray = make_given_ray(given);
  const AmbientDirection normal = seen_normal(p, &ray, placed);
  *cosine = inner_product(normal, light);
  if (!(*cosine > 0.0f)) {
    *cosine = 0.0f;
    return no_ray();
  }
  return ray_above(p, placed, normal, light);
}

/// The row of the directions towards the light (make_light_directions()) that a round's rays have:
/// those of shadow rays in turns, or if there are none, the only one.
ISO_INLINE uint light_row(uint num_shadow, uint round) {
  return num_shadow == 0u ? 0u : round % num_shadow;
}

/// A hit as the filter sees it: the ray that begins there and goes along its normal, in world
/// space, up to a factor; none without a hit.
///
/// frame  of the finest level of detail that draws
ISO_INLINE GivenRay normal_ray(const FrameParams *frame, const AmbientParams *p, uint ray_id,
                               HitRecord hit) {
  GivenRay from_hit = no_ray();
  AmbientDirection at, normal;
  Ray ray;
  float along;
  if (hit.t == INFINITY) return from_hit;
  ray = make_ray(frame, ray_id);
  along = hit.t / frame->view.t_scale;
  at = turned(p->view, fma(along, ray.x.d, ray.x.o), fma(along, ray.y.d, ray.y.o),
              fma(along, ray.z.d, ray.z.o));
  normal = seen_normal(p, &ray, hit);
  from_hit.o_x = at.x;
  from_hit.o_y = at.y;
  from_hit.o_z = at.z;
  from_hit.d_x = normal.x;
  from_hit.d_y = normal.y;
  from_hit.d_z = normal.z;
  return from_hit;
}

/// How much a neighbour counts, [0,1]: 1 within the tangent plane, 0 if it is farther off than half
/// a voxel and half of its distance. Both are normal_ray()s.
ISO_INLINE float likeness(GivenRay of, GivenRay neighbour) {
  const float cosine =
      fma(of.d_x, neighbour.d_x, fma(of.d_y, neighbour.d_y, of.d_z * neighbour.d_z));
  const float x = neighbour.o_x - of.o_x, y = neighbour.o_y - of.o_y, z = neighbour.o_z - of.o_z;
  const float off = fabs(fma(of.d_x, x, fma(of.d_y, y, of.d_z * z)));
  const float length = sqrt(fma(x, x, fma(y, y, z * z)));
  const float weight = 1.0f - off / fma(0.5f, length, 0.5f);
  float power = cosine * cosine;
  if (!(cosine > 0.0f && weight > 0.0f)) return 0.0f;
  power *= power;
  return weight * power * power; /* cosine^8 */
}

/// The light of a ray's hit after a step of the filter; 0 without a hit.
///
/// width, height  of the frame [rays]
/// places  [height * width] see normal_ray()
/// light   [height * width] before the step
/// apart   distance of the taps [rays]
ISO_INLINE float filtered_light(uint width, uint height, ISO_GLOBAL const GivenRay *places,
                                ISO_GLOBAL const float *light, uint ray_id, uint apart) {
  const GivenRay of = places[ray_id];
  const int column = (int)(ray_id % width), row = (int)(ray_id / width);
  float sum = 4.0f * light[ray_id], weights = 4.0f;
  int dx, dy;
  if (!is_given(of)) return 0.0f;
  for (dy = -1; dy <= 1; ++dy) { /* in one order on every device */
    for (dx = -1; dx <= 1; ++dx) {
      const int x = column + dx * (int)apart, y = row + dy * (int)apart;
      GivenRay neighbour;
      float weight;
      if ((dx == 0 && dy == 0) || x < 0 || y < 0 || x >= (int)width || y >= (int)height) continue;
      neighbour = places[(uint)x + (uint)y * width];
      if (!is_given(neighbour)) continue;
      weight = (dx == 0 || dy == 0 ? 2.0f : 1.0f) * likeness(of, neighbour);
      sum = fma(weight, light[(uint)x + (uint)y * width], sum);
      weights += weight;
    }
  }
  return sum / weights;
}

ISO_NAMESPACE_END

#endif
