/// touched_blocks.h -- which blocks a ray needs to cross one block's dual cells.
///
/// Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_TOUCHED_BLOCKS_H
#define ISOWAVE_TOUCHED_BLOCKS_H

#include "grid_dda.h"

ISO_NAMESPACE_BEGIN

/// From one event up to the next.
typedef struct RaySpan {
  RayEvent begin, end;
} RaySpan;

ISO_INLINE RaySpan common_span(RaySpan a, RaySpan b) {
  RaySpan both;
  both.begin = event_before(a.begin, b.begin) ? b.begin : a.begin;
  both.end = event_before(a.end, b.end) ? a.end : b.end;
  return both;
}

/// Narrows a span in a region that ends at plane `end` to where the ray is between planes begin and end of this axis.
ISO_INLINE RaySpan span_between(RaySpan span, RayAxis a, int axis, int begin, int end) {
  RaySpan slab;      /* not span itself: rusticl changes the caller's struct with a parameter */
  if (a.d == 0.0f) { /* within a plane: in the region after it, or in the domain's last */
    slab.begin = span.begin;
    slab.end = begin >= end || a.o < (float)begin ? span.begin : span.end;
    return slab;
  }
  slab.begin = make_event(plane_t(a, (float)(a.d > 0.0f ? begin : end)), axis);
  slab.end = make_event(plane_t(a, (float)(a.d > 0.0f ? end : begin)), axis);
  return common_span(span, slab);
}

/// The corners (bits 0..7, corner x + 2y + 4z) of the dual grid of block (x,y,z) whose voxels the cells that the ray crosses
/// in the block have. A cell has voxels of the neighbour at +x where it is the block's fourth along x. A ray is in that layer
/// from one event to another; so it is in several layers at once where those spans overlap, and no cell need be walked.
ISO_INLINE uint touched_blocks(const Ray *r, int x, int y, int z, LastPlanes last) {
  RaySpan in_block, in_x, in_y, in_z, in_xy;
  uint touched = 1u;
  in_block.begin = region_entry(r, x, y, z, 4, last);
  {
    const GridWalk block = walk_from(r, x, y, z, 4, last);
    in_block.end = walk_exit(&block, r);
  }
  in_x = span_between(in_block, r->x, 0, 4 * x + 3, 4 * x + 4 > last.x ? last.x : 4 * x + 4);
  in_y = span_between(in_block, r->y, 1, 4 * y + 3, 4 * y + 4 > last.y ? last.y : 4 * y + 4);
  in_z = span_between(in_block, r->z, 2, 4 * z + 3, 4 * z + 4 > last.z ? last.z : 4 * z + 4);
  in_xy = common_span(in_x, in_y);
#define ISO_SPAN_BIT(span, bit) (event_before((span).begin, (span).end) ? 1u << (bit) : 0u)
  touched |= ISO_SPAN_BIT(in_x, 1) | ISO_SPAN_BIT(in_y, 2) | ISO_SPAN_BIT(in_xy, 3) | ISO_SPAN_BIT(in_z, 4);
  in_x = common_span(in_x, in_z);
  in_y = common_span(in_y, in_z);
  in_xy = common_span(in_xy, in_z);
  touched |= ISO_SPAN_BIT(in_x, 5) | ISO_SPAN_BIT(in_y, 6) | ISO_SPAN_BIT(in_xy, 7);
#undef ISO_SPAN_BIT
  return touched;
}

ISO_NAMESPACE_END

#endif
