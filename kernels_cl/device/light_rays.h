/// light_rays.h -- what ambient and shadow rays have met. OpenCL C 1.2.
#ifndef ISOWAVE_LIGHT_RAYS_H
#define ISOWAVE_LIGHT_RAYS_H

#include "portable/clip.h"

/// The size of the voxels of a ray's level of detail [voxels of the finest level].
ISO_INLINE float voxel_of(uint first_level, GivenRay given) {
  return (float)(1u << first_level) * (float)(1u << given.level);
}

/// Has a ray met what is clipped?
ISO_INLINE int meets_clipped(const FrameParams *frame, global const ClipParams *clip,
                             uint first_level, GivenRay given, HitRecord met) {
  const float in_first = (float)(1u << given.level);
  return is_clipped(clip, given, voxel_of(first_level, given),
                    met.t / (frame->view.t_scale * in_first));
}

/// Has a ray met a surface that is drawn?
ISO_INLINE int meets_surface(const FrameParams *frame, global const ClipParams *clip,
                             uint first_level, GivenRay given, HitRecord met) {
  return met.t != INFINITY &&
         (clip->num_planes == 0 || !meets_clipped(frame, clip, first_level, given, met));
}

#endif
