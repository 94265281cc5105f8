/// grid_dda.h -- rays in index space and exact walks through grids of cells, blocks and macrocells
/// (Sec. 3.3).
///
/// Portable: OpenCL C 1.2 and C++; kernels and the scalar twin run these very lines.
///
/// No walk here accumulates anything. The moment a ray crosses a grid plane is a pure function of
/// (ray, axis, plane), in two-float arithmetic (about 45 bits). All crossings of a ray have one
/// total order: by t, then axis x < y < z; the ray's start, t = 0, comes after planes at t = 0.
/// "The cell after an event" is the number of planes of each axis that are not later than the
/// event. So walking cell by cell, skipping by macrocells, and resuming at a block pass through the
/// same cells with the same bits, and a ray's state between passes is just a block.
///
/// Float filter: processors compare moments in float32 first. float_t() rounds three times: plane -
/// o, 1 / d and their product. Each is off by at most u = 2^-24 of itself, 1 / d by 5 u if a device
/// divides within 2.5 ulp, as OpenCL allows. So a moment in float32 is off by at most 7.1 u
/// of itself, and the two-float one by far less than the 0.1. Two moments that are further apart
/// than 16 u = 2^-20 of the one with the larger magnitude are in the order that two-float finds:
/// 14.2 u cover what both are off by, the rest covers the rounding of their difference. If the
/// smaller moment has the larger magnitude, it is negative. The other one is then either not, and
/// signs are exact, or so near that the same rest covers the difference of their magnitudes.
/// Closer moments are in doubt, and two-float decides.
///
/// A brick counts its cells, blocks and macrocells from its own first voxel on, `origin`. Rays and
/// planes stay where they are in the whole volume: moments, and so decisions, have the same bits in
/// a brick as in the whole. Regions, and the planes at the ends of boxes (LastPlanes), are the
/// brick's; planes as floats are the whole's. All are whole numbers below 2^24: sums are exact.
#ifndef ISOWAVE_GRID_DDA_H
#define ISOWAVE_GRID_DDA_H

#include "two_float.h"

ISO_NAMESPACE_BEGIN

#define ISO_AXIS_START 3             ///< axis of the event "the ray starts here"
#define ISO_SAMPLE_SEED 0x9e3779b9u  ///< of samples of rays, see place_of_ray()
#define ISO_SMALLEST_DIRECTION \
  0x1p-40f  ///< smaller direction components count as 0: no denormals behind them

#if defined(ISO_CPU) || !defined(__OPENCL_C_VERSION__)
#define ISO_FLOAT_FILTER 1  ///< a GPU compares two-floats faster than it branches
#endif
#define ISO_FLOAT_DOUBT 0x1p-20f  ///< share of a moment within which float32 leaves an order open
/// The float32 moment of a crossing that never comes. Others are below 2^65: eyes are at most 1e7
/// voxels away.
#define ISO_NEVER 0x1p100f

/// One axis of a ray. Position = o + t d.
typedef struct RayAxis {
  float o;         ///< eye, index space [voxels]
  float d;         ///< direction [voxels per t]; exactly 0 or at least ISO_SMALLEST_DIRECTION
  TwoFloat inv_d;  ///< 1 / d; unused if d = 0
  float origin;    ///< where regions count from, see BrickPlace
} RayAxis;

#define ISO_NOT_CUT (-1)

typedef struct Ray {
  RayAxis x, y, z;
  float begin_t, end_t;  ///< the part of it that is drawn; only read if ISO_INTERVALS is 1
  int cut_by;            ///< the clipping plane at which it begins, or ISO_NOT_CUT
} Ray;

/// A crossing of a plane of `axis` (0..2), or where the ray starts, or is cut.
typedef struct RayEvent {
  TwoFloat t;
  int axis;
} RayEvent;

ISO_INLINE int event_before(RayEvent a, RayEvent b) {
  return t_less(a.t, b.t) || (!t_less(b.t, a.t) && a.axis < b.axis);
}

ISO_INLINE RayEvent make_event(TwoFloat t, int axis) {
  RayEvent e;
  e.t = t;
  e.axis = axis;
  return e;
}

