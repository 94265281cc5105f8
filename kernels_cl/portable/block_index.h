/// block_index.h -- the places where blocks with lengths of their own begin in a zfp stream: 2.5
/// bytes a block.
///
/// Sixteen blocks share ten words: the first bit of the first one, in 64 bits, and from there the
/// first bit of each, in 16 bits. One more entry than there are blocks says where the last one
/// ends. Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_BLOCK_INDEX_H
#define ISOWAVE_BLOCK_INDEX_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

#define ISO_INDEX_BLOCKS 16u  ///< that share
#define ISO_INDEX_WORDS 10u   ///< so many words

/// The longest block, and so fifteen of them fit 16 bits: up to 15 bits before the planes (of a
/// reversible stream; else 9), 32 planes of 64 coefficients, of which each gets at most a bit in
/// every plane; a group test before each that becomes significant; and one at each plane's end.
#define ISO_MAX_BLOCK_BITS 2159u

/// Words of the index of so many blocks.
ISO_INLINE ulong block_index_words(ulong num_blocks) {
  return (num_blocks / ISO_INDEX_BLOCKS + 1u) * ISO_INDEX_WORDS;
}

/// The first bit of block block_id, or where the stream ends behind the last.
ISO_INLINE ulong block_begin(ISO_GLOBAL const uint *index, uint block_id) {
  ISO_GLOBAL const uint *group = index + (ulong)(block_id / ISO_INDEX_BLOCKS) * ISO_INDEX_WORDS;
  const uint pair = group[2u + block_id % ISO_INDEX_BLOCKS / 2u];
  return ((ulong)group[1] << 32 | group[0]) + (pair >> 16u * (block_id & 1u) & 0xFFFFu);
}

/// The entry of a block in a window: the whole word that the block begins with, and how many bits
/// before the next block are not this one's, 0 to 31. first_word: below 2^27.
ISO_INLINE uint window_entry(uint first_word, uint unused_bits) {
  return first_word << 5 | unused_bits;
}
ISO_INLINE uint entry_bit(uint entry) {
  return entry & ~31u;
}
ISO_INLINE uint entry_bits(uint entry, uint next_entry) {
  return entry_bit(next_entry) - entry_bit(entry) - (entry & 31u);
}

ISO_NAMESPACE_END

#endif
