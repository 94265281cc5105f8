/// block_bound.h -- how far the field of a level of detail may be from the volume that it stands
/// for, block by block, in 8 bits (core/zfp/level_bounds.hpp), and voxel by voxel what follows from
/// that. Portable: OpenCL C 1.2 and C++.
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

/// zfp is not as far off everywhere in a block. Bit planes left out of negabinary coefficients
/// leave errors whose mean is not 0; at voxel (1,1,1), where all basis functions are positive, they
/// add up, and on the lines through it along the axes, at voxel (2,2,2) and at corners a little. Of
/// a block's bound, voxels of the finest level have these shares, and the bound is made so that no
/// voxel exceeds its own: what they are decides how tight it is, never whether it holds. Files name
/// the number of this rule.
#define ISO_BOUND_PLACES 3u
#define ISO_BOUND_PLACES_RULE 2u

/// 0: most voxels; 1: those little ones; 2: voxel (1,1,1). voxel: x + 4 y + 16 z.
ISO_INLINE uint bound_place(uint voxel) {
  const uint x = voxel & 3u, y = voxel >> 2 & 3u, z = voxel >> 4;
  const uint ones = (uint)(x == 1u) + (uint)(y == 1u) + (uint)(z == 1u);
  const int is_corner = x % 3u == 0u && y % 3u == 0u && z % 3u == 0u;
  if (ones == 3u) return 2u;
  return ones == 2u || is_corner || (x == 2u && y == 2u && z == 2u) ? 1u : 0u;
}

ISO_INLINE float bound_share(uint place) {
  return place == 0u ? 0.5625f : place == 1u ? 0.625f : 1.0f;
}

ISO_NAMESPACE_END

#endif
