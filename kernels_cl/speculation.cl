/// speculation.cl -- the pass's N_Spec from the rays still at work (Sec. 4).
#include "shared_types.h"

/// Opens a pass: N_Spec = min(max_spec_count, floor(W H / N_Act)), counters at 0. One work-item.
kernel void begin_pass(constant FrameParams *frame, global PassCounts *counts) {
  const uint active = counts->next_active_count;
  uint spec = 0;
  if (active != 0) {
    spec = frame->width * frame->height / active;
    if (spec > frame->max_spec_count) spec = frame->max_spec_count;
  }
  counts->pass += 1;
  counts->active_count = active;
  counts->spec_count = spec;
  counts->pair_slot_count = active * spec;
  counts->pair_count = 0;
  counts->granted_count = 0;
  counts->visible_count = 0;
  counts->requested_count = 0;
  counts->decoded_count = 0;
  counts->hit_count = 0;
}
