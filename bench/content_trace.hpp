#pragma once
// Rays through levels of detail that tiles of 16^3 voxels choose: alone, and in packets of eight.
// Only content_bench.cpp includes this file; ISO_LEVELS is 1 there.

#include <immintrin.h>

#include <bit>
#include <cmath>
#include <cstddef>
#include <span>

#include "core/frame/solvers.hpp"
#include "core/host/host_bands.hpp"
#include "kernels_cl/portable/cell_intersect.h"

namespace isowave::core::bench {

inline constexpr uchar kNoLevel = 255;         ///< of tiles without the isovalue
inline constexpr std::size_t kMostLevels = 5;  ///< voxels of the coarsest are as large as tiles
inline constexpr int kTile = 16;

/// Where a ray goes on, and by which level of detail. t: of the finest level
struct Stretch {
  float begin = 0, end = INFINITY;
  uchar level = kNoLevel, next = kNoLevel;
};

/// The levels of a frame, and the level of each tile, which is a macrocell of the finest level.
struct ContentScene {
  std::span<const HostLevel> levels;
  const uchar *tiles;

  float scale(uchar level) const {
    return levels[0].frame.view.t_scale / levels[level].frame.view.t_scale;
  }
};

/// A ray on its way from tile to tile of the finest level.
class TileWalk {
 public:
  TileWalk(const ContentScene &scene, uint ray_id)
      : scene_(scene),
        frame_(scene.levels[0].frame),
        last_(last_planes(&frame_)),
        box_(active_box(frame_.surface, last_)),
        ray_(make_ray(&frame_, ray_id)) {
    ray_.begin_t = 0;
    ray_.end_t = INFINITY;
    RayEvent exit = border_event(INFINITY);
    enter_ = start_event();
    walks_ = frame_.surface.active_end_x > 0 &&
             clip_to_box(&ray_, box_.begin, box_.end, &enter_, &exit) != 0;
    if (!walks_) return;
    at_ = walk_from(&ray_, locate(ray_.x, 0, enter_, kTile, box_.first.x, box_.final.x),
                    locate(ray_.y, 1, enter_, kTile, box_.first.y, box_.final.y),
                    locate(ray_.z, 2, enter_, kTile, box_.first.z, box_.final.z), kTile, last_);
  }

  /// The next stretch of one level; level kNoLevel: there is none.
  Stretch next() {
    Stretch stretch{at_t_, INFINITY, level_, kNoLevel};
    while (walks_) {
      const uchar own = scene_.tiles[tile()];
      if (own != kNoLevel && stretch.level == kNoLevel) stretch.level = own;
      if (own != kNoLevel && stretch.level != own) {
        level_ = stretch.next = own;
        at_t_ = stretch.end = enter_.t.hi;
        return stretch;
      }
      enter_ = walk_exit(&at_, &ray_);
      walk_step(&at_, &ray_, enter_, kTile, last_);
      walks_ = at_.x >= box_.first.x && at_.x <= box_.final.x && at_.y >= box_.first.y &&
               at_.y <= box_.final.y && at_.z >= box_.first.z && at_.z <= box_.final.z;
    }
    level_ = kNoLevel;
    return stretch;
  }

 private:
  std::size_t tile() const {
    const uint columns = (frame_.grid.blocks_x + 3) / 4, rows = (frame_.grid.blocks_y + 3) / 4;
    return static_cast<std::size_t>(at_.x) +
           columns * (static_cast<std::size_t>(at_.y) + rows * static_cast<std::size_t>(at_.z));
  }

  const ContentScene &scene_;
  const FrameParams &frame_;
  LastPlanes last_;
  ActiveBox box_;
  Ray ray_;
  RayEvent enter_{};
  GridWalk at_{};
  bool walks_ = false;
  float at_t_ = 0;
  uchar level_ = kNoLevel;
};

/// A ray in a level, with that stretch as its interval.
inline Ray ray_in(const ContentScene &scene, const Stretch &stretch, uint ray_id) {
  Ray ray = make_ray(&scene.levels[stretch.level].frame, ray_id);
  ray.begin_t = stretch.begin * scene.scale(stretch.level);
  ray.end_t = stretch.end * scene.scale(stretch.level);
  return ray;
}

/// The hit of a ray, alone.
inline bool trace_ray(const ContentScene &scene, uint ray_id, HitRecord *hit) {
  TileWalk walk(scene, ray_id);
  uint before = ISO_SIDE_UNKNOWN;
  for (Stretch at = walk.next(); at.level != kNoLevel; at = walk.next()) {
    if (at.begin < at.end) {
      const HostLevel &level = scene.levels[at.level];
      const LastPlanes last = last_planes(&level.frame);
      const Ray ray = ray_in(scene, at, ray_id);
      BlockCoords cell;
      if (before != ISO_SIDE_UNKNOWN) {
        const uint side = side_at_border(level, ray, last, ray.begin_t, &cell);
        if (side != ISO_SIDE_UNKNOWN && side != before) {
          *hit = hit_at_border(level, ray, last, cell);
          return true;
        }
      }
      const ActiveBox box = active_box(level.frame.surface, last);
      if (level.frame.surface.active_end_x > 0 &&
          walk_ray(level.frame, level.field, box, last, ray, hit))
        return true;
      before = side_at_border(level, ray, last, ray.end_t, &cell);
    }
    if (at.next == kNoLevel) return false;
  }
  return false;
}

}  // namespace isowave::core::bench

#pragma GCC push_options
#pragma GCC target("avx2,bmi,bmi2,fma,popcnt")
#define ISO_PACKET_NAMESPACE packets_of_content
#include "core/host/packet_trace.hpp"

