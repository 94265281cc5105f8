/// shade.h -- a pixel's colour, the mean of its rays', each from its hit: a headlight at the eye,
/// Blinn-Phong, and a light above it; both sides of the surface alike. Portable: OpenCL C 1.2 and
/// C++, so that pictures of devices and of the twin are the same files. No pow.
///
/// Instead of the light above, there may be a light of the scene, which does not turn. It lights
/// the sides that face it, as far as these see it (ambient.h).
///
/// The light above turns with the camera, for which way is up in a scan is not known: it stands
/// halfway between the viewer and the picture's upper edge. It tells slopes that face up from those
/// that face down, which the headlight lights alike.
#ifndef ISOWAVE_SHADE_H
#define ISOWAVE_SHADE_H

#include "ambient.h"
#include "label_table.h"

ISO_NAMESPACE_BEGIN

/// Colours are display values, [0,1].
typedef struct ShadeParams {
  float
      normal[9];  ///< row-major: gradient in index space -> normal in world space (up to a factor)
  float view[9];  ///< row-major: ray direction in index space -> world space (up to a factor)
  float surface_r, surface_g, surface_b;
  float background_r, background_g, background_b;  ///< at the lower edge; 0 if transparent
  float rise_r, rise_g, rise_b;  ///< of the background to the upper edge; 0: it is uniform
  float ambient;                 ///< weight of light from all around
  float diffuse, specular;       ///< of the headlight; its highlight is white
  float above;                   ///< weight of the light above, or the scene's
  uint transparent;              ///< 0 or 1: pictures have an alpha, and no background
  uint has_map;                  ///< 0, ISO_MAP_BY_*: surfaces have the colour map's colours
  /// Place in the colour map, [0,1], of what lies at p in index space: axis p + axis_begin.
  float axis[3], axis_begin;
  uint has_light;  ///< 0 or 1: there is a light of the scene, instead of the light above
  float light[3];  ///< towards it, in world space, of length 1
  float field_low, field_scale;  ///< place of a field's value: (value - field_low) * field_scale
} ShadeParams;
ISO_CHECK_SIZE(ShadeParams, 172);

#define ISO_MAP_BY_AXIS 1u
#define ISO_MAP_BY_FIELD 2u
#define ISO_MAP_BY_LABEL 3u  ///< labels of a field: that of label L is entry L % ISO_MAP_COLORS

/// Are colours by the value of a field at the hit?
ISO_INLINE int has_field_colors(const ShadeParams *p) {
  return p->has_map == ISO_MAP_BY_FIELD || p->has_map == ISO_MAP_BY_LABEL;
}

#define ISO_MAP_COLORS 256u  ///< of a colour map: words, red in bits 0..7, green 8..15, blue 16..23

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

/// The background at the middle of a row of pixels, row 0 at the top. All rays of a pixel have the
/// same.
///
/// height  of the picture [rays]
ISO_INLINE Color background_color(const ShadeParams *p, uint row, uint height, uint samples) {
  float up = 0.0f;
  if (p->rise_r != 0.0f || p->rise_g != 0.0f || p->rise_b != 0.0f) {
    const uint rows = height / samples;
    up = ((float)(rows - row) - 0.5f) / (float)rows;
  }
  return make_color(fma(up, p->rise_r, p->background_r), fma(up, p->rise_g, p->background_g),
                    fma(up, p->rise_b, p->background_b));
}

ISO_INLINE Color color_of_word(uint word) {
  return make_color((float)(word & 255u) / 255.0f, (float)(word >> 8 & 255u) / 255.0f,
                    (float)(word >> 16 & 255u) / 255.0f);
}

/// The colour of a map [ISO_MAP_COLORS] at a place: 0 is its first colour, 1 its last.
ISO_INLINE Color map_color(ISO_GLOBAL const uint *color_map, float at) {
  at = at > 0.0f ? (at < 1.0f ? at : 1.0f) : 0.0f; /* 0 also if it is not a number */
  return color_of_word(color_map[(uint)fma(at, (float)(ISO_MAP_COLORS - 1u), 0.5f)]);
}

