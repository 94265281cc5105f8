/// level_band.h -- the part of a ray that one level of detail draws (core/view/detail.hpp). OpenCL
/// C 1.2. If ISO_BANDS is 0, that is all of the ray, and nothing here costs anything.
#ifndef ISOWAVE_LEVEL_BAND_H
#define ISOWAVE_LEVEL_BAND_H

#include "portable/grid_dda.h"
#include "portable/ray_state.h"

/// The place where this level's masks begin among those of all levels.
ISO_INLINE uint masks_begin(const FrameParams *frame) {
  return ISO_LEVELS ? frame->place.masks_begin : 0u;
}

ISO_INLINE RayEvent band_begin(const FrameParams *frame) {
  return border_event(ISO_BANDS ? frame->band.begin_t : 0.0f);
}
ISO_INLINE RayEvent band_end(const FrameParams *frame) {
  return border_event(ISO_BANDS ? frame->band.end_t : INFINITY);
}

/// Is `exit` beyond the band?
ISO_INLINE int ends_band(const FrameParams *frame, RayEvent exit) {
  return ISO_BANDS && !event_before(exit, band_end(frame));
}

/// The beginning of the ray's band, if the ray has not entered the region before.
ISO_INLINE RayEvent band_entry(const FrameParams *frame, RayEvent entry) {
  return ISO_BANDS && event_before(entry, band_begin(frame)) ? band_begin(frame) : entry;
}

/// The end of the ray's band, if it comes before the ray leaves the region.
ISO_INLINE RayEvent band_exit(const FrameParams *frame, RayEvent exit) {
  return ends_band(frame, exit) ? band_end(frame) : exit;
}

/// Does the ray stand at a border, with a side that it was on before?
ISO_INLINE int has_side(uint side) {
  return ISO_BANDS && side != ISO_SIDE_UNKNOWN;
}

/// The place where a ray stands: without levels a block, and no side.
ISO_INLINE RayStand read_stand(uint stand) {
  RayStand at;
  at.block_id = ISO_LEVELS ? unpack_stand(stand).block_id : stand;
  at.side = ISO_LEVELS ? unpack_stand(stand).side : ISO_SIDE_UNKNOWN;
  return at;
}

#endif
