/// packet.h -- eight rays at a time: pure functions, as those of the scalar headers without
/// `packet_`, with the same bits.
///
/// Portable: OpenCL C 1.2 and C++. The file that includes it brings the vectors, device/float8.h or
/// core/host/float8.hpp: Floats, Ints and Mask (-1 or 0 in each lane), the functions of OpenCL C
/// that are used here, and those that both list.
///
/// A walk decides by moments in float32. Lanes that they leave in doubt (grid_dda.h) ask the scalar
/// functions, one by one.
#ifndef ISOWAVE_PACKET_H
#define ISOWAVE_PACKET_H

ISO_PACKET_NAMESPACE_BEGIN

/// One axis of eight rays, as RayAxis. packet_float_t() of a plane is (plane - from) * rate, even
/// if d = 0.
typedef struct PacketAxis {
  Floats o, d, inv_hi, inv_lo, from, rate;
  float origin;
  Mask up;      ///< d > 0
  Floats sign;  ///< 1 or -1, by up
} PacketAxis;

/// Instead of an axis, the end of a ray's interval, which is on no plane.
#define ISO_AXIS_END 4

/// The plane that each ray crosses; axis ISO_AXIS_START: the ray begins there.
typedef struct Crossings {
  Ints axis;
  Floats plane;
} Crossings;

typedef struct TwoFloats {
  Floats hi, lo;
} TwoFloats;

typedef struct Cubics {
  Floats b0, b1, b2, b3;
} Cubics;

/// The places of rays, for the scalar functions.
typedef struct PacketRays {
  PacketAxis axis[3];
  Crossings entered;  ///< by which rays entered the regions where they are
  /* Their intervals, as of Ray, if ISO_INTERVALS is 1. */
  Floats begin_t, end_t;
  Ints cut_by;
  int has_end;  ///< do intervals end?
} PacketRays;

/// The moments at which rays begin.
ISO_INLINE Floats packet_begin_t(const PacketRays *r) {
  return ISO_INTERVALS ? r->begin_t : floats(0.0f);
}

ISO_INLINE int packet_has_end(const PacketRays *r) {
  return ISO_INTERVALS && r->has_end != 0;
}

/// Gives all rays an interval.
ISO_INLINE void set_packet_interval(PacketRays *r, Band band) {
  r->begin_t = floats(band.begin_t);
  r->end_t = floats(band.end_t);
  r->cut_by = ints(ISO_NOT_CUT);
  r->has_end = band.end_t < ISO_NEVER;
}

// ---- Crossings and cells

ISO_INLINE TwoFloats packet_plane_t(Floats o, Floats inv_hi, Floats inv_lo, Floats plane) {
  const Floats s = plane - o;
  const Floats back = s - plane;
  const Floats e = (plane - (s - back)) - (o + back);
  const Floats h = s * inv_hi;
  const Floats l = fma(s, inv_hi, -h) + fma(s, inv_lo, e * inv_hi);
  TwoFloats t;
  t.hi = h + l;
  t.lo = l - (t.hi - h);
  return t;
}

ISO_INLINE Floats packet_local_position(const PacketAxis *a, TwoFloats t, Floats c) {
  const Floats s = a->o - c;
  const Floats sb = a->o - s;
  const Floats se = (a->o - (s + sb)) + (sb - c);
  const Floats p = t.hi * a->d;
  const Floats pe = fma(t.lo, a->d, fma(t.hi, a->d, -p));
  const Floats r = s + p;
  const Floats rb = r - s;
  const Floats re = (s - (r - rb)) + (p - rb);
  const Floats x = r + (re + (pe + se));
  return pick(x <= 0.0f, floats(0.0f), pick(x >= 1.0f, floats(1.0f), x));
}

ISO_INLINE Floats packet_lerp(Floats u, Floats a, Floats b) {
  return fma(u, b, fma(-u, a, a));
}

ISO_INLINE Floats packet_cubic_value(Cubics c, Floats s, Floats *derivative) {
  const Floats c0 = packet_lerp(s, c.b0, c.b1), c1 = packet_lerp(s, c.b1, c.b2),
               c2 = packet_lerp(s, c.b2, c.b3);
  const Floats d0 = packet_lerp(s, c0, c1), d1 = packet_lerp(s, c1, c2);
  *derivative = 3.0f * (d1 - d0);
  return packet_lerp(s, d0, d1);
}

