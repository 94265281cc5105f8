/// smooth_normals.cl -- the last wave of a frame: hits get the gradient of smooth_gradient.h, as
/// far as its blocks are cached; the other rays ask for what is missing.
///
///   [ a pipeline's passes ] -> smooth_normals -> [ cache -> decode -> smooth_normals ]*
///
/// All but the gradients of hits keep their bits.
#include "device/found_slots.h"
#include "device/level_borders.h"
#include "device/pass_counts.h"
#include "device/touched_requests.h"
#include "device/work_group.h"
#include "portable/block_cells.h"
#include "portable/smooth_gradient.h"

/// See smooth_derivative(). All blocks are cached.
ISO_INLINE Gradient cached_gradient(const CachedStencil *cached, const Stencil *s, CellPoint at) {
  float corners[8], beyond[8];
  Gradient gradient;
  ISO_UNROLL
  for (int i = 0; i < 8; ++i) {
    corners[i] =
        stencil_voxel(cached, s->x.cell + (i & 1), s->y.cell + (i >> 1 & 1), s->z.cell + (i >> 2));
  }
  ISO_UNROLL
  for (int i = 0; i < 8; ++i) {
    beyond[i] = stencil_voxel(cached, (i & 1) != 0 ? s->x.above : s->x.below,
                              s->y.cell + (i >> 1 & 1), s->z.cell + (i >> 2));
  }
  gradient.x = smooth_derivative(corners, beyond, 1, s->x, at);
  ISO_UNROLL
  for (int i = 0; i < 8; ++i) {
    beyond[i] = stencil_voxel(cached, s->x.cell + (i & 1), (i & 2) != 0 ? s->y.above : s->y.below,
                              s->z.cell + (i >> 2));
  }
  gradient.y = smooth_derivative(corners, beyond, 2, s->y, at);
  ISO_UNROLL
  for (int i = 0; i < 8; ++i) {
    beyond[i] = stencil_voxel(cached, s->x.cell + (i & 1), s->y.cell + (i >> 1 & 1),
                              (i & 4) != 0 ? s->z.above : s->z.below);
  }
  gradient.z = smooth_derivative(corners, beyond, 4, s->z, at);
  return gradient;
}

/// Stamps what a gradient in block b was made of. The stamp of a block stands for the next ones
/// along the axes, too (last_use() in block_cache.cl): what is left are those before b.
ISO_INLINE void stamp_stencil(global uint *slot_stamps, uint stamp, BlockCoords b,
                              const CachedStencil *cached) {
  const uint own = (b.x - cached->base.x) + 2 * (b.y - cached->base.y) + 4 * (b.z - cached->base.z);
  stamp_read(slot_stamps, cached->slots[own * ISO_SCRATCH_STRIDE], stamp);
  for (uint step = 1; step < 8; step *= 2) {
    if ((own & step) != 0)
      stamp_read(slot_stamps, cached->slots[(own - step) * ISO_SCRATCH_STRIDE], stamp);
  }
}

/// Gives a hit its gradient, made of cached blocks.
ISO_LONG void write_gradient(global HitRecord *hit, const CachedStencil *cached,
                             const Stencil *stencil) {
  const CellPoint at = {hit->x, hit->y, hit->z};
  const Gradient gradient = cached_gradient(cached, stencil, at);
  if (is_no_gradient(gradient)) return;
  hit->grad_x = gradient.x;
  hit->grad_y = gradient.y;
  hit->grad_z = gradient.z;
}

