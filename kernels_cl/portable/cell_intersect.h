/// cell_intersect.h -- the first crossing of a ray and the isosurface inside one dual cell (Sec.
/// 3.7).
///
/// Portable: OpenCL C 1.2 and C++; kernels and the scalar twin run these very lines.
///
/// inside := field >= isovalue, on w = voxel - isovalue: inside := w >= 0. A hit is the first
/// change of inside along the ray. Between entry pa and exit pb (cell-local [0,1]^3) the field is a
/// cubic in s; its Bernstein coefficients are values of the trilinear form at mixed coordinates of
/// pa and pb [Ramshaw 1987, blossoms], hence convex combinations of corners:
///   b0 = f(a,a,a)    b1 = (f(b,a,a) + f(a,b,a) + f(a,a,b)) / 3
///   b3 = f(b,b,b)    b2 = (f(b,b,a) + f(b,a,b) + f(a,b,b)) / 3
/// b0 and b3 lie on cell faces. There one coordinate is exactly 0 or 1 and lerp() returns its end
/// exactly, so the two cells of a face compute the same bits: a ray cannot slip between them.
/// lerp() also keeps signs (two ends < 0 give < 0, two ends >= 0 give >= 0), which is what clamping
/// the face's value to its corners' range would be for: cells and blocks whose corners agree in
/// sign can be skipped without changing any hit.
#ifndef ISOWAVE_CELL_INTERSECT_H
#define ISOWAVE_CELL_INTERSECT_H

#include "block_grid.h"
#include "grid_dda.h"
#include "no_data.h"
#include "solver.h"

ISO_NAMESPACE_BEGIN

/// Position in a cell, [0,1]^3.
typedef struct CellPoint {
  float x, y, z;
} CellPoint;

/// Position of the ray at `e` in cell (x,y,z). On the axis of the event it is exactly the face's 0
/// or 1. leaving: 0 when `e` enters the cell, 1 when it leaves it.
ISO_INLINE CellPoint event_position(const Ray *r, RayEvent e, int x, int y, int z, int leaving) {
  CellPoint p;
  p.x = e.axis == 0 ? ((r->x.d > 0.0f) == leaving ? 1.0f : 0.0f) : local_position(r->x, e.t, x);
  p.y = e.axis == 1 ? ((r->y.d > 0.0f) == leaving ? 1.0f : 0.0f) : local_position(r->y, e.t, y);
  p.z = e.axis == 2 ? ((r->z.d > 0.0f) == leaving ? 1.0f : 0.0f) : local_position(r->z, e.t, z);
  return p;
}

/// w [8]: corner x + 2y + 4z minus the isovalue.
ISO_INLINE Cubic segment_cubic(const float *w, CellPoint a, CellPoint b) {
  /* Names: axis values already fixed, in the order x, y, z; digit: corner along y, z. */
  const float a00 = lerp(a.x, w[0], w[1]), a10 = lerp(a.x, w[2], w[3]);
  const float a01 = lerp(a.x, w[4], w[5]), a11 = lerp(a.x, w[6], w[7]);
  const float b00 = lerp(b.x, w[0], w[1]), b10 = lerp(b.x, w[2], w[3]);
  const float b01 = lerp(b.x, w[4], w[5]), b11 = lerp(b.x, w[6], w[7]);
  const float aa0 = lerp(a.y, a00, a10), aa1 = lerp(a.y, a01, a11);
  const float ab0 = lerp(b.y, a00, a10), ab1 = lerp(b.y, a01, a11);
  const float ba0 = lerp(a.y, b00, b10), ba1 = lerp(a.y, b01, b11);
  const float bb0 = lerp(b.y, b00, b10), bb1 = lerp(b.y, b01, b11);
  const float third = 1.0f / 3.0f;
  Cubic c;
  c.b0 = lerp(a.z, aa0, aa1);
  c.b1 = (lerp(a.z, ba0, ba1) + lerp(a.z, ab0, ab1) + lerp(b.z, aa0, aa1)) * third;
  c.b2 = (lerp(a.z, bb0, bb1) + lerp(b.z, ba0, ba1) + lerp(b.z, ab0, ab1)) * third;
  c.b3 = lerp(b.z, bb0, bb1);
  return c;
}