/// The ray at t, on no plane: where one level of detail takes over from another.
ISO_INLINE RayEvent border_event(float t) {
  return make_event(two_float(t), ISO_AXIS_START);
}

ISO_INLINE RayEvent start_event(void) {
  return border_event(0.0f);
}

ISO_INLINE RayAxis make_ray_axis(float o, float d) {
  RayAxis a;
  a.o = o;
  a.d = fabs(d) < ISO_SMALLEST_DIRECTION ? 0.0f : d;
  a.inv_d.hi = a.d == 0.0f ? 0.0f : 1.0f / a.d;
  a.inv_d.lo = a.d == 0.0f ? 0.0f : fma(-a.inv_d.hi, a.d, 1.0f) / a.d;
  a.origin = 0.0f;
  return a;
}

/// An axis of make_ray().
ISO_INLINE RayAxis make_camera_axis(uint is_parallel, float u, float v, float length, float eye,
                                    float fwd, float right, float up) {
  return is_parallel != 0 ? make_ray_axis(fma(v, up, fma(u, right, eye)), fwd)
                          : make_ray_axis(eye, fma(v, up, fma(u, right, fwd)) / length);
}

typedef struct RayPlace {
  int column, row;
} RayPlace;

/// The place of a ray in a grid of stride * width x stride * height places. If the stride is 1, the
/// places are the rays. Otherwise, the rays are a sample of a frame's: each square of stride x
/// stride places has one ray, at a place that is chosen by a hash (lowbias32, C. Wellons).
ISO_INLINE RayPlace place_of_ray(const View *view, int column, int row) {
  RayPlace place;
  place.column = column;
  place.row = row;
  if (view->stride > 1) {
    uint hash = (uint)column + view->width * (uint)row + ISO_SAMPLE_SEED;
    hash = (hash ^ (hash >> 16)) * 0x7feb352du;
    hash = (hash ^ (hash >> 15)) * 0x846ca68bu;
    hash ^= hash >> 16;
    place.column = (int)((uint)column * view->stride + ((hash & 0xffffu) * view->stride >> 16));
    place.row = (int)((uint)row * view->stride + ((hash >> 16) * view->stride >> 16));
  }
  return place;
}

/// Twice u and v of a place, in rays, from the middle of the picture.
ISO_INLINE int twice_u(const View *view, int column) {
  return 2 * column + 1 - (int)(view->stride * view->width);
}
ISO_INLINE int twice_v(const View *view, int row) {
  return (int)(view->stride * view->height) - 1 - 2 * row;
}

/// A ray in the axes of the camera: fwd + u right + v up.
typedef struct RayOfView {
  float u, v;
  float length;  ///< sqrt(1 + u^2 + v^2)
} RayOfView;

/// The ray of a pixel (row-major, row 0 at the top).
ISO_INLINE RayOfView ray_of_view(const View *view, uint pixel) {
  const RayPlace place = place_of_ray(view, (int)(pixel % view->width), (int)(pixel / view->width));
  RayOfView r;
  r.u = (float)twice_u(view, place.column) * view->pixel_scale;
  r.v = (float)twice_v(view, place.row) * view->pixel_scale;
  r.length = sqrt(fma(r.u, r.u, fma(r.v, r.v, 1.0f)));
  return r;
}

/// The ray of a pixel. Its direction is (fwd + u right + v up) / sqrt(1 + u^2 + v^2), mapped to
/// index space; t * frame->view.t_scale is the distance from the eye in world units. A parallel
/// ray's direction is fwd; its distance is that from the eye's plane. Its interval is the frame's
/// band.
ISO_INLINE Ray make_ray(const FrameParams *frame, uint pixel) {
  const RayOfView view = ray_of_view(&frame->view, pixel);
  const uint is_parallel = frame->view.is_parallel;
  Ray r;
  r.x = make_camera_axis(is_parallel, view.u, view.v, view.length, frame->view.eye_x,
                         frame->view.fwd_x, frame->view.right_x, frame->view.up_x);
  r.y = make_camera_axis(is_parallel, view.u, view.v, view.length, frame->view.eye_y,
                         frame->view.fwd_y, frame->view.right_y, frame->view.up_y);
  r.z = make_camera_axis(is_parallel, view.u, view.v, view.length, frame->view.eye_z,
                         frame->view.fwd_z, frame->view.right_z, frame->view.up_z);
  r.x.origin = frame->brick.origin_x;
  r.y.origin = frame->brick.origin_y;
  r.z.origin = frame->brick.origin_z;
  r.begin_t = ISO_BANDS ? frame->band.begin_t : 0.0f;
  r.end_t = ISO_BANDS ? frame->band.end_t : INFINITY;
  r.cut_by = ISO_NOT_CUT;
  return r;
}

