/// block_pages.h -- enters blocks into the cache's table (portable/block_table.h), and takes them
/// out. OpenCL C 1.2. A kernel does one of the two.
#ifndef ISOWAVE_BLOCK_PAGES_H
#define ISOWAVE_BLOCK_PAGES_H

#include "portable/block_table.h"

/// Takes a free page, and counts one block of it. No work-item holds a page without having a slot
/// for a block of it, so one is free. Begins to look at the page with the slot's number, which no
/// other work-item begins with.
ISO_INLINE uint take_page(volatile global uint *table, uint num_slots, uint slot) {
  uint page = slot;
  while (atomic_cmpxchg(&table[page_count_at(num_slots, page)], 0u, 1u) != 0u)
    page = page + 1u == num_slots ? 0u : page + 1u;
  return page;
}

/// Counts block b, which is not in the table, and has this slot. Returns the word that is to get
/// the slot. Others may enter blocks meanwhile.
ISO_INLINE uint enter_block(const FrameParams *frame, volatile global uint *table, BlockCoords b,
                            uint slot) {
  const uint num_slots = frame->schedule.cache_slots, none = empty_page(num_slots);
  volatile global uint *entry = &table[directory_word(frame, b.x, b.y, b.z)];
  uint page = ISO_CHECK_RACES ? atomic_or(entry, 0u) : *entry;
  if (page == none) {
    const uint taken = take_page(table, num_slots, slot);
    page = atomic_cmpxchg(entry, none, taken);
    if (page == none) return page_word(frame, taken, b.x, b.y, b.z);
    atomic_dec(&table[page_count_at(num_slots, taken)]); /* another was first */
  }
  atomic_inc(&table[page_count_at(num_slots, page)]);
  return page_word(frame, page, b.x, b.y, b.z);
}

/// Takes block b out of the table. Others may take blocks out meanwhile.
ISO_INLINE void remove_block(const FrameParams *frame, volatile global uint *table, BlockCoords b) {
  const uint num_slots = frame->schedule.cache_slots;
  volatile global uint *entry = &table[directory_word(frame, b.x, b.y, b.z)];
  const uint page = ISO_CHECK_RACES ? atomic_or(entry, 0u) : *entry;
  table[page_word(frame, page, b.x, b.y, b.z)] = ISO_BLOCK_ABSENT;
  if (atomic_dec(&table[page_count_at(num_slots, page)]) == 1u)
    atomic_xchg(entry, empty_page(num_slots));
}

#endif
