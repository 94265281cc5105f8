/// ray_source.h -- the source of the rays of pipeline `rays`: the camera, or a list. OpenCL C 1.2.
#ifndef ISOWAVE_RAY_SOURCE_H
#define ISOWAVE_RAY_SOURCE_H

#include "portable/clip.h"

/// The ray of the camera with this number, in the index space of the frame's level, with its
/// interval there.
ISO_INLINE Ray camera_ray(const FrameParams *frame, global const ClipParams *clip, uint pixel) {
  Ray ray = make_ray(frame, pixel);
  (void)clip;
#if ISO_CLIP
  clip_ray(frame, clip, pixel, &ray);
#endif
  return ray;
}

/// The ray with this number.
///
/// given  [pixel] the list; not read if ISO_GIVEN_RAYS is 0
/// clip   only read if ISO_CLIP is 1
ISO_INLINE Ray ray_of(const FrameParams *frame, global const ClipParams *clip,
                      global const GivenRay *given, uint pixel) {
#if ISO_GIVEN_RAYS
  (void)clip;
  Ray ray = make_given_ray(given[pixel]);
  ray.x.origin = frame->brick.origin_x;
  ray.y.origin = frame->brick.origin_y;
  ray.z.origin = frame->brick.origin_z;
  return ray;
#else
  (void)given;
  return camera_ray(frame, clip, pixel);
#endif
}

/// Is there one?
ISO_INLINE int has_ray(global const GivenRay *given, uint pixel) {
  return !ISO_GIVEN_RAYS || is_given(given[pixel]);
}

/// `frame`: that of the level of detail in which the ray with this number begins.
#if ISO_GIVEN_RAYS && ISO_LEVELS
#define ISO_FIRST_FRAME_OF(frame, pixel)                                   \
  const FrameParams frame##_params = frames[level_of_given(given[pixel])]; \
  const FrameParams *frame = &frame##_params
#else
#define ISO_FIRST_FRAME_OF(frame, pixel) const FrameParams *frame = &frame_params
#endif

#endif
