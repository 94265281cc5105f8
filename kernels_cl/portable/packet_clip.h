/// packet_clip.h -- clip.h for eight rays at a time, with the same bits.
///
/// Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_PACKET_CLIP_H
#define ISOWAVE_PACKET_CLIP_H

#include "clip.h"
#include "packet.h"

ISO_PACKET_NAMESPACE_BEGIN

/// clip_ray() of the rays of pixels (column, row).
ISO_INLINE void clip_packet(const FrameParams *frame, ISO_GLOBAL const ClipParams *clip,
                            Ints column, Ints row, PacketRays *rays) {
  const PacketOfView r = packet_of_view(&frame->view, column, row);
  const float scale = clip->t_scale / frame->view.t_scale;
  Floats begin = floats(0.0f), end = floats(INFINITY);
  Ints cut_by = ints(ISO_NOT_CUT);
  for (uint i = 0; i < clip->num_planes; ++i) {
    ISO_GLOBAL const PlaneParams *plane = &clip->planes[i];
    PacketAxis a;
    make_packet_camera_axis(&frame->view, r.u, r.v, r.length, plane->eye * scale, plane->fwd,
                            plane->right, plane->up, 0.0f, &a);
    const Mask still = a.d == 0.0f;
    const Floats never = pick(a.o < 0.0f, floats(0.0f), floats(INFINITY)),
                 crossing = packet_plane_t(a.o, a.inv_hi, a.inv_lo, floats(0.0f)).hi,
                 t = pick(still, never, crossing);
    const Mask later = a.up & (t > begin);
    begin = pick(later, t, begin);
    cut_by = pick(later, ints((int)i), cut_by);
    end = pick(~a.up & (t < end), t, end);
  }
  const Mask is_cut = (cut_by != ISO_NOT_CUT) & (begin >= rays->begin_t);
  rays->begin_t = pick(is_cut, begin, rays->begin_t);
  rays->cut_by = pick(is_cut, cut_by, rays->cut_by);
  rays->end_t = smaller(end, rays->end_t);
  rays->has_end = any(rays->end_t < ISO_NEVER);
}

/// has_interval() of each.
ISO_INLINE Mask have_intervals(const PacketRays *rays) {
  return rays->begin_t < rays->end_t;
}

ISO_PACKET_NAMESPACE_END

#endif
