/// raster.h -- which pixels' rays meet a triangle, and where. Portable: OpenCL C 1.2 and C++;
/// kernels and the scalar twin run these very lines.
///
/// View coordinates of a vector are (forward, right, up), as parts of the basis in View; a pixel's
/// ray, that of make_ray(), is (1, u, v) there. A pixel is covered if its ray meets the triangle:
/// so drawn meshes and raycast surfaces show the same rays.
///
/// The test is a ray's own [Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection"]:
/// seen along the ray, the corners are points of a plane, (right - u forward, up - v forward), and
/// the ray is its origin. A corner's point depends on its place and the ray alone, so all triangles
/// that share the corner see the same point. On which side of an edge the origin is, is decided
/// without error (side_of_edge()), and an edge belongs to both of its triangles. So no ray slips
/// between the triangles of a closed surface. If several are met, the nearest counts, and of
/// equally near ones the first of the mesh.
///
/// Nothing is projected through the eye, so nothing needs to be clipped before it: what is behind
/// the eye is met at a forward <= 0. Projected are only the corners, to find the pixels to ask.
#ifndef ISOWAVE_RASTER_H
#define ISOWAVE_RASTER_H

#include "block_cells.h"
#include "block_vertex.h"
#include "cell_intersect.h"

ISO_NAMESPACE_BEGIN

/// From index space to the picture.
typedef struct RasterView {
  float forward_x, forward_y, forward_z;  ///< rows of the inverse of the basis in View
  float right_x, right_y, right_z;
  float up_x, up_y, up_z;
  float border_u, border_v;         ///< no ray's |u| and |v| are larger
  float columns_per_u;              ///< columns, and rows, that u and v are a step of
  float centre_column, centre_row;  ///< where u = v = 0 [pixels]
  float margin;                     ///< how far rounding may move a corner in the picture [pixels]
} RasterView;
ISO_CHECK_SIZE(RasterView, 60);

/// Corners of a triangle, view coordinates from the eye.
typedef struct ViewTriangle {
  float forward[3], right[3], up[3];
} ViewTriangle;

/// u and v of the pixels of a column and of a row, as in make_ray().
ISO_INLINE float column_u(const FrameParams *frame, uint column) {
  return (float)(2 * (int)column + 1 - (int)frame->view.width) * frame->view.pixel_scale;
}
ISO_INLINE float row_v(const FrameParams *frame, uint row) {
  return (float)((int)frame->view.height - 1 - 2 * (int)row) * frame->view.pixel_scale;
}

/// One coordinate of a lattice point, minus the eye's: within an ulp. Depends on the point alone.
ISO_INLINE float lattice_minus_eye(uint steps, float eye) {
  const float n = (float)steps;
  return fma(n, ISO_VOXELS_PER_STEP_LOW, fma(n, ISO_VOXELS_PER_STEP, -eye));
}

/// vertices: the triangle's three.
ISO_INLINE ViewTriangle view_triangle(const FrameParams *frame, const RasterView *view,
                                      ISO_GLOBAL const BlockVertex *vertices) {
  const BlockCoords b = block_coords(frame, vertices[0].block_id);
  ViewTriangle triangle;
  int i;
  ISO_UNROLL
  for (i = 0; i < 3; ++i) {
    const LatticePoint p = lattice_point(b, vertices[i].steps);
    const float x = lattice_minus_eye(p.x, frame->view.eye_x),
                y = lattice_minus_eye(p.y, frame->view.eye_y),
                z = lattice_minus_eye(p.z, frame->view.eye_z);
    triangle.forward[i] = fma(view->forward_x, x, fma(view->forward_y, y, view->forward_z * z));
    triangle.right[i] = fma(view->right_x, x, fma(view->right_y, y, view->right_z * z));
    triangle.up[i] = fma(view->up_x, x, fma(view->up_y, y, view->up_z * z));
  }
  return triangle;
}

ISO_INLINE float larger(float a, float b) {
  return a > b ? a : b;
}
ISO_INLINE float smaller(float a, float b) {
  return a < b ? a : b;
}

