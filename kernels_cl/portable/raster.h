/// raster.h -- which pixels' rays meet a triangle, and where. Portable: OpenCL C 1.2 and C++;
/// kernels and the scalar twin run these very lines.
///
/// A pixel is covered if its ray, that of make_ray(), meets the triangle: so drawn meshes and
/// raycast surfaces show the same rays. What is decided in the picture is only where to look
/// (triangle_box()), with room for all rounding.
///
/// The test [Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection"]: seen along the
/// ray, the corners are points of a plane, and the ray is its origin. A corner's point depends on
/// ray and corner alone, so all triangles that share the corner see the same point. On which side
/// of an edge the origin is, is decided without error (side_of_edge()), and an edge belongs to both
/// of its triangles. So no ray slips between the triangles of a closed surface. Where several are
/// met, the nearest counts, and of equally near ones the first of the mesh.
///
/// Nothing is projected through the eye, so nothing needs to be clipped before it: what is behind
/// the eye is met at t <= 0.
#ifndef ISOWAVE_RASTER_H
#define ISOWAVE_RASTER_H

#include "block_cells.h"
#include "block_vertex.h"
#include "cell_intersect.h"

ISO_NAMESPACE_BEGIN

/// From index space to the picture. View coordinates of a vector v: v = forward fwd + right right +
/// up up, of the basis in View; a ray has (1, u, v).
typedef struct RasterView {
  float forward_x, forward_y, forward_z;  ///< rows of the inverse of that basis
  float right_x, right_y, right_z;
  float up_x, up_y, up_z;
  float border_u, border_v;         ///< no ray's u and v are larger, however they are rounded
  float columns_per_u;              ///< columns, and rows, that u and v are a step of
  float centre_column, centre_row;  ///< where u = v = 0 [pixels]
  float margin_x, margin_y;         ///< how far rounding may move a ray [pixels]
  float doubt;  ///< how far rounding may move view coordinates, and a corner as the test sees it,
                ///< as a part of the corner's largest coordinate
} RasterView;
ISO_CHECK_SIZE(RasterView, 68);

/// Corners minus the eye, index space.
typedef struct EyeTriangle {
  float x[3], y[3], z[3];
} EyeTriangle;

/// One coordinate of a lattice point, minus the eye's. Depends on the point alone.
ISO_INLINE float lattice_minus_eye(uint steps, float eye) {
  const float n = (float)steps;
  return fma(n, ISO_VOXELS_PER_STEP_LOW, fma(n, ISO_VOXELS_PER_STEP, -eye));
}

/// vertices: the triangle's three.
ISO_INLINE EyeTriangle eye_triangle(const FrameParams *frame,
                                    ISO_GLOBAL const BlockVertex *vertices) {
  const BlockCoords b = block_coords(frame, vertices[0].block_id);
  EyeTriangle triangle;
  int i;
  ISO_UNROLL
  for (i = 0; i < 3; ++i) {
    const LatticePoint p = lattice_point(b, vertices[i].steps);
    triangle.x[i] = lattice_minus_eye(p.x, frame->view.eye_x);
    triangle.y[i] = lattice_minus_eye(p.y, frame->view.eye_y);
    triangle.z[i] = lattice_minus_eye(p.z, frame->view.eye_z);
  }
  return triangle;
}

ISO_INLINE float larger(float a, float b) {
  return a > b ? a : b;
}
ISO_INLINE float smaller(float a, float b) {
  return a < b ? a : b;
}

/// Are all three beyond the plane through the eye in which rays have their largest u or v?
ISO_INLINE int all_beyond(const float *side, const float *forward, float border, float doubt) {
  const float limit = doubt * (1.0f + border);
  return side[0] - border * forward[0] > limit && side[1] - border * forward[1] > limit &&
         side[2] - border * forward[2] > limit;
}
ISO_INLINE int all_before(const float *side, const float *forward, float border, float doubt) {
  const float limit = doubt * (1.0f + border);
  return -side[0] - border * forward[0] > limit && -side[1] - border * forward[1] > limit &&
         -side[2] - border * forward[2] > limit;
}

ISO_INLINE uint first_pixel(float at, uint count) {
  return at <= 0.0f ? 0u : (at >= (float)count ? count : (uint)ceil(at));
}
ISO_INLINE uint end_pixel(float at, uint count) {
  return at < 0.0f ? 0u : (at >= (float)count ? count : (uint)floor(at) + 1u);
}

