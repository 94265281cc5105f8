/// start_and_march.cl -- pipeline `rays`: begins a frame whose blocks are mostly cached, on GPUs.
/// What start_rays and march do (Sec. 3.2, 3.3, 3.7), in one kernel, each ray by one work-item. If
/// most rays wait at once, the two are faster: start_rays is lean, and march has several work-items
/// for each of the last rays.
#include "device/march_block.h"
#include "device/march_pass.h"
#include "device/ray_source.h"
#include "device/work_group.h"
#include "portable/block_cells.h"
#include "portable/window.h"

/// How far a ray has got.
typedef struct RayWay {
  int result;       ///< ISO_RAY_*
  uint first;       ///< the first active block that it meets, or ISO_INVALID_ID
  uint at;          ///< the block in which it did not go on, if it waits
  uint num_blocks;  ///< that it has left behind
  BlockChange change;
} RayWay;

/// Takes a pixel's ray on until it hits, leaves or waits.
///
/// blocks  [ISO_BLOCKS_AT_ONCE] scratch, ISO_SCRATCH_STRIDE apart
ISO_INLINE void take_ray_on(const FrameParams *frame, global const uint *macrocell_masks,
                            const CacheReader *cache, const Ray *ray, LastPlanes last, uint pixel,
                            ISO_SCRATCH uint *blocks, RayWay *way) {
  const uint x = pixel % frame->view.width, y = pixel / frame->view.width;
  uint next = x >= frame->screen.begin_x && x < frame->screen.end_x && y >= frame->screen.begin_y &&
                      y < frame->screen.end_y
                  ? first_block(frame, ray)
                  : ISO_INVALID_ID;
  while (next != ISO_INVALID_ID && way->result == ISO_RAY_LEFT) {
    const uint num_found = find_blocks(frame, macrocell_masks, ray, &next, ISO_BLOCKS_AT_ONCE,
                                       blocks, ISO_SCRATCH_STRIDE);
    if (way->first == ISO_INVALID_ID && num_found != 0) way->first = blocks[0];
    for (uint i = 0; i < num_found && way->result == ISO_RAY_LEFT; ++i) {
      way->at = blocks[i * ISO_SCRATCH_STRIDE];
      way->result = march_block(frame, cache, ray, last, block_coords(frame, way->at), 0,
                                ISO_SIDE_UNKNOWN, 0, 0, &way->change);
      if (way->result == ISO_RAY_LEFT) ++way->num_blocks;
    }
  }
}

/// Begins a frame with the camera's rays, and takes each on until it hits, leaves or waits. Frames
/// have one level of detail, and are not clipped.
///
/// prev    counts of the last pass of the wave before
/// other arguments as march
/// Out     hits [pixel] of all pixels; next_active_ray_ids [counts->next_active_count],
///         ray_block_ids, slot_stamps as march; counts->active_count: the rays that meet an active
///         block; *next_counts, opened
/// Launch  groups of ISO_GROUP_SIZE, which stride over the tiles of the picture
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void start_and_march(
    const FrameParams frame_params, global const uint *macrocell_masks, global const uint *table,
    global const ulong *inside, global ulong *changing, global const SlotValue *cache_values,
    global const PassCounts *prev, global PassCounts *counts, global PassCounts *next_counts,
    global uint *next_active_ray_ids, global uint *ray_block_ids, global HitRecord *hits,
    global uint *slot_stamps, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  ISO_SCRATCH_ARRAY(slots, 8);
  ISO_SCRATCH_ARRAY(blocks, ISO_BLOCKS_AT_ONCE);
  local uint counters[2], group_hits, group_blocks, group_rays;
  const LastPlanes last = last_planes(frame);
  const PixelBox image = {0, 0, frame->view.width, frame->view.height};
  const uint item = get_local_id(0), num_tiled = num_tiled_pixels(image);
  const CacheReader reader = {
      .table = table,
      .inside = inside,
      .changing = changing,
      .values = cache_values,
      .slot_stamps = slot_stamps,
      .stamp = read_stamp(counts->pass),
      .slots = slots,
  };
  uint num_hits = 0, num_blocks = 0, num_rays = 0;
  if (get_global_id(0) == 0) {
    counts->last_frame_pass = prev->frame_pass;
    counts->frame_pass = counts->pass;
    counts->window_count = first_window(frame);
    open_march(frame, prev, counts, next_counts, cache);
  }
  if (item == 0) counters[0] = group_hits = group_blocks = group_rays = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_global_id(0) - item; begin < num_tiled; begin += get_global_size(0)) {
    const uint pixel =
        begin + item < num_tiled ? tiled_pixel(frame, image, begin + item) : ISO_INVALID_ID;
    RayWay way;
    way.result = ISO_RAY_LEFT;
    way.first = way.at = ISO_INVALID_ID;
    way.num_blocks = 0;
    if (pixel != ISO_INVALID_ID) {
      const Ray ray = make_ray(frame, pixel);
      take_ray_on(frame, macrocell_masks, &reader, &ray, last, pixel, blocks, &way);
      num_rays += (uint)(way.first != ISO_INVALID_ID);
      num_blocks += way.num_blocks;
      if (way.result == ISO_RAY_HIT) {
        hits[pixel] = hit_of(frame, (global const ClipParams *)0, &ray, &way.change);
        ++num_hits;
        ++num_blocks;
      } else {
        hits[pixel] = no_hit();
      }
    }
    const int waits = way.result == ISO_RAY_DOUBT || way.result == ISO_RAY_WAITS;
    uint entry = 0;
    if (waits) {
      const uint log_ahead =
          way.at == way.first ? ISO_FIRST_LOG_AHEAD : further_ahead(ISO_FIRST_LOG_AHEAD);
      ray_block_ids[pixel] = way.at;
      entry = pack_entry(pixel, log_ahead, way.result == ISO_RAY_DOUBT ? 1u : 0u);
    }
    append_entry(waits, entry, counters, &counts->next_active_count, next_active_ray_ids);
  }
  if (num_hits != 0) atomic_add(&group_hits, num_hits);
  if (num_blocks != 0) atomic_add(&group_blocks, num_blocks);
  if (num_rays != 0) atomic_add(&group_rays, num_rays);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_hits != 0) atomic_add(&counts->hit_count, group_hits);
  if (item == 0 && group_blocks != 0) atomic_add(&counts->granted_count, group_blocks);
  if (item == 0 && group_rays != 0) atomic_add(&counts->active_count, group_rays);
}
