/// initial_rays.cl -- camera -> where each pixel's ray starts (Sec. 3.2).
#define ISO_FOUND global
#include "device/block_walk.h"
#include "portable/cell_intersect.h"
#include "portable/window.h"

/// Begins a frame.
///
/// Out     by pixel [height * width]: hits: none; the first block of the ray; whether it meets any
///         that may be active; ray_ids: its entry, for the compaction that follows
/// Launch  grid-stride over pixels, in `parts` launches (ocl::Range)
kernel void initial_rays(const FrameParams frame_params, uint parts, global HitRecord *hits,
                         global uint *ray_block_ids, global uint *ray_ids,
                         global uint *ray_active_mask, global PassCounts *counts) {
  const FrameParams *frame = &frame_params;
  if (get_global_id(0) == 0) {
    counts->last_frame_pass = counts->frame_pass;
    counts->frame_pass = counts->pass + 1;
    counts->ray_count = frame_rays(frame);
    counts->window_count = first_window(frame);
  }
  for (uint pixel = get_global_id(0); pixel < frame_rays(frame);
       pixel += parts * get_global_size(0)) {
    const Ray ray = make_ray(frame, pixel);
    const uint block_id = first_block(frame, &ray);
    hits[pixel] = no_hit();
    ray_block_ids[pixel] = block_id;
    ray_ids[pixel] = pack_entry(pixel, 0, 0);
    ray_active_mask[pixel] = block_id != ISO_INVALID_ID;
  }
}
