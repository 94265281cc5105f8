/// level_requests.h -- which of a pass's requests are for a level of detail. OpenCL C 1.2. If
/// ISO_LEVELS is 0, all are, and nothing here costs anything.
#ifndef ISOWAVE_LEVEL_REQUESTS_H
#define ISOWAVE_LEVEL_REQUESTS_H

#include "block_stream.h"
#include "portable/block_grid.h"

#define ISO_LEVEL_SLOTS (ISO_LEVELS ? ISO_GROUP_SIZE : 1)  ///< entries of to_slots

/// Request number i of this launch. places: the launch's requests, if a window of the stream has
/// the blocks of only one level.
ISO_INLINE uint place_of(global const uint *places, uint i) {
  if (!ISO_LEVELS) return i;
  return ISO_STREAM_PARTS == 0 ? places[i] : i;
}

/// The block with this id among those of its own level: of `frame`, or else of `next`, then
/// *is_next is 1. ISO_INVALID_ID if it is neither's.
ISO_INLINE uint served_block(const FrameParams *frame, const FrameParams *next, uint block_id,
                             int *is_next) {
  uint served = block_id;
  *is_next = 0;
  if (ISO_LEVELS && block_id != ISO_INVALID_ID) {
    served = level_block_of(frame, block_id);
    *is_next = served == ISO_INVALID_ID;
    if (*is_next) served = level_block_of(next, block_id);
  }
  return served;
}

/// Tells the work-group where this item's block goes.
ISO_INLINE void tell_slot(local uint *to_slots, uint item, uint block_id, global const uint *slots,
                          uint request) {
  if (ISO_LEVELS) to_slots[item] = block_id == ISO_INVALID_ID ? ISO_BLOCK_ABSENT : slots[request];
}

/// The slot for the block of item `block`, of the requests from `begin` on; ISO_BLOCK_ABSENT if the
/// block is of another level.
ISO_INLINE uint told_slot(local const uint *to_slots, global const uint *slots, uint begin,
                          uint block) {
  return ISO_LEVELS ? to_slots[block] : slots[begin + block];
}
ISO_INLINE int is_served(uint slot) {
  return !ISO_LEVELS || slot != ISO_BLOCK_ABSENT;
}

#endif
