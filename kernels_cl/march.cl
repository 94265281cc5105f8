/// march.cl -- pipeline `rays`: each ray walks through the active blocks and intersects those that
/// are cached; at the first that is not it waits, and asks for that block and its next candidates
/// (Sec. 3.3, 4).
///
/// start_rays -> march -> request_ahead -> [ cache -> decode -> march -> request_ahead ]*. No sort
/// and no composite: a ray's blocks come in ray order, so its first change is its hit.
#define ISO_FOUND local
#include "device/block_requests.h"
#include "device/level_borders.h"
#include "device/march_block.h"
#include "portable/touched_blocks.h"

/// Appends the rays that go on to next_active_ray_ids. Called by whole work-groups.
/// goes_on: this work-item has one. counters [2] of the work-group: 0 on entry and on return.
ISO_INLINE void append_ray(int goes_on, uint entry, volatile local uint *counters,
                           volatile global uint *count, global uint *list) {
  uint place = 0;
  if (goes_on) place = atomic_inc(&counters[0]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0 && counters[0] != 0) counters[1] = atomic_add(count, counters[0]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (goes_on) list[counters[1] + place] = entry;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
}

/// Work-items for each ray, all of one work-group: as many as there are, up to one for each block
/// of a round.
ISO_INLINE uint lanes_per_ray(uint num_rays) {
  uint lanes = min(ISO_BLOCKS_AT_ONCE, (uint)ISO_GROUP_SIZE);
  while (lanes > 1 && lanes * num_rays > get_global_size(0)) lanes /= 2;
  return lanes;
}

ISO_INLINE uint frame_rays(const FrameParams *frame) {
  return frame->width * frame->height;
}

/// N_Spec (Sec. 4) of so many rays at work.
ISO_INLINE uint speculation_count(const FrameParams *frame, uint num_rays) {
  return num_rays == 0 ? 0 : clamp(frame_rays(frame) / num_rays, 1u, frame->max_spec_count);
}

/// How many of the rays that wait ask for blocks in this pass: see next_window(). All in the first
/// of a frame.
ISO_INLINE uint open_window(const FrameParams *frame, global const PassCounts *prev,
                            global const PassCounts *counts) {
  uint window = frame_rays(frame);
  if (counts->pass != counts->frame_pass) {
    /* Fewer rays than take part may be left; that is no reason to leave out some of more. */
    const uint asked = prev->requested_count > counts->decoded_count
                           ? min(prev->window_count, prev->next_active_count)
                           : prev->window_count;
    window = next_window(asked, prev->requested_count, counts->decoded_count);
  }
  return min(window, frame_rays(frame));
}

/// Opens the counts of the next pass. One work-item; nobody reads *next in this pass.
ISO_INLINE void open_next_counts(const FrameParams *frame, global const PassCounts *counts,
                                 global PassCounts *next) {
  next->ray_count = frame_rays(frame);
  next->pass = counts->pass + 1;
  next->frame_pass = counts->frame_pass;
  next->last_frame_pass = counts->last_frame_pass;
  next->active_count = next->spec_count = next->window_count = 0;
  next->pair_slot_count = next->pair_count = next->ahead_count = 0;
  next->granted_count = next->visible_count = next->requested_count = next->decoded_count = 0;
  next->recycled_count = next->hit_count = next->next_active_count = 0;
  next->free_count = counts->free_count;
}

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

/// Begins a frame. hits [pixel], seen as words, = none; next_active_ray_ids
/// [counts->next_active_count]: of the frame's screen box, the pixels whose rays meet an active
/// block, each with that block in ray_block_ids [pixel]. counts: of the frame's last pass,
/// next_active_count 0 before; *next: of the first pass of this frame. frames [num_frames]: with
/// levels of detail, those that draw, the finest first; frame_params is the first of them. ranges:
/// of their blocks. A kernel of its own, since it is so much leaner than march that far more of its
/// work-items fit a device at a time. Groups stride over the tiles.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void start_rays(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const uint *macrocell_masks, global const ushort *ranges, global PassCounts *counts,
    global PassCounts *next, global uint *next_active_ray_ids, global uint *ray_block_ids,
    global uint *hit_words) {
  const FrameParams *frame = &frame_params;
  local uint found[ISO_GROUP_SIZE], counters[2];
  const PixelBox box = {frame->screen_begin_x, frame->screen_begin_y, frame->screen_end_x,
                        frame->screen_end_y};
  const uint item = get_local_id(0), num_tiled = num_tiled_pixels(box);
  if (get_global_id(0) == 0) {
    next->last_frame_pass = counts->frame_pass;
    next->frame_pass = next->pass;
  }
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < frame_rays(frame);
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    clear_hits(hit_words + begin * ISO_HIT_WORDS,
               min((uint)ISO_GROUP_SIZE, frame_rays(frame) - begin));
    barrier(CLK_LOCAL_MEM_FENCE); /* or each of a CPU's work-items, one by one, would go through all
                                     memory */
  }
  if (item == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_tiled;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint pixel =
        begin + item < num_tiled ? tiled_pixel(frame, box, begin + item) : ISO_INVALID_ID;
    uint num_found = 0, log_ahead = ISO_FIRST_LOG_AHEAD;
    if (pixel != ISO_INVALID_ID) {
      const Ray ray = make_ray(frame, pixel);
      uint block_id = first_block(frame, &ray);
      if (block_id != ISO_INVALID_ID)
        num_found = find_blocks(frame, macrocell_masks, &ray, &block_id, 1, found + item, 1);
      if (ISO_LEVELS && num_found == 0) {
        log_ahead = ISO_BORDER_LOG_AHEAD;
        found[item] = cross_borders(frames, num_frames, macrocell_masks, ranges, pixel, 0,
                                    ISO_SIDE_UNKNOWN, found + item);
        num_found = found[item] != ISO_INVALID_ID;
      }
      if (num_found != 0) ray_block_ids[pixel] = found[item];
    }
    append_ray(num_found != 0, pixel | log_ahead << ISO_RAY_AHEAD_SHIFT, counters,
               &counts->next_active_count, next_active_ray_ids);
  }
}

