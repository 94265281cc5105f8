#pragma once
// Rays of a frame that several levels of detail draw, each its band: ray by ray, and in packets of
// eight. Only host_loops.cpp includes this file.

#include <bit>
#include <cmath>
#include <span>

#include "core/host/host_packets.hpp"
#include "core/host/host_rays.hpp"
#include "kernels_cl/portable/ray_state.h"

namespace isowave::core {

/// Decodes a cell.
inline void open_cell(const HostLevel &level, BlockCoords cell, float *w) {
  level.field.open(level_block_at(&level.frame, cell.x >> 2, cell.y >> 2, cell.z >> 2));
  load_corners(level.frame, level.field, static_cast<int>(cell.x), static_cast<int>(cell.y),
               static_cast<int>(cell.z), w);
}

/// The side on which a ray is at the border at t, which is in *cell; unknown if it does not come to
/// the border, or is in a cell without data there.
inline uint side_at_border(const HostLevel &level, const Ray &ray, LastPlanes last, float t,
                           BlockCoords *cell) {
  if (!reaches_border(&ray, last, t)) return ISO_SIDE_UNKNOWN;
  *cell = region_at_border(&ray, last, t, 1);
  const uint side =
      side_of_block(level.frame, level.field, {cell->x >> 2, cell->y >> 2, cell->z >> 2});
  if (side != ISO_SIDE_UNKNOWN) return side;
  float w[8];
  open_cell(level, *cell, w);
  if (lacks_data(w)) return ISO_SIDE_UNKNOWN;
  return inside_at(&ray, w, border_event(t), static_cast<int>(cell->x), static_cast<int>(cell->y),
                   static_cast<int>(cell->z), 0)
             ? ISO_SIDE_INSIDE
             : ISO_SIDE_OUTSIDE;
}

/// The hit of a ray where its interval begins, in that cell. Few rays have one.
__attribute__((noinline)) inline HitRecord hit_at_border(const HostLevel &level, const Ray &ray,
                                                         LastPlanes last, BlockCoords cell) {
  const int x = static_cast<int>(cell.x), y = static_cast<int>(cell.y),
            z = static_cast<int>(cell.z);
  const GridWalk walk = walk_from(&ray, x, y, z, 1, last);
  const RayEvent exit = walk_exit(&walk, &ray);
  float w[8];
  open_cell(level, cell, w);
  HitRecord hit = make_hit(&level.frame, &ray, w, x, y, z, border_event(ray.begin_t),
                           passes_border(exit, ray.end_t) ? border_event(ray.end_t) : exit, 0.0f);
  mark_beginning(level.clip, &ray, &hit);
  return hit;
}

/// The first hit of a ray, from band to band. If two levels have it on different sides of the
/// surface, it hits at their border; if it is inside where it is cut, it hits there.
///
/// before  the side on which the ray comes to the first of the levels
template <auto kTraceRay, auto kSide>
inline bool trace_bands(std::span<const HostLevel> levels, uint ray_id, HitRecord *hit,
                        uint before = ISO_SIDE_UNKNOWN) {
  for (const HostLevel &level : levels) {
    const LastPlanes last = last_planes(&level.frame);
    const Ray ray = ray_of_level(level, ray_id);
    if (!has_interval(&ray)) continue;
    if (ray.cut_by != ISO_NOT_CUT) before = side_where_cut(level.clip, &ray);
    BlockCoords cell;
    if (before != ISO_SIDE_UNKNOWN) {
      const uint side = kSide(level, ray, last, ray.begin_t, &cell);
      if (side != ISO_SIDE_UNKNOWN && side != before) {
        *hit = hit_at_border(level, ray, last, cell);
        return true;
      }
    }
    const ActiveBox box = active_box(level.frame.surface, last);
    if (kTraceRay(level.frame, level.field, box, last, ray, hit)) return true;
    if (ray.end_t < level.frame.band.end_t) return false;
    if (&level != &levels.back()) before = kSide(level, ray, last, ray.end_t, &cell);
  }
  return false;
}

/// Gives the hits of a tile in a level of detail smooth gradients.
inline void smooth(const FrameParams &frame, const HostField &field, const RayTile &tile,
                   HitRecord *hits) {
  const LastPlanes last = last_planes(&frame);
  for (uint y = tile.begin_y; y < tile.end_y; ++y) {
    for (uint x = tile.begin_x; x < tile.end_x; ++x) {
      HitRecord *hit = hits + x + frame.view.width * y;
      if (is_hit_of(frame, *hit)) smooth_gradient(frame, field, last, hit);
    }
  }
}

template <auto kTraceRay, auto kSide>
inline uint trace_rays_of_levels(std::span<const HostLevel> levels, const RayTile &tile,
                                 HitRecord *hits) {
  uint num_hits = 0;
  for (uint y = tile.begin_y; y < tile.end_y; ++y) {
    for (uint x = tile.begin_x; x < tile.end_x; ++x) {
      const uint ray_id = x + levels.front().frame.view.width * y;
      num_hits += trace_bands<kTraceRay, kSide>(levels, ray_id, hits + ray_id);
    }
  }
  return num_hits;
}

#ifdef ISO_HAS_PACKETS
/// Eight rays of a frame: 4 columns and 2 rows from (x, y) on.
struct RayPacket {
  uint x, y;
  uint lanes;            ///< bit column + 4 row: the rays that have no hit yet
  uchar before[8];       ///< where they were at the end of the last band; of the first, unknown
  BandSides sides;       ///< of this band
  bool by_lane = false;  ///< hits are [8], instead of those of all rays

