/// speculation.cl -- the pass's N_Spec from the rays still at work (Sec. 4).
#include "shared_types.h"

/// Opens a pass: N_Spec = min(max_spec_count, floor(W H / N_Act)), counters at 0. One work-item.
///
/// Not in the paper: when a pass asked for more blocks than the cache could free, only as many rays take part in the next one
/// as could be served; when it did not, a quarter more. Otherwise all rays would hold on to parts of their dual grids, none
/// would get the rest, and only the ray that is served first would move. While rays are left out, the others look ahead less
/// (scarce_speculation()).
kernel void begin_pass(const FrameParams frame_params, global PassCounts *counts) {
  const FrameParams *frame = &frame_params;
  const uint active = counts->next_active_count;
  const uint requested = counts->requested_count, decoded = counts->decoded_count;
  uint spec = 0, window = counts->window_count;
  if (active != 0) {
    spec = frame->width * frame->height / active;
    if (spec > frame->max_spec_count) spec = frame->max_spec_count;
  }
  window = requested > decoded ? (uint)((ulong)window * decoded / requested) : window + window / 4 + 1;
  if (window == 0) window = 1;
  if (window > active) window = active;
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
