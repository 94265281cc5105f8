/// march_packets.cl -- pipeline `rays` on CPUs: what start_rays and march do, eight rays at a time
/// (Sec. 3.2, 3.3, 3.7).
///
/// open_packets -> march_packets -> request_ahead -> [ cache -> decode -> open_packets ->
/// march_packets -> request_ahead ]*. The first march makes the rays of the picture, in packets of
/// 4 x 2; later ones take those that wait, eight neighbours of the list. Rays of the camera and
/// solver `bernstein` alone: march has the others.
///
/// ISO_ON_DEMAND, by -D: 1: rays decode the blocks that they come to (on_demand.h). So they wait
/// only if there is no free slot, and a frame with enough slots takes one pass.
///
/// ISO_LEVELS, by -D, with ISO_ON_DEMAND: 1: the first pass of a frame that is clipped or that
/// several levels of detail draw, in a launch for each band (packet_bands.h). Rays that wait then
/// go on in march.
#ifndef ISO_ON_DEMAND
#define ISO_ON_DEMAND 0
#endif
#include "device/float8.h"
#include "device/level_band.h"
#include "device/march_block.h"
#include "device/march_pass.h"
#include "device/on_demand.h"
#include "device/opened_blocks.h"
#include "portable/ray_state.h"

#define ISO_LANES 8u
// A work-item takes a chunk of packets at a time: a tile of the picture, wide enough that the hits
// of its rows are cleared in long runs, and high enough that its rays share blocks; or as many of a
// list.
#define ISO_TILE_COLUMNS 64u
#define ISO_TILE_ROWS 16u
#define ISO_TILE_PACKETS (ISO_TILE_COLUMNS * ISO_TILE_ROWS / ISO_LANES)
#define ISO_LIST_PACKETS 32u

/// The progress of the rays of a packet.
typedef struct PacketProgress {
  Mask met;         ///< have come to an active block
  Mask moved;       ///< to a second one
  uint num_blocks;  ///< blocks that they were intersected in
  Ints opened;      ///< the places of the blocks that they have opened last ...
  Ints have;        ///< ... and what these had: OpenedBlock
  Mask lost;        ///< other blocks have taken these places
} PacketProgress;

/// Blocks come from the cache.
typedef struct PacketField {
  global const uint *macrocell_masks;
  /* What borders between levels need: level_borders.h. */
  global const uint *all_masks, *no_data;
  global const ushort *ranges;
  uint no_data_begin;
  uint *macrocell_sides; /* [ISO_KNOWN_SIDES], see packet_bands.h */
  CacheReader cache;
  OpenedBlock *opened; /* [ISO_OPENED_BLOCKS] */
  PacketProgress *progress;
  BlockMaker *maker;
} PacketField;

ISO_INLINE void macrocell_bits(const PacketField *field, Ints macrocells, Mask lanes, Ints *low,
                               Ints *high) {
  const Ints at = 2 * (macrocells & lanes);
  global const uint *masks = field->macrocell_masks;
  const Ints lows = as_int8((uint8)(masks[at.s0], masks[at.s1], masks[at.s2], masks[at.s3],
                                    masks[at.s4], masks[at.s5], masks[at.s6], masks[at.s7]));
  ++masks;
  const Ints highs = as_int8((uint8)(masks[at.s0], masks[at.s1], masks[at.s2], masks[at.s3],
                                     masks[at.s4], masks[at.s5], masks[at.s6], masks[at.s7]));
  *low = pick(lanes, lows, *low);
  *high = pick(lanes, highs, *high);
}

/// Opens block b, unless a ray has been there before. corners: of its dual grid, those whose voxels
/// rays need, to be decoded on demand; 0: they need its cells alone.
ISO_INLINE const OpenedBlock *find_opened(const PacketField *field, const FrameParams *frame,
                                          BlockCoords b, uint corners) {
  const uint place = opened_place(b), needed = corners == 0 ? ISO_OPENED_CACHED : corners;
  OpenedBlock *opened = &field->opened[place];
  const int is_new = opened->block_id != block_id_at(frame, b.x, b.y, b.z);
  if (is_new) field->progress->lost |= field->progress->opened == (int)place;
  const int has_voxels = !is_new && (opened->have & 0xFFu) != 0;
  if (corners != 0 ? !has_voxels : is_new && !open_without_voxels(&field->cache, frame, b, opened))
    open_with_voxels(&field->cache, frame, b, opened);
  if (ISO_ON_DEMAND && (needed & ~opened->have) != 0 && !field->maker->is_full) {
    bring_corners(field->maker, frame, b, corners == 0 ? 1u : corners & ~opened->have);
    open_with_voxels(&field->cache, frame, b, opened);
  }
  return opened;
}

