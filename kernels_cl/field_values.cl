/// field_values.cl -- a wave of a frame whose surface has the colours of another volume, the field:
/// hits get the values of portable/field_value.h, as far as the field's blocks are cached; the
/// other rays ask for what is missing.
///
///   [ smooth normals ] -> field_values -> [ cache -> decode -> field_values ]*
#include "device/found_slots.h"
#include "device/level_borders.h"
#include "device/pass_counts.h"
#include "device/touched_requests.h"
#include "portable/block_cells.h"
#include "portable/field_value.h"
#include "portable/ray_state.h"

/// The value at a hit, of cached blocks. A function of its own: inlined into the kernel, PoCL 5
/// does not compile it.
ISO_LONG float cached_value(global const FieldMap *map, global const uint *label_table,
                            HitRecord hit, const FieldPlace *place, const CachedStencil *cached) {
  float corners[8];
  ISO_UNROLL
  for (int c = 0; c < 8; ++c) {
    corners[c] =
        stencil_voxel(cached, place->x + (c & 1), place->y + (c >> 1 & 1), place->z + (c >> 2));
  }
  return value_of_hit(map, label_table, hit, corners, place->at);
}

/// frame_params  view and screen of the frame; grid and schedule of the field
/// frames, num_frames  as start_rays: the field is the drawn volume, and hits get the values of
///               their levels of detail; not read if ISO_LEVELS is 0
/// parts         as start_rays
/// label_table   [ISO_NUM_LABELS / 4] see groups_of_label(); not read unless map->labels is
///               ISO_FIELD_OWN_LABELS
/// begins  1: all hits. 0: the hits of the list
/// prev    counts of the pass before
/// In      map [num_frames], or [1] if ISO_LEVELS is 0; hits [pixel];
///         active_ray_ids [prev->next_active_count], unless it begins
/// Out     field_values [pixel] of hits on the map's surfaces;
///         next_active_ray_ids [counts->next_active_count]: the
///         rays that wait. The first counts->window_count of them ask for blocks of the field:
///         request_block_ids [counts->requested_count, at most capacity]; slot_stamps of the blocks
///         that were read, or are needed; *next_counts, opened
/// Launch  groups of ISO_GROUP_SIZE, which stride over the tiles of the screen box, or the list,
///         in parts as start_rays
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void field_values(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const FieldMap *map, global const uint *label_table, uint parts, uint begins,
    global const uint *table, global const SlotValue *cache_values, global const PassCounts *prev,
    global PassCounts *counts, global PassCounts *next_counts, global const uint *active_ray_ids,
    global uint *next_active_ray_ids, global const HitRecord *hits, global float *field_values,
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
  const uint num_rays = begins ? num_tiled_pixels(box) : num_left;
  const uint window = begins ? first_window(frame)
                             : next_window(frame, prev->window_count, num_left,
                                           prev->requested_count, counts->decoded_count);
  if (get_global_id(0) == 0) {
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
    uint pixel = ISO_INVALID_ID, touched = 0, missing = 0, block_id = ISO_INVALID_ID;
    BlockCoords base = {0, 0, 0};
    if (i < num_rays)
      pixel = begins ? tiled_pixel(frame, box, i) : unpack_entry(active_ray_ids[i]).pixel;
    if (pixel != ISO_INVALID_ID) block_id = hits[pixel].block_id;
    if (block_id != ISO_INVALID_ID) {
      ISO_FRAME_OF(level, block_id);
      global const FieldMap *of_level =
          ISO_LEVELS ? map + level_of(frames, num_frames, block_id) : map;
      const FieldPlace place = field_place(of_level, hits[pixel]);
      if (is_in_field(place)) {
        base = field_base(place);
        touched = field_blocks(place);
        missing = touched & ~find_slots(level, table, base, touched, slots);
        if (missing == 0) {
          const CachedStencil cached = {cache_values, slots, base, 0};
          field_values[pixel] = cached_value(of_level, label_table, hits[pixel], &place, &cached);
          /* The stamp of a block stands for the next ones along the axes, too (last_use()). */
          stamp_read(slot_stamps, slots[0], read_stamp(pass));
        } else {
          atomic_inc(&num_waiting);
        }
      } else if (is_of_map(of_level, hits[pixel])) {
        field_values[pixel] = no_value(); /* in place of that of a layer before */
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

/// In      field_values [count]
/// Out     range [2]: field_key() of the least and of the largest value; as it was if there is none
/// Launch  grid-stride over values
kernel void field_range(uint count, global const float *field_values, global uint *range) {
  uint least = 0xFFFFFFFFu, largest = 0;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    const float value = field_values[i];
    if (is_no_data(value)) continue;
    least = min(least, field_key(value));
    largest = max(largest, field_key(value));
  }
  if (least > largest) return;
  atomic_min(&range[0], least);
  atomic_max(&range[1], largest);
}
