/// light_rays.h -- what ambient and shadow rays have met. OpenCL C 1.2.
#ifndef ISOWAVE_LIGHT_RAYS_H
#define ISOWAVE_LIGHT_RAYS_H

#include "portable/clip.h"

/// Has a ray met what is clipped?
ISO_INLINE int meets_clipped(const FrameParams *frame, global const ClipParams *clip,
                             uint first_level, GivenRay given, HitRecord met) {
  const float in_first = (float)(1u << given.level), voxel = (float)(1u << first_level) * in_first;
  return is_clipped(clip, given, voxel, met.t / (frame->view.t_scale * in_first));
}

/// Has a ray met a surface that is drawn?
ISO_INLINE int meets_surface(const FrameParams *frame, global const ClipParams *clip,
                             uint first_level, GivenRay given, HitRecord met) {
  return met.t != INFINITY &&
         (clip->num_planes == 0 || !meets_clipped(frame, clip, first_level, given, met));
}

#endif