  uint ray_id(const FrameParams &frame, uint lane) const {
    return x + lane % 4 + frame.view.width * (y + lane / 4);
  }
  uint place(const FrameParams &frame, uint lane) const {
    return by_lane ? lane : ray_id(frame, lane);
  }
};

/// Lets rays hit where they begin in a level, if the level before has them on the other side of the
/// surface, or if they are inside and a cap is there. Returns these rays.
template <auto kSide>
inline uint hit_at_borders(const HostLevel &level, const RayPacket &packet, HitRecord *hits) {
  const LastPlanes last = last_planes(&level.frame);
  uint found = 0;
  for (uint left = packet.lanes; left != 0; left &= left - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(left));
    const uint before = packet.sides.before(packet.before, lane),
               at_begin = packet.sides.at_begin[lane];
    if (before == ISO_SIDE_UNKNOWN || at_begin == ISO_SIDE_UNKNOWN || at_begin == before) continue;
    const uint ray_id = packet.ray_id(level.frame, lane);
    const Ray ray = ray_of_level(level, ray_id);
    BlockCoords cell;
    const uint side = kSide(level, ray, last, ray.begin_t, &cell);
    if (side == ISO_SIDE_UNKNOWN || side == before) continue;
    hits[packet.place(level.frame, lane)] = hit_at_border(level, ray, last, cell);
    found |= 1u << lane;
  }
  return found;
}

/// packet.before = where the rays are at the end of a level's band.
template <auto kSide>
inline void end_band(const HostLevel &level, RayPacket &packet) {
  for (uint left = packet.lanes; left != 0; left &= left - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(left));
    packet.before[lane] = packet.sides.at_end[lane];
    if (packet.before[lane] != ISO_SIDE_NOT_CERTAIN) continue;
    const Ray ray = ray_of_level(level, packet.ray_id(level.frame, lane));
    BlockCoords cell;
    packet.before[lane] =
        static_cast<uchar>(kSide(level, ray, last_planes(&level.frame), ray.end_t, &cell));
  }
}

/// Traces a packet from the first of the levels on.
///
/// hits     packet.place()
/// Returns  number of hits
template <auto kTraceBand, auto kSide>
inline uint trace_packet_bands(std::span<const HostLevel> levels, bool begins, RayPacket &packet,
                               HitRecord *hits) {
  uint num_hits = 0;
  for (const HostLevel &level : levels) {
    uint found =
        kTraceBand(level, packet.x, packet.y, packet.lanes, hits, packet.by_lane, &packet.sides);
    if (!begins || &level != levels.data() || level.clip != nullptr)
      found |= hit_at_borders<kSide>(level, packet, hits);
    num_hits += static_cast<uint>(std::popcount(found));
    packet.lanes &= ~(found | packet.sides.ended);
    if (packet.lanes == 0) break;
    if (&level != &levels.back()) end_band<kSide>(level, packet);
  }
  return num_hits;
}

/// trace_rays_of_levels() in packets.
template <auto kTraceBand, auto kSide>
inline uint trace_levels(std::span<const HostLevel> levels, const RayTile &tile, HitRecord *hits) {
  uint num_hits = 0;
  for (uint y = tile.begin_y; y < tile.end_y; y += 2) {
    for (uint x = tile.begin_x; x < tile.end_x; x += 4) {
      const uint columns = tile.end_x - x < 4 ? (1u << (tile.end_x - x)) - 1 : 0xFu;
      RayPacket packet = {x, y, y + 1 < tile.end_y ? columns | columns << 4 : columns, {}, {}};
      num_hits += trace_packet_bands<kTraceBand, kSide>(levels, true, packet, hits);
    }
  }
  return num_hits;
}
#endif

}  // namespace isowave::core
