/// layers.h -- several surfaces and slices, and what is seen through translucent ones: a ray goes
/// on from a hit to the next crossing of that surface, and its hits are blended front to back
/// (core/frame/surfaces.hpp). Portable: OpenCL C 1.2 and C++.
///
/// A slice is a plane that shows the voxels. A ray hits it once at most, at a place that follows
/// from ray and plane alone. The voxels there give the colour, without light. Slices are numbered
/// behind the surfaces; if a surface is hit at the same place, the slice is in front.
///
/// Each surface has its own hits. A layer is each ray's nearest of them; of hits at one place, that
/// of the largest isovalue, which lies innermost. A ray goes on by the number of its hit's crossing
/// within the cell (ISO_CROSSING_BIT), not by t: two crossings may round to the same t.
#ifndef ISOWAVE_LAYERS_H
#define ISOWAVE_LAYERS_H

#include "clip.h"
#include "field_value.h"
#include "shade.h"

ISO_NAMESPACE_BEGIN

/// A ray ends where less of what lies behind would be seen: half a step of an 8-bit colour.
#define ISO_LEAST_TRANSMITTANCE 0x1p-9f

/// What layers_blend does.
#define ISO_COUNTS_ALONE 0u
#define ISO_PREVIEWS 1u
#define ISO_BLENDS 2u

/// Display values, [0,1].
typedef struct SurfaceColor {
  float r, g, b;
  float opacity;  ///< 1: nothing behind it is seen
} SurfaceColor;

/// The surfaces and slices of a frame, by their numbers: slice i has number num_surfaces + i.
typedef struct LayerParams {
  SurfaceColor surfaces[ISO_MAX_SURFACES];  ///< slices have an opacity alone
  ClipParams slices;                        ///< their planes
  uint num_surfaces;
  uint whole_slices;            ///< bit i: clipping planes leave slice i whole
  uint unmapped;                ///< bit i: colour maps leave surface i its own colour
  float low, scale;             ///< place of a voxel in the colour map: (value - low) * scale
  uint colors[ISO_MAP_COLORS];  ///< of slices
} LayerParams;
ISO_CHECK_SIZE(LayerParams, 1632);

/// What a ray has seen so far.
typedef struct RayColor {
  float r, g, b;        ///< of its hits, each times its share
  float transmittance;  ///< the share of what lies behind
} RayColor;
ISO_CHECK_SIZE(RayColor, 16);

/// Counts of a layer.
typedef struct LayerCounts {
  uint hits;
  uint first_hits;                  ///< those that are their rays' first
  uint rays;                        ///< rays that go on, which are listed
  uint going_on[ISO_MAX_SURFACES];  ///< rays that go on from a hit of each surface
} LayerCounts;
ISO_CHECK_SIZE(LayerCounts, 44);

ISO_INLINE RayColor clear_ray(void) {
  RayColor c;
  c.r = c.g = c.b = 0.0f;
  c.transmittance = 1.0f;
  return c;
}

/// Is there anything to see behind?
ISO_INLINE int goes_on(RayColor c) {
  return c.transmittance >= ISO_LEAST_TRANSMITTANCE;
}

/// The number of crossings of its surface in its cell up to a hit, itself included. Caps and hits
/// at borders, where their rays begin in the cell, are no crossings: 0.
ISO_INLINE uint crossings_up_to_cell(uint hit_cell) {
  return (hit_cell & ISO_CAP) != 0 ? 0u
                                   : (hit_cell + (1u << ISO_CROSSING_BIT)) >> ISO_CROSSING_BIT & 3u;
}
ISO_INLINE uint crossings_up_to(HitRecord hit) {
  return crossings_up_to_cell(hit.cell);
}

/// The number of a hit's surface.
ISO_INLINE uint surface_of(HitRecord hit) {
  return hit.cell >> ISO_SURFACE_BIT;
}

ISO_INLINE HitRecord with_surface(HitRecord hit, uint surface) {
  hit.cell |= surface << ISO_SURFACE_BIT;
  return hit;
}

