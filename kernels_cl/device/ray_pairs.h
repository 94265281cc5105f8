/// ray_pairs.h -- the places of an active ray's pairs, one behind the other along the ray.
/// OpenCL C 1.2.
///
/// Two ways (frame->schedule.scanned_pairs). 0: every ray has N_Spec places, the last ones of which
/// may be empty (ISO_INVALID_ID). 1: it has as many as pairs; pair_begins [window_count + 1] says
/// where they begin, pair_rays [pair_slot_count] whose they are.
#ifndef ISOWAVE_RAY_PAIRS_H
#define ISOWAVE_RAY_PAIRS_H

#include "portable/shared_types.h"

/// The first place of active ray `a`; those of the next ray begin where its own end.
ISO_INLINE uint first_pair(const FrameParams *frame, global const uint *pair_begins, uint a,
                           uint spec_count) {
  return frame->schedule.scanned_pairs ? pair_begins[a] : a * spec_count;
}

/// The active ray of a place.
ISO_INLINE uint ray_of_pair(const FrameParams *frame, global const uint *pair_rays, uint pair,
                            uint spec_count) {
  return frame->schedule.scanned_pairs ? pair_rays[pair] : pair / spec_count;
}

#endif