/// Walks rays on until they hit, leave or wait: active_ray_ids [prev->next_active_count], each from
/// ray_block_ids [pixel], an active block. Out: hits [pixel]; next_active_ray_ids
/// [counts->next_active_count] of those that wait, and in ray_block_ids the block they wait at;
/// *next, opened. macrocell_masks: as traverse(). frame_params, frames, ranges: as start_rays; a
/// ray that leaves the band of its level waits behind the border.
///
/// Groups stride over the rays, in rounds: find the next blocks, walk their cells. When rays are so
/// few that a device would wait for the longest of them, each has more work-items, up to one for
/// each block of a round; the first block in which anything happens decides, which an atomic_min of
/// its place tells.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void march(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const uint *macrocell_masks, global const ushort *ranges, global BlockEntry *table,
    global const ulong *inside, global const float *cache_values, global const PassCounts *prev,
    global PassCounts *counts, global PassCounts *next_counts, global const uint *active_ray_ids,
    global uint *next_active_ray_ids, global uint *ray_block_ids, global HitRecord *hits,
    global uint *slot_stamps, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  local uint slots[8 * ISO_GROUP_SIZE], found[ISO_BLOCKS_AT_ONCE * ISO_GROUP_SIZE];
  local uint counters[2], group_hits, group_blocks, num_going;
  volatile local uint deciding[ISO_GROUP_SIZE]; /* of each ray's blocks of the round */
  const uint item = get_local_id(0), num_rays = prev->next_active_count;
  const uint lanes = lanes_per_ray(num_rays);
  const uint stamp = read_stamp(counts->pass);
  uint num_hits = 0, num_blocks = 0;
  if (get_global_id(0) == 0) {
    open_next_counts(frame, counts, next_counts);
    open_requests(cache);
    cache->first_block_id = ISO_INVALID_ID;
    counts->active_count = num_rays;
    counts->window_count = open_window(frame, prev, counts);
    counts->free_count = cache->free_count;
  }
  if (item == 0) counters[0] = group_hits = group_blocks = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_rays * lanes;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint i = (begin + item) / lanes, lane = item % lanes;
    const int is_ray = i < num_rays;
    const uint entry = is_ray ? active_ray_ids[i] : 0, pixel = entry & ISO_RAY_PIXEL;
    const uint state = is_ray ? ray_block_ids[pixel] : ISO_INVALID_ID;
    const uint from = ISO_LEVELS && is_ray ? state & ISO_RAY_BLOCK : state;
    const uint side = ISO_LEVELS && is_ray ? state >> ISO_RAY_SIDE_SHIFT : ISO_SIDE_UNKNOWN;
    ISO_FRAME_OF(level, from);
    const LastPlanes last = last_planes(level);
    const Ray ray = make_ray(level, pixel);
    uint next = from, at = lane, more = 1, waits_as = 0, decides_at = 0;
    int result = ISO_RAY_LEFT, going = is_ray, gone = 0, first = 1;
    BlockChange change;
    while (more != 0) {
      uint num_passed = 0;
      if (lane == 0) deciding[item / lanes] = ISO_INVALID_ID;
      if (item == 0) num_going = 0;
      barrier(CLK_LOCAL_MEM_FENCE);
      if (going) {
        uint num_found = 1;
        if (first && lanes == 1) { /* most rays of a cold frame wait right there */
          found[item] = from;
          next = block_behind(level, &ray, block_coords(level, from), last);
        } else {
          num_found =
              find_blocks_from(level, macrocell_masks, &ray, first ? side : ISO_SIDE_UNKNOWN, &next,
                               ISO_BLOCKS_AT_ONCE, found + item);
        }
        for (at = lane; at < num_found && result == ISO_RAY_LEFT; at += lanes) {
          const int stands_here = first && at == 0;
          const int may_end = ISO_LEVELS && next == ISO_INVALID_ID && at + 1 == num_found;
          result = march_block(level, table, inside, cache_values, &ray,
                               block_coords(level, found[at * ISO_GROUP_SIZE + item]), last,
                               slots + item, slot_stamps, stamp,
                               stands_here && (entry & ISO_RAY_IN_DOUBT) != 0,
                               stands_here ? side : ISO_SIDE_UNKNOWN, may_end, &change);
          if (result == ISO_RAY_LEFT) {
            ++num_passed;
          } else {
            atomic_min(&deciding[item / lanes], at);
            decides_at = at;
            waits_as = found[at * ISO_GROUP_SIZE + item];
          }
        }
      }
      barrier(CLK_LOCAL_MEM_FENCE);
      if (going) {
        const uint place = deciding[item / lanes];
        if (lane < place) num_blocks += min(num_passed, (place - lane - 1) / lanes + 1);
        if (decides_at != place) result = ISO_RAY_LEFT;
        going = place == ISO_INVALID_ID && next != ISO_INVALID_ID;
        gone = place == ISO_INVALID_ID && next == ISO_INVALID_ID;
        if (going) atomic_inc(&num_going);
      }
      first = 0;
      barrier(CLK_LOCAL_MEM_FENCE |
              CLK_GLOBAL_MEM_FENCE); /* all know where their ray stood: one may say where it is */
      more = num_going;
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (result == ISO_RAY_HIT) {
      hits[pixel] = hit_of(level, &ray, &change);
      ++num_hits;
      ++num_blocks;
    }
    int waits = result == ISO_RAY_DOUBT || result == ISO_RAY_WAITS;
    uint log_ahead = entry >> ISO_RAY_AHEAD_SHIFT & 7u;
    if (waits) {
      if (waits_as != from) log_ahead = min(log_ahead + 1, ISO_RAY_AHEAD_MAX);
      ray_block_ids[pixel] = ISO_LEVELS && waits_as == from ? state : waits_as;
    }
    if (ISO_LEVELS && (result >= ISO_RAY_ENDS || (gone && lane == 0))) {
      const uint left_on = result == ISO_RAY_ENDS       ? ISO_SIDE_OUTSIDE
                           : result == ISO_RAY_ENDS + 1 ? ISO_SIDE_INSIDE
                                                        : ISO_SIDE_UNKNOWN;
      const uint behind = cross_borders(frames, num_frames, macrocell_masks, ranges, pixel,
                                        level_of(frames, num_frames, from), left_on, found + item);
      waits = behind != ISO_INVALID_ID;
      if (waits) ray_block_ids[pixel] = behind;
      log_ahead = ISO_BORDER_LOG_AHEAD;
    }
    append_ray(waits,
               pixel | log_ahead << ISO_RAY_AHEAD_SHIFT |
                   (result == ISO_RAY_DOUBT ? ISO_RAY_IN_DOUBT : 0u),
               counters, &counts->next_active_count, next_active_ray_ids);
  }
  if (num_hits != 0) atomic_add(&group_hits, num_hits);
  if (num_blocks != 0) atomic_add(&group_blocks, num_blocks);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_hits != 0) atomic_add(&counts->hit_count, group_hits);
  if (item == 0 && group_blocks != 0) atomic_add(&counts->granted_count, group_blocks);
}

