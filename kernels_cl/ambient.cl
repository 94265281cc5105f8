/// ambient.cl -- between the rounds of ambient and shadow rays: counts which rays of a round met
/// nothing, and makes those of the next (portable/ambient.h).
///
///   [ smooth normals ] -> ambient -> [ pipeline `rays` on these rays -> ambient ]*
///
/// If a frame has several surfaces, the hits of each layer have such rays. A ray may meet each of
/// the opaque surfaces: it goes through pipeline `rays` once for each, and ambient_block takes out
/// what has met one. Surfaces that clipping planes leave whole come first; then ambient_enter moves
/// rays that begin in what the planes have taken away.
#include "device/level_borders.h"
#include "device/light_rays.h"
#include "portable/ambient.h"
#include "portable/layers.h"

#ifndef ISO_PLACED_HITS   /* by -D */
#define ISO_PLACED_HITS 0 /* 1: hits are placed_hit()s, of whatever brick */
#endif

/// frame_params, frames, num_frames  as start_rays
/// clip [1]    of the frame
/// first_level the finest level of detail that draws, of all
/// directions  [num_rounds][ISO_AMBIENT_PATTERNS]
/// round       0..num_rounds: the rays to make; num_rounds: none
/// num_surfaces  hits of surfaces of this number or a greater one have no rays: they are on slices
/// In      hits [pixel]: of the frame; given [pixel], given_hits [pixel]: the rays of the round
///         before, and what they met
/// Out     open_counts [2][pixel]: ambient rays of the rounds before that met nothing that is
///         drawn, 0 without a hit; and such shadow rays, if there are any; given [pixel]
/// Launch  grid-stride over pixels
kernel void ambient(const FrameParams frame_params, global const FrameParams *frames,
                    uint num_frames, global const ClipParams *clip, uint first_level,
                    const AmbientParams params, global const AmbientDirection *directions,
                    uint round, uint num_rounds, uint num_surfaces, global const HitRecord *hits,
                    global const HitRecord *given_hits, global GivenRay *given,
                    global uchar *open_counts) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  const int counts_lit = round != 0 && is_shadow_ray(&params, round - 1);
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    const HitRecord hit = hits[pixel];
    if (round == 0) {
      open_counts[pixel] = 0;
      if (params.num_ambient != num_rounds) open_counts[num_pixels + pixel] = 0;
    }
    if (hit.t == INFINITY || surface_of(hit) >= num_surfaces) {
      given[pixel] = no_ray();
      continue;
    }
    if (round != 0 && is_given(given[pixel])) {
      const int meets = meets_surface(frame, clip, first_level, given[pixel], given_hits[pixel]);
      const uint place = counts_lit ? num_pixels + pixel : pixel;
      open_counts[place] = (uchar)(open_counts[place] + !meets);
    }
    if (round == num_rounds) continue;
    HitRecord placed = hit;
    if (!ISO_PLACED_HITS) {
      ISO_FRAME_OF(level, hit.block_id);
      placed = placed_hit(level, ISO_LEVELS ? level_of(frames, num_frames, hit.block_id) : 0u, hit);
    }
    given[pixel] =
        ambient_ray(frame, &params, placed, pixel, round,
                    directions[round * ISO_AMBIENT_PATTERNS + ambient_pattern(frame, pixel)]);
  }
}

/// Takes out the rays of a round that have met a surface. The others have met nothing then.
///
/// frame_params, clip, first_level  as ambient; clip is that of the surface
/// In, Out  given [pixel], given_hits [pixel]
/// Launch   grid-stride over pixels
kernel void ambient_block(const FrameParams frame_params, global const ClipParams *clip,
                          uint first_level, global GivenRay *given, global HitRecord *given_hits) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    if (!is_given(given[pixel]) || given_hits[pixel].t == INFINITY) continue;
    if (clip->num_planes != 0 &&
        meets_clipped(frame, clip, first_level, given[pixel], given_hits[pixel])) {
      given_hits[pixel] = no_hit();
    } else {
      given[pixel] = no_ray();
    }
  }
}

/// Moves the rays of a round to where they enter what is left of clipped surfaces: entering().
///
/// frame_params, clip, first_level  as ambient
/// has_nearest  0 or 1: nearest are hits
/// In, Out  given [pixel]; nearest [pixel]: bounce_nearest's, whose t go with the rays
/// Launch   grid-stride over pixels
kernel void ambient_enter(const FrameParams frame_params, global const ClipParams *clip,
                          uint first_level, uint has_nearest, global GivenRay *given,
                          global HitRecord *nearest) {
  const FrameParams *frame = &frame_params;
  const uint num_pixels = frame->view.width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < num_pixels; pixel += get_global_size(0)) {
    const GivenRay ray = given[pixel];
    if (!is_given(ray)) continue;
    const RayEntrance at = entrance_of(clip, ray, voxel_of(first_level, ray));
    given[pixel] = entering(clip, ray, at);
    if (has_nearest)
      nearest[pixel].t =
          t_from(frame->view.t_scale * voxel_in_first(ray), nearest[pixel].t, at.begin);
  }
}