/// Is the ray inside at `e`, by which it enters or leaves cell (x,y,z)? As the ends of
/// segment_cubic() say. leaving: as in event_position.
ISO_INLINE int inside_at(const Ray *r, const float *w, RayEvent e, int x, int y, int z,
                         int leaving) {
  const CellPoint p = event_position(r, e, x, y, z, leaving);
  return segment_cubic(w, p, p).b0 >= 0.0f;
}

/// The field at (x,y,z) of the cell. w [8] as in segment_cubic.
ISO_INLINE TwoFloat precise_trilinear(const float *w, float x, float y, float z) {
  TwoFloat v[8];
  int i, n;
  for (i = 0; i < 8; ++i) v[i] = two_float(w[i]);
  for (n = 4; n > 0; n >>= 1) {
    for (i = 0; i < n; ++i) v[i] = tf_lerp(n == 4 ? x : (n == 2 ? y : z), v[2 * i], v[2 * i + 1]);
  }
  return v[0];
}

/// segment_cubic() in 48 bits. A loop, for one copy of the arithmetic: compilers that inline and
/// unroll everything take half a minute over eight.
ISO_INLINE PreciseCubic precise_segment_cubic(const float *w, CellPoint a, CellPoint b) {
  PreciseCubic c;
  TwoFloat third;
  int i;
  for (i = 0; i < 4; ++i) c.b[i] = two_float(0.0f);
  for (i = 0; i < 8; ++i) {
    const int k = (i & 1) + (i >> 1 & 1) + (i >> 2); /* coordinates of b */
    c.b[k] = tf_add(c.b[k], precise_trilinear(w, i & 1 ? b.x : a.x, i >> 1 & 1 ? b.y : a.y,
                                              i >> 2 ? b.z : a.z));
  }
  third.hi = 1.0f / 3.0f;
  third.lo = fma(-third.hi, 3.0f, 1.0f) / 3.0f;
  c.b[1] = tf_mul(third, c.b[1]);
  c.b[2] = tf_mul(third, c.b[2]);
  return c;
}

/// 1 if the corners [8] are not all on one side, and all have data: only then can `inside` change
/// in the cell.
ISO_INLINE int corners_differ(const float *w) {
  const int in = w[0] >= 0.0f;
  const int differ = (w[1] >= 0.0f) != in || (w[2] >= 0.0f) != in || (w[3] >= 0.0f) != in ||
                     (w[4] >= 0.0f) != in || (w[5] >= 0.0f) != in || (w[6] >= 0.0f) != in ||
                     (w[7] >= 0.0f) != in;
  return ISO_NO_DATA ? differ && !lacks_data(w) : differ;
}

/// A change of inside in a cell, not yet refined.
typedef struct CellChange {
  Cubic cubic;
  Bracket bracket;
} CellChange;

/// Finds the first change of inside between the events `enter` and `exit` of cell (x,y,z), in
/// float. Returns 1, 0 or ISO_DOUBTFUL. w [8] as in segment_cubic.
ISO_INLINE int change_or_doubt_in_cell(Solver solver, const Ray *r, const float *w, int x, int y,
                                       int z, RayEvent enter, RayEvent exit, CellChange *change) {
  if (!corners_differ(w)) return 0;
  change->cubic =
      segment_cubic(w, event_position(r, enter, x, y, z, 0), event_position(r, exit, x, y, z, 1));
  return isolate(solver, change->cubic, &change->bracket);
}

