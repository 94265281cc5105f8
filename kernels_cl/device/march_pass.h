/// march_pass.h -- how a pass of pipeline `rays` begins. OpenCL C 1.2.
#ifndef ISOWAVE_MARCH_PASS_H
#define ISOWAVE_MARCH_PASS_H

#include "block_requests.h"
#include "pass_counts.h"

/// Opens what march leaves to request_ahead, and the counts of the next pass. One work-item, before
/// anybody reads any of it.
///
/// prev    counts of the pass before
/// In      counts->window_count: 0, but in the first pass of a wave
/// Out     counts: window_count, free_count
ISO_INLINE void open_march(const FrameParams *frame, global const PassCounts *prev,
                           global PassCounts *counts, global PassCounts *next,
                           global CacheState *cache) {
  open_next_counts(frame, counts, next);
  open_requests(cache);
  cache->first_block_id = ISO_INVALID_ID;
  if (counts->window_count == 0)
    counts->window_count = next_window(frame, prev->window_count, prev->next_active_count,
                                       prev->requested_count, counts->decoded_count);
  counts->free_count = cache->free_count;
}

#endif