/// Is a corner beyond the plane through the eye in which rays have their largest u, or v? With room
/// for rounding. side: right or up, or minus that for the plane of the least.
ISO_INLINE int is_beyond(float side, float forward, float border) {
  const float out = border * forward;
  return side - out > 0x1p-22f * (fabs(side) + fabs(out));
}
ISO_INLINE int all_beyond(const float *side, float sign, const float *forward, float border) {
  return is_beyond(sign * side[0], forward[0], border) &&
         is_beyond(sign * side[1], forward[1], border) &&
         is_beyond(sign * side[2], forward[2], border);
}

ISO_INLINE uint first_pixel(float at, uint count) {
  return at <= 0.0f ? 0u : (at >= (float)count ? count : (uint)ceil(at));
}
ISO_INLINE uint end_pixel(float at, uint count) {
  return at < 0.0f ? 0u : (at >= (float)count ? count : (uint)floor(at) + 1u);
}

/// The pixels whose rays may meet the triangle: those whose centres are in its bounding box, or no
/// more beside it than rounding can do. If the triangle crosses the plane of the eye, all pixels:
/// such a triangle is next to the eye, or beside the picture.
ISO_INLINE PixelBox triangle_box(const FrameParams *frame, const RasterView *view,
                                 const ViewTriangle *p) {
  const uint width = frame->view.width, height = frame->view.height;
  const float *f = p->forward;
  float u[3], v[3];
  PixelBox box = {0u, 0u, 0u, 0u};
  int i;
  if (larger(f[0], larger(f[1], f[2])) <= 0.0f || all_beyond(p->right, 1.0f, f, view->border_u) ||
      all_beyond(p->right, -1.0f, f, view->border_u) ||
      all_beyond(p->up, 1.0f, f, view->border_v) || all_beyond(p->up, -1.0f, f, view->border_v))
    return box;
  if (smaller(f[0], smaller(f[1], f[2])) <= 0.0f) {
    box.end_x = width;
    box.end_y = height;
    return box;
  }
  ISO_UNROLL
  for (i = 0; i < 3; ++i) {
    u[i] = fma(p->right[i] / f[i], view->columns_per_u, view->centre_column);
    v[i] = fma(-p->up[i] / f[i], view->columns_per_u, view->centre_row);
  }
  box.begin_x = first_pixel(smaller(u[0], smaller(u[1], u[2])) - view->margin, width);
  box.end_x = end_pixel(larger(u[0], larger(u[1], u[2])) + view->margin, width);
  box.begin_y = first_pixel(smaller(v[0], smaller(v[1], v[2])) - view->margin, height);
  box.end_y = end_pixel(larger(v[0], larger(v[1], v[2])) + view->margin, height);
  return box;
}

ISO_INLINE uint box_pixels(PixelBox box) {
  return box.begin_x < box.end_x && box.begin_y < box.end_y
             ? (box.end_x - box.begin_x) * (box.end_y - box.begin_y)
             : 0u;
}

/// a b - c d. Its sign is never wrong: products are taken exactly, as two floats. If their highs do
/// not differ, their lows do, or the result is 0. Swapping the products changes only the sign.
ISO_INLINE float side_of_edge(float a, float b, float c, float d) {
  const float ab = a * b, cd = c * d;
  return (ab - cd) + (fma(a, b, -ab) - fma(c, d, -cd));
}

/// The point where a ray meets a triangle.
typedef struct TriangleHit {
  float forward;
  float a, b, c;  ///< weights of the corners, 0 to 1
} TriangleHit;

