/// speculation.cl -- the pass's N_Spec from the rays still at work (Sec. 4).
#include "portable/shared_types.h"

/// Opens a pass: N_Spec = min(max_spec_count, floor(W H / N_Act)), next_window(), counters at 0.
/// One work-item.
kernel void begin_pass(const FrameParams frame_params, global PassCounts *counts) {
  const FrameParams *frame = &frame_params;
  const uint active = counts->next_active_count;
  const uint window = min(
      next_window(counts->window_count, counts->requested_count, counts->decoded_count), active);
  uint spec = 0;
  if (active != 0) {
    spec = frame->width * frame->height / active;
    if (spec > frame->max_spec_count) spec = frame->max_spec_count;
  }
  counts->pass += 1;
  counts->active_count = active;
  counts->spec_count = spec;
  counts->window_count = window;
  counts->pair_slot_count = window * spec;
  counts->pair_count = counts->ahead_count = 0;
  counts->granted_count = 0;
  counts->visible_count = 0;
  counts->requested_count = 0;
  counts->decoded_count = counts->recycled_count = 0;
  counts->hit_count = 0;
}
