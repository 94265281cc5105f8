/// block_table.h -- which cache slot a block is in: a hash table of O(slots), not of O(blocks).
///
/// Open addressing. The eight blocks of a 2^3 group begin their search side by side, for a ray asks
/// for neighbours. An entry whose block was evicted keeps its key until the table is rebuilt
/// (block_cache.cl); at least three eighths of the entries have no key, so every search ends, and
/// most soon.
#ifndef ISOWAVE_BLOCK_TABLE_H
#define ISOWAVE_BLOCK_TABLE_H

#include "block_grid.h"

ISO_NAMESPACE_BEGIN

typedef struct BlockEntry {
  uint block_id;       ///< ISO_INVALID_ID: never used
  uint slot;           ///< ISO_BLOCK_ABSENT: evicted
  uint changing_low;   ///< bit x + 4y + 16z: does inside change in the cell? z = 0, 1
  uint changing_high;  ///< z = 2, 3
} BlockEntry;
ISO_CHECK_SIZE(BlockEntry, 16);

/// Both halves of the changing cells of a block that no ray has looked at. A work-item that reads
/// while another writes may get one half of each: cells too many, which does no harm.
#define ISO_CHANGING_UNKNOWN 0xFFFFFFFFFFFFFFFFul

ISO_INLINE ulong changing_of(ISO_GLOBAL const BlockEntry *entry) {
  return (ulong)entry->changing_high << 32 | entry->changing_low;
}

/// Counts and places that the cache's kernels leave for each other, and for the next pass.
typedef struct CacheState {
  uint
      first_block_id;  ///< the block that the pass must serve, or ISO_INVALID_ID; of its dual grid,
  uint first_touched;  ///< these blocks (bits 0..7, corner x + 2y + 4z)
  uint free_count;     ///< slots that hold no block, before the pass's grants
  uint granted;        ///< slots given in the pass
  uint table_count;  ///< at least the keys in the table before the pass's grants, those of evicted
                     ///< blocks included
  /* The outcome of cache_select: */
  uint free_before;   ///< free slots before eviction
  uint cutoff_rank;   ///< all slots of higher ranks are victims (slot_stamps.h) ...
  uint cutoff_count;  ///< ... and this many of just this rank
  uint num_evicted;   ///< so far
  uint num_cutoff;    ///< tickets drawn by slots of the cutoff rank
  uint recycled;      ///< of the victims, those that their own frame had used
  uint rebuild;       ///< the table has too many keys of evicted blocks
} CacheState;

#define ISO_TABLE_STEP \
  9u  ///< from entry to entry of a search; odd, and no factor of the table's size

/// The first entry of the search for block (x,y,z). frame->schedule.table_groups: entries / 8.
ISO_INLINE uint table_home(const FrameParams *frame, uint x, uint y, uint z) {
  const uint layer = id_layer(frame, z); /* the same seen from every level */
  uint h = ((x >> 1) * 0x9E3779B1u) ^ ((y >> 1) * 0x85EBCA77u) ^ ((layer >> 1) * 0xC2B2AE3Du);
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  h ^= h >> 13;
  return 8u * (uint)(((ulong)h * frame->schedule.table_groups) >> 32) + (x & 1u) + 2u * (y & 1u) +
         4u * (layer & 1u);
}

ISO_INLINE uint table_next(const FrameParams *frame, uint entry) {
  const uint next = entry + ISO_TABLE_STEP, size = 8u * frame->schedule.table_groups;
  return next >= size ? next - size : next;
}

/// The table entry of block (x,y,z), or ISO_INVALID_ID if it has none.
ISO_INLINE uint find_entry(const FrameParams *frame, ISO_GLOBAL const BlockEntry *table, uint x,
                           uint y, uint z) {
  const uint block_id = block_id_at(frame, x, y, z);
  uint i = table_home(frame, x, y, z), key = table[i].block_id;
  while (key != block_id && key != ISO_INVALID_ID) {
    i = table_next(frame, i);
    key = table[i].block_id;
  }
  return key == block_id ? i : ISO_INVALID_ID;
}

/// The entries of the dual grid of block (x,y,z): corner x + 2y + 4z; slot ISO_BLOCK_ABSENT if a
/// block is not cached. All eight are read before one is looked at: a GPU waits once, not eight
/// times.
ISO_INLINE void find_dual_grid(const FrameParams *frame, ISO_GLOBAL const BlockEntry *table, uint x,
                               uint y, uint z, BlockEntry *entries) {
  uint corner;
  ISO_UNROLL
  for (corner = 0; corner < 8u; ++corner) {
    entries[corner] =
        table[table_home(frame, x + (corner & 1u), y + (corner >> 1 & 1u), z + (corner >> 2))];
  }
  ISO_UNROLL
  for (corner = 0; corner < 8u; ++corner) {
    const uint bx = x + (corner & 1u), by = y + (corner >> 1 & 1u), bz = z + (corner >> 2);
    const uint key = entries[corner].block_id;
    if (key != block_id_at(frame, bx, by, bz)) {
      const uint entry =
          key == ISO_INVALID_ID ? ISO_INVALID_ID : find_entry(frame, table, bx, by, bz);
      entries[corner].slot = ISO_BLOCK_ABSENT;
      if (entry != ISO_INVALID_ID) entries[corner] = table[entry];
    }
  }
}

/// The slot of block (x,y,z), or ISO_BLOCK_ABSENT.
ISO_INLINE uint cached_slot(const FrameParams *frame, ISO_GLOBAL const BlockEntry *table, uint x,
                            uint y, uint z) {
  const uint entry = find_entry(frame, table, x, y, z);
  return entry == ISO_INVALID_ID ? ISO_BLOCK_ABSENT : table[entry].slot;
}

ISO_NAMESPACE_END

#endif
