/// rasterise.cl -- triangles -> hit buffer.
///
///   raster_clear -> [ raster_part for depth -> raster_part for triangle -> raster_hits ]*
///
/// A mesh may come in parts. For each part, the first turn finds each pixel's least distance
/// (atomic_min), the second the first triangle that has it (atomic_min), and the third makes hits
/// of these. No outcome depends on the order in which work-items run, nor on how a mesh is cut: of
/// equally near triangles the earlier part's stays.
#include "device/work_group.h"
#include "portable/raster.h"

#define DEPTH_TURN 0u
#define TRIANGLE_TURN 1u

/// Pixels of a box that a work-item looks at alone; larger ones are shared by the work-group ...
#define ALONE 32u
/// ... and those beyond this by all, as far as their list reaches.
#define SHARED 4096u

/// Begins a picture without a hit.
///
/// Launch  grid-stride over pixels
kernel void raster_clear(const FrameParams frame_params, global uint *depth, global uint *triangles,
                         global HitRecord *hits) {
  const uint count = frame_params.view.width * frame_params.view.height;
  for (uint pixel = get_global_id(0); pixel < count; pixel += get_global_size(0)) {
    depth[pixel] = ISO_NO_DEPTH;
    triangles[pixel] = ISO_INVALID_ID;
    hits[pixel] = no_hit();
  }
}

/// One pixel's turn with one triangle.
ISO_INLINE void offer(const FrameParams *frame, const ViewTriangle *corners, uint triangle,
                      uint column, uint row, uint turn, volatile global uint *depth,
                      volatile global uint *triangles) {
  const uint pixel = column + frame->view.width * row;
  TriangleHit hit;
  if (!ray_meets_triangle(column_u(frame, column), row_v(frame, row), corners, &hit)) return;
  if (turn == DEPTH_TURN) {
    atomic_min(&depth[pixel], as_uint(hit.forward));
  } else if (depth[pixel] == as_uint(hit.forward)) {
    atomic_min(&triangles[pixel], triangle);
  }
}

/// The turn of every step-th pixel of the triangle's box, from pixel `first` on.
ISO_INLINE void offer_some(const FrameParams *frame, const RasterView *view,
                           global const BlockVertex *vertices, uint triangle, uint first, uint step,
                           uint turn, volatile global uint *depth,
                           volatile global uint *triangles) {
  const ViewTriangle corners = view_triangle(frame, view, vertices + 3 * (ulong)triangle);
  const PixelBox box = triangle_box(frame, view, &corners);
  const uint pixels = box_pixels(box), columns = box.end_x - box.begin_x;
  for (uint i = first; i < pixels; i += step)
    offer(frame, &corners, triangle, box.begin_x + i % columns, box.begin_y + i / columns, turn,
          depth, triangles);
}

/// Triangles [0, count) of a part.
///
/// turn  DEPTH_TURN or TRIANGLE_TURN
/// In    vertices [3 * count]; TRIANGLE_TURN: depth, of DEPTH_TURN
/// Out   depth or triangles [pixel]; listed [1 + capacity]: how many triangles are left to
///       raster_listed, then these; listed[0] must be 0, and may come to exceed capacity
/// Launch  groups of ISO_GROUP_SIZE, which stride over as many triangles
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void raster_part(
    const FrameParams frame_params, const RasterView view, uint count, uint turn,
    global const BlockVertex *vertices, global uint *depth, global uint *triangles, uint capacity,
    volatile global uint *listed) {
  const FrameParams *frame = &frame_params;
  local uint large[ISO_GROUP_SIZE], num_large;
  const uint item = get_local_id(0);
  for (uint first = get_group_id(0) * ISO_GROUP_SIZE; first < count;
       first += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint triangle = first + item;
    if (item == 0) num_large = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (triangle < count) {
      const ViewTriangle corners = view_triangle(frame, &view, vertices + 3 * (ulong)triangle);
      const PixelBox box = triangle_box(frame, &view, &corners);
      const uint pixels = box_pixels(box);
      uint place = capacity;
      if (pixels > SHARED) place = atomic_inc(&listed[0]);
      if (place < capacity) {
        listed[1 + place] = triangle;
      } else if (pixels > ALONE) {
        large[atomic_inc(&num_large)] = triangle;
      } else {
        for (uint row = box.begin_y; row < box.end_y; ++row) {
          for (uint column = box.begin_x; column < box.end_x; ++column)
            offer(frame, &corners, triangle, column, row, turn, depth, triangles);
        }
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint num = num_large;
    for (uint k = 0; k < num; ++k)
      offer_some(frame, &view, vertices, large[k], item, ISO_GROUP_SIZE, turn, depth, triangles);
    barrier(CLK_LOCAL_MEM_FENCE); /* all have read num_large */
  }
}

/// The triangles that raster_part has left: each is shared by all work-items.
///
/// Launch  grid-stride over pixels
kernel void raster_listed(const FrameParams frame_params, const RasterView view, uint turn,
                          global const BlockVertex *vertices, global uint *depth,
                          global uint *triangles, uint capacity, global const uint *listed) {
  const FrameParams *frame = &frame_params;
  const uint num = min(listed[0], capacity);
  for (uint k = 0; k < num; ++k)
    offer_some(frame, &view, vertices, listed[1 + k], get_global_id(0), get_global_size(0), turn,
               depth, triangles);
}

/// Hits of the pixels for which the part has a nearer triangle than the parts before; no triangle
/// afterwards, for the next part.
///
/// In      vertices of the part; triangles [pixel]
/// Out     hits [pixel]
/// Launch  grid-stride over pixels
kernel void raster_hits(const FrameParams frame_params, const RasterView view,
                        global const BlockVertex *vertices, global uint *triangles,
                        global HitRecord *hits) {
  const FrameParams *frame = &frame_params;
  const uint width = frame->view.width, count = width * frame->view.height;
  for (uint pixel = get_global_id(0); pixel < count; pixel += get_global_size(0)) {
    const uint triangle = triangles[pixel];
    if (triangle == ISO_INVALID_ID) continue;
    global const BlockVertex *own = vertices + 3 * (ulong)triangle;
    const ViewTriangle corners = view_triangle(frame, &view, own);
    const float u = column_u(frame, pixel % width), v = row_v(frame, pixel / width);
    TriangleHit at;
    if (ray_meets_triangle(u, v, &corners, &at)) {
      const HitRecord hit = triangle_hit(frame, own, u, v, at);
      if (hit.t < hits[pixel].t) hits[pixel] = hit;
    }
    triangles[pixel] = ISO_INVALID_ID;
  }
}