/// Returns 0 if the ray (1, u, v) does not meet it, or runs along it.
ISO_INLINE int ray_meets_triangle(float u, float v, const ViewTriangle *p, TriangleHit *hit) {
  float x[3], y[3], sum;
  int i;
  ISO_UNROLL
  for (i = 0; i < 3; ++i) {
    x[i] = fma(-u, p->forward[i], p->right[i]);
    y[i] = fma(-v, p->forward[i], p->up[i]);
  }
  hit->a = side_of_edge(x[2], y[1], y[2], x[1]);
  hit->b = side_of_edge(x[0], y[2], y[0], x[2]);
  hit->c = side_of_edge(x[1], y[0], y[1], x[0]);
  if ((hit->a < 0.0f || hit->b < 0.0f || hit->c < 0.0f) &&
      (hit->a > 0.0f || hit->b > 0.0f || hit->c > 0.0f))
    return 0;
  sum = hit->a + hit->b + hit->c;
  if (sum == 0.0f) return 0;
  hit->a /= sum;
  hit->b /= sum;
  hit->c /= sum;
  hit->forward = fma(hit->a, p->forward[0], fma(hit->b, p->forward[1], hit->c * p->forward[2]));
  return hit->forward > 0.0f;
}

/// One axis of a hit, counted from the block's first voxel, becomes its place in a cell, 0 to 1.
/// last: of the block's cells. Returns the cell.
ISO_INLINE uint cell_of_steps(float steps, uint last, float *place) {
  const float voxels = steps * ISO_VOXELS_PER_STEP;
  const uint floor_cell = (uint)floor(voxels), cell = floor_cell < last ? floor_cell : last;
  const float x = voxels - (float)cell;
  *place = x >= 1.0f ? 1.0f : x;
  return cell;
}

/// The last cell along an axis of block b, of a domain of `dim` voxels.
ISO_INLINE uint last_cell(uint b, uint dim) {
  const uint last = dim - 2u - 4u * b;
  return last < 3u ? last : 3u;
}

/// The hit of a ray that meets the triangle. Its gradient is the triangle's normal, towards larger
/// values: a direction alone, of any length.
///
/// vertices: the triangle's three; u, v: the ray
ISO_INLINE HitRecord triangle_hit(const FrameParams *frame, ISO_GLOBAL const BlockVertex *vertices,
                                  float u, float v, TriangleHit at) {
  const uint block_id = vertices[0].block_id;
  const BlockCoords b = block_coords(frame, block_id), zero = {0u, 0u, 0u};
  const LatticePoint p = lattice_point(zero, vertices[0].steps),
                     q = lattice_point(zero, vertices[1].steps),
                     r = lattice_point(zero, vertices[2].steps);
  /* Whole numbers below 2^10, their products below 2^21: all exact. */
  const float qx = (float)q.x - (float)p.x, qy = (float)q.y - (float)p.y,
              qz = (float)q.z - (float)p.z, rx = (float)r.x - (float)p.x,
              ry = (float)r.y - (float)p.y, rz = (float)r.z - (float)p.z;
  HitRecord hit;
  hit.t = at.forward * sqrt(fma(u, u, fma(v, v, 1.0f))) * frame->view.t_scale;
  hit.block_id = block_id;
  hit.cell = cell_of_steps(fma(at.a, (float)p.x, fma(at.b, (float)q.x, at.c * (float)r.x)),
                           last_cell(b.x, frame->grid.dims_x), &hit.x);
  hit.cell += 4u * cell_of_steps(fma(at.a, (float)p.y, fma(at.b, (float)q.y, at.c * (float)r.y)),
                                 last_cell(b.y, frame->grid.dims_y), &hit.y);
  hit.cell += 16u * cell_of_steps(fma(at.a, (float)p.z, fma(at.b, (float)q.z, at.c * (float)r.z)),
                                  last_cell(b.z, frame->grid.dims_z), &hit.z);
  hit.grad_x = without_zero_sign(qz * ry - qy * rz);
  hit.grad_y = without_zero_sign(qx * rz - qz * rx);
  hit.grad_z = without_zero_sign(qy * rx - qx * ry);
  return hit;
}

/// Order of distances, for atomic_min: that of positive float32 is that of their bits.
#define ISO_NO_DEPTH 0x7F800000u /* INFINITY */

ISO_NAMESPACE_END

#endif