ISO_INLINE int is_of_slice(ISO_GLOBAL const LayerParams *layers, HitRecord hit) {
  return hit.t != INFINITY && surface_of(hit) >= layers->num_surfaces;
}

/// Is a ray at t in the band of a level of detail? The border belongs to the level behind it.
ISO_INLINE int is_in_band(const FrameParams *frame, float t) {
#if defined(__OPENCL_C_VERSION__) && !ISO_LEVELS
  (void)frame;
  (void)t;
  return 1;
#else
  return t >= frame->band.begin_t && t < frame->band.end_t;
#endif
}

/// Where a ray of the camera meets a slice: the plane's gradient, in a cell of the grid. No hit
/// outside the grid or the level's band, in a block of another brick, or in what is clipped.
///
/// frame  of a level of detail
ISO_INLINE HitRecord slice_hit(const FrameParams *frame, ISO_GLOBAL const ClipParams *clip,
                               ISO_GLOBAL const LayerParams *layers, uint slice, uint ray_id) {
  const RayOfView view = ray_of_view(&frame->view, ray_id);
  ISO_GLOBAL const PlaneParams *plane = &layers->slices.planes[slice];
  const RayAxis along =
      make_plane_axis(&frame->view, &layers->slices, plane, view.u, view.v, view.length);
  Ray ray = make_ray(frame, ray_id);
  HitRecord hit = no_hit();
  BlockCoords b;
  int x, y, z;
  float t;
  if (along.d == 0.0f) return hit;
  t = plane_t(along, 0.0f).hi;
  if ((layers->whole_slices >> slice & 1u) == 0) clip_ray(frame, clip, ray_id, &ray);
  if (!(t >= ray.begin_t && t <= ray.end_t && t < INFINITY) || !is_in_band(frame, t)) return hit;
  x = field_cell(fma(t, ray.x.d, ray.x.o), ray.x.origin, frame->grid.dims_x, &hit.x);
  y = field_cell(fma(t, ray.y.d, ray.y.o), ray.y.origin, frame->grid.dims_y, &hit.y);
  z = field_cell(fma(t, ray.z.d, ray.z.o), ray.z.origin, frame->grid.dims_z, &hit.z);
  if (x < 0 || y < 0 || z < 0) return no_hit();
  b.x = (uint)(x >> 2);
  b.y = (uint)(y >> 2);
  b.z = (uint)(z >> 2);
  if (!is_own(frame, b)) return no_hit();
  hit.t = t * frame->view.t_scale;
  hit.block_id = block_id_at(frame, b.x, b.y, b.z);
  hit.cell = (uint)((x & 3) + 4 * (y & 3) + 16 * (z & 3)) | ISO_CAP |
             (layers->num_surfaces + slice) << ISO_SURFACE_BIT;
  hit.grad_x = plane->grad_x;
  hit.grad_y = plane->grad_y;
  hit.grad_z = plane->grad_z;
  return hit;
}

/// A ray's nearest hit in a level of detail on slices that it has not passed yet.
///
/// passed  bit i: slice i
ISO_INLINE HitRecord nearest_slice(const FrameParams *frame, ISO_GLOBAL const ClipParams *clip,
                                   ISO_GLOBAL const LayerParams *layers, uint passed, uint ray_id) {
  HitRecord nearest = no_hit();
  for (uint i = 0; i < layers->slices.num_planes; ++i) {
    HitRecord hit;
    if ((passed >> i & 1u) != 0) continue;
    hit = slice_hit(frame, clip, layers, i, ray_id);
    if (hit.t < nearest.t) nearest = hit;
  }
  return nearest;
}

/// Is nothing seen of a hit? So it is on a slice whose voxels there have no data.
ISO_INLINE int is_unseen(ISO_GLOBAL const LayerParams *layers, HitRecord hit, float value) {
  return is_of_slice(layers, hit) && is_no_data(value);
}

/// Has a hit a colour by its value in the colour map of slices, or of a field?
ISO_INLINE int has_value_color(const ShadeParams *p, ISO_GLOBAL const LayerParams *layers,
                               HitRecord hit) {
  return is_of_slice(layers, hit) ||
         (has_field_colors(p) && (layers->unmapped >> surface_of(hit) & 1u) == 0);
}