/// The same without doubt: returns 1 or 0.
ISO_INLINE int change_in_cell(Solver solver, const Ray *r, const float *w, int x, int y, int z,
                              RayEvent enter, RayEvent exit, CellChange *change) {
  const int found = change_or_doubt_in_cell(solver, r, w, x, y, z, enter, exit, change);
  if (found != ISO_DOUBTFUL) return found;
  return isolate_precisely(precise_segment_cubic(w, event_position(r, enter, x, y, z, 0),
                                                 event_position(r, exit, x, y, z, 1)),
                           change->cubic, &change->bracket);
}

/// Finds change number `number` of inside, 0: the first, as change_or_doubt_in_cell() and
/// change_in_cell() find the first. For `bernstein`.
///
/// precise  there is no doubt
ISO_INLINE int numbered_change_in_cell(const Ray *r, const float *w, int x, int y, int z,
                                       RayEvent enter, RayEvent exit, uint number, int precise,
                                       CellChange *change) {
  CellPoint a, b;
  int found;
  if (!corners_differ(w)) return 0;
  a = event_position(r, enter, x, y, z, 0);
  b = event_position(r, exit, x, y, z, 1);
  change->cubic = segment_cubic(w, a, b);
  found = isolate_bernstein_change(change->cubic, number, &change->bracket);
  if (found != ISO_DOUBTFUL || !precise) return found;
  return isolate_change_precisely(precise_segment_cubic(w, a, b), change->cubic, number,
                                  &change->bracket);
}

/// 0 without its sign, which compilers may change by rewriting differences (llvmpipe's does).
ISO_INLINE float without_zero_sign(float x) {
  return x == 0.0f ? 0.0f : x;
}

/// The hit at parameter s of cell (x,y,z): t, position in the cell, gradient. w [8] as in
/// segment_cubic.
ISO_INLINE HitRecord make_hit(const FrameParams *frame, const Ray *r, const float *w, int x, int y,
                              int z, RayEvent enter, RayEvent exit, float s) {
  const CellPoint a = event_position(r, enter, x, y, z, 0), b = event_position(r, exit, x, y, z, 1);
  HitRecord hit;
  /* Two-float differences first: t_exit - t_enter may be far below an ulp of t. */
  const float length = (exit.t.hi - enter.t.hi) + (exit.t.lo - enter.t.lo);
  hit.t = (enter.t.hi + fma(s, length, enter.t.lo)) * frame->view.t_scale;
  hit.block_id = block_id_at(frame, (uint)(x >> 2), (uint)(y >> 2), (uint)(z >> 2));
  hit.cell = (uint)((x & 3) + 4 * (y & 3) + 16 * (z & 3));
  hit.x = lerp(s, a.x, b.x);
  hit.y = lerp(s, a.y, b.y);
  hit.z = lerp(s, a.z, b.z);
  hit.grad_x =
      lerp(hit.z, lerp(hit.y, w[1] - w[0], w[3] - w[2]), lerp(hit.y, w[5] - w[4], w[7] - w[6]));
  hit.grad_y =
      lerp(hit.z, lerp(hit.x, w[2] - w[0], w[3] - w[1]), lerp(hit.x, w[6] - w[4], w[7] - w[5]));
  hit.grad_z =
      lerp(hit.y, lerp(hit.x, w[4] - w[0], w[5] - w[1]), lerp(hit.x, w[6] - w[2], w[7] - w[3]));
  hit.grad_x = without_zero_sign(hit.grad_x);
  hit.grad_y = without_zero_sign(hit.grad_y);
  hit.grad_z = without_zero_sign(hit.grad_z);
  return hit;
}

/// "Nothing hit."
ISO_INLINE HitRecord no_hit(void) {
  HitRecord hit;
  hit.t = INFINITY;
  hit.block_id = ISO_INVALID_ID;
  hit.cell = ISO_INVALID_ID;
  hit.x = hit.y = hit.z = 0.0f;
  hit.grad_x = hit.grad_y = hit.grad_z = 0.0f;
  return hit;
}

ISO_NAMESPACE_END

#endif