/// The pixels whose rays may meet the triangle: those whose centres are in its bounding box, or no
/// more beside it than rounding can do. All of the picture where the triangle comes too near to the
/// plane of the eye; only triangles next to the eye do that without being beside the picture.
ISO_INLINE PixelBox triangle_box(const FrameParams *frame, const RasterView *view,
                                 const EyeTriangle *p) {
  const uint width = frame->view.width, height = frame->view.height;
  float forward[3], right[3], up[3], largest = 0.0f, doubt, nearest, farthest;
  float min_u, max_u, min_v, max_v;
  PixelBox box = {0u, 0u, 0u, 0u};
  int i;
  ISO_UNROLL
  for (i = 0; i < 3; ++i) {
    forward[i] =
        fma(view->forward_x, p->x[i], fma(view->forward_y, p->y[i], view->forward_z * p->z[i]));
    right[i] = fma(view->right_x, p->x[i], fma(view->right_y, p->y[i], view->right_z * p->z[i]));
    up[i] = fma(view->up_x, p->x[i], fma(view->up_y, p->y[i], view->up_z * p->z[i]));
    largest = larger(largest, larger(fabs(p->x[i]), larger(fabs(p->y[i]), fabs(p->z[i]))));
  }
  doubt = view->doubt * largest;
  nearest = smaller(forward[0], smaller(forward[1], forward[2]));
  farthest = larger(forward[0], larger(forward[1], forward[2]));
  if (farthest < -doubt || all_beyond(right, forward, view->border_u, doubt) ||
      all_before(right, forward, view->border_u, doubt) ||
      all_beyond(up, forward, view->border_v, doubt) ||
      all_before(up, forward, view->border_v, doubt))
    return box;
  if (!(nearest > 128.0f * doubt)) {
    box.end_x = width;
    box.end_y = height;
    return box;
  }
  min_u = min_v = INFINITY;
  max_u = max_v = -INFINITY;
  ISO_UNROLL
  for (i = 0; i < 3; ++i) {
    const float inverse = 1.0f / forward[i], u = right[i] * inverse, v = up[i] * inverse;
    /* (right +- doubt) / (forward +- doubt), where doubt is below forward / 128 */
    const float off = 1.02f * doubt * inverse;
    min_u = smaller(min_u, u - off * (1.0f + fabs(u)));
    max_u = larger(max_u, u + off * (1.0f + fabs(u)));
    min_v = smaller(min_v, v - off * (1.0f + fabs(v)));
    max_v = larger(max_v, v + off * (1.0f + fabs(v)));
  }
  box.begin_x =
      first_pixel(fma(min_u, view->columns_per_u, view->centre_column) - view->margin_x, width);
  box.end_x =
      end_pixel(fma(max_u, view->columns_per_u, view->centre_column) + view->margin_x, width);
  box.begin_y =
      first_pixel(fma(-max_v, view->columns_per_u, view->centre_row) - view->margin_y, height);
  box.end_y =
      end_pixel(fma(-min_v, view->columns_per_u, view->centre_row) + view->margin_y, height);
  return box;
}

ISO_INLINE uint box_pixels(PixelBox box) {
  return box.begin_x < box.end_x && box.begin_y < box.end_y
             ? (box.end_x - box.begin_x) * (box.end_y - box.begin_y)
             : 0u;
}

/// Pixel i of a box of at least one.
ISO_INLINE uint box_pixel(const FrameParams *frame, PixelBox box, uint i) {
  const uint columns = box.end_x - box.begin_x;
  return box.begin_x + i % columns + frame->view.width * (box.begin_y + i / columns);
}

/// a b - c d. Its sign is never the wrong one: products are taken exactly, as two floats, and where
/// the highs do not differ, the lows do, or it is 0. Swapping the products changes the sign alone.
ISO_INLINE float side_of_edge(float a, float b, float c, float d) {
  const float ab = a * b, cd = c * d;
  return (ab - cd) + (fma(a, b, -ab) - fma(c, d, -cd));
}

/// Where a ray meets a triangle.
typedef struct TriangleHit {
  float t;
  float a, b, c;  ///< weights of the corners, 0 to 1
} TriangleHit;

/// Returns 0 if the ray does not meet it, or runs along it.
ISO_INLINE int ray_meets_triangle(const Ray *ray, const EyeTriangle *p, TriangleHit *hit) {
  /* The axis along which the ray is longest is the third here, which keeps the others finite. */
  const float dx = fabs(ray->x.d), dy = fabs(ray->y.d), dz = fabs(ray->z.d);
  const int axis = dx >= dy ? (dx >= dz ? 0 : 2) : (dy >= dz ? 1 : 2);
  const float inverse = axis == 0 ? ray->x.inv_d.hi : axis == 1 ? ray->y.inv_d.hi : ray->z.inv_d.hi;
  const float slope_u = (axis == 0 ? ray->y.d : ray->x.d) * inverse,
              slope_v = (axis == 2 ? ray->y.d : ray->z.d) * inverse;
  float u[3], v[3], w[3], sum;
  int i;
  ISO_UNROLL
  for (i = 0; i < 3; ++i) {
    w[i] = axis == 0 ? p->x[i] : axis == 1 ? p->y[i] : p->z[i];
    u[i] = fma(-slope_u, w[i], axis == 0 ? p->y[i] : p->x[i]);
    v[i] = fma(-slope_v, w[i], axis == 2 ? p->y[i] : p->z[i]);
  }
  hit->a = side_of_edge(u[2], v[1], v[2], u[1]);
  hit->b = side_of_edge(u[0], v[2], v[0], u[2]);
  hit->c = side_of_edge(u[1], v[0], v[1], u[0]);
  if ((hit->a < 0.0f || hit->b < 0.0f || hit->c < 0.0f) &&
      (hit->a > 0.0f || hit->b > 0.0f || hit->c > 0.0f))
    return 0;
  sum = hit->a + hit->b + hit->c;
  if (sum == 0.0f) return 0;
  hit->a /= sum;
  hit->b /= sum;
  hit->c /= sum;
  hit->t = fma(hit->a, w[0], fma(hit->b, w[1], hit->c * w[2])) * inverse;
  return hit->t > 0.0f;
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
/// vertices: the triangle's three.
ISO_INLINE HitRecord triangle_hit(const FrameParams *frame, ISO_GLOBAL const BlockVertex *vertices,
                                  TriangleHit at) {
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
  hit.t = at.t * frame->view.t_scale;
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
