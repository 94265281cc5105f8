/// slot_stamps.h -- when a cache slot was used last, and which slots are freed first. OpenCL C 1.2.
///
/// A pass has two stamps, an even one for blocks that rays read in it, then an odd one for blocks that its waiting rays need. So a
/// slot with an odd stamp holds a block that nobody has read since it was asked for: mostly a wrong guess of speculation.
#ifndef ISOWAVE_SLOT_STAMPS_H
#define ISOWAVE_SLOT_STAMPS_H

#include "shared_types.h"

ISO_INLINE uint read_stamp(uint pass) {
  return 2 * pass;
}
ISO_INLINE uint needed_stamp(uint pass) {
  return 2 * pass + 1;
}

#define ISO_RANKS_PER_CLASS (ISO_EVICTION_RANKS / 4)
#define ISO_RANKS_OF_FRAME \
  (ISO_EVICTION_RANKS / 2)  ///< those below are of slots that the frame at work has used

/// Slots are freed from rank ISO_EVICTION_RANKS - 1 down. Rank 0: needed at the end of the pass that `counts` are of, or later.
/// Not in the paper, whose cache is strictly LRU. There are four classes, freed in this order:
///   unread, and last used in an earlier frame: the least recently used first
///   read in an earlier frame: the least recently used first
///   unread, of this frame: the least recently used first
///   read in this frame: the most recently used first
/// The last class goes only when the frame needs more blocks than there are slots. Least recently used first, each of its
/// blocks would be freed shortly before the next frame reads it; so the first ones stay.
ISO_INLINE uint eviction_rank(uint stamp, global const PassCounts *counts) {
  const uint now = needed_stamp(counts->pass), begin = read_stamp(counts->frame_pass);
  const uint oldest = ISO_RANKS_PER_CLASS - 1; /* older ones count as this old */
  const int is_unread = (stamp & 1u) != 0;
  uint rank = 0;
  /* Differences, since the stamps' clock wraps. */
  if ((int)(stamp - begin) < 0) {
    rank = (is_unread ? 3 : 2) * ISO_RANKS_PER_CLASS + min((begin - stamp) / 2, oldest);
  } else if ((int)(stamp - now) < 0) {
    const uint age = min((now - stamp) / 2, oldest - 1);
    rank = is_unread ? ISO_RANKS_PER_CLASS + age : oldest - age;
  }
  return rank;
}

#endif
