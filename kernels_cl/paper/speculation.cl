/// speculation.cl -- the pass's N_Spec from the rays still at work (Sec. 4).
#include "device/pass_counts.h"

/// Opens a pass: N_Spec, the window of the rays at work, counters at 0; and the counts of the next,
/// for smooth_normals. One work-item.
kernel void begin_pass(const FrameParams frame_params, global PassCounts *counts,
                       global PassCounts *next_counts) {
  const FrameParams *frame = &frame_params;
  const uint active = counts->next_active_count, spec_count = speculation_count(frame, active);
  const uint next = next_window(frame, counts->window_count, counts->active_count,
                                counts->requested_count, counts->decoded_count);
  const uint window = rays_in_window(next, active);
  counts->pass += 1;
  counts->active_count = active;
  counts->spec_count = spec_count;
  counts->window_count = window;
  counts->pair_slot_count = window * spec_count;
  counts->pair_count = counts->ahead_count = 0;
  counts->granted_count = 0;
  counts->visible_count = 0;
  counts->requested_count = 0;
  counts->decoded_count = counts->recycled_count = 0;
  counts->hit_count = 0;
  open_next_counts(frame, counts, next_counts);
}
