/// touched_requests.h -- work-groups ask for blocks that their rays touch: collected first, so that
/// a group makes room for all of them at once. OpenCL C 1.2.
#ifndef ISOWAVE_TOUCHED_REQUESTS_H
#define ISOWAVE_TOUCHED_REQUESTS_H

#include "block_requests.h"

#define ISO_REQUEST_STAGING 256u  ///< requests that a work-group collects before it writes them out

/// The request list, and where a work-group collects what it will add to it.
typedef struct Requests {
  global uint *bits, *block_ids;
  uint capacity;
  volatile global uint *count;
  local uint *staged;               ///< [ISO_REQUEST_STAGING]
  volatile local uint *num_staged;  ///< 0 at first
} Requests;

/// The given corners x + 2y + 4z (bits 0..7) of the 2^3 blocks from b on that no ray is known to
/// have asked for. Most have been asked for by another ray: their bits tell, and cost neither a
/// search in the table nor an atomic, for whose result this ray would wait.
ISO_INLINE uint unasked_corners(const FrameParams *frame, BlockCoords b, uint corners,
                                Requests requests) {
  uint unasked = corners;
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
    const uint word = (corners >> corner & 1u) != 0 ? request_word(frame, x, y, z) : 0;
    const uint bits = ISO_CHECK_RACES ? atomic_or(&requests.bits[word], 0u) : requests.bits[word];
    unasked &= ~((uint)((bits & request_bit(frame, x, y, z)) != 0) << corner);
  }
  return unasked;
}

/// Asks for those corners, which are not cached.
ISO_INLINE void request_corners(const FrameParams *frame, BlockCoords b, uint corners,
                                Requests requests) {
  for (uint corner = 0; corner < 8; ++corner) {
    const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
    if ((corners >> corner & 1u) != 0 && mark_request(frame, requests.bits, x, y, z)) {
      const uint block_id = block_id_at(frame, x, y, z), place = atomic_inc(requests.num_staged);
      if (place < ISO_REQUEST_STAGING) {
        requests.staged[place] = block_id;
      } else {
        list_request(frame, requests.block_ids, requests.capacity, requests.bits,
                     atomic_inc(requests.count), block_id);
      }
    }
  }
}

/// Asks for the missing ones of the touched corners; the others stay.
///
/// place  of the ray among those that wait: the first one is named in *cache
/// slots  [8] of the corners, ISO_SCRATCH_STRIDE apart
ISO_INLINE void request_missing(const FrameParams *frame, BlockCoords b, uint touched, uint missing,
                                uint place, uint needed, ISO_SCRATCH const uint *slots,
                                global uint *slot_stamps, Requests requests,
                                global CacheState *cache) {
  for (uint corner = 0; corner < 8; ++corner) {
    if ((touched & ~missing & 1u << corner) != 0)
      stamp_needed(slot_stamps, slots[corner * ISO_SCRATCH_STRIDE], needed);
  }
  request_corners(frame, b, unasked_corners(frame, b, missing, requests), requests);
  if (place == 0) {
    cache->first_block_id = block_id_at(frame, b.x, b.y, b.z);
    cache->first_touched = touched;
  }
}

/// Adds what the work-group has collected to the list. All items must call it.
/// list_begin: scratch of the work-group.
ISO_INLINE void list_staged(const FrameParams *frame, Requests requests, local uint *list_begin) {
  const uint item = get_local_id(0);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0)
    *list_begin = atomic_add(requests.count, min(*requests.num_staged, ISO_REQUEST_STAGING));
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint j = item; j < min(*requests.num_staged, ISO_REQUEST_STAGING); j += ISO_GROUP_SIZE) {
    list_request(frame, requests.block_ids, requests.capacity, requests.bits, *list_begin + j,
                 requests.staged[j]);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0) *requests.num_staged = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
}

#endif