#define ISO_REQUEST_STAGING 256u  ///< requests that a work-group collects before it writes them out

/// The request list, and where a work-group collects what it will add to it.
typedef struct Requests {
  global uint *bits, *block_ids;
  uint capacity;
  volatile global uint *count;
  local uint *staged;
  volatile local uint *num_staged;
} Requests;

/// Asks for those of the given corners of the dual grid of block b that are not cached; stamps the
/// others. In steps for all corners, so that a GPU waits for memory twice, not sixteen times. Most
/// have been asked for by another ray: their bits tell, and cost neither a search in the table nor
/// an atomic, for whose result one would wait.
ISO_INLINE void request_touched(const FrameParams *frame, global const BlockEntry *table,
                                global uint *slot_stamps, uint stamp, BlockCoords b, uint touched,
                                Requests requests) {
  BlockEntry entries[8];
  uint missing = touched; /* of the corners: nobody is known to have asked for them */
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
    const uint word = (touched >> corner & 1u) != 0 ? request_word(frame, x, y, z) : 0;
    const uint bits = ISO_CHECK_RACES ? atomic_or(&requests.bits[word], 0u) : requests.bits[word];
    missing &= ~((uint)((bits & request_bit(frame, x, y, z)) != 0) << corner);
  }
  if (missing == 0) return;
  find_dual_grid(frame, table, b.x, b.y, b.z, entries);
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    if ((missing >> corner & 1u) != 0 && entries[corner].slot != ISO_BLOCK_ABSENT) {
      slot_stamps[entries[corner].slot] = stamp;
      missing &= ~(1u << corner);
    }
  }
  for (uint corner = 0; corner < 8; ++corner) {
    const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
    if ((missing >> corner & 1u) != 0 && mark_request(frame, requests.bits, x, y, z)) {
      const uint block_id = block_id_at(frame, x, y, z), place = atomic_inc(requests.num_staged);
      if (place < ISO_REQUEST_STAGING) {
        requests.staged[place] = block_id;
      } else {
        list_request(frame, requests.block_ids, requests.capacity, requests.bits,
                     atomic_inc(requests.count), block_id);
      }
    }
  }
}