/// Most lanes come to the same block.
ISO_INLINE Mask open_blocks(const PacketField *field, const FrameParams *frame, const Ints *at,
                            Mask lanes, Ints *low, Ints *high) {
  PacketProgress *progress = field->progress;
  Mask waits = ints(0), left = lanes;
  progress->moved |= progress->met & lanes;
  progress->met |= lanes;
  while (any(left)) {
    const uint first = first_lane(bits_of(left));
    const Mask here =
        left & (at[0] == at[0][first]) & (at[1] == at[1][first]) & (at[2] == at[2][first]);
    BlockCoords b;
    b.x = (uint)at[0][first];
    b.y = (uint)at[1][first];
    b.z = (uint)at[2][first];
    const OpenedBlock *opened = find_opened(field, frame, b, 0);
    left &= ~here;
    if ((opened->have & ISO_OPENED_CACHED) == 0) {
      waits |= here;
    } else {
      *low = pick(here, ints((int)opened->cells_low), *low);
      *high = pick(here, ints((int)opened->cells_high), *high);
      progress->num_blocks += popcount(bits_of(here));
      progress->opened = pick(here, ints((int)opened_place(b)), progress->opened);
      progress->have = pick(here, ints((int)opened->have), progress->have);
      progress->lost &= ~here;
    }
  }
  return waits;
}

/// The corners of cells (x, y, z) whose voxels lanes have not at hand, into rows [lane]. Returns
/// the lanes that must wait for them.
ISO_SELDOM Mask bring_voxels(const PacketField *field, const FrameParams *frame, Ints x, Ints y,
                             Ints z, Mask lanes, float8 *rows) {
  PacketProgress *progress = field->progress;
  Mask waits = ints(0);
  ISO_EACH_LANE(lane, lanes) {
    const BlockCoords b = {(uint)x[lane] >> 2, (uint)y[lane] >> 2, (uint)z[lane] >> 2};
    const int in_x = x[lane] & 3, in_y = y[lane] & 3, in_z = z[lane] & 3;
    const uint corners = cell_blocks(in_x, in_y, in_z);
    const OpenedBlock *opened = find_opened(field, frame, b, corners);
    const Mask here = ~progress->lost & (progress->opened == (int)opened_place(b));
    progress->have = pick(here, ints((int)opened->have), progress->have);
    if ((corners & ~opened->have) != 0) {
      waits[lane] = -1;
      --progress->num_blocks;
    } else {
      rows[lane] = cell_corners(opened->voxels + in_x + 5 * in_y + 25 * in_z);
    }
  }
  return waits;
}

ISO_INLINE Mask load_corners(const PacketField *field, const FrameParams *frame, const Ints *at,
                             Mask lanes, Floats *w) {
  const PacketProgress *progress = field->progress;
  const Ints x = at[0] & 3, y = at[1] & 3, z = at[2] & 3;
  const Mask missing =
      lanes & (progress->lost | ((blocks_of_cells(x, y, z) & ~progress->have) != 0));
  const Ints places = pick(lanes & ~missing,
                           (int)ISO_OPENED_WORDS * progress->opened + x + 5 * y + 25 * z, ints(0));
  float8 rows[ISO_LANES];
  Mask waits = ints(0);
  _Pragma("unroll") for (uint lane = 0; lane < ISO_LANES; ++lane) rows[lane] =
      cell_corners(field->opened->voxels + places[lane]);
  if (any(missing)) waits = bring_voxels(field, frame, at[0], at[1], at[2], missing, rows);
  transpose(rows, w);
  _Pragma("unroll") for (int corner = 0; corner < 8; ++corner) w[corner] -= frame->surface.isovalue;
  return waits;
}

#include "portable/packet_walk.h"

