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

/// Does the ray stand at its last hit?
ISO_INLINE int is_at_hit(uint side) {
  return ISO_BEHIND_HITS && side == ISO_AT_HIT;
}

/// Does the ray stand where it begins in a level, with a side that it was on before?
ISO_INLINE int has_side(uint side) {
  return ISO_INTERVALS && side != ISO_SIDE_UNKNOWN && !is_at_hit(side);
}

/// The place where a ray stands: a block, and no side unless kernels have any.
ISO_INLINE RayStand read_stand(uint stand) {
  RayStand at;
  const int is_packed = ISO_LEVELS || ISO_CLIP || ISO_BEHIND_HITS;
  at.block_id = is_packed ? unpack_stand(stand).block_id : stand;
  at.side = is_packed ? unpack_stand(stand).side : ISO_SIDE_UNKNOWN;
  return at;
}

#endif
