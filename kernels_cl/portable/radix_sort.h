/// radix_sort.h -- what core/radix_sort and radix_sort.cl must agree on.
#ifndef ISOWAVE_RADIX_SORT_H
#define ISOWAVE_RADIX_SORT_H

#include "shared_types.h"

/// Most key bits per pass: 1 to 9. Local memory per work-group is 4 bytes for each pair of a tile
/// and, for each of the 2^bits digits, 8 bytes and ISO_RADIX_ROUND / 8 more; 9 are too many for
/// groups of 256.
#define ISO_RADIX_BITS 6u
#define ISO_RADIX_DIGITS (1u << ISO_RADIX_BITS)
#define ISO_RADIX_ITEMS (16u * ISO_GROUP_SHARE)  ///< pairs per work-item and tile: a power of two
#define ISO_RADIX_ROUND 128u  ///< pairs that a work-group ranks together: a power of two from 32

#endif