/// Where the rays of a launch go.
typedef struct LaunchRays {
  volatile global uint *num_waiting;
  global uint *waiting, *ray_block_ids;
  global HitRecord *hits;
  global uint *band_packets;  ///< BandPacket of each packet that draws, see packet_bands.h
  uint bands_behind;          ///< bands of this frame behind this one
  uint num_met, num_hits;     ///< rays that have come to their first active block; that hit
} LaunchRays;

#if ISO_BANDS
#include "device/packet_bands.h"
#endif

/// Opens a pass. One work-item.
///
/// begins  1: the first of a frame
/// prev    counts of the pass before
/// counts  of this pass
/// Out     counts: frame_pass, window_count, free_count, active_count; begins: 0 of the last
kernel void open_packets(const FrameParams frame_params, uint begins, global const PassCounts *prev,
                         global PassCounts *counts, global PassCounts *next_counts,
                         global CacheState *cache) {
  if (begins != 0) {
    counts->last_frame_pass = prev->frame_pass;
    counts->frame_pass = counts->pass;
    counts->window_count = first_window(&frame_params);
  } else {
    counts->active_count = prev->next_active_count;
  }
  open_march(&frame_params, prev, counts, next_counts, cache);
}

/// The rays of a packet, and which of them there are.
typedef struct PacketSource {
  Mask lanes;
  Ints ray_ids, column, row;
  Ints log_ahead;  ///< of each RayEntry
  uint number;     ///< packet_number(); of a list, 0
} PacketSource;

ISO_INLINE uint tiles_along(uint rays, uint tile_rays) {
  return (rays + tile_rays - 1) / tile_rays;
}

/// The first ray of a packet, of 4 columns and 2 rows.
typedef struct PacketPlace {
  int x, y;
} PacketPlace;

/// The first packet of a tile of the picture.
ISO_INLINE PacketPlace tile_place(const View *view, uint tile) {
  const uint tiles_x = tiles_along(view->width, ISO_TILE_COLUMNS);
  PacketPlace place;
  place.x = (int)(ISO_TILE_COLUMNS * (tile % tiles_x));
  place.y = (int)(ISO_TILE_ROWS * (tile / tiles_x));
  return place;
}

/// A tile's packet `packet`: those of 16 columns, then of the next 16.
ISO_INLINE PacketPlace packet_place(PacketPlace tile, uint packet) {
  const uint packets_y = ISO_TILE_ROWS / 2;
  PacketPlace place;
  place.x = tile.x + (int)(16 * (packet / 4 / packets_y) + 4 * (packet % 4));
  place.y = tile.y + (int)(2 * (packet / 4 % packets_y));
  return place;
}

/// The number of a packet among those of the picture.
ISO_INLINE uint packet_number(const View *view, PacketPlace place) {
  return (uint)place.x / 4 + tiles_along(view->width, 4) * ((uint)place.y / 2);
}

/// May rays of a packet meet the box of the active blocks, or, behind the first band, do any go on?
ISO_INLINE int may_draw(const FrameParams *frame, PacketPlace place, uint begins,
                        const LaunchRays *rays) {
  const ScreenBox box = frame->screen;
  return place.x + 4 > (int)box.begin_x && place.x < (int)box.end_x &&
         place.y + 2 > (int)box.begin_y && place.y < (int)box.end_y &&
         (begins != ISO_BEGINS_BAND ||
          (rays->band_packets[packet_number(&frame->view, place)] & 0xFFu) != 0);
}

ISO_INLINE PacketSource picture_packet(const View *view, PacketPlace place) {
  PacketSource source;
  source.number = packet_number(view, place);
  source.column = place.x + (int8)(0, 1, 2, 3, 0, 1, 2, 3);
  source.row = place.y + (int8)(0, 0, 0, 0, 1, 1, 1, 1);
  source.ray_ids = source.column + (int)view->width * source.row;
  source.log_ahead = ints(ISO_FIRST_LOG_AHEAD);
  source.lanes = (source.column < (int)view->width) & (source.row < (int)view->height);
  return source;
}

