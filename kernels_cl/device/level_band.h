/// level_band.h -- the interval of a ray in a level of detail (core/view/detail.hpp), clipped
/// (clip.h). OpenCL C 1.2. If ISO_INTERVALS is 0, that is all of the ray, and nothing here costs
/// anything.
#ifndef ISOWAVE_LEVEL_BAND_H
#define ISOWAVE_LEVEL_BAND_H

#include "portable/grid_dda.h"
#include "portable/ray_state.h"

/// The place where this level's masks begin among those of all levels.
ISO_INLINE uint masks_begin(const FrameParams *frame) {
  return ISO_LEVELS ? frame->place.masks_begin : 0u;
}

ISO_INLINE RayEvent ray_begin(const Ray *ray) {
  return border_event(ISO_INTERVALS ? ray->begin_t : 0.0f);
}
ISO_INLINE RayEvent ray_end(const Ray *ray) {
  return border_event(ISO_INTERVALS ? ray->end_t : INFINITY);
}

/// Is `exit` beyond the ray's interval?
ISO_INLINE int ends_ray(const Ray *ray, RayEvent exit) {
  return ISO_INTERVALS && !event_before(exit, ray_end(ray));
}

/// The beginning of the ray, if it has not entered the region before.
ISO_INLINE RayEvent ray_entry(const Ray *ray, RayEvent entry) {
  return ISO_INTERVALS && event_before(entry, ray_begin(ray)) ? ray_begin(ray) : entry;
}

/// The end of the ray, if it comes before the ray leaves the region.
ISO_INLINE RayEvent ray_exit(const Ray *ray, RayEvent exit) {
  return ends_ray(ray, exit) ? ray_end(ray) : exit;
}

/// Does the ray stand where it begins in a level, with a side that it was on before?
ISO_INLINE int has_side(uint side) {
  return ISO_INTERVALS && side != ISO_SIDE_UNKNOWN;
}

/// The place where a ray stands: without intervals a block, and no side.
ISO_INLINE RayStand read_stand(uint stand) {
  RayStand at;
  at.block_id = ISO_LEVELS || ISO_CLIP ? unpack_stand(stand).block_id : stand;
  at.side = ISO_LEVELS || ISO_CLIP ? unpack_stand(stand).side : ISO_SIDE_UNKNOWN;
  return at;
}

#endif
