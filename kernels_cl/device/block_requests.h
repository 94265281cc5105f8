/// block_requests.h -- the list of blocks that a pass asks for, each once. OpenCL C 1.2.
#ifndef ISOWAVE_BLOCK_REQUESTS_H
#define ISOWAVE_BLOCK_REQUESTS_H

#include "portable/block_table.h"
#include "slot_stamps.h"

/// Begins a pass. One work-item, in a kernel that reads none of this.
ISO_INLINE void open_requests(global CacheState *cache) {
  cache->free_count -= cache->granted;
  cache->granted = cache->recycled = 0;
}

/// Word and bit of a block in requested_bits [2 * coarse macrocells]; laid out as macrocell_masks,
/// with several levels of detail as those of one whose blocks have their ids.
ISO_INLINE uint request_word(const FrameParams *frame, uint x, uint y, uint z) {
  const uint coarse_x = (id_blocks_x(frame) + 3) / 4, coarse_y = (id_blocks_y(frame) + 3) / 4;
  const uint layer = id_layer(frame, z);
  return 2 * ((x >> 2) + coarse_x * ((y >> 2) + coarse_y * (layer >> 2))) + (layer >> 1 & 1);
}
ISO_INLINE uint request_bit(const FrameParams *frame, uint x, uint y, uint z) {
  return 1u << ((x & 3) + 4 * (y & 3) + 16 * (id_layer(frame, z) & 1));
}

/// Marks block (x,y,z). Returns 1 to the one who is first.
ISO_INLINE int mark_request(const FrameParams *frame, volatile global uint *requested_bits, uint x,
                            uint y, uint z) {
  const uint bit = request_bit(frame, x, y, z);
  return (atomic_or(&requested_bits[request_word(frame, x, y, z)], bit) & bit) == 0;
}

ISO_INLINE void unmark_request(const FrameParams *frame, volatile global uint *requested_bits,
                               uint x, uint y, uint z) {
  atomic_and(&requested_bits[request_word(frame, x, y, z)], ~request_bit(frame, x, y, z));
}

/// Stamps block (x,y,z) as needed if it is cached. Returns 1 if it is not, and this is the first to
/// ask for it.
ISO_INLINE int request_block(const FrameParams *frame, global const uint *table,
                             global uint *slot_stamps, uint pass,
                             volatile global uint *requested_bits, uint x, uint y, uint z) {
  const uint slot = cached_slot(frame, table, x, y, z);
  if (slot == ISO_BLOCK_ABSENT) return mark_request(frame, requested_bits, x, y, z);
  slot_stamps[slot] = needed_stamp(pass);
  return 0;
}

/// Puts a marked block at `place` of the list [capacity]; takes the mark back if the list has
/// ended.
ISO_INLINE void list_request(const FrameParams *frame, global uint *request_block_ids,
                             uint capacity, volatile global uint *requested_bits, uint place,
                             uint block_id) {
  if (place < capacity) {
    request_block_ids[place] = block_id;
  } else {
    const BlockCoords b = block_coords(frame, block_id);
    unmark_request(frame, requested_bits, b.x, b.y, b.z);
  }
}

#endif
