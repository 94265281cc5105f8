/// bounce.cl -- light that ambient rays bring from the surface that they meet (portable/bounce.h).
/// Behind each round of ambient rays, before the next:
///
///   pipeline `rays` -> bounce_rays -> pipeline `rays` on the rays to the light -> add_bounced
///
/// and behind all rounds place_hits, then filter_bounced, ISO_BOUNCE_STEPS times.
///
/// In frames of several surfaces, so for each layer:
///
///   [ pipeline `rays` on an opaque surface -> bounce_nearest ]* -> bounce_rays
///     -> [ pipeline `rays` on an opaque surface -> ambient_block ]* -> add_colored
#include "device/level_borders.h"
#include "device/light_rays.h"
#include "portable/bounce.h"
#include "portable/layers.h"

/// Keeps the nearest of what the rays of a round have met.
///
/// frame_params, clip, first_level  as ambient; clip is that of the surface
/// surface  that they have met
/// In       given [pixel], given_hits [pixel]
/// In, Out  nearest [pixel], with the numbers of the surfaces
/// Launch   grid-stride over pixels
kernel void bounce_nearest(const FrameParams frame_params, global const ClipParams *clip,
                           uint first_level, uint surface, global const GivenRay *given,
                           global const HitRecord *given_hits, global HitRecord *nearest) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    const GivenRay ray = given[pixel];
    if (!is_given(ray)) continue;
    const HitRecord met = given_hits[pixel];
    if (met.t < nearest[pixel].t && meets_surface(frame, clip, first_level, ray, met))
      nearest[pixel] = with_surface(met, surface);
  }
}

/// Replaces each ambient ray of a round by the ray towards the light from what it has met.
///
/// frame_params, frames, num_frames  as start_rays
/// clip [1], first_level  as ambient; clip has no planes if given_hits are bounce_nearest's
/// directions  [rows][ISO_AMBIENT_PATTERNS] towards the light
/// row         of directions
/// In      given_hits [pixel]: what the ambient rays have met
/// In, Out given [pixel]; open_counts [pixel]: counts the round's rays that have met nothing
/// Out     brings [pixel]: what the new ray brings if it meets nothing, 0 without one
/// Launch  grid-stride over pixels
kernel void bounce_rays(const FrameParams frame_params, global const FrameParams *frames,
                        uint num_frames, global const ClipParams *clip, uint first_level,
                        const AmbientParams params, global const AmbientDirection *directions,
                        uint row, global const HitRecord *given_hits, global GivenRay *given,
                        global uchar *open_counts, global float *brings) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    const GivenRay ray = given[pixel];
    const HitRecord met = given_hits[pixel];
    float cosine = 0.0f;
    if (is_given(ray)) {
      if (meets_surface(frame, clip, first_level, ray, met)) {
        ISO_FRAME_OF(level, met.block_id);
        const HitRecord placed =
            placed_hit(level, ISO_LEVELS ? level_of(frames, num_frames, met.block_id) : 0u, met);
        given[pixel] = bounce_ray(
            &params, ray, placed,
            directions[row * ISO_AMBIENT_PATTERNS + ambient_pattern(frame, pixel)], &cosine);
      } else {
        given[pixel] = no_ray();
        ++open_counts[pixel];
      }
    }
    brings[pixel] = cosine;
  }
}

/// Adds what the rays towards the light bring, and takes them out.
///
/// round   0: the sums begin
/// In      given_hits [pixel]; brings [pixel]
/// In, Out given [pixel]; bounced [pixel]: sums of the rounds
/// Launch  grid-stride over pixels
kernel void add_bounced(const FrameParams frame_params, global const ClipParams *clip,
                        uint first_level, uint round, global const HitRecord *given_hits,
                        global const float *brings, global GivenRay *given, global float *bounced) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    const GivenRay ray = given[pixel];
    float sum = round == 0 ? 0.0f : bounced[pixel];
    if (is_given(ray)) {
      if (!meets_surface(frame, clip, first_level, ray, given_hits[pixel])) sum += brings[pixel];
      given[pixel] = no_ray();
    }
    bounced[pixel] = sum;
  }
}

/// add_bounced in frames of several surfaces: rays that have met one are none (ambient_block).
///
/// has_map  0, or a ShadeParams::has_map
/// In       layers [1]; met [pixel]: bounce_nearest's; brings [pixel]
/// In, Out  given [pixel]; bounced [ISO_LAYER_SUMS][pixel]: see LightOfHits
/// Launch   grid-stride over pixels
kernel void add_colored(const FrameParams frame_params, uint round, uint has_map,
                        global const LayerParams *layers, global const HitRecord *met,
                        global const float *brings, global GivenRay *given, global float *bounced) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    BouncedLight sum = nothing_bounced();
    if (round != 0) sum = bounced_sum(bounced, num_pixels, pixel);
    if (is_given(given[pixel])) {
      sum = sum_with(sum, brings[pixel], sent_on(has_map, layers, surface_of(met[pixel])));
      given[pixel] = no_ray();
    }
    bounced[pixel] = sum.own;
    bounced[num_pixels + pixel] = sum.r;
    bounced[2 * num_pixels + pixel] = sum.g;
    bounced[3 * num_pixels + pixel] = sum.b;
  }
}

/// What the filter needs of the hits.
///
/// frame_params  of the finest level of detail that draws
/// num_surfaces  as ambient
/// In      hits [pixel] of the frame, or of a layer
/// Out     places [pixel]: see normal_ray()
/// Launch  grid-stride over pixels
kernel void place_hits(const FrameParams frame_params, const AmbientParams params,
                       uint num_surfaces, global const HitRecord *hits, global GivenRay *places) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    const HitRecord hit = hits[pixel];
    places[pixel] =
        normal_ray(frame, &params, pixel, surface_of(hit) < num_surfaces ? hit : no_hit());
  }
}

/// A step of the filter.
///
/// width, height  of the frame [rays]
/// num_sums  of each pixel
/// apart   distance of the taps [rays]
/// In      places [pixel]; bounced [num_sums][pixel]
/// Out     filtered [num_sums][pixel]
/// Launch  grid-stride over pixels
kernel void filter_bounced(uint width, uint height, uint num_sums, uint apart,
                           global const GivenRay *places, global const float *bounced,
                           global float *filtered) {
  const uint num_pixels = width * height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    for (uint begin = 0; begin < num_sums * num_pixels; begin += num_pixels)
      filtered[begin + pixel] =
          filtered_light(width, height, places, bounced + begin, pixel, apart);
  }
}