/// A ray with all of its interval.
ISO_INLINE Ray make_whole_ray(RayAxis x, RayAxis y, RayAxis z) {
  Ray r;
  r.x = x;
  r.y = y;
  r.z = z;
  r.begin_t = 0.0f;
  r.end_t = INFINITY;
  r.cut_by = ISO_NOT_CUT;
  return r;
}

/// The level of detail that a ray of a list goes through: which of those that draw the frame, 0:
/// the finest of them.
ISO_INLINE uint level_of_given(GivenRay given) {
  return given.level & 0xFFu;
}

/// The clipping plane at whose cap the ray begins, or ISO_NOT_CUT.
ISO_INLINE int cut_of_given(GivenRay given) {
  return (int)(given.level >> 8) - 1;
}

/// The ray, cut by that plane.
ISO_INLINE GivenRay cut_by_plane(GivenRay given, int plane) {
  given.level = level_of_given(given) | (uint)(plane + 1) << 8;
  return given;
}

/// A ray of a list, of a whole volume.
ISO_INLINE Ray make_given_ray(GivenRay given) {
  Ray ray = make_whole_ray(make_ray_axis(given.o_x, given.d_x), make_ray_axis(given.o_y, given.d_y),
                           make_ray_axis(given.o_z, given.d_z));
  ray.cut_by = cut_of_given(given);
  return ray;
}

/// "There is no ray."
ISO_INLINE GivenRay no_ray(void) {
  GivenRay given;
  given.o_x = given.o_y = given.o_z = 0.0f;
  given.d_x = given.d_y = given.d_z = 0.0f;
  given.level = 0;
  return given;
}

ISO_INLINE int is_given(GivenRay given) {
  return given.d_x != 0.0f || given.d_y != 0.0f || given.d_z != 0.0f;
}

/// t at which the ray crosses the plane, a whole number (a pure function; the order of crossings
/// rests on it). Needs d != 0. plane - o is exact as a pair (Knuth's two-sum); it is multiplied by
/// the two-float 1 / d.
ISO_INLINE TwoFloat plane_t(RayAxis a, float plane) {
  const float s = plane - a.o;
  const float back = s - plane;
  const float e = (plane - (s - back)) - (a.o + back);
  const float h = s * a.inv_d.hi;
  const float l = fma(s, a.inv_d.hi, -h) + fma(s, a.inv_d.lo, e * a.inv_d.hi);
  TwoFloat t;
  t.hi = h + l;
  t.lo = l - (t.hi - h);
  return t;
}

/// A plane of the brick as one of the whole volume.
ISO_INLINE float whole_plane(RayAxis a, int plane) {
  return ISO_BRICKS ? (float)plane + a.origin : (float)plane;
}

/// Regions are slabs [size c, size (c+1)] of planes along one axis, cut at the domain's last plane.
/// The plane by which the ray leaves region c. Exact: dims are far below 2^24.
ISO_INLINE float far_plane(RayAxis a, int c, int size, int last_plane) {
  const int plane = a.d > 0.0f ? size * (c + 1) : size * c;
  return whole_plane(a, plane > last_plane ? last_plane : plane);
}

/// When it does: never, if it runs within the slab.
ISO_INLINE TwoFloat far_t(RayAxis a, float plane) {
  TwoFloat t = plane_t(a, plane);
  t.hi = a.d == 0.0f ? INFINITY : t.hi;
  return t;
}

/// When the ray crosses the plane, in float32.
ISO_INLINE float float_t(RayAxis a, float plane) {
  return a.d == 0.0f ? ISO_NEVER : (plane - a.o) * a.inv_d.hi;
}

