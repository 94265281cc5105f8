/// layers.cl -- several surfaces and slices, and what is seen through translucent ones
/// (portable/layers.h).
///
///   [ each surface's first hits ] -> layers_choose, once for each surface
///     -> field_values of slices, of a field -> smooth_normals -> layers_blend
///     -> [ layers_begin -> march -> ... for each surface ] -> layers_choose ...
///
/// Each surface has its own hits, which march replaces by the next ones on the same rays. Behind
/// the first layer, everything costs O(rays that go on), which layers_blend lists.
#include "device/block_requests.h"
#include "device/level_borders.h"
#include "device/pass_counts.h"
#include "device/store_pixels.h"
#include "device/work_group.h"
#include "portable/block_cells.h"
#include "portable/cell_intersect.h"
#include "portable/layers.h"
#include "portable/ray_state.h"
#include "portable/window.h"

/// A ray's nearest hit on slices that it has not passed yet, in any level of detail.
ISO_INLINE HitRecord nearest_of_levels(const FrameParams *frame_params,
                                       global const FrameParams *frames, uint num_frames,
                                       global const ClipParams *clip,
                                       global const LayerParams *layers, uint passed, uint ray) {
#if ISO_LEVELS
  HitRecord nearest = no_hit();
  (void)frame_params;
  for (uint level = 0; level < num_frames; ++level) {
    const FrameParams frame = frames[level];
    const HitRecord hit = nearest_slice(&frame, clip, layers, passed, ray);
    if (hit.t < nearest.t) nearest = hit;
  }
  return nearest;
#else
  (void)frames;
  (void)num_frames;
  return nearest_slice(frame_params, clip, layers, passed, ray);
#endif
}

/// Takes a surface's hits into the layer where they are the nearest. If hits are at one place, the
/// surface that is taken first stays. A layer begins with the nearest hits on slices.
///
/// frame_params, frames, num_frames  as start_rays
/// surface       its number
/// begins_layer  1: the layer has no hits yet
/// is_first      1: the layer is the frame's first, of all rays
/// In            clip [1]; layers [1]; hits [height * width] of the surface; rays [counts->rays] of
///               a further layer
/// In, Out       passed [height * width]: bit i: the ray has passed slice i. The first layer sets
///               them to 0
/// Out           layer [height * width]
/// Launch        grid-stride over rays
kernel void layers_choose(const FrameParams frame_params, global const FrameParams *frames,
                          uint num_frames, uint surface, uint begins_layer, uint is_first,
                          global const ClipParams *clip, global const LayerParams *layers,
                          global const LayerCounts *counts, global const uint *rays,
                          global const HitRecord *hits, global uchar *passed,
                          global HitRecord *layer) {
  const uint has_slices = layers->slices.num_planes != 0;
  const uint num_rays = is_first ? frame_rays(&frame_params) : counts->rays;
  for (uint i = get_global_id(0); i < num_rays; i += get_global_size(0)) {
    const uint ray = is_first ? i : rays[i];
    if (begins_layer && has_slices) {
      if (is_first) passed[ray] = 0;
      layer[ray] =
          nearest_of_levels(&frame_params, frames, num_frames, clip, layers, passed[ray], ray);
    }
    const float before = begins_layer && !has_slices ? INFINITY : layer[ray].t;
    if (hits[ray].t < before) {
      layer[ray] = with_surface(hits[ray], surface);
    } else if (begins_layer && !has_slices) {
      layer[ray] = no_hit();
    }
  }
}

/// Out     layer [height * width]: no hits
/// Launch  grid-stride over rays
kernel void layers_forget(const FrameParams frame_params, global HitRecord *layer) {
  for (uint ray = get_global_id(0); ray < frame_rays(&frame_params); ray += get_global_size(0))
    layer[ray] = no_hit();
}