namespace isowave::core::packets_of_content {

/// Eight rays on their way through tiles, each with its stretch.
struct StretchPacket {
  Floats begin, end;
  Ints level, next;
  uchar before[8] = {};
};

/// Finds the ends of the stretches of lanes that walk from tile to tile.
inline void find_ends(const PacketScene &scene, const uchar *tiles, Packet *w, StretchPacket *s) {
  constexpr int kNone = bench::kNoLevel;
  Mask &walks = w->at[ISO_MACROCELLS];
  s->end = floats(INFINITY);
  s->next = ints(kNone);
  while (any(walks)) {
    Ints own = ints(kNone);
    const Ints place = w->level[ISO_MACROCELLS].place;
    ISO_EACH_LANE(lane, walks) own[lane] = tiles[place[lane]];
    s->level = pick(walks & (s->level == kNone), own, s->level);
    const Mask stops = walks & (own != kNone) & (own != s->level);
    if (any(stops)) {
      s->end = pick(stops, crossing_t(&w->rays, w->rays.entered).hi, s->end);
      s->next = pick(stops, own, s->next);
      walks &= ~stops;
    }
    if (any(walks)) step_to_next(w, ISO_MACROCELLS);
  }
  (void)scene;
}

/// Traces lanes in their stretches of one level. Returns those that hit something.
inline Mask trace_stretches(const bench::ContentScene &scene, uchar number, Ints column, Ints row,
                            Mask lanes, StretchPacket *s, HitRecord *hits) {
  const HostLevel &level = scene.levels[number];
  const float scale = scene.scale(number);
  lanes &= s->begin < s->end;
  if (!any(lanes)) return lanes;
  Packet p;
  make_packet_rays(level.frame, column, row, &p.rays);
  p.rays.begin_t = s->begin * scale;
  p.rays.end_t = s->end * scale;
  p.rays.has_end = any(lanes & (s->end < ISO_NEVER));
  const Ints ids = ray_ids(level.frame, column, row);
  const LastPlanes last = last_planes(&level.frame);
  PacketScene of_level;
  const bool is_active = make_packet_scene(&level.frame, &level.field, &of_level) != 0;
  const auto ray_of = [&](int lane) {
    return bench::ray_in(scene, {s->begin[lane], s->end[lane], number, bench::kNoLevel},
                         static_cast<uint>(ids[lane]));
  };
  Mask at_border = ints(0);
  const Mask late = lanes & (s->begin > 0.0f);
  if (any(late)) {
    const Ints sides = find_sides(&of_level, &p.rays, p.rays.begin_t, late);
    ISO_EACH_LANE(lane, late) {
      const uint before = s->before[lane];
      if (before == ISO_SIDE_UNKNOWN || sides[lane] == ISO_SIDE_UNKNOWN ||
          sides[lane] == static_cast<int>(before))
        continue;
      const Ray ray = ray_of(lane);
      BlockCoords cell;
      const uint side = side_at_border(level, ray, last, ray.begin_t, &cell);
      if (side == ISO_SIDE_UNKNOWN || side == before) continue;
      hits[ids[lane]] = hit_at_border(level, ray, last, cell);
      at_border[lane] = -1;
    }
  }
  const Mask drawn = lanes & ~at_border, found = is_active && any(drawn)
                                                     ? trace_packet(of_level, ids, drawn, hits, &p)
                                                     : ints(0);
  const Mask left = drawn & ~found & (s->end < ISO_NEVER);
  if (any(left)) {
    const Ints sides = find_sides(&of_level, &p.rays, s->end * scale, left);
    ISO_EACH_LANE(lane, left) {
      s->before[lane] = static_cast<uchar>(sides[lane]);
      if (sides[lane] != ISO_SIDE_NOT_CERTAIN) continue;
      const Ray ray = ray_of(lane);
      BlockCoords cell;
      s->before[lane] = static_cast<uchar>(side_at_border(level, ray, last, ray.end_t, &cell));
    }
  }
  return found | at_border;
}

/// bench::trace_ray() of a tile of the picture.
__attribute__((flatten)) inline void trace_content(const bench::ContentScene &scene,
                                                   const RayTile &tile, HitRecord *hits) {
  constexpr int kNone = bench::kNoLevel;
  const FrameParams &finest = scene.levels[0].frame;
  PacketScene tiles;
  if (!make_packet_scene(&finest, &scene.levels[0].field, &tiles)) return;
  for (uint y = tile.begin_y; y < tile.end_y; y += 2) {
    for (uint x = tile.begin_x; x < tile.end_x; x += 4) {
      const Ints column = columns_from(x), row = rows_from(y);
      Packet w;
      make_packet_rays(finest, column, row, &w.rays);
      Mask left = enter_box(&w.rays, &tiles) & (column < static_cast<int>(tile.end_x)) &
                  (row < static_cast<int>(tile.end_y));
      if (!any(left)) continue;
      open_packet(&w, &tiles);
      begin_at_box(&w, &tiles, left);
      StretchPacket s{floats(0.0f), floats(0.0f), ints(kNone), ints(kNone), {}};
      for (;;) {
        find_ends(tiles, scene.tiles, &w, &s);
        left &= s.level != kNone;
        Mask found = ints(0);
        for (Mask open = left; any(open);) {
          const int level = s.level[std::countr_zero(bits_of(open))];
          const Mask alike = open & (s.level == level);
          open &= ~alike;
          found |= trace_stretches(scene, static_cast<uchar>(level), column, row, alike, &s, hits);
        }
        left &= ~found & (s.next != kNone);
        if (!any(left)) break;
        s.level = s.next;
        s.begin = s.end;
        w.at[ISO_MACROCELLS] = left;
      }
    }
  }
}

}  // namespace isowave::core::packets_of_content
#pragma GCC pop_options
