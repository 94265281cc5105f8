/// touched_blocks.h -- which blocks a ray needs to cross one block's dual cells.
///
/// Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_TOUCHED_BLOCKS_H
#define ISOWAVE_TOUCHED_BLOCKS_H

#include "grid_dda.h"

ISO_NAMESPACE_BEGIN

/// A ray's way through a block along one axis: does it cross cells of the block's fourth layer,
/// which have voxels of the neighbour at +axis? The ray is in that layer after it crosses the
/// layer's first plane, or until then, as its direction is.
typedef struct LastLayer {
  RayEvent plane;
  int after;   ///< the plane, or before it
  int always;  ///< the ray crosses no plane of the axis
  int crossed;
} LastLayer;

ISO_INLINE LastLayer last_layer(RayAxis a, int axis, int plane, int last_plane, RayEvent enter,
                                RayEvent exit) {
  LastLayer layer;
  layer.plane = make_event(plane_t(a, whole_plane(a, plane)), axis);
  layer.after = a.d > 0.0f;
  layer.always = a.d == 0.0f;
  layer.crossed = layer.always  ? plane < last_plane && a.o >= whole_plane(a, plane)
                  : layer.after ? event_before(layer.plane, exit)
                                : event_before(enter, layer.plane);
  return layer;
}

/// Is the ray in both layers at once? Both reach to the block's exit, or both to its entry, unless
/// one is after its plane and the other before.
ISO_INLINE int in_both(LastLayer a, LastLayer b) {
  const int overlap = a.always || b.always || a.after == b.after ||
                      (a.after ? event_before(a.plane, b.plane) : event_before(b.plane, a.plane));
  return a.crossed && b.crossed && overlap;
}

/// The corners (bits 0..7, corner x + 2y + 4z) of the dual grid of block (x,y,z) whose voxels the
/// cells that the ray crosses in the block have. No cell need be walked: if any two of three spans
/// overlap, all three do.
ISO_LONG uint touched_blocks(const Ray *r, int x, int y, int z, LastPlanes last) {
  const RayEvent enter = region_entry(r, x, y, z, 4, last);
  const GridWalk block = walk_from(r, x, y, z, 4, last);
  const RayEvent exit = walk_exit(&block, r);
  const LastLayer in_x = last_layer(r->x, 0, 4 * x + 3, last.x, enter, exit),
                  in_y = last_layer(r->y, 1, 4 * y + 3, last.y, enter, exit),
                  in_z = last_layer(r->z, 2, 4 * z + 3, last.z, enter, exit);
  const uint xy = (uint)in_both(in_x, in_y), xz = (uint)in_both(in_x, in_z),
             yz = (uint)in_both(in_y, in_z);
  return 1u | (uint)in_x.crossed << 1 | (uint)in_y.crossed << 2 | xy << 3 |
         (uint)in_z.crossed << 4 | xz << 5 | yz << 6 | (xy & xz & yz) << 7;
}

ISO_NAMESPACE_END

#endif
