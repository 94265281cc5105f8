/// clip.h -- clipping planes: the part of each ray of the camera that is drawn
/// (core/view/clip.hpp). Portable: OpenCL C 1.2 and C++.
///
/// A ray's distance from a plane is a linear function of t, as its coordinate on an axis is
/// (RayAxis), and the ray crosses the plane where that is 0. So the interval of a ray is a pure
/// function of ray and planes. It has the same bits in all bricks, and in all levels of detail,
/// whose t differ by powers of two.
#ifndef ISOWAVE_CLIP_H
#define ISOWAVE_CLIP_H

#include "grid_dda.h"
#include "ray_state.h"

ISO_NAMESPACE_BEGIN

/// A ray's distance from a plane, as an axis of the ray. u, v, length: see RayOfView.
ISO_INLINE RayAxis make_plane_axis(const View *view, ISO_GLOBAL const ClipParams *clip,
                                   ISO_GLOBAL const PlaneParams *plane, float u, float v,
                                   float length) {
  return make_camera_axis(view->is_parallel, u, v, length,
                          plane->eye * (clip->t_scale / view->t_scale), plane->fwd, plane->right,
                          plane->up);
}

/// Shortens the interval of a ray of the camera to what is in front of all planes. An empty one
/// ends where it begins, or before.
ISO_INLINE void clip_ray(const FrameParams *frame, ISO_GLOBAL const ClipParams *clip, uint pixel,
                         Ray *ray) {
  const RayOfView r = ray_of_view(&frame->view, pixel);
  float begin = 0.0f, end = INFINITY;
  int cut_by = ISO_NOT_CUT;
  for (uint i = 0; i < clip->num_planes; ++i) {
    const RayAxis a = make_plane_axis(&frame->view, clip, &clip->planes[i], r.u, r.v, r.length);
    const float t = a.d == 0.0f ? (a.o < 0.0f ? 0.0f : INFINITY) : plane_t(a, 0.0f).hi;
    if (a.d > 0.0f && t > begin) {
      begin = t;
      cut_by = (int)i;
    }
    if (!(a.d > 0.0f) && t < end) end = t;
  }
  if (cut_by != ISO_NOT_CUT && begin >= ray->begin_t) {
    ray->begin_t = begin;
    ray->cut_by = cut_by;
  }
  if (end < ray->end_t) ray->end_t = end;
}

/// Is there any of the ray left?
ISO_INLINE int has_interval(const Ray *ray) {
  return ray->begin_t < ray->end_t;
}

/// Does a ray that begins inside the surface hit there?
ISO_INLINE int begins_at_cap(ISO_GLOBAL const ClipParams *clip, const Ray *ray) {
  return ISO_CLIP && ray->cut_by != ISO_NOT_CUT && clip->with_caps != 0;
}

/// The side on which a ray that begins at a clipping plane was before (ISO_SIDE_*).
ISO_INLINE uint side_where_cut(ISO_GLOBAL const ClipParams *clip, const Ray *ray) {
  return begins_at_cap(clip, ray) ? ISO_SIDE_OUTSIDE : ISO_SIDE_UNKNOWN;
}

/// Gives a hit at the beginning of a clipped ray the mark and the gradient of a cap.
ISO_INLINE void cap_hit(ISO_GLOBAL const ClipParams *clip, const Ray *ray, HitRecord *hit) {
  ISO_GLOBAL const PlaneParams *plane = &clip->planes[ray->cut_by];
  hit->cell |= ISO_CAP;
  hit->grad_x = plane->grad_x;
  hit->grad_y = plane->grad_y;
  hit->grad_z = plane->grad_z;
}

/// Marks a hit where a ray begins: on a cap, or at a border between levels of detail.
ISO_INLINE void mark_beginning(ISO_GLOBAL const ClipParams *clip, const Ray *ray, HitRecord *hit) {
  if (begins_at_cap(clip, ray)) {
    cap_hit(clip, ray, hit);
  } else {
    hit->cell |= ISO_AT_BORDER;
  }
}

ISO_INLINE int is_cap(HitRecord hit) {
  return ISO_CLIP && hit.t != INFINITY && (hit.cell & ISO_CAP) != 0;
}

/// Where a light ray enters the half spaces of all planes: those of the surfaces that are clipped,
/// which the surface with its hit need not be.
typedef struct RayEntrance {
  float begin;  ///< how far along the ray; 0: it begins there
  int plane;    ///< by which it enters, or ISO_NOT_CUT
} RayEntrance;

/// A ray that never enters gets to where is_clipped() finds that it has left.
///
/// given  in the index space of a level of detail
/// voxel  its voxels' size [voxels of the finest level]
ISO_INLINE RayEntrance entrance_of(ISO_GLOBAL const ClipParams *clip, GivenRay given, float voxel) {
  RayEntrance at = {0.0f, ISO_NOT_CUT};
  for (uint i = 0; i < clip->num_planes; ++i) {
    ISO_GLOBAL const PlaneParams *p = &clip->planes[i];
    const float d = fma(p->grad_x, given.d_x, fma(p->grad_y, given.d_y, p->grad_z * given.d_z)),
                o = fma(p->grad_x, given.o_x, fma(p->grad_y, given.o_y, p->grad_z * given.o_z));
    const float t = d > 0.0f ? -(o + p->first_voxel / voxel) / d : 0.0f;
    if (t > at.begin) {
      at.begin = t;
      at.plane = (int)i;
    }
  }
  return at;
}

/// The ray from a place on its way on.
ISO_INLINE GivenRay ray_from(GivenRay given, float begin) {
  given.o_x = fma(begin, given.d_x, given.o_x);
  given.o_y = fma(begin, given.d_y, given.o_y);
  given.o_z = fma(begin, given.d_z, given.o_z);
  return given;
}

/// t of a hit of that ray, if it begins there.
///
/// t_scale  View::t_scale of the ray's level of detail
ISO_INLINE float t_from(float t_scale, float t, float begin) {
  return fma(-begin, t_scale, t);
}

/// The ray from where it enters: see entrance_of(). If there are caps, it begins at one: what is
/// inside a surface there stops it.
ISO_INLINE GivenRay entering(ISO_GLOBAL const ClipParams *clip, GivenRay given, RayEntrance at) {
  given = ray_from(given, at.begin);
  return clip->with_caps != 0 ? cut_by_plane(given, at.plane) : given;
}

/// Has a ray that begins in front of all planes, or is entering(), left their half spaces at t?
///
/// given, voxel  as of entrance_of()
ISO_INLINE int is_clipped(ISO_GLOBAL const ClipParams *clip, GivenRay given, float voxel, float t) {
  int behind = 0;
  for (uint i = 0; i < clip->num_planes; ++i) {
    ISO_GLOBAL const PlaneParams *p = &clip->planes[i];
    const float d = fma(p->grad_x, given.d_x, fma(p->grad_y, given.d_y, p->grad_z * given.d_z)),
                o = fma(p->grad_x, given.o_x, fma(p->grad_y, given.o_y, p->grad_z * given.o_z));
    behind |= !(d > 0.0f) && fma(voxel, fma(t, d, o), p->first_voxel) < 0.0f;
  }
  return behind;
}

ISO_NAMESPACE_END

#endif
