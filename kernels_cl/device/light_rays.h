/// light_rays.h -- what ambient and shadow rays have met. OpenCL C 1.2.
#ifndef ISOWAVE_LIGHT_RAYS_H
#define ISOWAVE_LIGHT_RAYS_H

#include "portable/clip.h"

/// The size of the voxels of a ray's level of detail [voxels of the finest that draws].
ISO_INLINE float voxel_in_first(GivenRay given) {
  return (float)(1u << level_of_given(given));
}

/// The size of the voxels of a ray's level of detail [voxels of the finest level].
ISO_INLINE float voxel_of(uint first_level, GivenRay given) {
  return (float)(1u << first_level) * voxel_in_first(given);
}

/// Has a ray met what is clipped?
ISO_INLINE int meets_clipped(const FrameParams *frame, global const ClipParams *clip,
                             uint first_level, GivenRay given, HitRecord met) {
  return is_clipped(clip, given, voxel_of(first_level, given),
                    met.t / (frame->view.t_scale * voxel_in_first(given)));
}

/// Has a ray met a surface that is drawn?
ISO_INLINE int meets_surface(const FrameParams *frame, global const ClipParams *clip,
                             uint first_level, GivenRay given, HitRecord met) {
  return met.t != INFINITY &&
         (clip->num_planes == 0 || !meets_clipped(frame, clip, first_level, given, met));
}

#endif
