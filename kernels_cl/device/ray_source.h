/// ray_source.h -- the source of the rays of pipeline `rays`: the camera, or a list. OpenCL C 1.2.
#ifndef ISOWAVE_RAY_SOURCE_H
#define ISOWAVE_RAY_SOURCE_H

#include "portable/grid_dda.h"

/// The ray with this number, in the index space of the frame's level.
///
/// given  [pixel] the list; not read if ISO_GIVEN_RAYS is 0
ISO_INLINE Ray ray_of(const FrameParams *frame, global const GivenRay *given, uint pixel) {
#if ISO_GIVEN_RAYS
  Ray ray = make_given_ray(given[pixel]);
  ray.x.origin = frame->brick.origin_x;
  ray.y.origin = frame->brick.origin_y;
  ray.z.origin = frame->brick.origin_z;
  return ray;
#else
  (void)given;
  return make_ray(frame, pixel);
#endif
}

/// Is there one?
ISO_INLINE int has_ray(global const GivenRay *given, uint pixel) {
  return !ISO_GIVEN_RAYS || is_given(given[pixel]);
}

/// `frame`: that of the level of detail in which the ray with this number begins.
#if ISO_GIVEN_RAYS && ISO_LEVELS
#define ISO_FIRST_FRAME_OF(frame, pixel)                         \
  const FrameParams frame##_params = frames[given[pixel].level]; \
  const FrameParams *frame = &frame##_params
#else
#define ISO_FIRST_FRAME_OF(frame, pixel) const FrameParams *frame = &frame_params
#endif

#endif