/// w [8], a [3], b [3].
ISO_INLINE Cubics packet_segment_cubic(const Floats *w, const Floats *a, const Floats *b) {
  const Floats a00 = packet_lerp(a[0], w[0], w[1]), a10 = packet_lerp(a[0], w[2], w[3]);
  const Floats a01 = packet_lerp(a[0], w[4], w[5]), a11 = packet_lerp(a[0], w[6], w[7]);
  const Floats b00 = packet_lerp(b[0], w[0], w[1]), b10 = packet_lerp(b[0], w[2], w[3]);
  const Floats b01 = packet_lerp(b[0], w[4], w[5]), b11 = packet_lerp(b[0], w[6], w[7]);
  const Floats aa0 = packet_lerp(a[1], a00, a10), aa1 = packet_lerp(a[1], a01, a11);
  const Floats ab0 = packet_lerp(b[1], a00, a10), ab1 = packet_lerp(b[1], a01, a11);
  const Floats ba0 = packet_lerp(a[1], b00, b10), ba1 = packet_lerp(a[1], b01, b11);
  const Floats bb0 = packet_lerp(b[1], b00, b10), bb1 = packet_lerp(b[1], b01, b11);
  const float third = 1.0f / 3.0f;
  Cubics c;
  c.b0 = packet_lerp(a[2], aa0, aa1);
  c.b1 = (packet_lerp(a[2], ba0, ba1) + packet_lerp(a[2], ab0, ab1) + packet_lerp(b[2], aa0, aa1)) *
         third;
  c.b2 = (packet_lerp(a[2], bb0, bb1) + packet_lerp(b[2], ba0, ba1) + packet_lerp(b[2], ab0, ab1)) *
         third;
  c.b3 = packet_lerp(b[2], bb0, bb1);
  return c;
}

/// refine() of solver `bernstein`, in brackets of those lanes.
ISO_INLINE Floats packet_refine(Cubics c, Floats lo, Floats hi, Mask lanes, int max_steps) {
  Floats derivative;
  const Mask in_lo = packet_cubic_value(c, lo, &derivative) >= 0.0f;
  Mask going = lanes & (lo != hi);
  Floats s = 0.5f * (lo + hi);
  s = pick((lo == 0.0f) & (hi == 1.0f), c.b0 / (c.b0 - c.b3), s);
  s = pick(lo == hi, lo, s);
  for (int step = 0; step < max_steps && any(going); ++step) {
    const Floats value = packet_cubic_value(c, s, &derivative);
    const Mask before = (value >= 0.0f) == in_lo;
    lo = pick(going & before, s, lo);
    hi = pick(going & ~before, s, hi);
    Floats next = s - value / derivative;
    going &= ~(((derivative > 0.0f) != in_lo) & (fabs(next - s) < ISO_ROOT_STEP));
    next = pick((next > lo) & (next < hi), next, 0.5f * (lo + hi));
    s = pick(going, next, s);
  }
  return pick(s > 0.0f, s, floats(0.0f));
}

// ---- Rays

ISO_INLINE void make_packet_axis(Floats o, Floats d, float origin, PacketAxis *a) {
  const Mask still = fabs(d) < ISO_SMALLEST_DIRECTION;
  a->o = o;
  a->origin = origin;
  a->d = pick(still, floats(0.0f), d);
  a->inv_hi = pick(still, floats(0.0f), 1.0f / a->d);
  a->inv_lo = pick(still, floats(0.0f), fma(-a->inv_hi, a->d, floats(1.0f)) / a->d);
  a->from = pick(still, floats(-ISO_NEVER), a->o);
  a->rate = pick(still, floats(1.0f), a->inv_hi);
  a->up = a->d > 0.0f;
  a->sign = pick(a->up, floats(1.0f), floats(-1.0f));
}

/// make_camera_axis() of each lane.
ISO_INLINE void make_packet_camera_axis(const View *view, Floats u, Floats v, Floats length,
                                        float eye, float fwd, float right, float up, float origin,
                                        PacketAxis *a) {
  if (view->is_parallel != 0) {
    make_packet_axis(fma(v, floats(up), fma(u, floats(right), floats(eye))), floats(fwd), origin,
                     a);
  } else {
    make_packet_axis(floats(eye), fma(v, floats(up), fma(u, floats(right), floats(fwd))) / length,
                     origin, a);
  }
}

/// As RayOfView.
typedef struct PacketOfView {
  Floats u, v, length;
} PacketOfView;

/// ray_of_view() of pixels (column, row).
ISO_INLINE PacketOfView packet_of_view(const View *view, Ints column, Ints row) {
  PacketOfView r;
  if (view->stride > 1) {
    ISO_EACH_LANE(lane, ints(-1)) {
      const RayPlace place = place_of_ray(view, column[lane], row[lane]);
      column[lane] = place.column;
      row[lane] = place.row;
    }
  }
  r.u = to_floats(2 * column + 1 - (int)(view->stride * view->width)) * view->pixel_scale;
  r.v = to_floats((int)(view->stride * view->height) - 1 - 2 * row) * view->pixel_scale;
  r.length = sqrt(fma(r.u, r.u, fma(r.v, r.v, floats(1.0f))));
  return r;
}