/// hits [8] = no_hit(), at a multiple of 32 bytes.
ISO_INLINE void clear_eight_hits(global HitRecord *hits) {
  global float8 *to = (global float8 *)hits;
  const HitRecord none = no_hit();
  const float t = none.t, b = as_float(none.block_id), c = as_float(none.cell);
  stream_out((float8)(t, b, c, 0, 0, 0, 0, 0), to);
  stream_out((float8)(0, t, b, c, 0, 0, 0, 0), to + 1);
  stream_out((float8)(0, 0, t, b, c, 0, 0, 0), to + 2);
  stream_out((float8)(0, 0, 0, t, b, c, 0, 0), to + 3);
  stream_out((float8)(0, 0, 0, 0, t, b, c, 0), to + 4);
  stream_out((float8)(0, 0, 0, 0, 0, t, b, c), to + 5);
  stream_out((float8)(0, 0, 0, 0, 0, 0, t, b), to + 6);
  stream_out((float8)(c, 0, 0, 0, 0, 0, 0, t), to + 7);
  stream_out((float8)(b, c, 0, 0, 0, 0, 0, 0), to + 8);
}

/// hits = no_hit() of a tile.
ISO_INLINE void clear_hits(const View *view, uint tile, global HitRecord *hits) {
  const uint tiles_x = tiles_along(view->width, ISO_TILE_COLUMNS);
  const uint begin_x = ISO_TILE_COLUMNS * (tile % tiles_x),
             begin_y = ISO_TILE_ROWS * (tile / tiles_x),
             end_x = min(begin_x + ISO_TILE_COLUMNS, view->width),
             end_y = min(begin_y + ISO_TILE_ROWS, view->height);
  const HitRecord none = no_hit();
  for (uint y = begin_y; y < end_y; ++y) {
    const uint row = view->width * y, end = row + end_x;
    uint i = row + begin_x;
    for (; i % 8 != 0 && i < end; ++i) hits[i] = none;
    for (; i + 8 <= end; i += 8) clear_eight_hits(hits + i);
    for (; i < end; ++i) hits[i] = none;
  }
}

/// The rays of a packet that may meet the box of the active blocks.
ISO_INLINE Mask on_screen(ScreenBox box, PacketSource source) {
  return source.lanes & (source.column >= (int)box.begin_x) & (source.column < (int)box.end_x) &
         (source.row >= (int)box.begin_y) & (source.row < (int)box.end_y);
}

/// Packet `packet` of a list of rays.
ISO_INLINE PacketSource listed_packet(const View *view, global const uint *entries, uint num_rays,
                                      uint packet) {
  PacketSource source;
  source.number = 0;
  source.lanes = source.column = source.row = source.ray_ids = source.log_ahead = ints(0);
  for (uint lane = 0; lane < ISO_LANES; ++lane) {
    const uint i = ISO_LANES * packet + lane;
    if (i < num_rays) {
      const RayEntry entry = unpack_entry(entries[i]);
      source.lanes[lane] = -1;
      source.ray_ids[lane] = (int)entry.pixel;
      source.column[lane] = (int)(entry.pixel % view->width);
      source.row[lane] = (int)(entry.pixel / view->width);
      source.log_ahead[lane] = (int)entry.log_ahead;
    }
  }
  return source;
}

/// Lists the rays that wait, and where.
ISO_INLINE void list_waiting(const Packet *p, const FrameParams *frame, PacketSource source,
                             Mask moved, volatile global uint *count, global uint *list,
                             global uint *ray_block_ids) {
  Ints at[3];
  uint place = atomic_add(count, popcount(bits_of(p->waits)));
  blocks_at(p, at);
  ISO_EACH_LANE(lane, p->waits) {
    const uint pixel = (uint)source.ray_ids[lane], log_ahead = (uint)source.log_ahead[lane];
    ray_block_ids[pixel] =
        block_id_at(frame, (uint)at[0][lane], (uint)at[1][lane], (uint)at[2][lane]);
    list[place] = pack_entry(pixel, moved[lane] != 0 ? further_ahead(log_ahead) : log_ahead, 0);
    ++place;
  }
}

/// The picture's tiles, or as many packets of the list at a time.
ISO_INLINE uint count_chunks(const View *view, uint begins, uint num_rays) {
  return begins != 0
             ? tiles_along(view->width, ISO_TILE_COLUMNS) * tiles_along(view->height, ISO_TILE_ROWS)
             : tiles_along(num_rays, ISO_LANES * ISO_LIST_PACKETS);
}