/// Does two-float have to say which of two moments, by float_t(), is the earlier?
ISO_INLINE int in_doubt(float earlier, float later) {
  return later - earlier <= ISO_FLOAT_DOUBT * fabs(later);
}

/// The later of `e` and the crossing by which the ray enters region c of this axis.
ISO_INLINE RayEvent later_entry(RayEvent e, RayAxis a, int axis, int c, int size, int last_plane) {
  int plane = a.d > 0.0f ? size * c : size * (c + 1);
  RayEvent near;
  if (a.d == 0.0f) return e;
  near = make_event(plane_t(a, whole_plane(a, plane > last_plane ? last_plane : plane)), axis);
  return event_before(e, near) ? near : e;
}

/// Is the ray, just after event `e`, on the far side of the plane as seen from -infinity? Needs d
/// != 0.
ISO_INLINE int is_above(RayAxis a, int axis, int plane, RayEvent e) {
  const int crossed =
      !event_before(e, make_event(plane_t(a, whole_plane(a, plane)), axis)); /* itself counts */
  return crossed == (a.d > 0.0f);
}

/// The region along one axis, within [first, last], that the ray is in just after event `e`. The
/// position o + t d decides if it is further from a plane than its error, 2^-24 (|t d| + |o + t
/// d|); otherwise crossings are compared. A brick's origin is subtracted from the position without
/// rounding: behind the origin, both are multiples of the position's ulp; just before it, they are
/// nearly alike.
ISO_INLINE int locate(RayAxis a, int axis, RayEvent e, int size, int first, int last) {
  const float p = a.d == 0.0f ? a.o : fma(e.t.hi, a.d, a.o);
  const float error = 0x1p-22f * (fabs(p) + fabs(a.o));
  const int on_plane = axis == e.axis; /* on a whole number, then */
  const float in_whole = on_plane ? rint(p) : p, at = ISO_BRICKS ? in_whole - a.origin : in_whole;
  const float x = at / (float)size; /* size is a power of two: exact */
  const float region = on_plane && a.d < 0.0f ? ceil(x) - 1.0f : floor(x);
  int c = region <= (float)first ? first : (region >= (float)last ? last : (int)region);
  int step = a.d != 0.0f && (on_plane ? error > 0.25f : fabs(at - (float)size * rint(x)) <= error);
  while (step != 0) {
    const int up = c < last && is_above(a, axis, size * (c + 1), e);
    step = up ? 1 : (c > first && !is_above(a, axis, size * c, e) ? -1 : 0);
    c += step;
  }
  return c;
}

/// Position along one axis at t, relative to the integer plane c: (o - c) + t d with the
/// cancellation done exactly, clamped to the cell [0,1].
ISO_INLINE float local_position(RayAxis a, TwoFloat t, int c) {
  const float cf = whole_plane(a, c);
  const float s = a.o - cf;
  const float sb = a.o - s;
  const float se = (a.o - (s + sb)) + (sb - cf);
  const float p = t.hi * a.d;
  const float pe = fma(t.lo, a.d, fma(t.hi, a.d, -p));
  const float r = s + p;
  const float rb = r - s;
  const float re = (s - (r - rb)) + (p - rb);
  const float x = r + (re + (pe + se));
  return x <= 0.0f ? 0.0f : (x >= 1.0f ? 1.0f : x);
}

/// A walk through regions of one size: where it is, and by which plane of each axis it would leave.
/// A GPU computes the three times when it needs them, without a branch, faster than it chooses one
/// of them to renew; a CPU keeps them in float32. The same bits either way.
typedef struct GridWalk {
  int x, y, z;                ///< the region
  float far_x, far_y, far_z;  ///< planes
#ifdef ISO_FLOAT_FILTER
  float t_x, t_y, t_z;  ///< float_t() of each
#endif
} GridWalk;

/// Number of the domain's last plane along each axis: dims - 1.
typedef struct LastPlanes {
  int x, y, z;
} LastPlanes;