/// Blends a layer behind the layers before, and lists the rays that go on.
///
/// frame_params  of the finest level of detail, which need not draw
/// blends   ISO_COUNTS_ALONE: counts the layer's hits. ISO_PREVIEWS: writes colors and counts.
///          ISO_BLENDS: all of Out and In, Out
/// open_counts, num_ambient, num_shadow, bounced, num_bounced  of the layer's hits: LightOfHits
/// In       color_map [ISO_MAP_COLORS]; as layers_choose; layers [1]; values [height * width] of
///          hits with has_value_color()
/// In, Out  hits [height * width] of the layer; passed [height * width]; if the layer is not the
///          first, first_hits [height * width] of rays that had seen nothing yet
/// Out      colors [height * width]; *next_counts, which was 0; next_rays [next_counts->rays]
/// Launch   groups of ISO_GROUP_SIZE, which stride over rays, in tiles if all are in the layer
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void layers_blend(
    const FrameParams frame_params, const ShadeParams shade_params, global const uint *color_map,
    uint blends, uint is_first, global const LayerParams *layers, global const LayerCounts *counts,
    global const uint *rays, global const float *values, global const uchar *open_counts,
    uint num_ambient, uint num_shadow, global const float *bounced, uint num_bounced,
    global HitRecord *hits, global HitRecord *first_hits, global uchar *passed,
    global RayColor *colors, global LayerCounts *next_counts, global uint *next_rays) {
  const FrameParams *frame = &frame_params;
  const LightOfHits light = {open_counts, num_ambient, num_shadow, bounced, num_bounced, 1};
  local uint sums[2 + ISO_MAX_SURFACES], counters[2];
  const PixelBox box = {0, 0, frame->view.width, frame->view.height};
  const uint item = get_local_id(0), num_rays = is_first ? num_tiled_pixels(box) : counts->rays;
  for (uint i = item; i < 2 + ISO_MAX_SURFACES; i += ISO_GROUP_SIZE) sums[i] = 0;
  if (item == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_global_id(0) - item; begin < num_rays; begin += get_global_size(0)) {
    const uint i = begin + item;
    uint ray = ISO_INVALID_ID;
    int is_on = 0;
    if (i < num_rays) ray = is_first ? tiled_pixel(frame, box, i) : rays[i];
    if (ray != ISO_INVALID_ID && hits[ray].t != INFINITY) {
      const HitRecord hit = hits[ray];
      const int is_of_slices = is_of_slice(layers, hit);
      const float value = blends != ISO_COUNTS_ALONE && has_value_color(&shade_params, layers, hit)
                              ? values[ray]
                              : 0.0f;
      const int is_seen = !is_unseen(layers, hit, value);
      if (is_seen) atomic_inc(&sums[0]);
      if (blends != ISO_COUNTS_ALONE) {
        const RayColor seen = blend_hit(frame, &shade_params, color_map, layers, ray, hit, value,
                                        light_of_hit(&light, frame_rays(frame), ray), colors[ray]);
        colors[ray] = seen;
        is_on = goes_on(seen);
        if (is_on) atomic_inc(&sums[2 + surface_of(hit)]);
      }
      if (blends == ISO_BLENDS) {
        if (is_of_slices) passed[ray] |= (uchar)(1u << (surface_of(hit) - layers->num_surfaces));
        if (!is_seen) {
          hits[ray] = no_hit();
        } else if (is_first || first_hits[ray].t == INFINITY) {
          atomic_inc(&sums[1]);
          if (!is_first) first_hits[ray] = hit;
        }
      }
    }
    append_entry(is_on, ray, counters, &next_counts->rays, next_rays);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = item; i < 2 + ISO_MAX_SURFACES; i += ISO_GROUP_SIZE) {
    global uint *sum = i == 0   ? &next_counts->hits
                       : i == 1 ? &next_counts->first_hits
                                : &next_counts->going_on[i - 2];
    if (sums[i] != 0) atomic_add(sum, sums[i]);
  }
}

/// Begins a wave of those rays of a layer that have hits of a surface, or any.
///
/// surface  its number, or ISO_INVALID_ID: any
/// In       rays [layer_counts->rays]; layer [height * width]; counts->next_active_count: 0
/// Out      next_active_ray_ids [counts->next_active_count]; ray_block_ids [pixel]: the hits'
///          blocks; counts and next, those of the wave's first pass: window_count
/// Launch   groups of ISO_GROUP_SIZE, which stride over the rays
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void layers_begin(
    const FrameParams frame_params, uint surface, global const LayerCounts *layer_counts,
    global const uint *rays, global const HitRecord *layer, global PassCounts *counts,
    global PassCounts *next, global uint *next_active_ray_ids, global uint *ray_block_ids) {
  const FrameParams *frame = &frame_params;
  local uint counters[2];
  const uint item = get_local_id(0), num_rays = layer_counts->rays;
  if (get_global_id(0) == 0) counts->window_count = next->window_count = first_window(frame);
  if (item == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_global_id(0) - item; begin < num_rays; begin += get_global_size(0)) {
    const uint ray = begin + item < num_rays ? rays[begin + item] : ISO_INVALID_ID;
    const int is_on = ray != ISO_INVALID_ID && layer[ray].t != INFINITY &&
                      (surface == ISO_INVALID_ID || surface_of(layer[ray]) == surface);
    if (is_on) ray_block_ids[ray] = pack_stand(layer[ray].block_id, ISO_AT_HIT);
    append_entry(is_on, pack_entry(ray, ISO_FIRST_LOG_AHEAD, 0), counters,
                 &counts->next_active_count, next_active_ray_ids);
  }
}

/// The picture of rays that have gone through layers: as shade.
///
/// In      colors [height * width]
/// Out     bytes, with_alpha: as shade
/// Launch  grid-stride over four pixels
kernel void layers_shade(const FrameParams frame_params, const ShadeParams shade_params,
                         uint samples, global const RayColor *colors, uint with_alpha,
                         global void *bytes) {
  global uint *image = (global uint *)bytes;
  const FrameParams *frame = &frame_params;
  const uint columns = frame->view.width / samples, rows = frame->view.height / samples;
  const uint num_pixels = columns * rows,
             num_items = (num_pixels + ISO_PIXELS_OF_ITEM - 1) / ISO_PIXELS_OF_ITEM;
  for (uint item = get_global_id(0); item < num_items; item += get_global_size(0)) {
    uint rgba[ISO_PIXELS_OF_ITEM];
    for (uint i = 0; i < ISO_PIXELS_OF_ITEM; ++i) {
      const uint pixel = ISO_PIXELS_OF_ITEM * item + i;
      rgba[i] = pixel < num_pixels ? layered_pixel(frame, &shade_params, samples, pixel % columns,
                                                   pixel / columns, colors)
                                   : 0;
    }
    store_pixels(rgba, with_alpha, image, item);
  }
}