/// The colour of the surface that a ray hits at t: its own, or the colour map's.
///
/// color_map  [ISO_MAP_COLORS]; not read without one
/// value      of the field at the hit; NaN, or no label if it should be one: the surface has its
/// own
///            colour
ISO_INLINE Color surface_color(const FrameParams *frame, const ShadeParams *p,
                               ISO_GLOBAL const uint *color_map, uint ray_id, float t, float value,
                               Color own) {
  Ray ray;
  float along, at;
  if (!p->has_map) return own;
  if (p->has_map == ISO_MAP_BY_LABEL) {
    if (!is_label(value)) return own;
    return color_of_word(color_map[(uint)value % ISO_MAP_COLORS]);
  }
  if (p->has_map == ISO_MAP_BY_FIELD) {
    if (value != value) return own;
    at = (value - p->field_low) * p->field_scale;
  } else {
    ray = make_ray(frame, ray_id);
    along = t / frame->view.t_scale;
    at = fma(p->axis[0], fma(along, ray.x.d, ray.x.o),
             fma(p->axis[1], fma(along, ray.y.d, ray.y.o),
                 fma(p->axis[2], fma(along, ray.z.d, ray.z.o), p->axis_begin)));
  }
  return map_color(color_map, at);
}

/// The scene's light that comes to a hit by way of other places, as shares of it.
typedef struct BouncedLight {
  float own;      ///< by way of places of the hit's own colour
  float r, g, b;  ///< by way of places of other colours, times these
} BouncedLight;

/// The light that gets to a hit.
typedef struct HitLight {
  float open;  ///< the share of the sky that it sees, [0,1]; the same share of all lights but the
               ///< headlight and the scene's gets there
  float lit;   ///< the share of the scene's light that gets there
  BouncedLight bounced;
} HitLight;

ISO_INLINE BouncedLight nothing_bounced(void) {
  BouncedLight light;
  light.own = light.r = light.g = light.b = 0.0f;
  return light;
}

/// The colour of a ray that hits a surface of that colour.
ISO_INLINE Color shade_ray(const FrameParams *frame, const ShadeParams *p, Color surface,
                           uint ray_id, float gx, float gy, float gz, HitLight of_hit) {
  Ray ray;
  float nx, ny, nz, vx, vy, vz, ux, uy, uz, n, lengths, cosine, facing, slope, highlight, light,
      own;
  float largest = fabs(gx) > fabs(gy) ? fabs(gx) : fabs(gy);
  int i;
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
  if (p->has_light) {
    ux = p->light[0];
    uy = p->light[1];
    uz = p->light[2];
  }
  lengths = n * sqrt(fma(ux, ux, fma(uy, uy, uz * uz)));
  slope = lengths > 0.0f ? fma(nx, ux, fma(ny, uy, nz * uz)) / lengths : 0.0f;
  facing /= cosine > ISO_GRAZING ? cosine : ISO_GRAZING; /* the side that is seen, 1 or -1 */
  slope = p->has_light ? slope * facing : fma(slope, facing, cosine) * 0.70710678f;
  highlight = cosine;
  for (i = 0; i < 5; ++i) highlight *= highlight; /* cosine^32 */
  light = fma(p->diffuse, cosine, of_hit.open * p->ambient);
  if (slope > 0.0f) light = fma((p->has_light ? of_hit.lit : of_hit.open) * p->above, slope, light);
  highlight *= p->specular;
  own = of_hit.bounced.own * p->above;
  return make_color(
      fma(surface.r, fma(surface.r, own, fma(of_hit.bounced.r, p->above, light)), highlight),
      fma(surface.g, fma(surface.g, own, fma(of_hit.bounced.g, p->above, light)), highlight),
      fma(surface.b, fma(surface.b, own, fma(of_hit.bounced.b, p->above, light)), highlight));
}

/// What the light rays of hits have found, for shading.
typedef struct LightOfHits {
  /// [2][ray] ambient rays of its hit, and shadow rays, that met nothing (ambient.h)
  ISO_GLOBAL const uchar *open_counts;
  uint num_ambient;  ///< ambient rays of a hit; 0: there are none, and all is open
  uint num_shadow;   ///< shadow rays of a hit; 0: there are none, and all is lit
  /// [ray] sums of the light that ambient rays bring from surfaces (bounce.h): BouncedLight::own;
  /// of layers [4][ray]: BouncedLight
  ISO_GLOBAL const float *bounced;
  uint num_bounced;  ///< rays in a sum; 0: there are none
  uint has_colors;   ///< 0 or 1: of layers
} LightOfHits;

#define ISO_LAYER_SUMS 4u  ///< of bounced light of each ray, in frames of layers

