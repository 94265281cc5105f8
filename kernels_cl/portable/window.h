/// window.h -- how many of the rays at work take part in a pass, and how many blocks they look
/// ahead at (Sec. 4).
///
/// Portable: OpenCL C 1.2 and C++.
///
/// The window of a pass: of the list of rays at work, the first so many take part. Not in the
/// paper, in which all do. A pass that found too few cache slots leaves fewer rays to the next.
#ifndef ISOWAVE_WINDOW_H
#define ISOWAVE_WINDOW_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

ISO_INLINE uint frame_rays(const FrameParams *frame) {
  return frame->view.width * frame->view.height;
}

/// The number of rays that take part, of num_rays.
ISO_INLINE uint rays_in_window(uint window, uint num_rays) {
  return num_rays < window ? num_rays : window;
}

/// The window of the first pass of a frame: all rays.
ISO_INLINE uint first_window(const FrameParams *frame) {
  return frame_rays(frame);
}

/// After a pass with enough slots, a quarter more rays than before. After one with too few, about
/// as many as can be served: otherwise all would hold on to parts of their dual grids, none would
/// get the rest, and only the ray that is served first would move.
///
/// window     of the pass whose requests have been answered
/// num_rays   at work when it asked; fewer than the window may have been left
/// requested  blocks that it asked for
/// granted    blocks that got a slot
ISO_INLINE uint next_window(const FrameParams *frame, uint window, uint num_rays, uint requested,
                            uint granted) {
  const uint all = frame_rays(frame);
  uint next = window + window / 4 + 1;
  if (requested > granted) {
    const uint asked = rays_in_window(window, num_rays);
    next = (uint)((ulong)asked * granted / requested);
    if (next < asked / 4)
      next = asked / 4; /* nothing was freed, perhaps, since the host took slots for ample */
    if (next == 0) next = 1;
  }
  return next < all ? next : all;
}

/// N_Spec of a pass with so many rays at work; 0 for none.
ISO_INLINE uint speculation_count(const FrameParams *frame, uint num_rays) {
  uint count = 0;
  if (num_rays != 0) {
    count = frame_rays(frame) / num_rays;
    if (count > frame->schedule.max_spec_count) count = frame->schedule.max_spec_count;
    if (count == 0) count = 1;
  }
  return count;
}

/// Most blocks that a ray looks ahead at. Not in the paper. While only num_rays of all take part,
/// as many for all of them together as there are slots, but one for each: what rays look at in vain
/// costs slots whose blocks other rays would read.
ISO_INLINE uint most_ahead(const FrameParams *frame, uint window, uint num_rays) {
  uint most = ISO_MAX_SPECULATION;
  if (window < frame_rays(frame)) {
    most = frame->schedule.cache_slots / (num_rays + 1);
    if (most == 0) most = 1;
  }
  return most;
}

ISO_NAMESPACE_END

#endif
