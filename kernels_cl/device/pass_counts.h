/// pass_counts.h -- the counts of the next pass. OpenCL C 1.2.
#ifndef ISOWAVE_PASS_COUNTS_H
#define ISOWAVE_PASS_COUNTS_H

#include "portable/window.h"

/// Opens the counts of the next pass. One work-item; no other reads *next in this pass.
ISO_INLINE void open_next_counts(const FrameParams *frame, global const PassCounts *counts,
                                 global PassCounts *next) {
  next->ray_count = frame_rays(frame);
  next->pass = counts->pass + 1;
  next->frame_pass = counts->frame_pass;
  next->last_frame_pass = counts->last_frame_pass;
  next->active_count = next->spec_count = next->window_count = 0;
  next->pair_slot_count = next->pair_count = next->ahead_count = 0;
  next->granted_count = next->visible_count = next->requested_count = next->decoded_count = 0;
  next->recycled_count = next->hit_count = next->next_active_count = 0;
  next->free_count = counts->free_count;
}

#endif
