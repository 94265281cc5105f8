/// block_bound.h -- how far the field of a level of detail may be from the volume that it stands for, block by block, in 8 bits
/// (core/level_bounds.hpp). Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_BLOCK_BOUND_H
#define ISOWAVE_BLOCK_BOUND_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

#define ISO_BOUND_CODES 256u
#define ISO_BOUND_MAX 507904.0f  ///< of the last code

/// 0..15, then 16 steps for each doubling; exact.
ISO_INLINE float block_bound(uint code) {
  const uint steps = code & 15u, doublings = code >> 4;
  return (float)(doublings == 0u ? steps : (16u + steps) << (doublings - 1u));
}

/// The code of a block, of codes packed four to a word.
ISO_INLINE uint packed_bound_code(ISO_GLOBAL const uint *codes, uint block) {
  return codes[block / 4u] >> (8u * (block & 3u)) & 0xFFu;
}

ISO_NAMESPACE_END

#endif