/// frame_params, frames, num_frames, parts  as start_rays
/// begins  1: all hits; nothing happens while prev->next_active_count rays are still on their way
///         to a hit. 0: the hits of the list
/// prev    counts of the pass before
/// In      active_ray_ids [prev->next_active_count], unless it begins
/// Out     gradients of hits [pixel]; next_active_ray_ids [counts->next_active_count]: the rays
///         that wait, of which the first counts->window_count ask for blocks: request_block_ids
///         [counts->requested_count, at most capacity]; slot_stamps of the blocks that were read,
///         or are needed; *next_counts, opened
/// Launch  groups of ISO_GROUP_SIZE, which stride over the tiles of the screen box, or the list,
///         in parts as start_rays
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void smooth_normals(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames, uint parts,
    uint begins, global const uint *table, global const SlotValue *cache_values,
    global const PassCounts *prev, global PassCounts *counts, global PassCounts *next_counts,
    global const uint *active_ray_ids, global uint *next_active_ray_ids, global HitRecord *hits,
    global uint *slot_stamps, global uint *requested_bits, global uint *request_block_ids,
    uint capacity, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  ISO_SCRATCH_ARRAY(slots, 8);
  local uint staged[ISO_REQUEST_STAGING];
  local uint num_staged, list_begin, counters[2], num_waiting;
  const Requests requests = {requested_bits, request_block_ids, capacity, &counts->requested_count,
                             staged,         &num_staged};
  const PixelBox box = {frame->screen.begin_x, frame->screen.begin_y, frame->screen.end_x,
                        frame->screen.end_y};
  const uint item = get_local_id(0), num_left = prev->next_active_count, pass = counts->pass;
  const int too_early = begins && num_left != 0;
  const uint num_rays = too_early ? 0 : (begins ? num_tiled_pixels(box) : num_left);
  const uint window = begins ? first_window(frame)
                             : next_window(frame, prev->window_count, num_left,
                                           prev->requested_count, counts->decoded_count);
  if (get_global_id(0) == 0 && !too_early) {
    open_next_counts(frame, counts, next_counts);
    open_requests(cache);
    counts->active_count = begins ? 0 : num_left;
    counts->window_count = window;
    counts->free_count = cache->free_count;
  }
  if (item == 0) num_staged = counters[0] = num_waiting = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_global_id(0) - item; begin < num_rays;
       begin += parts * get_global_size(0)) {
    const uint i = begin + item;
    uint pixel = ISO_INVALID_ID, block_id = ISO_INVALID_ID, touched = 0, missing = 0;
    BlockCoords base = {0, 0, 0};
    if (i < num_rays)
      pixel = begins ? tiled_pixel(frame, box, i) : unpack_entry(active_ray_ids[i]).pixel;
    if (pixel != ISO_INVALID_ID && (hits[pixel].cell & ISO_CAP) == 0)
      block_id = hits[pixel].block_id;
    if (block_id != ISO_INVALID_ID) {
      ISO_FRAME_OF(level, block_id);
      const BlockCoords b = block_coords(level, block_id);
      const Stencil stencil = stencil_of(b, hits[pixel].cell, last_planes(level));
      base = stencil_base(&stencil);
      touched = stencil_blocks(&stencil);
      missing = touched & ~find_slots(level, table, base, touched, slots);
      if (missing == 0) {
        const CachedStencil cached = {cache_values, slots, base,
                                      hits[pixel].cell >> ISO_SURFACE_BIT};
        write_gradient(&hits[pixel], &cached, &stencil);
        stamp_stencil(slot_stamps, read_stamp(pass), b, &cached);
      } else {
        atomic_inc(&num_waiting);
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    uint any_waits = num_waiting != 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (; any_waits != 0; any_waits = 0) { /* none, mostly: a CPU pays for each barrier */
      const uint place = append_entry(missing != 0, pack_entry(pixel, 0, 0), counters,
                                      &counts->next_active_count, next_active_ray_ids);
      if (missing != 0 && place < window) {
        ISO_FRAME_OF(level, block_id);
        request_missing(level, base, touched, missing, place, needed_stamp(pass), slots,
                        slot_stamps, requests, cache);
      }
      list_staged(frame, requests, &list_begin);
      if (item == 0) num_waiting = 0;
      barrier(CLK_LOCAL_MEM_FENCE);
    }
  }
}
