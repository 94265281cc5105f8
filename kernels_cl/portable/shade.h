/// shade.h -- a pixel's colour, the mean of its rays', each from its hit: a headlight at the eye,
/// Blinn-Phong, and a light above it; both sides of the surface alike. Portable: OpenCL C 1.2 and
/// C++, so that pictures of devices and of the twin are the same files. No pow.
///
/// The light above turns with the camera, for which way is up in a scan is not known: it stands
/// halfway between the viewer and the picture's upper edge. It tells slopes that face up from those
/// that face down, which the headlight lights alike.
#ifndef ISOWAVE_SHADE_H
#define ISOWAVE_SHADE_H

#include "ambient.h"

ISO_NAMESPACE_BEGIN

/// Colours are display values, [0,1].
typedef struct ShadeParams {
  float
      normal[9];  ///< row-major: gradient in index space -> normal in world space (up to a factor)
  float view[9];  ///< row-major: ray direction in index space -> world space (up to a factor)
  float surface_r, surface_g, surface_b;
  float background_r, background_g, background_b;  ///< 0 if transparent
  float ambient;                                   ///< weight of light from all around
  float diffuse, specular;                         ///< of the headlight; its highlight is white
  float above;                                     ///< weight of the light above
  uint transparent;  ///< 0 or 1: pictures have an alpha, and no background
} ShadeParams;
ISO_CHECK_SIZE(ShadeParams, 116);

/// Bytes of a pixel: RGB, or RGBA.
ISO_INLINE uint num_channels(const ShadeParams *p) {
  return p->transparent ? 4u : 3u;
}

/// Cosines of surface and viewer below which the side that is seen is in doubt, and slopes count
/// less: at silhouettes, normals turn from one side to the other.
#define ISO_GRAZING 0.125f

typedef struct Color {
  float r, g, b;  ///< display values, [0,1]
} Color;

ISO_INLINE float clamp_to_unit(float c) {
  return c <= 0.0f ? 0.0f : (c >= 1.0f ? 1.0f : c);
}

ISO_INLINE Color make_color(float r, float g, float b) {
  Color color;
  color.r = clamp_to_unit(r);
  color.g = clamp_to_unit(g);
  color.b = clamp_to_unit(b);
  return color;
}

ISO_INLINE uint to_byte(float c) {
  return (uint)fma(c, 255.0f, 0.5f);
}

ISO_INLINE uint pixel_of(float r, float g, float b, uint alpha) {
  return to_byte(r) | to_byte(g) << 8 | to_byte(b) << 16 | alpha << 24;
}

/// A pixel whose rays hit nothing.
ISO_INLINE uint background_pixel(const ShadeParams *p) {
  const Color color = make_color(p->background_r, p->background_g, p->background_b);
  return pixel_of(color.r, color.g, color.b, 0);
}

/// The color of a ray. open: the share of the sky that its hit sees, [0,1]; the same share of all
/// lights but the headlight's gets there.
ISO_INLINE Color shade_ray(const FrameParams *frame, const ShadeParams *p, uint ray_id, float t,
                           float gx, float gy, float gz, float open) {
  Ray ray;
  float nx, ny, nz, vx, vy, vz, ux, uy, uz, n, lengths, cosine, facing, slope, highlight, light;
  float largest = fabs(gx) > fabs(gy) ? fabs(gx) : fabs(gy);
  int i;
  if (t == INFINITY) return make_color(p->background_r, p->background_g, p->background_b);
  ray = make_ray(frame, ray_id);
  largest = fabs(gz) > largest ? fabs(gz) : largest;
  if (largest >
      0.0f) { /* only its direction counts: squares of huge or tiny values would not survive */
    gx /= largest;
    gy /= largest;
    gz /= largest;
  }
  nx = fma(p->normal[0], gx, fma(p->normal[1], gy, p->normal[2] * gz));
  ny = fma(p->normal[3], gx, fma(p->normal[4], gy, p->normal[5] * gz));
  nz = fma(p->normal[6], gx, fma(p->normal[7], gy, p->normal[8] * gz));
  vx = fma(p->view[0], ray.x.d, fma(p->view[1], ray.y.d, p->view[2] * ray.z.d));
  vy = fma(p->view[3], ray.x.d, fma(p->view[4], ray.y.d, p->view[5] * ray.z.d));
  vz = fma(p->view[6], ray.x.d, fma(p->view[7], ray.y.d, p->view[8] * ray.z.d));
  ux = fma(p->view[0], frame->view.up_x,
           fma(p->view[1], frame->view.up_y, p->view[2] * frame->view.up_z));
  uy = fma(p->view[3], frame->view.up_x,
           fma(p->view[4], frame->view.up_y, p->view[5] * frame->view.up_z));
  uz = fma(p->view[6], frame->view.up_x,
           fma(p->view[7], frame->view.up_y, p->view[8] * frame->view.up_z));
  n = sqrt(fma(nx, nx, fma(ny, ny, nz * nz)));
  lengths = n * sqrt(fma(vx, vx, fma(vy, vy, vz * vz)));
  /* The light is at the eye, so the half vector is the view vector and one cosine does for both
   * terms. */
  facing = lengths > 0.0f ? -fma(nx, vx, fma(ny, vy, nz * vz)) / lengths : 1.0f;
  cosine = fabs(facing);
  lengths = n * sqrt(fma(ux, ux, fma(uy, uy, uz * uz)));
  slope = lengths > 0.0f ? fma(nx, ux, fma(ny, uy, nz * uz)) / lengths : 0.0f;
  facing /= cosine > ISO_GRAZING ? cosine : ISO_GRAZING; /* the side that is seen, 1 or -1 */
  slope = fma(slope, facing, cosine) * 0.70710678f;
  highlight = cosine;
  for (i = 0; i < 5; ++i) highlight *= highlight; /* cosine^32 */
  light = fma(p->diffuse, cosine, open * p->ambient);
  if (slope > 0.0f) light = fma(open * p->above, slope, light);
  highlight *= p->specular;
  return make_color(fma(p->surface_r, light, highlight), fma(p->surface_g, light, highlight),
                    fma(p->surface_b, light, highlight));
}