#if ISO_BANDS
/// The intervals of a packet's rays in a level of detail, and where the rays were before. Returns
/// the lanes that have one.
ISO_INLINE Mask make_intervals(const FrameParams *frame, global const ClipParams *clip,
                               PacketSource source, PacketRays *r, Ints *before) {
  make_packet_axes(frame, source.column, source.row, r->axis);
  set_packet_interval(r, frame->band);
  (void)clip;
  (void)before;
#if ISO_CLIP
  clip_packet(frame, clip, source.column, source.row, r);
  *before =
      pick(r->cut_by != ISO_NOT_CUT,
           ints(clip->with_caps != 0 ? (int)ISO_SIDE_OUTSIDE : (int)ISO_SIDE_UNKNOWN), *before);
#endif
  return have_intervals(r);
}

/// Walks the rays of a packet through the band of a level of detail. In the first band, they begin;
/// in others, those go on that have left the one before.
ISO_INLINE void draw_packet(Packet *p, const PacketScene *scene, global const ClipParams *clip,
                            int is_active_somewhere, PacketSource source, uint begins,
                            LaunchRays *rays) {
  const FrameParams *frame = scene->frame;
  PacketProgress *progress = scene->field->progress;
  const Ints ray_ids = source.ray_ids;
  global uint *kept = &rays->band_packets[source.number];
  const int is_first = begins == ISO_BEGINS_FRAME;
  BandPacket before = unpack_band_packet(is_first ? 0 : *kept);
  Mask lanes = is_first ? on_screen(frame->screen, source) : before.lanes;
  if (!any(lanes)) {
    if (is_first) *kept = 0;
    return;
  }
  const Mask drawn = make_intervals(frame, clip, source, &p->rays, &before.sides);
  const Mask comes = lanes & drawn & (before.sides != (int)ISO_SIDE_UNKNOWN);
  if (any(comes)) {
    const Ints sides = sides_at(scene, &p->rays, p->rays.begin_t, comes);
    const Mask differs = comes & (sides != (int)ISO_SIDE_UNKNOWN) & (sides != before.sides);
    if (any(differs))
      lanes &= ~differs | cross_border(scene, clip, &p->rays, ray_ids, before.sides, differs, rays);
  }
  if (is_active_somewhere && any(lanes)) {
    const Mask enters = enter_box(&p->rays, scene) & lanes;
    if (any(enters)) {
      open_packet(p, scene);
      begin_at_box(p, scene, enters);
      walk_packet(p, scene);
      if (any(p->found.lanes)) write_hits(p, scene, ray_ids, ISO_ROOT_STEPS, rays->hits);
      if (any(p->waits))
        list_waiting(p, frame, source, progress->moved, rays->num_waiting, rays->waiting,
                     rays->ray_block_ids);
      rays->num_hits += popcount(bits_of(p->found.lanes));
      rays->num_met += popcount(bits_of(progress->met & ~before.met));
      lanes &= ~(p->found.lanes | p->waits);
    }
  }
  if (frame->band.end_t == INFINITY) return;
  BandPacket behind;
  behind.lanes = lanes & ~have_left(scene, &p->rays, p->rays.end_t, rays->bands_behind);
  if (ISO_CLIP) behind.lanes &= p->rays.end_t == frame->band.end_t;
  behind.met = before.met | progress->met;
  behind.sides = ints(0);
  const Mask ends = ISO_CLIP ? behind.lanes & drawn : behind.lanes;
  if (any(ends)) {
    behind.sides = sides_at(scene, &p->rays, p->rays.end_t, ends);
    const Mask open = ends & (behind.sides == (int)ISO_SIDE_NOT_CERTAIN);
    if (any(open)) {
      behind.sides = sides_of_each(scene, &p->rays, ray_ids, open, behind.sides, rays);
      behind.lanes &= ~open | (behind.sides != (int)ISO_SIDE_NOT_CERTAIN);
    }
  }
  *kept = pack_band_packet(behind);
}
#else
/// Puts rays that wait back to the blocks where they stand.
ISO_INLINE void resume(Packet *p, const PacketScene *scene, PacketSource source,
                       global const uint *ray_block_ids) {
  Ints at[3];
  at[0] = at[1] = at[2] = ints(0);
  ISO_EACH_LANE(lane, source.lanes) {
    const BlockCoords b = block_coords(scene->frame, ray_block_ids[source.ray_ids[lane]]);
    at[0][lane] = (int)b.x;
    at[1][lane] = (int)b.y;
    at[2][lane] = (int)b.z;
  }
  begin_at_blocks(p, scene, at, source.lanes);
}

