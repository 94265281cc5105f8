/// bounce.cl -- light that ambient rays bring from the surface that they meet (portable/bounce.h).
/// Behind each round of ambient rays, before the next:
///
///   pipeline `rays` -> bounce_rays -> pipeline `rays` on the rays to the light -> add_bounced
///
/// and behind all rounds place_hits, then filter_bounced, ISO_BOUNCE_STEPS times.
#include "device/level_borders.h"
#include "device/light_rays.h"
#include "portable/bounce.h"

/// Replaces each ambient ray of a round by the ray towards the light from what it has met.
///
/// frame_params, frames, num_frames  as start_rays
/// clip [1], first_level  as ambient
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

/// What the filter needs of the hits.
///
/// frame_params  of the finest level of detail that draws
/// In      hits [pixel] of the frame
/// Out     places [pixel]: see normal_ray()
/// Launch  grid-stride over pixels
kernel void place_hits(const FrameParams frame_params, const AmbientParams params,
                       global const HitRecord *hits, global GivenRay *places) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0))
    places[pixel] = normal_ray(frame, &params, pixel, hits[pixel]);
}

/// A step of the filter.
///
/// width, height  of the frame [rays]
/// apart   distance of the taps [rays]
/// In      places [pixel]; bounced [pixel]
/// Out     filtered [pixel]
/// Launch  grid-stride over pixels
kernel void filter_bounced(uint width, uint height, uint apart, global const GivenRay *places,
                           global const float *bounced, global float *filtered) {
  for (uint pixel = get_global_id(0); pixel < width * height; pixel += get_global_size(0))
    filtered[pixel] = filtered_light(width, height, places, bounced, pixel, apart);
}