/// make_ray() of pixels (column, row), into axes [3].
ISO_INLINE void make_packet_axes(const FrameParams *frame, Ints column, Ints row,
                                 PacketAxis *axes) {
  const View *view = &frame->view;
  const PacketOfView r = packet_of_view(view, column, row);
  make_packet_camera_axis(view, r.u, r.v, r.length, view->eye_x, view->fwd_x, view->right_x,
                          view->up_x, frame->brick.origin_x, &axes[0]);
  make_packet_camera_axis(view, r.u, r.v, r.length, view->eye_y, view->fwd_y, view->right_y,
                          view->up_y, frame->brick.origin_y, &axes[1]);
  make_packet_camera_axis(view, r.u, r.v, r.length, view->eye_z, view->fwd_z, view->right_z,
                          view->up_z, frame->brick.origin_z, &axes[2]);
}

/// Planes of the brick as those of the whole volume, and positions the other way round.
ISO_INLINE Floats in_whole(const PacketAxis *a, Floats planes) {
  return ISO_BRICKS ? planes + a->origin : planes;
}
ISO_INLINE Floats in_brick(const PacketAxis *a, Floats positions) {
  return ISO_BRICKS ? positions - a->origin : positions;
}

ISO_INLINE RayAxis axis_of_lane(const PacketAxis *a, int lane) {
  RayAxis axis;
  axis.o = a->o[lane];
  axis.d = a->d[lane];
  axis.inv_d.hi = a->inv_hi[lane];
  axis.inv_d.lo = a->inv_lo[lane];
  axis.origin = a->origin;
  return axis;
}
ISO_INLINE Ray ray_of_lane(const PacketRays *rays, int lane) {
  Ray ray;
  ray.x = axis_of_lane(&rays->axis[0], lane);
  ray.y = axis_of_lane(&rays->axis[1], lane);
  ray.z = axis_of_lane(&rays->axis[2], lane);
  ray.begin_t = packet_begin_t(rays)[lane];
  ray.end_t = ISO_INTERVALS ? rays->end_t[lane] : INFINITY;
  ray.cut_by = ISO_INTERVALS ? rays->cut_by[lane] : ISO_NOT_CUT;
  return ray;
}
ISO_INLINE RayEvent event_of_lane(const PacketRays *rays, int lane) {
  const int axis = rays->entered.axis[lane];
  if (axis == ISO_AXIS_START) return border_event(packet_begin_t(rays)[lane]);
  return make_event(plane_t(axis_of_lane(&rays->axis[axis], lane), rays->entered.plane[lane]),
                    axis);
}

ISO_INLINE Floats packet_float_t(const PacketAxis *a, Floats plane) {
  return (plane - a->from) * a->rate;
}

/// One number of each ray: that of the axis of its crossing.
ISO_INLINE Floats of_axis(Ints axis, Floats x, Floats y, Floats z) {
  return pick(axis == 0, x, pick(axis == 1, y, z));
}

/// When rays cross those planes, in float32.
ISO_INLINE Floats crossing_float_t(const PacketRays *r, Crossings c) {
  const Floats from = of_axis(c.axis, r->axis[0].from, r->axis[1].from, r->axis[2].from),
               rate = of_axis(c.axis, r->axis[0].rate, r->axis[1].rate, r->axis[2].rate);
  return pick(c.axis == ISO_AXIS_START, packet_begin_t(r), (c.plane - from) * rate);
}

/// The moments at which rays entered their regions, in float32.
ISO_INLINE Floats entry_t(const PacketRays *r) {
  return crossing_float_t(r, r->entered);
}

/// When they cross those planes, in two-float.
ISO_INLINE TwoFloats crossing_t(const PacketRays *r, Crossings c) {
  TwoFloats t = packet_plane_t(
      of_axis(c.axis, r->axis[0].o, r->axis[1].o, r->axis[2].o),
      of_axis(c.axis, r->axis[0].inv_hi, r->axis[1].inv_hi, r->axis[2].inv_hi),
      of_axis(c.axis, r->axis[0].inv_lo, r->axis[1].inv_lo, r->axis[2].inv_lo), c.plane);
  t.hi = pick(c.axis == ISO_AXIS_START, packet_begin_t(r), t.hi);
  t.lo = pick(c.axis == ISO_AXIS_START, floats(0.0f), t.lo);
  if (packet_has_end(r)) {
    t.hi = pick(c.axis == ISO_AXIS_END, r->end_t, t.hi);
    t.lo = pick(c.axis == ISO_AXIS_END, floats(0.0f), t.lo);
  }
  return t;
}

// ---- Decisions. Those by float32 first; lanes in doubt by the scalar functions.

/// By the plane of which axis rays leave their regions.
typedef struct Exits {
  Mask on[3];
} Exits;