/// Of the rays that wait, active_ray_ids [counts->next_active_count], the first
/// counts->window_count ask for the blocks that they touch in their next active blocks: N_Spec of
/// them (Sec. 4), or their own number of frame->per_ray_speculation. Out: request_block_ids
/// [counts->requested_count, at most capacity]. The other arguments as in march. Groups stride over
/// the rays; when these are few, each has more work-items, which share its blocks out among them.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void request_ahead(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const uint *macrocell_masks, global const BlockEntry *table, global PassCounts *counts,
    global const uint *active_ray_ids, global const uint *ray_block_ids, global uint *slot_stamps,
    global uint *requested_bits, global uint *request_block_ids, uint capacity,
    global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  local uint found[ISO_BLOCKS_AT_ONCE * ISO_GROUP_SIZE], staged[ISO_REQUEST_STAGING];
  local uint num_staged, list_begin, group_pairs, group_ahead;
  const Requests requests = {requested_bits, request_block_ids, capacity, &counts->requested_count,
                             staged,         &num_staged};
  const uint item = get_local_id(0), num_waiting = counts->next_active_count;
  const uint num_rays = min(num_waiting, counts->window_count), lanes = lanes_per_ray(num_rays);
  const uint stamp = needed_stamp(counts->pass);
  const uint spec_count = speculation_count(frame, num_waiting);
  /* Where rays are few, all look further: the last ones take fewer passes, and decode hardly more.
     With the number of those that wait, which is fewer, decoding takes longer than the passes that
     it saves. */
  const uint least = speculation_count(frame, counts->active_count) / 2;
  const uint most = counts->window_count < frame_rays(frame) ? scarce_speculation(frame, num_rays)
                                                             : ISO_MAX_SPECULATION;
  uint num_pairs = 0, num_ahead = 0;
  if (get_global_id(0) == 0) counts->spec_count = spec_count;
  if (item == 0) num_staged = group_pairs = group_ahead = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_rays * lanes;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint i = (begin + item) / lanes, lane = (begin + item) % lanes;
    if (i < num_rays) {
      const uint entry = active_ray_ids[i], pixel = entry & ISO_RAY_PIXEL;
      const uint state =
          ray_block_ids[pixel]; /* it stands at an active block, or where it has a side */
      uint next = ISO_LEVELS ? state & ISO_RAY_BLOCK : state,
           side = ISO_LEVELS ? state >> ISO_RAY_SIDE_SHIFT : ISO_SIDE_UNKNOWN;
      ISO_FRAME_OF(level, next);
      const LastPlanes last = last_planes(level);
      const Ray ray = make_ray(level, pixel);
      const uint own = min(1u << (entry >> ISO_RAY_AHEAD_SHIFT & 7u), frame->max_spec_count);
      const uint ahead = min(frame->per_ray_speculation ? max(own, least) : spec_count, most);
      if (lane == 0) num_ahead += ahead;
      for (uint asked = 0; asked < ahead && next != ISO_INVALID_ID;) {
        const uint num_found =
            find_blocks_from(level, macrocell_masks, &ray, side, &next,
                             min(ahead - asked, ISO_BLOCKS_AT_ONCE), found + item);
        side = ISO_SIDE_UNKNOWN;
        for (uint at = lane; at < num_found; at += lanes) { /* all lanes at once */
          const uint block_id = found[at * ISO_GROUP_SIZE + item];
          const BlockCoords b = block_coords(level, block_id);
          const uint touched = touched_blocks(&ray, (int)b.x, (int)b.y, (int)b.z, last);
          request_touched(level, table, slot_stamps, stamp, b, touched, requests);
          ++num_pairs;
          if (i == 0 && asked + at == 0) {
            cache->first_block_id = block_id;
            cache->first_touched = touched;
          }
        }
        asked += num_found;
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) list_begin = atomic_add(requests.count, min(num_staged, ISO_REQUEST_STAGING));
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint j = item; j < min(num_staged, ISO_REQUEST_STAGING); j += ISO_GROUP_SIZE) {
      list_request(frame, request_block_ids, capacity, requested_bits, list_begin + j, staged[j]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) num_staged = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (num_pairs != 0) atomic_add(&group_pairs, num_pairs);
  if (num_ahead != 0) atomic_add(&group_ahead, num_ahead);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_pairs != 0) atomic_add(&counts->pair_count, group_pairs);
  if (item == 0 && group_ahead != 0) atomic_add(&counts->ahead_count, group_ahead);
}