ISO_INLINE LastPlanes last_planes(const FrameParams *frame) {
  LastPlanes last;
  last.x = (int)frame->grid.dims_x - 1;
  last.y = (int)frame->grid.dims_y - 1;
  last.z = (int)frame->grid.dims_z - 1;
  return last;
}

/// Starts (or restarts) a walk in region (x,y,z).
ISO_INLINE GridWalk walk_from(const Ray *r, int x, int y, int z, int size, LastPlanes last) {
  GridWalk w;
  w.x = x;
  w.y = y;
  w.z = z;
  w.far_x = far_plane(r->x, x, size, last.x);
  w.far_y = far_plane(r->y, y, size, last.y);
  w.far_z = far_plane(r->z, z, size, last.z);
#ifdef ISO_FLOAT_FILTER
  w.t_x = float_t(r->x, w.far_x);
  w.t_y = float_t(r->y, w.far_y);
  w.t_z = float_t(r->z, w.far_z);
#endif
  return w;
}

/// The event by which the ray entered region (x,y,z): the last of its three near planes, or the
/// start.
ISO_INLINE RayEvent region_entry(const Ray *r, int x, int y, int z, int size, LastPlanes last) {
  RayEvent e = start_event();
  e = later_entry(e, r->x, 0, x, size, last.x);
  e = later_entry(e, r->y, 1, y, size, last.y);
  return later_entry(e, r->z, 2, z, size, last.z);
}

/// The event by which the ray leaves a region with these far planes: the first of the three; ties
/// in the order x, y, z. Numbers are chosen, not structs, which compilers would choose by address
/// and so keep in memory.
ISO_INLINE RayEvent first_exit(const Ray *r, float far_x, float far_y, float far_z) {
  const TwoFloat x = far_t(r->x, far_x), y = far_t(r->y, far_y), z = far_t(r->z, far_z);
  const int y_first = t_less(y, x);
  TwoFloat xy;
  RayEvent e;
  int z_first;
  xy.hi = y_first ? y.hi : x.hi;
  xy.lo = y_first ? y.lo : x.lo;
  z_first = t_less(z, xy);
  e.t.hi = z_first ? z.hi : xy.hi;
  e.t.lo = z_first ? z.lo : xy.lo;
  e.axis = z_first ? 2 : y_first;
  return e;
}

#ifdef ISO_FLOAT_FILTER
/// The same; two-float finds the moment of the exit, and the order only if float32 leaves it in
/// doubt.
ISO_INLINE RayEvent walk_exit(const GridWalk *w, const Ray *r) {
  const int y_first = w->t_y < w->t_x;
  const float xy = y_first ? w->t_y : w->t_x, not_xy = y_first ? w->t_x : w->t_y;
  const int z_first = w->t_z < xy;
  const float first = z_first ? w->t_z : xy, not_z = z_first ? xy : w->t_z,
              second = not_z < not_xy ? not_z : not_xy;
  RayAxis a;
  if (in_doubt(first, second)) return first_exit(r, w->far_x, w->far_y, w->far_z);
  a.o = z_first ? r->z.o : (y_first ? r->y.o : r->x.o);
  a.d = z_first ? r->z.d : (y_first ? r->y.d : r->x.d);
  a.inv_d.hi = z_first ? r->z.inv_d.hi : (y_first ? r->y.inv_d.hi : r->x.inv_d.hi);
  a.inv_d.lo = z_first ? r->z.inv_d.lo : (y_first ? r->y.inv_d.lo : r->x.inv_d.lo);
  return make_event(plane_t(a, z_first ? w->far_z : (y_first ? w->far_y : w->far_x)),
                    z_first ? 2 : y_first);
}
#else
/// The same for the walk's region.
ISO_INLINE RayEvent walk_exit(const GridWalk *w, const Ray *r) {
  return first_exit(r, w->far_x, w->far_y, w->far_z);
}
#endif

/// One axis of walk_step().
ISO_INLINE float next_far_plane(RayAxis a, float plane, int size, int last_plane) {
  const float next = plane + (float)(a.d > 0.0f ? size : -size), end = whole_plane(a, last_plane);
  return next > end ? end : next;
}