/// The share of a hit's light rays that met nothing.
///
/// num_rays  of the hit; 0: there are none, and all is open
ISO_INLINE float open_share(ISO_GLOBAL const uchar *open_counts, uint place, uint num_rays) {
  return num_rays == 0 ? 1.0f : (float)open_counts[place] / (float)num_rays;
}

/// A hit's sums of bounced light in frames of layers.
///
/// sums      [ISO_LAYER_SUMS][ray] see LightOfHits
/// num_rays  of the frame
ISO_INLINE BouncedLight bounced_sum(ISO_GLOBAL const float *sums, uint num_rays, uint ray_id) {
  BouncedLight sum;
  sum.own = sums[ray_id];
  sum.r = sums[num_rays + ray_id];
  sum.g = sums[2 * num_rays + ray_id];
  sum.b = sums[3 * num_rays + ray_id];
  return sum;
}

/// The sums with what a ray brings.
///
/// sent_on  the share of each that the surface has sent on
ISO_INLINE BouncedLight sum_with(BouncedLight sum, float brings, BouncedLight sent_on) {
  sum.own = fma(brings, sent_on.own, sum.own);
  sum.r = fma(brings, sent_on.r, sum.r);
  sum.g = fma(brings, sent_on.g, sum.g);
  sum.b = fma(brings, sent_on.b, sum.b);
  return sum;
}

/// The shares of sums of that many rays.
ISO_INLINE BouncedLight share_of_sum(BouncedLight sum, uint num_bounced) {
  sum.own /= (float)num_bounced;
  sum.r /= (float)num_bounced;
  sum.g /= (float)num_bounced;
  sum.b /= (float)num_bounced;
  return sum;
}

/// The light of a ray's hit.
///
/// num_rays  of the frame
ISO_INLINE HitLight light_of_hit(const LightOfHits *light, uint num_rays, uint ray_id) {
  HitLight of_hit;
  of_hit.open = open_share(light->open_counts, ray_id, light->num_ambient);
  of_hit.lit = open_share(light->open_counts, num_rays + ray_id, light->num_shadow);
  of_hit.bounced = nothing_bounced();
  if (light->num_bounced == 0) return of_hit;
  if (light->has_colors) {
    of_hit.bounced =
        share_of_sum(bounced_sum(light->bounced, num_rays, ray_id), light->num_bounced);
  } else {
    of_hit.bounced.own = light->bounced[ray_id] / (float)light->num_bounced;
  }
  return of_hit;
}

/// RGBA of the pixel at a column and row of the picture, 8 bits each, red in bits 0..7. The pixel
/// has samples times samples rays of the frame. If pictures are transparent, the colour is the mean
/// of the rays that hit, and A is their share of all rays (straight alpha); 0 0 0 0 if none hits.
/// Otherwise the colour is the mean of all rays, and A is 255 if any of them hits, else 0.
///
/// color_map    as surface_color()
/// values       [ray] of the field; not read unless colours are by it
ISO_INLINE uint shade_pixel(const FrameParams *frame, const ShadeParams *p,
                            ISO_GLOBAL const uint *color_map, uint samples, uint column, uint row,
                            ISO_GLOBAL const HitRecord *hits, const LightOfHits *light,
                            ISO_GLOBAL const float *values) {
  const uint num_rays = samples * samples, frame_rays = frame->view.width * frame->view.height;
  const uint first_ray = row * samples * frame->view.width + column * samples;
  float r = 0.0f, g = 0.0f, b = 0.0f, share;
  uint i, num_hits = 0;
  const Color behind = background_color(p, row, frame->view.height, samples);
  Color own;
  own.r = p->surface_r;
  own.g = p->surface_g;
  own.b = p->surface_b;
  if (samples == 1 && hits[first_ray].t == INFINITY)
    return pixel_of(behind.r, behind.g, behind.b, 0);
  for (i = 0; i < num_rays; ++i) { /* in one order on every device */
    const uint ray_id = first_ray + i / samples * frame->view.width + i % samples;
    Color color = behind;
    if (hits[ray_id].t != INFINITY) {
      const float value = has_field_colors(p) ? values[ray_id] : 0.0f;
      color = shade_ray(frame, p,
                        surface_color(frame, p, color_map, ray_id, hits[ray_id].t, value, own),
                        ray_id, hits[ray_id].grad_x, hits[ray_id].grad_y, hits[ray_id].grad_z,
                        light_of_hit(light, frame_rays, ray_id));
      ++num_hits;
    }
    r += color.r;
    g += color.g;
    b += color.b;
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
