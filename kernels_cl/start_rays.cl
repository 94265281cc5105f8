/// start_rays.cl -- pipeline `rays`: begins a frame, or a list of rays, with those that meet an
/// active block (Sec. 3.2, 3.3). A kernel of its own, since it is so much leaner than march that
/// far more of its work-items fit a device at a time.
#include "device/level_borders.h"
#include "device/ray_source.h"
#include "device/work_group.h"
#include "portable/block_cells.h"
#include "portable/window.h"

#define ISO_HIT_WORDS ((uint)(sizeof(HitRecord) / sizeof(uint)))

/// hits [count] = no_hit(), by a work-group. Seen as words, in fours, of which neighbours write
/// neighbours: records are 36 bytes long, so that the nine stores of each would be scattered.
ISO_INLINE void clear_hits(global uint *words, uint count) {
  const uint num_words = ISO_HIT_WORDS * count;
  for (uint i = 4 * get_local_id(0); i < num_words; i += 4 * ISO_GROUP_SIZE) {
    const uint4 at = i % ISO_HIT_WORDS + (uint4)(0, 1, 2, 3);
    const uint4 field =
        select(at, at - ISO_HIT_WORDS, at >= ISO_HIT_WORDS); /* t; block_id and cell; zeros */
    const uint4 ids = select((uint4)(0), (uint4)(ISO_INVALID_ID), field < 3);
    const uint4 words_of_none = select(ids, as_uint4((float4)(INFINITY)), field == 0);
    if (i + 4 <= num_words) {
      vstore4(words_of_none, 0, words + i);
    } else { /* the image's last few */
      words[i] = words_of_none.x;
      if (i + 1 < num_words) words[i + 1] = words_of_none.y;
      if (i + 2 < num_words) words[i + 2] = words_of_none.z;
    }
  }
}

/// Begins a wave of rays.
///
/// begins_frame  1: and with it a frame, for the stamps of cache slots (slot_stamps.h)
/// frames  [num_frames] with levels of detail, those that draw, the finest first; frame_params is
///         the first of them
/// clip [1]  of the camera's rays, if ISO_CLIP is 1
/// given   [pixel] the rays, if ISO_GIVEN_RAYS is 1
/// ranges  of the blocks of all levels
/// no_data, no_data_begin  as lacks_data_at_border
/// counts  of the last pass of the wave before
/// next    counts of this wave's first pass
/// In      counts->next_active_count: 0
/// Out     hit_words: hits [pixel], seen as words, all none; next_active_ray_ids
///         [counts->next_active_count]: of the frame's screen box, the pixels whose rays meet an
///         active block; ray_block_ids [pixel]: that block
/// Launch  groups of ISO_GROUP_SIZE, which stride over the tiles of the screen box; in as many
///         parts, one after the other, as `parts` says (ocl::Range)
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void start_rays(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const ClipParams *clip, uint parts, uint begins_frame, global const GivenRay *given,
    global const uint *macrocell_masks, global const ushort *ranges, global const uint *no_data,
    uint no_data_begin, global PassCounts *counts, global PassCounts *next,
    global uint *next_active_ray_ids, global uint *ray_block_ids,
    global ISO_WORDS(HitRecord) *hit_words) {
  const FrameParams *frame = &frame_params;
  ISO_SCRATCH_ARRAY(found, 1);
  local uint counters[2];
  const PixelBox box = {frame->screen.begin_x, frame->screen.begin_y, frame->screen.end_x,
                        frame->screen.end_y};
  const uint item = get_local_id(0), num_tiled = num_tiled_pixels(box);
  if (get_global_id(0) == 0) {
    if (begins_frame != 0) {
      next->last_frame_pass = counts->frame_pass;
      next->frame_pass = next->pass;
    }
    next->window_count = first_window(frame);
  }
  for (uint begin = get_global_id(0) - item; begin < frame_rays(frame);
       begin += parts * get_global_size(0)) {
    clear_hits(hit_words + begin * ISO_HIT_WORDS,
               min((uint)ISO_GROUP_SIZE, frame_rays(frame) - begin));
    barrier(CLK_LOCAL_MEM_FENCE); /* or each of a CPU's work-items, one by one, would go through all
                                     memory */
  }
  if (item == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_global_id(0) - item; begin < num_tiled;
       begin += parts * get_global_size(0)) {
    const uint pixel =
        begin + item < num_tiled ? tiled_pixel(frame, box, begin + item) : ISO_INVALID_ID;
    uint stand = ISO_INVALID_ID, log_ahead = ISO_FIRST_LOG_AHEAD;
    if (pixel != ISO_INVALID_ID && has_ray(given, pixel)) {
      ISO_FIRST_FRAME_OF(level, pixel);
      const Ray ray = ray_of(level, clip, given, pixel);
      if (!ISO_CLIP || has_interval(&ray))
        stand = begin_in_level(level, &ray, macrocell_masks, ranges, no_data, no_data_begin,
                               side_where_cut(clip, &ray), found);
      if (stand == ISO_INVALID_ID) {
        stand = cross_borders(frames, num_frames, clip, macrocell_masks, ranges, no_data,
                              no_data_begin, pixel, 0, ISO_SIDE_UNKNOWN, found);
        log_ahead = ISO_BORDER_LOG_AHEAD;
      }
      if (stand != ISO_INVALID_ID) ray_block_ids[pixel] = stand;
    }
    append_entry(stand != ISO_INVALID_ID, pack_entry(pixel, log_ahead, 0), counters,
                 &counts->next_active_count, next_active_ray_ids);
  }
}
