/// slot_stamps.h -- when a cache slot was used last, and which slots are freed first. OpenCL C 1.2.
///
/// A pass has two stamps, an even one for blocks that rays read in it, then an odd one for blocks
/// that its waiting rays need. So a slot with an odd stamp holds a block that no ray has read since
/// it was asked for: mostly a wrong guess of speculation.
#ifndef ISOWAVE_SLOT_STAMPS_H
#define ISOWAVE_SLOT_STAMPS_H

#include "portable/shared_types.h"

ISO_INLINE uint read_stamp(uint pass) {
  return 2 * pass;
}
ISO_INLINE uint needed_stamp(uint pass) {
  return 2 * pass + 1;
}
/// The read stamp of the same pass.
ISO_INLINE uint as_read_stamp(uint stamp) {
  return stamp & ~1u;
}

/// Stamps a slot that a waiting ray needs, with needed_stamp() of the pass.
ISO_INLINE void stamp_needed(volatile global uint *slot_stamps, uint slot, uint stamp) {
  if (ISO_CHECK_RACES) {
    atomic_max(&slot_stamps[slot], stamp);
  } else {
    slot_stamps[slot] = stamp;
  }
}
/// Stamps a slot that was read, with read_stamp() of the pass, in a kernel that also stamps what is
/// needed: that wins.
ISO_INLINE void stamp_read(volatile global uint *slot_stamps, uint slot, uint stamp) {
  if (ISO_CHECK_RACES || (int)(slot_stamps[slot] - stamp) < 0)
    atomic_max(&slot_stamps[slot], stamp);
}

#define ISO_CLASS_RANKS (ISO_EVICTION_RANKS / 8)
#define ISO_RANKS_OF_FRAME \
  (2 * ISO_CLASS_RANKS)  ///< those below are of slots that the frame at work has used

#define ISO_RANKS_OF_EARLIER \
  (4 * ISO_CLASS_RANKS)  ///< ... these and those above, of slots used neither in it nor in the last

/// Slots are freed from rank ISO_EVICTION_RANKS - 1 down. Rank 0: needed at the end of the pass
/// that `counts` are of, or later. Not in the paper, whose cache is strictly LRU. There are five
/// classes, freed in this order:
///   not used in this frame nor the last: the least recently used first
///   of the last frame, unread: the least recently used first
///   of the last frame, read: the least recently used first
///   of this frame, unread: the least recently used first
///   of this frame, read: the most recently used first
/// So a view whose blocks fit is decoded once. Slots of this frame go only when it needs more
/// blocks than there are slots. The least recently used of those that it has read would be freed
/// shortly before the next frame reads them; so the first stay.
ISO_INLINE uint eviction_rank(uint stamp, global const PassCounts *counts) {
  const uint now = needed_stamp(counts->pass), begin = read_stamp(counts->frame_pass),
             last_begin = read_stamp(counts->last_frame_pass);
  const uint oldest = ISO_CLASS_RANKS - 1; /* greater ages count as this */
  const int is_unread = stamp != as_read_stamp(stamp);
  uint rank = 0;
  /* Differences, since the clock of the stamps wraps. */
  if ((int)(stamp - last_begin) < 0) {
    rank = ISO_RANKS_OF_EARLIER + min((last_begin - stamp) / 2, 4 * ISO_CLASS_RANKS - 1);
  } else if ((int)(stamp - begin) < 0) {
    rank = (is_unread ? 3 : 2) * ISO_CLASS_RANKS + min((begin - stamp) / 2, oldest);
  } else if ((int)(stamp - now) < 0) {
    const uint age = min((now - stamp) / 2, oldest - 1);
    rank = is_unread ? ISO_CLASS_RANKS + age : oldest - age;
  }
  return rank;
}

#endif