/// Walks the rays of a packet on, from their beginning or from where they wait.
///
/// begins  1: the first pass of a frame
/// Out     p->found, p->waits
ISO_INLINE void march_packet(Packet *p, const PacketScene *scene, PacketSource source, uint begins,
                             global const uint *ray_block_ids) {
  Mask lanes = begins != 0 ? on_screen(scene->frame->screen, source) : source.lanes;
  if (!any(lanes)) return;
  make_packet_axes(scene->frame, source.column, source.row, p->rays.axis);
  if (begins != 0) lanes &= enter_box(&p->rays, scene);
  if (!any(lanes)) return;
  open_packet(p, scene);
  if (begins != 0)
    begin_at_box(p, scene, lanes);
  else
    resume(p, scene, source, ray_block_ids);
  walk_packet(p, scene);
}

/// Walks the rays of a packet on, and stores their hits, or where they wait.
ISO_INLINE void draw_packet(Packet *p, const PacketScene *scene, global const ClipParams *clip,
                            int is_active_somewhere, PacketSource source, uint begins,
                            LaunchRays *rays) {
  (void)clip;
  const PacketProgress *progress = scene->field->progress;
  if (is_active_somewhere) march_packet(p, scene, source, begins, rays->ray_block_ids);
  if (any(p->found.lanes)) write_hits(p, scene, source.ray_ids, ISO_ROOT_STEPS, rays->hits);
  if (any(p->waits))
    list_waiting(p, scene->frame, source, progress->moved, rays->num_waiting, rays->waiting,
                 rays->ray_block_ids);
  rays->num_met += popcount(bits_of(progress->met));
  rays->num_hits += popcount(bits_of(p->found.lanes));
}
#endif

/// If rays begin, draws the packets of a tile of the picture. Otherwise draws ISO_LIST_PACKETS
/// packets of the list active_ray_ids [num_rays].
ISO_LONG void draw_chunk(const PacketScene *scene, global const ClipParams *clip,
                         int is_active_somewhere, uint begins, global const uint *active_ray_ids,
                         uint num_rays, uint chunk, LaunchRays *rays) {
  const FrameParams *frame = scene->frame;
  const View *view = &frame->view;
  PacketProgress *progress = scene->field->progress;
  const PacketPlace tile = tile_place(view, chunk);
  const uint num_packets = begins != 0 ? ISO_TILE_PACKETS : ISO_LIST_PACKETS;
  if (begins == ISO_BEGINS_FRAME) clear_hits(view, chunk, rays->hits);
  for (uint packet = 0; packet < num_packets; ++packet) {
    const PacketPlace place = packet_place(tile, packet);
    if (ISO_BANDS && !may_draw(frame, place, begins, rays)) continue;
    const PacketSource source = begins != 0 ? picture_packet(view, place)
                                            : listed_packet(view, active_ray_ids, num_rays,
                                                            ISO_LIST_PACKETS * chunk + packet);
    Packet p;
    progress->met = progress->moved = ints(0);
    p.waits = p.found.lanes = ints(0);
    draw_packet(&p, scene, clip, is_active_somewhere, source, begins, rays);
  }
}

/// Adds what a work-item has done.
ISO_INLINE void add_counts(const LaunchRays *rays, uint num_blocks, uint num_made, uint begins,
                           global PassCounts *counts) {
  if (rays->num_hits != 0) atomic_add(&counts->hit_count, rays->num_hits);
  if (num_made != 0) {
    atomic_add(&counts->decoded_count, num_made);
    atomic_sub(&counts->free_count, num_made);
  }
  if (num_blocks != 0) atomic_add(&counts->granted_count, num_blocks);
  if (begins != 0 && rays->num_met != 0) atomic_add(&counts->active_count, rays->num_met);
}