/// The axis of each. Vectors go by value, and so does what is returned: what a rare call is given a
/// pointer to, or returns as a struct, would be kept in memory by all others.
ISO_RARE Ints settle_exits(const PacketRays *r, Floats far_x, Floats far_y, Floats far_z,
                           Mask lanes) {
  Ints settled = ints(0);
  ISO_EACH_LANE(lane, lanes) {
    const Ray ray = ray_of_lane(r, lane);
    settled[lane] = first_exit(&ray, far_x[lane], far_y[lane], far_z[lane]).axis;
  }
  return settled;
}

/// far [3]: planes by which they leave.
ISO_INLINE Exits find_exits(const PacketRays *r, const Floats *far, Mask lanes) {
  const Floats x = packet_float_t(&r->axis[0], far[0]), y = packet_float_t(&r->axis[1], far[1]),
               z = packet_float_t(&r->axis[2], far[2]);
  const Floats xy = smaller(x, y), first = smaller(xy, z), not_xy = larger(x, y),
               not_z = smaller(not_xy, z), second = larger(xy, not_z);
  const Mask doubt = lanes & (second - first <= ISO_FLOAT_DOUBT * fabs(second));
  Exits exits;
  exits.on[2] = (z < xy) & lanes;
  exits.on[1] = (y < x) & ~exits.on[2] & lanes;
  exits.on[0] = lanes & ~(exits.on[1] | exits.on[2]);
  if (ISO_UNLIKELY(any(doubt))) {
    const Ints settled = settle_exits(r, far[0], far[1], far[2], doubt);
    ISO_EACH_OF_3(axis) exits.on[axis] = pick(doubt, settled == axis, exits.on[axis]);
  }
  return exits;
}

/// Regions along an axis, from first to last.
typedef struct Range {
  Ints first, last;
} Range;

ISO_RARE Ints settle_places(const PacketRays *r, int axis, int size, Range range, Mask lanes,
                            Ints places) {
  Ints settled = places;
  ISO_EACH_LANE(lane, lanes) {
    settled[lane] = locate(axis_of_lane(&r->axis[axis], lane), axis, event_of_lane(r, lane), size,
                           range.first[lane], range.last[lane]);
  }
  return settled;
}

/// The regions along one axis that rays are in just after they crossed r->entered, about at t.
/// If that is a plane of this axis, half a voxel behind it decides, which is exact. Else the
/// position o + t d decides if it is further from a plane than its error: 7.1 u |t d| of t
/// (grid_dda.h) and u |o + t d| of rounding, at most 8.2 u (|o + t d| + |o|).
ISO_INLINE Ints packet_locate(const PacketRays *r, int axis, int size, Floats t, Range range,
                              Mask lanes) {
  const PacketAxis *a = &r->axis[axis];
  const Floats position = fma(t, a->d, a->o);
  const Mask on_plane = r->entered.axis == axis;
  const Floats behind = r->entered.plane + 0.5f * a->sign,
               at = in_brick(a, pick(on_plane, behind, position)), x = at * (1.0f / (float)size);
  const Ints at_least = larger(to_ints(x), range.first), /* below 0, either way the first */
      places = smaller(at_least, range.last);
  const Floats distance = fabs(at - (float)size * to_nearest(x)),
               error = ISO_FLOAT_DOUBT * (fabs(position) + fabs(a->o));
  const Mask doubt = lanes & ~on_plane & (distance <= error);
  if (ISO_UNLIKELY(any(doubt))) return settle_places(r, axis, size, range, doubt, places);
  return places;
}

/// The last of the rays' crossings of near planes, one along each axis, or their start.
typedef struct Entry {
  Floats t, before;  ///< of it, and of the one before: float32
  Crossings at;
} Entry;

/// near [3]: by which rays enter a region.
ISO_INLINE Entry last_entry(const PacketRays *r, const Floats *near) {
  Entry entry;
  entry.t = packet_begin_t(r);
  entry.before = floats(-ISO_NEVER);
  entry.at.axis = ints(ISO_AXIS_START);
  entry.at.plane = floats(0.0f);
  ISO_EACH_OF_3(axis) {
    const PacketAxis *a = &r->axis[axis];
    const Floats t = pick(a->d == 0.0f, floats(-ISO_NEVER), packet_float_t(a, near[axis]));
    const Mask later = t > entry.t;
    const Floats not_later = smaller(entry.t, t);
    entry.at.axis = pick(later, ints(axis), entry.at.axis);
    entry.at.plane = pick(later, near[axis], entry.at.plane);
    entry.before = larger(entry.before, not_later);
    entry.t = larger(entry.t, t);
  }
  return entry;
}

ISO_INLINE Mask entry_in_doubt(const Entry *entry) {
  return entry->t - entry->before <= ISO_FLOAT_DOUBT * entry->t;
}

ISO_PACKET_NAMESPACE_END

#endif
