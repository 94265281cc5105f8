/// closest_pair.h -- which of a ray's pairs decides: the first that hits or was not tested
/// (Sec. 4.4). OpenCL C 1.2. A ray's blocks come in ray order, so that is the one with the lowest
/// index, and no distances are compared: a 32-bit atomic_min does what the paper wanted 64-bit
/// atomics for.
///
/// Two ways, by -D ISO_CLOSEST_BY_ATOMICS: 1, the stages that learn a pair's result offer its index
/// to closest_pairs [active rays] (ISO_INVALID_ID before); 0, composite searches the results of all
/// of a ray's pairs.
#ifndef ISOWAVE_CLOSEST_PAIR_H
#define ISOWAVE_CLOSEST_PAIR_H

#include "portable/shared_types.h"

#ifndef ISO_CLOSEST_BY_ATOMICS
#define ISO_CLOSEST_BY_ATOMICS 1
#endif

/// Says that a pair of active ray `a` hits, or was not tested.
ISO_INLINE void offer_closest(volatile global uint *closest_pairs, uint a, uint pair) {
  if (ISO_CLOSEST_BY_ATOMICS) atomic_min(&closest_pairs[a], pair);
}

/// Marks a pair of active ray `a` that cannot be intersected in this pass, or lies behind its last.
ISO_INLINE void mark_not_tested(global PairHit *pair_hits, volatile global uint *closest_pairs,
                                uint a, uint pair, uint block_id) {
  if (!ISO_CLOSEST_BY_ATOMICS || block_id != ISO_INVALID_ID) pair_hits[pair].cell = ISO_NOT_TESTED;
  if (block_id != ISO_INVALID_ID) offer_closest(closest_pairs, a, pair);
}

/// The pair of active ray `a` that decides, or ISO_INVALID_ID. begin, end: of its pairs.
ISO_INLINE uint closest_pair(global const uint *closest_pairs, global const uint *pair_block_ids,
                             global const PairHit *pair_hits, uint a, uint begin, uint end) {
  uint pair = begin;
  if (ISO_CLOSEST_BY_ATOMICS) return closest_pairs[a];
  while (pair < end && pair_block_ids[pair] != ISO_INVALID_ID && pair_hits[pair].cell == ISO_NO_HIT)
    ++pair;
  return pair < end && pair_block_ids[pair] != ISO_INVALID_ID ? pair : ISO_INVALID_ID;
}

#endif