/// Walks rays on until they hit, leave or wait: those of the picture, in the first pass of a frame,
/// or those that wait.
///
/// clip [1]         as start_rays
/// begins           ISO_BEGINS_FRAME: the first pass of a frame; ISO_BEGINS_BAND: a further band
/// bands_behind     bands of the frame behind this one
/// part_0 .. layout the zfp stream (block_stream.h), as free_slots for decoding on demand alone
/// macrocell_masks  as traverse
/// ranges, no_data, no_data_begin  as start_rays, with ISO_LEVELS alone
/// In      active_ray_ids [prev->next_active_count] and ray_block_ids [pixel] of the rays that
///         wait; begins: none; ISO_BANDS: active_ray_ids has room for a word for each packet
/// Out     as march; begins: hits of all pixels, and counts->active_count, the rays that have met
///         an active block. With what has been decoded on demand, counts->decoded_count grows and
///         counts->free_count shrinks
/// Launch  groups of one work-item, which stride over chunks of packets
kernel __attribute__((reqd_work_group_size(1, 1, 1))) void march_packets(
    const FrameParams frame_params, global const ClipParams *clip, uint begins, uint bands_behind,
    global const uint *part_0, global const uint *part_1, global const uint *part_2,
    global const uint *part_3, global const uint *index, const StreamLayout layout,
    global const uint *macrocell_masks, global const ushort *ranges, global const uint *no_data,
    uint no_data_begin, global uint *table, global ulong *inside, global ulong *changing,
    global SlotValue *cache_values, global const PassCounts *prev, global PassCounts *counts,
    global uint *active_ray_ids, global uint *next_active_ray_ids, global uint *ray_block_ids,
    global HitRecord *hits, global uint *slot_block_ids, global uint *slot_stamps,
    global uint *requested_bits, global const uint *free_slots, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  ISO_SCRATCH_ARRAY(slots, 8);
  OpenedBlock opened[ISO_OPENED_BLOCKS];
  const uint num_rays = prev->next_active_count, stamp = read_stamp(counts->pass),
             num_chunks = count_chunks(&frame->view, begins, num_rays);
  BlockMaker maker = {
      .part_0 = part_0,
      .part_1 = part_1,
      .part_2 = part_2,
      .part_3 = part_3,
      .index = index,
      .layout = layout,
      .isovalue = frame_params.surface.isovalue,
      .table = table,
      .values = cache_values,
      .inside = inside,
      .changing = changing,
      .slot_block_ids = slot_block_ids,
      .slot_stamps = slot_stamps,
      .requested_bits = requested_bits,
      .free_slots = free_slots,
      .cache = cache,
      .stamp = stamp,
  };
  PacketProgress progress = {.num_blocks = 0};
#if ISO_BANDS
  uint macrocell_sides[ISO_KNOWN_SIDES];
  for (uint i = 0; i < ISO_KNOWN_SIDES; ++i) macrocell_sides[i] = ISO_NO_MACROCELL;
#endif
  const PacketField field = {
    .macrocell_masks = macrocell_masks + masks_begin(frame),
    .all_masks = macrocell_masks,
    .no_data = no_data,
    .ranges = ranges,
    .no_data_begin = no_data_begin,
#if ISO_BANDS
    .macrocell_sides = macrocell_sides,
#endif
    .cache = {.table = table,
              .inside = inside,
              .changing = changing,
              .values = cache_values,
              .slot_stamps = slot_stamps,
              .stamp = stamp,
              .slots = slots},
    .opened = opened,
    .progress = &progress,
    .maker = &maker,
  };
  LaunchRays rays = {
      .num_waiting = &counts->next_active_count,
      .waiting = next_active_ray_ids,
      .ray_block_ids = ray_block_ids,
      .hits = hits,
      .band_packets = active_ray_ids,
      .bands_behind = bands_behind,
  };
  PacketScene scene;
  for (uint i = 0; i < ISO_OPENED_BLOCKS; ++i) opened[i].block_id = ISO_INVALID_ID;
  for (uint i = 0; i < ISO_BRICK_VOXELS; ++i) opened[0].voxels[i] = 0; /* read by idle lanes */
  const int is_active_somewhere = make_packet_scene(frame, &field, &scene);
  for (uint chunk = get_group_id(0); chunk < num_chunks; chunk += get_num_groups(0))
    draw_chunk(&scene, clip, is_active_somewhere, begins, active_ray_ids, num_rays, chunk, &rays);
  end_streams();
  add_counts(&rays, progress.num_blocks, maker.num_made, begins, counts);
}