/// Has a surface the colours of a map?
///
/// has_map  ShadeParams::has_map
ISO_INLINE int is_mapped(uint has_map, ISO_GLOBAL const LayerParams *layers, uint surface) {
  return has_map && (layers->unmapped >> surface & 1u) == 0;
}

/// The light that a surface sends on of what it gets, as shares of it. Those of a map's colours are
/// taken for the colour of the place that the light goes to.
ISO_INLINE BouncedLight sent_on(uint has_map, ISO_GLOBAL const LayerParams *layers, uint surface) {
  ISO_GLOBAL const SurfaceColor *color = &layers->surfaces[surface];
  BouncedLight light = nothing_bounced();
  if (is_mapped(has_map, layers, surface)) {
    light.own = 1.0f;
  } else {
    light.r = color->r;
    light.g = color->g;
    light.b = color->b;
  }
  return light;
}

/// Blends a ray's next hit behind what it has seen.
///
/// p          its surface colour is not used
/// color_map  as surface_color()
/// value      at the hit, if has_value_color(): of the voxels on a slice, else of the field
ISO_INLINE RayColor blend_hit(const FrameParams *frame, const ShadeParams *p,
                              ISO_GLOBAL const uint *color_map,
                              ISO_GLOBAL const LayerParams *layers, uint ray_id, HitRecord hit,
                              float value, HitLight light, RayColor seen) {
  ISO_GLOBAL const SurfaceColor *surface = &layers->surfaces[surface_of(hit)];
  Color color;
  float share;
  if (hit.t == INFINITY || is_unseen(layers, hit, value)) return seen;
  if (is_of_slice(layers, hit)) {
    color = map_color(layers->colors, (value - layers->low) * layers->scale);
  } else {
    color.r = surface->r;
    color.g = surface->g;
    color.b = surface->b;
    if (is_mapped(p->has_map, layers, surface_of(hit)))
      color = surface_color(frame, p, color_map, ray_id, hit.t, value, color);
    color = shade_ray(frame, p, color, ray_id, hit.grad_x, hit.grad_y, hit.grad_z, light);
  }
  share = seen.transmittance * surface->opacity;
  seen.r = fma(share, color.r, seen.r);
  seen.g = fma(share, color.g, seen.g);
  seen.b = fma(share, color.b, seen.b);
  seen.transmittance *= 1.0f - surface->opacity;
  return seen;
}

/// shade_pixel() of rays that have gone through layers. If pictures are transparent, the colour is
/// what the rays have seen of surfaces, and A is its share.
///
/// colors  [ray]
ISO_INLINE uint layered_pixel(const FrameParams *frame, const ShadeParams *p, uint samples,
                              uint column, uint row, ISO_GLOBAL const RayColor *colors) {
  const uint num_rays = samples * samples;
  const uint first_ray = row * samples * frame->view.width + column * samples;
  const Color back = background_color(p, row, frame->view.height, samples);
  float r = 0.0f, g = 0.0f, b = 0.0f, opacity = 0.0f, share;
  uint i, alpha, num_hits = 0;
  for (i = 0; i < num_rays; ++i) { /* in one order on every device */
    const RayColor seen = colors[first_ray + i / samples * frame->view.width + i % samples];
    const float behind = p->transparent ? 0.0f : seen.transmittance;
    r += fma(behind, back.r, seen.r);
    g += fma(behind, back.g, seen.g);
    b += fma(behind, back.b, seen.b);
    opacity += 1.0f - seen.transmittance;
    if (seen.transmittance < 1.0f) ++num_hits;
  }
  if (p->transparent) {
    if (num_hits == 0) return 0;
    share = 1.0f / opacity;
    alpha = (uint)(255.0f * opacity / (float)num_rays + 0.5f);
  } else {
    share = 1.0f / (float)num_rays;
    alpha = num_hits != 0 ? 255 : 0;
  }
  return pixel_of(clamp_to_unit(r * share), clamp_to_unit(g * share), clamp_to_unit(b * share),
                  alpha);
}

ISO_NAMESPACE_END

#endif