/// RGBA of the pixel at a column and row of the picture, 8 bits each, red in bits 0..7. The pixel
/// has samples times samples rays of the frame. If pictures are transparent, the colour is the mean
/// of the rays that hit, and A is their share of all rays (straight alpha); 0 0 0 0 if none hits.
/// Otherwise the colour is the mean of all rays, and A is 255 if any of them hits, else 0.
///
/// open_counts  [ray] ambient rays of its hit that met nothing (ambient.h)
/// num_ambient  ambient rays of a hit; 0: there are none, and all is open
ISO_INLINE uint shade_pixel(const FrameParams *frame, const ShadeParams *p, uint samples,
                            uint column, uint row, ISO_GLOBAL const HitRecord *hits,
                            ISO_GLOBAL const uchar *open_counts, uint num_ambient) {
  const uint num_rays = samples * samples;
  const uint first_ray = row * samples * frame->view.width + column * samples;
  float r = 0.0f, g = 0.0f, b = 0.0f, share;
  uint i, num_hits = 0;
  if (samples == 1 && hits[first_ray].t == INFINITY) return background_pixel(p);
  for (i = 0; i < num_rays; ++i) { /* in one order on every device */
    const uint ray_id = first_ray + i / samples * frame->view.width + i % samples;
    const Color color =
        shade_ray(frame, p, ray_id, hits[ray_id].t, hits[ray_id].grad_x, hits[ray_id].grad_y,
                  hits[ray_id].grad_z,
                  num_ambient == 0 ? 1.0f : (float)open_counts[ray_id] / (float)num_ambient);
    r += color.r;
    g += color.g;
    b += color.b;
    if (hits[ray_id].t != INFINITY) ++num_hits;
  }
  if (p->transparent) {
    if (num_hits == 0) return 0;
    share = 1.0f / (float)num_hits;
    return pixel_of(r * share, g * share, b * share, (255 * num_hits + num_rays / 2) / num_rays);
  }
  share = 1.0f / (float)num_rays;
  return pixel_of(r * share, g * share, b * share, num_hits != 0 ? 255 : 0);
}

/// The normal of a hit in world space, of length 1, away from larger values; 0 if there is no hit,
/// or no gradient.
ISO_INLINE AmbientDirection world_normal(const ShadeParams *p, HitRecord hit) {
  AmbientDirection normal;
  normal.x = hit.t == INFINITY ? 0.0f : hit.grad_x;
  normal.y = hit.t == INFINITY ? 0.0f : hit.grad_y;
  normal.z = hit.t == INFINITY ? 0.0f : hit.grad_z;
  normal = normalized(normal);
  normal = normalized(turned(p->normal, normal.x, normal.y, normal.z));
  /* Never -0, which Mesa makes of 0.0f - x. */
  normal.x = normal.x == 0.0f ? 0.0f : -normal.x;
  normal.y = normal.y == 0.0f ? 0.0f : -normal.y;
  normal.z = normal.z == 0.0f ? 0.0f : -normal.z;
  return normal;
}

ISO_NAMESPACE_END

#endif