/// Goes through the region's exit into the next region, which may lie outside the grid.
ISO_INLINE void walk_step(GridWalk *w, const Ray *r, RayEvent exit, int size, LastPlanes last) {
#ifdef ISO_FLOAT_FILTER
  if (exit.axis == 0) {
    w->x += r->x.d > 0.0f ? 1 : -1;
    w->far_x = next_far_plane(r->x, w->far_x, size, last.x);
    w->t_x = float_t(r->x, w->far_x);
  } else if (exit.axis == 1) {
    w->y += r->y.d > 0.0f ? 1 : -1;
    w->far_y = next_far_plane(r->y, w->far_y, size, last.y);
    w->t_y = float_t(r->y, w->far_y);
  } else {
    w->z += r->z.d > 0.0f ? 1 : -1;
    w->far_z = next_far_plane(r->z, w->far_z, size, last.z);
    w->t_z = float_t(r->z, w->far_z);
  }
#else /* no branches: the work-items of a GPU take turns at them */
  const int on_x = exit.axis == 0, on_y = exit.axis == 1, on_z = exit.axis == 2;
  const float far_x = next_far_plane(r->x, w->far_x, size, last.x),
              far_y = next_far_plane(r->y, w->far_y, size, last.y),
              far_z = next_far_plane(r->z, w->far_z, size, last.z);
  w->x += on_x ? (r->x.d > 0.0f ? 1 : -1) : 0;
  w->y += on_y ? (r->y.d > 0.0f ? 1 : -1) : 0;
  w->z += on_z ? (r->z.d > 0.0f ? 1 : -1) : 0;
  w->far_x = on_x ? far_x : w->far_x;
  w->far_y = on_y ? far_y : w->far_y;
  w->far_z = on_z ? far_z : w->far_z;
#endif
}

/// Does the walk leave the larger region that it is in, too, by its exit?
ISO_INLINE int leaves(const GridWalk *w, const GridWalk *larger, RayEvent exit) {
  return (exit.axis == 0 && w->far_x == larger->far_x) ||
         (exit.axis == 1 && w->far_y == larger->far_y) ||
         (exit.axis == 2 && w->far_z == larger->far_z);
}

/// Shrinks [*enter, *exit] to one axis of a box. Returns 0 if the ray runs beside it.
ISO_INLINE int clip_to_slab(RayAxis a, int axis, int begin, int end, RayEvent *enter,
                            RayEvent *exit) {
  RayEvent near, far;
  if (a.d == 0.0f) return a.o >= whole_plane(a, begin) && a.o <= whole_plane(a, end);
  near = make_event(plane_t(a, whole_plane(a, a.d > 0.0f ? begin : end)), axis);
  far = make_event(plane_t(a, whole_plane(a, a.d > 0.0f ? end : begin)), axis);
  if (event_before(*enter, near)) *enter = near;
  if (event_before(far, *exit)) *exit = far;
  return 1;
}

/// Shrinks [*enter, *exit] to the box from planes `begin` to planes `end`. Returns 0 if nothing is
/// left.
ISO_INLINE int clip_to_box(const Ray *r, LastPlanes begin, LastPlanes end, RayEvent *enter,
                           RayEvent *exit) {
  return clip_to_slab(r->x, 0, begin.x, end.x, enter, exit) &&
         clip_to_slab(r->y, 1, begin.y, end.y, enter, exit) &&
         clip_to_slab(r->z, 2, begin.z, end.z, enter, exit) && event_before(*enter, *exit);
}

/// The event by which the ray enters the box, or starts in it. Returns 0 if it never does.
ISO_INLINE int box_entry(const Ray *r, LastPlanes begin, LastPlanes end, RayEvent *enter) {
  RayEvent exit = border_event(INFINITY);
  *enter = start_event();
  return clip_to_box(r, begin, end, enter, &exit);
}

/// The event by which the ray enters the domain [0, dims-1], or starts there. Returns 0 if it never
/// does.
ISO_INLINE int domain_entry(const Ray *r, LastPlanes last, RayEvent *enter) {
  LastPlanes zero;
  zero.x = zero.y = zero.z = 0;
  return box_entry(r, zero, last, enter);
}

ISO_NAMESPACE_END

#endif
