/// block_table.h -- which cache slot a block is in: a table of pages.
///
/// A page has the slots of a group of 2^3 blocks, since a ray asks for neighbours. The directory
/// has a page for each group. There are as many pages as slots, so that none is ever missing: a
/// group has a page only while one of its blocks is cached. Groups without cached blocks share
/// one more page, whose slots are ISO_BLOCK_ABSENT. So looking a block up needs no branch.
///
/// In words, for S slots:
///   [8 * (S + 1)]  pages; in each x + 2y + 4z
///   [S]            how many blocks of each page are cached; 0: it is free
///   [groups]       the directory; and some more, for neighbours of the last groups
#ifndef ISOWAVE_BLOCK_TABLE_H
#define ISOWAVE_BLOCK_TABLE_H

#include "block_grid.h"

ISO_NAMESPACE_BEGIN

/// The cells of a slot that no ray has looked at, in both halves. A work-item that reads while
/// another writes may get one half of each: cells too many, which does no harm.
#define ISO_CHANGING_UNKNOWN 0xFFFFFFFFFFFFFFFFul

/// Counts and places that the cache's kernels leave for each other, and for the next pass.
typedef struct CacheState {
  uint
      first_block_id;  ///< the block that the pass must serve, or ISO_INVALID_ID; of its dual grid,
  uint first_touched;  ///< these blocks (bits 0..7, corner x + 2y + 4z)
  uint free_count;     ///< slots that hold no block, before the pass's grants
  uint granted;        ///< slots given in the pass
  /* The outcome of cache_select: */
  uint free_before;   ///< free slots before eviction
  uint cutoff_rank;   ///< all slots of higher ranks are victims (slot_stamps.h) ...
  uint cutoff_count;  ///< ... and this many of just this rank
  uint num_evicted;   ///< so far
  uint num_cutoff;    ///< tickets drawn by slots of the cutoff rank
  uint recycled;      ///< of the victims, those that their own frame had used
} CacheState;

/// The page that groups without cached blocks share.
ISO_INLINE uint empty_page(uint num_slots) {
  return num_slots;
}
/// Words: of page counts, and the directory.
ISO_INLINE uint page_count_at(uint num_slots, uint page) {
  return 8u * (num_slots + 1u) + page;
}
ISO_INLINE uint directory_begin(uint num_slots) {
  return page_count_at(num_slots, num_slots);
}

/// The number of a block's group.
///
/// blocks_x, blocks_y  of the grid in which ids of blocks count
/// x, y, layer         of the block in that grid
ISO_INLINE uint group_of_block(uint blocks_x, uint blocks_y, uint x, uint y, uint layer) {
  return x / 2u + (blocks_x + 1u) / 2u * (y / 2u + (blocks_y + 1u) / 2u * (layer / 2u));
}

/// The word of the directory for block (x,y,z). A block beyond the volume has that of any other.
ISO_INLINE uint directory_word(const FrameParams *frame, uint x, uint y, uint z) {
  return directory_begin(frame->schedule.cache_slots) +
         group_of_block(id_blocks_x(frame), id_blocks_y(frame), x, y, id_layer(frame, z));
}

/// The word of block (x,y,z), whose group has this page.
ISO_INLINE uint page_word(const FrameParams *frame, uint page, uint x, uint y, uint z) {
  return 8u * page + (x & 1u) + 2u * (y & 1u) + 4u * (id_layer(frame, z) & 1u);
}

/// The slot of block (x,y,z), or ISO_BLOCK_ABSENT.
ISO_INLINE uint cached_slot(const FrameParams *frame, ISO_GLOBAL const uint *table, uint x, uint y,
                            uint z) {
  return table[page_word(frame, table[directory_word(frame, x, y, z)], x, y, z)];
}

/// cached_slot() at this moment, while others enter blocks.
ISO_INLINE uint slot_by_now(const FrameParams *frame, volatile ISO_GLOBAL const uint *table,
                            BlockCoords b) {
  return table[page_word(frame, table[directory_word(frame, b.x, b.y, b.z)], b.x, b.y, b.z)];
}

/// slots [8]: those of the dual grid of block (x,y,z), corner x + 2y + 4z; ISO_BLOCK_ABSENT if a
/// block is not cached. In steps for all eight: a GPU waits twice, not sixteen times.
ISO_INLINE void find_dual_grid(const FrameParams *frame, ISO_GLOBAL const uint *table, uint x,
                               uint y, uint z, uint *slots) {
  uint pages[8], corner;
  ISO_UNROLL
  for (corner = 0; corner < 8u; ++corner) {
    pages[corner] =
        table[directory_word(frame, x + (corner & 1u), y + (corner >> 1 & 1u), z + (corner >> 2))];
  }
  ISO_UNROLL
  for (corner = 0; corner < 8u; ++corner) {
    slots[corner] = table[page_word(frame, pages[corner], x + (corner & 1u), y + (corner >> 1 & 1u),
                                    z + (corner >> 2))];
  }
}

ISO_NAMESPACE_END

#endif
