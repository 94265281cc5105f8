/// ambient.h -- the rays that find out how much light a hit gets: how much of the sky it sees, and
/// how much of the scene's light.
///
/// Portable: OpenCL C 1.2 and C++.
///
/// Ray k of a pixel begins half a voxel above its hit, on the side that is seen, and goes into the
/// half space above the hit's gradient, where it is open if it meets no surface. Directions are
/// distributed by their cosine with the normal, so that the share of open rays is what light from
/// all around would add to a matt surface. They come from a table: a spiral, one of its
/// ISO_AMBIENT_PATTERNS turns for each pixel of a tile of 4 x 4, so that neighbours see different
/// parts of the sky and together all of it.
///
/// Shadow rays follow: they begin at the same place, and go towards the light, or for soft shadows
/// to all parts of a disk around it. They are lit if they meet no surface. A hit on a side that
/// faces away from the light has none.
#ifndef ISOWAVE_AMBIENT_H
#define ISOWAVE_AMBIENT_H

#include "cell_intersect.h"

ISO_NAMESPACE_BEGIN

#define ISO_AMBIENT_PATTERNS 16u
#define ISO_MAX_AMBIENT_RAYS 255u  ///< of a hit: their counts are bytes
#define ISO_AMBIENT_LIFT 0.5f      ///< of a ray's beginning above its hit [voxels]

typedef struct AmbientParams {
  float normal[9];  ///< row-major: gradient in index space -> normal in world space, up to a factor
  float view[9];    ///< row-major: direction in index space -> world space, up to a factor
  float to_index[9];  ///< row-major: back
  uint num_ambient;   ///< ambient rays of each hit; its further rays are shadow rays
} AmbientParams;
ISO_CHECK_SIZE(AmbientParams, 112);

/// A direction of length 1: z along the normal, or of a shadow ray in world space.
typedef struct AmbientDirection {
  float x, y, z;
} AmbientDirection;
ISO_CHECK_SIZE(AmbientDirection, 12);

/// The turn of the spiral that a pixel has: neighbours have different ones.
ISO_INLINE uint ambient_pattern(const FrameParams *frame, uint pixel) {
  const uint x = pixel % frame->view.width & 3u, y = pixel / frame->view.width & 3u;
  const uint mixed = x ^ y; /* the bits of x ^ y and y, in turns, from the lowest: ordered dither */
  return (mixed & 1u) << 3 | (y & 1u) << 2 | (mixed >> 1) << 1 | y >> 1;
}

/// Row-major m times (x,y,z).
ISO_INLINE AmbientDirection turned(const float *m, float x, float y, float z) {
  AmbientDirection v;
  v.x = fma(m[0], x, fma(m[1], y, m[2] * z));
  v.y = fma(m[3], x, fma(m[4], y, m[5] * z));
  v.z = fma(m[6], x, fma(m[7], y, m[8] * z));
  return v;
}

ISO_INLINE float inner_product(AmbientDirection a, AmbientDirection b) {
  return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}

/// v with length 1; unchanged if v is 0.
ISO_INLINE AmbientDirection normalized(AmbientDirection v) {
  const float x = fabs(v.x), y = fabs(v.y), z = fabs(v.z);
  const float xy = x > y ? x : y, largest = z > xy ? z : xy;
  float length;
  if (!(largest > 0.0f)) return v;
  v.x /= largest; /* squares of huge or tiny values would not survive */
  v.y /= largest;
  v.z /= largest;
  length = sqrt(inner_product(v, v));
  v.x /= length;
  v.y /= length;
  v.z /= length;
  return v;
}

/// The normal of a hit, in world space, of length 1, on the side that is seen.
ISO_INLINE AmbientDirection seen_normal(const AmbientParams *p, const Ray *ray, HitRecord hit) {
  AmbientDirection gradient, normal, view;
  gradient.x = hit.grad_x;
  gradient.y = hit.grad_y;
  gradient.z = hit.grad_z;
  gradient = normalized(gradient);
  normal = normalized(turned(p->normal, gradient.x, gradient.y, gradient.z));
  view = normalized(turned(p->view, ray->x.d, ray->y.d, ray->z.d));
  if (!(inner_product(normal, normal) > 0.0f)) normal = view;
  if (inner_product(normal, view) > 0.0f) {
    normal.x = -normal.x;
    normal.y = -normal.y;
    normal.z = -normal.z;
  }
  return normal;
}

