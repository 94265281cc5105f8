/// store_pixels.h -- the bytes of a picture: a work-item stores four pixels, whose RGB is three
/// words. OpenCL C 1.2.
#ifndef ISOWAVE_STORE_PIXELS_H
#define ISOWAVE_STORE_PIXELS_H

#include "portable/shared_types.h"

#define ISO_PIXELS_OF_ITEM 4u

/// Stores pixels ISO_PIXELS_OF_ITEM * item and on.
///
/// rgba        [ISO_PIXELS_OF_ITEM] red in bits 0..7
/// with_alpha  0: RGB
/// image       words
ISO_INLINE void store_pixels(const uint *rgba, uint with_alpha, global uint *image, uint item) {
  if (with_alpha) {
    for (uint i = 0; i < ISO_PIXELS_OF_ITEM; ++i) image[4 * item + i] = rgba[i];
  } else {
    image[3 * item] = (rgba[0] & 0xffffffu) | rgba[1] << 24;
    image[3 * item + 1] = (rgba[1] >> 8 & 0xffffu) | rgba[2] << 16;
    image[3 * item + 2] = (rgba[2] >> 16 & 0xffu) | rgba[3] << 8;
  }
}

#endif
