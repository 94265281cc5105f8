/// cell_intersect.h -- where a ray first crosses the isosurface inside one dual cell (Sec. 3.7).
///
/// Portable: OpenCL C 1.2 and C++; kernels and the scalar twin run these very lines.
///
/// inside := field >= isovalue, on w = voxel - isovalue: inside := w >= 0. A hit is the first change of
/// inside along the ray. Between entry pa and exit pb (cell-local [0,1]^3) the field is a cubic in s; its
/// Bernstein coefficients are values of the trilinear form at mixed coordinates of pa and pb [Ramshaw 1987,
/// blossoms], hence convex combinations of corners:
///   b0 = f(a,a,a)    b1 = (f(b,a,a) + f(a,b,a) + f(a,a,b)) / 3
///   b3 = f(b,b,b)    b2 = (f(b,b,a) + f(b,a,b) + f(a,b,b)) / 3
/// b0 and b3 lie on cell faces. There one coordinate is exactly 0 or 1 and lerp() returns its end exactly, so
/// the two cells of a face compute the same bits: a ray cannot slip between them. lerp() also keeps signs (two
/// ends < 0 give < 0, two ends >= 0 give >= 0), which is what clamping the face's value to its corners' range
/// would be for: cells and blocks whose corners agree in sign can be skipped without changing any hit.
#ifndef ISOWAVE_CELL_INTERSECT_H
#define ISOWAVE_CELL_INTERSECT_H

#include "grid_dda.h"

ISO_NAMESPACE_BEGIN

/// Steps of the bracketed iteration. Newton needs 3 to 5; the rest is for double roots, where it halves.
#define ISO_MAX_ROOT_STEPS 32
/// The iteration ends when s moves less than this: 2^-23 of the way through the cell.
#define ISO_ROOT_STEP 0x1p-23f

/// a at u = 0 and b at u = 1, exactly; between them in sign and, but for rounding, in value.
static inline float lerp(float u, float a, float b) {
  return fma(u, b, fma(-u, a, a));
}

/// Position in a cell, [0,1]^3.
typedef struct CellPoint {
  float x, y, z;
} CellPoint;

/// Position of the ray at `e` in cell (x,y,z). On the axis of the event it is exactly the face's 0 or 1.
/// leaving: 0 when `e` enters the cell, 1 when it leaves it.
static inline CellPoint event_position(const Ray *r, RayEvent e, int x, int y, int z, int leaving) {
  CellPoint p;
  p.x = e.axis == 0 ? ((r->x.d > 0.0f) == leaving ? 1.0f : 0.0f) : local_position(r->x, e.t, x);
  p.y = e.axis == 1 ? ((r->y.d > 0.0f) == leaving ? 1.0f : 0.0f) : local_position(r->y, e.t, y);
  p.z = e.axis == 2 ? ((r->z.d > 0.0f) == leaving ? 1.0f : 0.0f) : local_position(r->z, e.t, z);
  return p;
}

/// The field along a segment: Bernstein coefficients on s in [0,1], isovalue subtracted.
typedef struct Cubic {
  float b0, b1, b2, b3;
} Cubic;

