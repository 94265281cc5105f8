/// level_border.h -- a ray at the borders between levels of detail (core/view/detail.hpp).
/// Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_LEVEL_BORDER_H
#define ISOWAVE_LEVEL_BORDER_H

#include "block_grid.h"
#include "grid_dda.h"

ISO_NAMESPACE_BEGIN

/// Is `exit`, the crossing of a plane, behind the border at t?
ISO_INLINE int passes_border(RayEvent exit, float t) {
  return exit.t.hi >= t && (exit.t.hi > t || exit.t.lo > 0.0f);
}

/// Does the ray reach the border at t within the domain?
ISO_INLINE int reaches_border(const Ray *ray, LastPlanes last, float t) {
  RayEvent enter = border_event(t), exit = border_event(INFINITY);
  LastPlanes zero;
  zero.x = zero.y = zero.z = 0;
  return clip_to_box(ray, zero, last, &enter, &exit) && enter.axis == ISO_AXIS_START;
}

/// The cell, or for size 4 the block, that a ray is in just behind a border that it reaches.
ISO_INLINE BlockCoords region_at_border(const Ray *ray, LastPlanes last, float t, int size) {
  const RayEvent border = border_event(t);
  BlockCoords b;
  b.x = (uint)locate(ray->x, 0, border, size, 0, (last.x - 1) / size);
  b.y = (uint)locate(ray->y, 1, border, size, 0, (last.y - 1) / size);
  b.z = (uint)locate(ray->z, 2, border, size, 0, (last.z - 1) / size);
  return b;
}

ISO_NAMESPACE_END

#endif
