/// initial_rays.cl -- camera -> where each pixel's ray starts (Sec. 3.2).
#include "block_grid.h"
#include "cell_intersect.h"

/// One entry per pixel [height * width]: no hit yet, the first block of the ray, whether it meets the volume
/// at all. ray_ids[i] = i, for the compaction that follows. Grid-stride.
kernel void initial_rays(constant FrameParams *frame, global HitRecord *hits, global uint *ray_block_ids,
                         global uint *ray_ids, global uint *ray_active_mask, global PassCounts *counts) {
  const LastPlanes last = last_planes(frame);
  if (get_global_id(0) == 0) counts->window_count = counts->pixel_count; /* the first pass is for all */
  for (uint pixel = get_global_id(0); pixel < frame->width * frame->height; pixel += get_global_size(0)) {
    const Ray ray = make_ray(frame, pixel);
    RayEvent enter;
    const int meets = domain_entry(&ray, last, &enter);
    uint block_id = ISO_INVALID_ID;
    if (meets) {
      /* Blocks that own no cell (one last voxel layer) are never entered. */
      block_id = block_id_at(frame, locate(ray.x, 0, enter, 4, 0, (last.x - 1) / 4),
                             locate(ray.y, 1, enter, 4, 0, (last.y - 1) / 4),
                             locate(ray.z, 2, enter, 4, 0, (last.z - 1) / 4));
    }
    hits[pixel] = no_hit();
    ray_block_ids[pixel] = block_id;
    ray_ids[pixel] = pixel;
    ray_active_mask[pixel] = meets;
  }
}