/// w [8]: corner x + 2y + 4z minus the isovalue.
static inline Cubic segment_cubic(const float *w, CellPoint a, CellPoint b) {
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

/// De Casteljau's value and derivative of the cubic at s.
static inline float cubic_value(Cubic c, float s, float *derivative) {
  const float c0 = lerp(s, c.b0, c.b1), c1 = lerp(s, c.b1, c.b2), c2 = lerp(s, c.b2, c.b3);
  const float d0 = lerp(s, c0, c1), d1 = lerp(s, c1, c2);
  *derivative = 3.0f * (d1 - d0);
  return lerp(s, d0, d1);
}

static inline int cubic_inside(Cubic c, float s) {
  float derivative;
  return cubic_value(c, s, &derivative) >= 0.0f;
}

/// s = n / (n + m) where n and m have one sign, so nothing cancels; -1 where they do not.
static inline float same_sign_fraction(float n, float m) {
  return (n > 0.0f && m > 0.0f) || (n < 0.0f && m < 0.0f) ? n / (n + m) : -1.0f;
}

/// The first s at which `inside` differs from its value at s = 0. Returns 0 if it never does.
///
/// No sign variation in the coefficients: no change (the curve lies in their hull). One: exactly one root,
/// bracketed by [0,1]. More: [0,1] is split where the derivative d0 (1-s)^2 + 2 d1 s (1-s) + d2 s^2 is 0.
/// With r = s / (1-s) > 0 that is d2 r^2 + 2 d1 r + d0 = 0, whose roots q / d2 and d0 / q (q = -(d1 +-
/// sqrt(d1^2 - d0 d2)), larger magnitude) give s without cancellation and without dividing by a leading
/// coefficient. A tangent's extremum is found to rounding because the value there depends on s only to second
/// order.
static inline int first_change(Cubic c, float *s_hit) {
  const int in0 = c.b0 >= 0.0f, in1 = c.b1 >= 0.0f, in2 = c.b2 >= 0.0f, in3 = c.b3 >= 0.0f;
  float lo = 0.0f, hi = 1.0f, s, value, derivative;
  int found = in0 != in3;
  int step;
  if (in0 == in1 && in0 == in2 && in0 == in3) return 0;
  if (in0 == in3 || (in1 != in0 && in2 == in0)) {
    const float e0 = c.b1 - c.b0, e1 = c.b2 - c.b1, e2 = c.b3 - c.b2;
    const float e01 = fabs(e0) > fabs(e1) ? fabs(e0) : fabs(e1), largest = fabs(e2) > e01 ? fabs(e2) : e01;
    /* Squares of huge or tiny values would not survive; only the ratios of the three count. */
    const float d0 = e0 / largest, d1 = e1 / largest, d2 = e2 / largest;
    const float d02 = d0 * d2;
    const float discriminant = fma(d1, d1, -d02) + fma(-d0, d2, d02); /* Kahan: exact to an ulp or two */
    if (discriminant > 0.0f) {
      const float root = sqrt(discriminant);
      const float q = d1 > 0.0f ? -(d1 + root) : root - d1;
      const float s_a = same_sign_fraction(q, d2), s_b = same_sign_fraction(d0, q);
      const float s_first = s_a < s_b ? s_a : s_b, s_second = s_a < s_b ? s_b : s_a;
      if (s_first >= 0.0f) {
        if (cubic_inside(c, s_first) != in0) {
          hi = s_first;
          found = 1;
        } else {
          lo = s_first;
        }
      }
      if (hi == 1.0f && s_second >= 0.0f) {
        if (cubic_inside(c, s_second) != in0) {
          hi = s_second;
          found = 1;
        } else {
          lo = s_second;
        }
      }
    }
  }
  if (!found) return 0;
  /* inside changes between lo and hi: Newton, kept in the bracket by bisection. */
  s = 0.5f * (lo + hi);
  if (lo == 0.0f && hi == 1.0f) s = c.b0 / (c.b0 - c.b3); /* signs differ: the chord's root, in [0,1] */
  for (step = 0; step < ISO_MAX_ROOT_STEPS; ++step) {
    float next;
    value = cubic_value(c, s, &derivative);
    if ((value >= 0.0f) == in0) {
      lo = s;
    } else {
      hi = s;
    }
    next = s - value / derivative;
    if (!(next > lo && next < hi)) next = 0.5f * (lo + hi); /* also when derivative = 0 */
    if (fabs(next - s) < ISO_ROOT_STEP) {
      s = next;
      break;
    }
    s = next;
  }
  *s_hit = s;
  return 1;
}

/// 1 if the corners [8] are not all on one side: only then can `inside` change in the cell.
static inline int corners_differ(const float *w) {
  const int in = w[0] >= 0.0f;
  return (w[1] >= 0.0f) != in || (w[2] >= 0.0f) != in || (w[3] >= 0.0f) != in || (w[4] >= 0.0f) != in ||
         (w[5] >= 0.0f) != in || (w[6] >= 0.0f) != in || (w[7] >= 0.0f) != in;
}

/// First change of inside between the events `enter` and `exit` of cell (x,y,z). w [8] as in segment_cubic.
static inline int intersect_cell(const Ray *r, const float *w, int x, int y, int z, RayEvent enter,
                                 RayEvent exit, float *s_hit) {
  if (!corners_differ(w)) return 0;
  return first_change(
      segment_cubic(w, event_position(r, enter, x, y, z, 0), event_position(r, exit, x, y, z, 1)), s_hit);
}

/// 0 without its sign, which compilers may change by rewriting differences (llvmpipe's does).
static inline float without_zero_sign(float x) {
  return x == 0.0f ? 0.0f : x;
}

/// The hit at parameter s of cell (x,y,z): t, position in the cell, gradient. w [8] as in segment_cubic.
static inline HitRecord make_hit(ISO_CONSTANT const FrameParams *frame, const Ray *r, const float *w, int x,
                                 int y, int z, RayEvent enter, RayEvent exit, float s) {
  const CellPoint a = event_position(r, enter, x, y, z, 0), b = event_position(r, exit, x, y, z, 1);
  HitRecord hit;
  /* Two-float differences first: t_exit - t_enter may be far below an ulp of t. */
  const float length = (exit.t.hi - enter.t.hi) + (exit.t.lo - enter.t.lo);
  hit.t = (enter.t.hi + fma(s, length, enter.t.lo)) * frame->t_scale;
  hit.block_id = (uint)(x >> 2) + frame->blocks_x * ((uint)(y >> 2) + frame->blocks_y * (uint)(z >> 2));
  hit.cell = (uint)((x & 3) + 4 * (y & 3) + 16 * (z & 3));
  hit.x = lerp(s, a.x, b.x);
  hit.y = lerp(s, a.y, b.y);
  hit.z = lerp(s, a.z, b.z);
  hit.grad_x = lerp(hit.z, lerp(hit.y, w[1] - w[0], w[3] - w[2]), lerp(hit.y, w[5] - w[4], w[7] - w[6]));
  hit.grad_y = lerp(hit.z, lerp(hit.x, w[2] - w[0], w[3] - w[1]), lerp(hit.x, w[6] - w[4], w[7] - w[5]));
  hit.grad_z = lerp(hit.y, lerp(hit.x, w[4] - w[0], w[5] - w[1]), lerp(hit.x, w[6] - w[2], w[7] - w[3]));
  hit.grad_x = without_zero_sign(hit.grad_x);
  hit.grad_y = without_zero_sign(hit.grad_y);
  hit.grad_z = without_zero_sign(hit.grad_z);
  return hit;
}

/// "Nothing hit."
static inline HitRecord no_hit(void) {
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
