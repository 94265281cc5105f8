/// on_demand.h -- blocks that are decoded in the kernel whose rays come to them, by the work-item
/// that is first at each. OpenCL C 1.2, on devices that keep more than that promises.
///
/// When the kernel begins, cache->free_count slots are free and no block is marked in
/// requested_bits. Here, a mark says that a work-item decodes the block. That work-item takes the
/// last free slot, fills it, enters it into the table, and takes the mark back. Others wait for
/// that, but not for long: then their rays wait for the next pass, as do those for which there is
/// no slot. So nothing depends on when other work-items run.
///
/// Order of memory: a block's values, bits, cells and stamp are written before an atomic_xchg gives
/// the block its slot in the table. OpenCL 1.2 orders no memory between work-groups. PoCL does: its
/// atomic functions are LLVM's with order acq_rel (seen in PoCL 3.1's library for x86), so a
/// work-item that reads the slot sees the stores before the atomic_xchg. Data of a slot are found
/// by the slot's number, so they are loaded after the slot.
#ifndef ISOWAVE_ON_DEMAND_H
#define ISOWAVE_ON_DEMAND_H

#include "block_pages.h"
#include "block_requests.h"
#include "block_stream.h"
#include "slot_values.h"

#ifndef ISO_DEMAND_PATIENCE
#define ISO_DEMAND_PATIENCE 20000u  ///< looks at the mark of another: some ten microseconds
#endif

/// The compressed volume (block_stream.h), and the cache (block_cache.cl).
typedef struct BlockMaker {
  global const uint *part_0, *part_1, *part_2, *part_3, *index;
  StreamLayout layout;
  float isovalue;
  global uint *table;
  global SlotValue *values;
  global ulong *inside, *changing;
  global uint *slot_block_ids, *slot_stamps, *requested_bits;
  global const uint *free_slots;
  global CacheState *cache;
  uint stamp;     ///< read_stamp() of the pass
  uint num_made;  ///< blocks decoded by this work-item
  int is_full;    ///< it has found no slot
} BlockMaker;

/// Takes the last free slot. Returns ISO_BLOCK_ABSENT if there is none.
ISO_INLINE uint take_free_slot(const BlockMaker *maker) {
  volatile global int *count = (volatile global int *)&maker->cache->free_count;
  int before = *count;
  if (before > 0) {
    before = atomic_dec(count);
    if (before <= 0) atomic_inc(count); /* others took the rest meanwhile; none come back */
  }
  return before > 0 ? maker->free_slots[before - 1] : ISO_BLOCK_ABSENT;
}

/// Decodes block b, which this work-item has marked, unless that has been done.
ISO_INLINE void make_block(BlockMaker *maker, const FrameParams *frame, BlockCoords b) {
  uint slot, v;
  float values[ISO_BLOCK_VOXELS];
  ulong inside = 0;
  if (slot_by_now(frame, maker->table, b) != ISO_BLOCK_ABSENT) return;
  slot = take_free_slot(maker);
  maker->is_full = slot == ISO_BLOCK_ABSENT;
  if (maker->is_full) return;
  decode_block(maker->part_0, maker->part_1, maker->part_2, maker->part_3, maker->index,
               maker->layout, level_block_at(frame, b.x, b.y, b.z), 0, values);
  for (v = 0; v < ISO_BLOCK_VOXELS; ++v) {
    maker->values[slot * ISO_BLOCK_VOXELS + v] = (SlotValue)values[v];
    inside |= (ulong)(field_of_slot(frame, values[v]) - maker->isovalue >= 0.0f) << v;
  }
  maker->inside[slot] = inside;
  maker->changing[slot] = ISO_CHANGING_UNKNOWN;
  maker->slot_block_ids[slot] = block_id_at(frame, b.x, b.y, b.z);
  maker->slot_stamps[slot] = maker->stamp;
  ++maker->num_made;
  atomic_xchg((volatile global uint *)&maker->table[enter_block(frame, maker->table, b, slot)],
              slot);
}

/// Has blocks of the dual grid of block b decoded, those of some of its corners (bits 0..7). They
/// are in the table then, unless there was no slot, or others took too long.
ISO_RARE void bring_corners(BlockMaker *maker, const FrameParams *frame, BlockCoords b,
                            uint corners) {
  uint others = 0, corner, looks;
  for (corner = 0; corner < 8; ++corner) {
    BlockCoords at = {b.x + (corner & 1u), b.y + (corner >> 1 & 1u), b.z + (corner >> 2)};
    if ((corners >> corner & 1u) == 0) continue;
    if (mark_request(frame, maker->requested_bits, at.x, at.y, at.z)) {
      make_block(maker, frame, at);
      unmark_request(frame, maker->requested_bits, at.x, at.y, at.z);
    } else {
      others |= 1u << corner;
    }
  }
  for (corner = 0; corner < 8; ++corner) {
    const uint x = b.x + (corner & 1u), y = b.y + (corner >> 1 & 1u), z = b.z + (corner >> 2);
    volatile global uint *word = &maker->requested_bits[request_word(frame, x, y, z)];
    const uint bit = request_bit(frame, x, y, z);
    if ((others >> corner & 1u) == 0) continue;
    for (looks = 0; looks < ISO_DEMAND_PATIENCE && (*word & bit) != 0; ++looks) {
    }
    atomic_or(word, 0u); /* what the other has written is read after this */
  }
}

#endif
