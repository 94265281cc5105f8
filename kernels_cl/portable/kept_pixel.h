/// kept_pixel.h -- a smaller picture of the same frame stands in for a larger one. Portable: OpenCL
/// C 1.2 and C++.
#ifndef ISOWAVE_KEPT_PIXEL_H
#define ISOWAVE_KEPT_PIXEL_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

/// The pixel of the smaller picture at the same place as a pixel of the larger one. Both have the
/// same vertical field of view.
ISO_INLINE uint kept_pixel(const View *view, uint small_columns, uint small_rows, uint pixel) {
  const int width = (int)view->width, height = (int)view->height;
  const int small_width = (int)small_columns, small_height = (int)small_rows;
  const int column = (int)(pixel % view->width), row = (int)(pixel / view->width);
  /* Distances from the middle, in halves of a pixel of the one picture times the other's height. */
  const int x = (2 * column + 1 - width) * small_height + small_width * height;
  const int at = x / (2 * height);
  const int small_column = at < 0 ? 0 : at < small_width ? at : small_width - 1;
  const int small_row = (2 * row + 1) * small_height / (2 * height);
  return (uint)(small_row * small_width + small_column);
}

ISO_NAMESPACE_END

#endif
