/// slot_values.h -- the type of the values in cache slots. OpenCL C 1.2.
///
/// ISO_SLOT_VALUE, ISO_SLOT_BITS, by -D (core/stages/slot_type.hpp): the type, and its bits. A
/// volume that has only the values of a short integer type is cached as that type, and read from
/// the cache as float. With ISO_LABELS a value is a bit mask of groups (portable/label_table.h).
#ifndef ISOWAVE_SLOT_VALUES_H
#define ISOWAVE_SLOT_VALUES_H

#include "portable/label_table.h"

#ifndef ISO_SLOT_VALUE
#define ISO_SLOT_VALUE float
#define ISO_SLOT_BITS 32u
#endif

typedef ISO_SLOT_VALUE SlotValue;

/// A slot in words.
#define ISO_SLOT_WORDS (ISO_BLOCK_VOXELS * ISO_SLOT_BITS / 32u)

/// The field's value in a voxel that has this value in its slot.
ISO_INLINE float field_of_slot(const FrameParams *frame, float value) {
  return ISO_LABELS ? group_field((uint)value, frame->surface.isovalue_index) : value;
}

/// Word w of a slot with these values.
ISO_INLINE uint slot_word(const float *values, uint w) {
#if ISO_SLOT_BITS == 32u
  return as_uint(values[w]);
#else
  const uint in_word = 32u / ISO_SLOT_BITS;
  uint word = 0;
  ISO_UNROLL
  for (uint i = 0; i < in_word; ++i)
    word |= ((uint)(int)values[in_word * w + i] & ((1u << ISO_SLOT_BITS) - 1u))
            << (i * ISO_SLOT_BITS);
  return word;
#endif
}

#endif