/// d in the frame whose third axis is n: x and y are along two directions at right angles to it, as
/// of Duff et al., "Building an Orthonormal Basis, Revisited" (JCGT 2017).
ISO_INLINE AmbientDirection around(AmbientDirection n, AmbientDirection d) {
  const float sign = n.z >= 0.0f ? 1.0f : -1.0f;
  const float a = -1.0f / (sign + n.z), b = n.x * n.y * a;
  AmbientDirection v;
  v.x = fma(d.x, fma(sign * n.x * n.x, a, 1.0f), fma(d.y, b, d.z * n.x));
  v.y = fma(d.x, sign * b, fma(d.y, fma(n.y * n.y, a, sign), d.z * n.y));
  v.z = fma(d.x, -sign * n.x, fma(d.y, -n.y, d.z * n.z));
  return v;
}

/// A hit that any brick can read: x, y, z are its position in the index space of its level of
/// detail, of the whole volume, and cell is that level's number, by which its rays go.
///
/// of_level  of the level of detail that has the hit
/// level     its number, 0: the finest that draws the frame
ISO_INLINE HitRecord placed_hit(const FrameParams *of_level, uint level, HitRecord hit) {
  const BlockCoords b = block_coords(of_level, hit.block_id);
  hit.x = (float)(4 * b.x + (hit.cell & 3u)) + of_level->brick.origin_x + hit.x;
  hit.y = (float)(4 * b.y + (hit.cell >> 2 & 3u)) + of_level->brick.origin_y + hit.y;
  hit.z = (float)(4 * b.z + (hit.cell >> 4 & 3u)) + of_level->brick.origin_z + hit.z;
  hit.cell = level;
  return hit;
}

/// A ray that begins above a hit.
///
/// placed  see placed_hit()
/// normal  of the hit, on the side of the ray, world space, of length 1
/// d       direction, world space
ISO_INLINE GivenRay ray_above(const AmbientParams *p, HitRecord placed, AmbientDirection normal,
                              AmbientDirection d) {
  const AmbientDirection up = normalized(turned(p->to_index, normal.x, normal.y, normal.z));
  GivenRay given;
  float scale = 1.0f;
  uint i;
  d = turned(p->to_index, d.x, d.y, d.z);
  for (i = 0; i < placed.cell; ++i) scale *= 0.5f;
  given.o_x = fma(up.x, ISO_AMBIENT_LIFT, placed.x);
  given.o_y = fma(up.y, ISO_AMBIENT_LIFT, placed.y);
  given.o_z = fma(up.z, ISO_AMBIENT_LIFT, placed.z);
  given.d_x = d.x * scale;
  given.d_y = d.y * scale;
  given.d_z = d.z * scale;
  given.level = placed.cell;
  return given;
}

/// Is a hit's ray of that number a shadow ray?
ISO_INLINE int is_shadow_ray(const AmbientParams *p, uint number) {
  return number >= p->num_ambient;
}

/// An ambient or shadow ray of a pixel's hit; a shadow ray of a hit that faces away from its
/// direction is none.
///
/// frame      of the camera
/// placed     see placed_hit()
/// number     of the ray
/// direction  see ambient_pattern()
ISO_INLINE GivenRay ambient_ray(const FrameParams *frame, const AmbientParams *p, HitRecord placed,
                                uint pixel, uint number, AmbientDirection direction) {
  const Ray ray = make_ray(frame, pixel);
  const AmbientDirection normal = seen_normal(p, &ray, placed);
  const int is_shadow = is_shadow_ray(p, number);
  if (is_shadow && !(inner_product(normal, direction) > 0.0f)) return no_ray();
  return ray_above(p, placed, normal, is_shadow ? direction : around(normal, direction));
}

ISO_NAMESPACE_END

#endif
