#pragma once
// Several surfaces, and what is seen through translucent ones (kernels_cl/portable/layers.h): rays
// go on from their hits, ray by ray and in packets of eight. Only host_loops.cpp includes this
// file.

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "core/host/host_bands.hpp"
#include "core/host/host_field.hpp"
#include "core/host/host_packets.hpp"
#include "core/host/host_rays.hpp"

namespace isowave::core {

/// A ray in the cell of its hit.
inline CellWalk cell_of_hit(const FrameParams &frame, LastPlanes last, const Ray &ray,
                            const HitRecord &hit) {
  const BlockCoords b = block_coords(&frame, hit.block_id);
  const int x = static_cast<int>(4 * b.x + (hit.cell & 3u)),
            y = static_cast<int>(4 * b.y + (hit.cell >> 2 & 3u)),
            z = static_cast<int>(4 * b.z + (hit.cell >> 4 & 3u));
  const RayEvent begin = border_event(ray.begin_t), entry = region_entry(&ray, x, y, z, 1, last);
  CellWalk at = start_at_cell(&ray, x, y, z, event_before(entry, begin) ? begin : entry, last);
  if (passes_border(at.exit, ray.end_t)) at.exit = border_event(ray.end_t);
  return at;
}

/// The next crossing of a surface in the cell of a hit on it that is a crossing.
inline bool find_in_cell(const FrameParams &frame, const HostField &field, const Ray &ray,
                         const CellWalk &at, const HitRecord &hit, HitRecord *next) {
  const int x = at.cell.x, y = at.cell.y, z = at.cell.z;
  field.open(level_block_at(&frame, static_cast<uint>(x) >> 2, static_cast<uint>(y) >> 2,
                            static_cast<uint>(z) >> 2));
  float w[8];
  CellChange change;
  load_corners(frame, field, x, y, z, w);
  const uint number = crossings_up_to(hit);
  if (!numbered_change_in_cell(&ray, w, x, y, z, at.enter, at.exit, number, 1, &change))
    return false;
  *next = make_hit(&frame, &ray, w, x, y, z, at.enter, at.exit,
                   refine(kDefaultSolver, change.cubic, change.bracket));
  next->cell |= number << ISO_CROSSING_BIT;
  return true;
}

/// The first crossing of a ray behind a cell, `at`, of its way. kTraceBlock: as walk_blocks()
template <auto kTraceBlock>
inline bool walk_behind(const FrameParams &frame, const HostField &field, const ActiveBox &box,
                        LastPlanes last, const Ray &ray, CellWalk at, HitRecord *next) {
  if (at.exit.axis == ISO_AXIS_START) return false;
  GridWalk block = at.block;
  if (next_cell(&at, &ray, last) &&
      trace_cells(frame, field, ray,
                  level_block_at(&frame, static_cast<uint>(block.x), static_cast<uint>(block.y),
                                 static_cast<uint>(block.z)),
                  at, last, next))
    return true;
  RayEvent enter = walk_exit(&block, &ray);
  if (passes_border(enter, ray.end_t)) return false;
  GridWalk coarse = walk_from(&ray, block.x / ISO_MACROCELL_BLOCKS, block.y / ISO_MACROCELL_BLOCKS,
                              block.z / ISO_MACROCELL_BLOCKS, kMacrocellVoxels, last);
  if (!leaves(&block, &coarse, enter)) {
    walk_step(&block, &ray, enter, 4, last);
    const WalkEnd end = walk_blocks<kTraceBlock>(
        frame, field, last, ray, coarse, macrocell_mask(frame, field, coarse), block, &enter, next);
    if (end != WalkEnd::kLeft) return end == WalkEnd::kHit;
  }
  walk_step(&coarse, &ray, enter, kMacrocellVoxels, last);
  return walk_macrocells<kTraceBlock>(frame, field, box, last, ray, coarse, enter, next);
}

/// The place of the level of detail that has a hit.
inline std::size_t level_of_hit(std::span<const HostLevel> levels, const HitRecord &hit) {
  std::size_t level = 0;
  while (level + 1 < levels.size() && !is_hit_of(levels[level].frame, hit)) ++level;
  return level;
}

/// The next hit of a ray in the cell of one that it has on the same surface, which is a crossing.
///
/// surface  at the level of detail that has the hit
/// Returns  whether there is one
inline bool trace_ray_in_cell(const HostLevel &surface, uint ray_id, const HitRecord &hit,
                              HitRecord *next) {
  const Ray ray = ray_of_level(surface, ray_id);
  const CellWalk at = cell_of_hit(surface.frame, last_planes(&surface.frame), ray, hit);
  return find_in_cell(surface.frame, surface.field, ray, at, hit, next);
}

/// The first hit of a ray behind the band of the first of some levels of detail, in which its
/// interval is `ray`'s.
template <auto kTraceRay, auto kSide>
inline bool trace_next_bands(std::span<const HostLevel> levels, const Ray &ray, uint ray_id,
                             HitRecord *hit) {
  const HostLevel &level = levels.front();
  if (levels.size() == 1 || ray.end_t < level.frame.band.end_t) return false;
  BlockCoords cell;
  const uint before = kSide(level, ray, last_planes(&level.frame), ray.end_t, &cell);
  return trace_bands<kTraceRay, kSide>(levels.subspan(1), ray_id, hit, before);
}

/// The hit of a ray behind one that it has on the same surface, as the scalar twin finds it.
///
/// kTraceRay, kTraceRayInCell, kTraceBlock  walk_ray(), trace_ray_in_cell() and trace_block() as
///                                          functions of their own: they are long
/// kSide                                    as trace_bands()
/// Returns  whether there is one
template <auto kTraceRay, auto kTraceRayInCell, auto kTraceBlock, auto kSide>
inline bool trace_ray_behind(std::span<const HostLevel> surface, uint ray_id, const HitRecord &hit,
                             HitRecord *next) {
  const std::span<const HostLevel> levels = surface.subspan(level_of_hit(surface, hit));
  const HostLevel &level = levels.front();
  const FrameParams &frame = level.frame;
  const LastPlanes last = last_planes(&frame);
  const Ray ray = ray_of_level(level, ray_id);
  const ActiveBox box = active_box(frame.surface, last);
  // Where the ray begins in the level may be outside the box.
  const bool begins = crossings_up_to(hit) == 0;
  if (begins ? kTraceRay(frame, level.field, box, last, ray, next)
             : kTraceRayInCell(level, ray_id, hit, next) ||
                   walk_behind<kTraceBlock>(frame, level.field, box, last, ray,
                                            cell_of_hit(frame, last, ray, hit), next))
    return true;
  return trace_next_bands<kTraceRay, kSide>(levels, ray, ray_id, next);
}

/// Eight rays of a frame on their way through layers: 4 columns and 2 rows from (x, y) on. Bits of
/// lanes: column + 4 row.
struct LayerPacket {
  uint x, y, width;

  uint ray_id(uint lane) const { return x + lane % 4 + width * (y + lane / 4); }
};

/// Finds the hits of rays behind those that they have on a surface.
///
/// hits  [8]; Out: next [8], of rays that have one
template <auto kTraceRayBehind>
inline void trace_rays_behind(std::span<const HostLevel> surface, const LayerPacket &packet,
                              uint lanes, const HitRecord *hits, HitRecord *next) {
  for (uint left = lanes; left != 0; left &= left - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(left));
    kTraceRayBehind(surface, packet.ray_id(lane), hits[lane], next + lane);
  }
}

#ifdef ISO_HAS_PACKETS
/// The same in the level of detail that has the hits: in their cells ray by ray, and behind them in
/// packets. Returns the lanes without a hit there.
///
/// next  [8] no_hit() before
template <auto kTraceRayInCell, auto kTracePacket>
inline uint trace_packets_in_level(const HostLevel &level, const LayerPacket &packet, uint lanes,
                                   const HitRecord *hits, HitRecord *next) {
  uint behind = 0, begin = 0, left = 0;
  for (uint of = lanes; of != 0; of &= of - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(of));
    if (crossings_up_to(hits[lane]) == 0) {
      begin |= 1u << lane;
    } else if (!kTraceRayInCell(level, packet.ray_id(lane), hits[lane], next + lane)) {
      behind |= 1u << lane;
    }
  }
  if ((behind | begin) != 0) kTracePacket(level, packet.x, packet.y, behind, begin, hits, next);
  for (uint of = behind | begin; of != 0; of &= of - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(of));
    if (next[lane].t == INFINITY) left |= 1u << lane;
  }
  return left;
}

/// trace_rays_behind() in packets, from level to level.
template <auto kTraceRayInCell, auto kTracePacket, auto kTraceBand, auto kSide>
inline void trace_packets_behind(std::span<const HostLevel> surface, const LayerPacket &packet,
                                 uint lanes, const HitRecord *hits, HitRecord *next) {
  RayPacket on = {packet.x, packet.y, 0, {}, {}, true};  // have left the level of their hits
  for (const HostLevel &level : surface) {
    if (on.lanes != 0) {
      uint found = kTraceBand(level, on.x, on.y, on.lanes, next, true, &on.sides);
      found |= hit_at_borders<kSide>(level, on, next);
      on.lanes &= ~(found | on.sides.ended);
      if (on.lanes != 0 && &level != &surface.back()) end_band<kSide>(level, on);
    }
    uint here = surface.size() == 1 ? lanes : 0;
    for (uint left = lanes & ~here; left != 0; left &= left - 1) {
      const auto lane = static_cast<uint>(std::countr_zero(left));
      if (is_hit_of(level.frame, hits[lane])) here |= 1u << lane;
    }
    if (here == 0) continue;
    lanes &= ~here;
    uint left =
        trace_packets_in_level<kTraceRayInCell, kTracePacket>(level, packet, here, hits, next);
    for (; left != 0 && &level != &surface.back(); left &= left - 1) {
      const auto lane = static_cast<uint>(std::countr_zero(left));
      const Ray ray = ray_of_level(level, packet.ray_id(lane));
      if (ray.end_t < level.frame.band.end_t) continue;
      BlockCoords cell;
      on.before[lane] =
          static_cast<uchar>(kSide(level, ray, last_planes(&level.frame), ray.end_t, &cell));
      on.lanes |= 1u << lane;
    }
  }
}
#endif

/// The value that a hit's colour is by: of its level's voxels on a slice, of the field on a
/// surface.
inline float value_of_color(const LayerBlend &by, std::span<const HostLevel> levels,
                            const HitRecord &hit) {
  float value = no_value();
  if (is_of_slice(&by.colors, hit)) {
    const std::size_t level = level_of_hit(levels, hit);
    value = value_at_hit(by.slice_maps[level], levels[level].frame, levels[level].field, hit);
  } else if (by.field != nullptr && has_value_color(&by.shading.params, &by.colors, hit)) {
    (*by.field)({&hit, 1}, &value);
  }
  return value;
}

/// A ray's nearest hit on slices that it has not passed yet, in any level of detail.
inline HitRecord nearest_on_slices(std::span<const HostLevel> levels, const LayerBlend &by,
                                   uint passed, uint ray_id) {
  HitRecord nearest = no_hit();
  for (const HostLevel &level : levels) {
    const HitRecord hit = nearest_slice(&level.frame, &by.clip, &by.colors, passed, ray_id);
    if (hit.t < nearest.t) nearest = hit;
  }
  return nearest;
}

/// The hit of a light ray that begins at a cap, if it is inside the surface there.
template <auto kSide>
inline bool meets_cap(const HostLevel &surface, LastPlanes last, const Ray &ray, HitRecord *met) {
  BlockCoords cell;
  if (ray.cut_by == ISO_NOT_CUT || kSide(surface, ray, last, ray.begin_t, &cell) != ISO_SIDE_INSIDE)
    return false;
  *met = hit_at_border(surface, ray, last, cell);
  return true;
}

/// What a light ray meets in its level of detail: the nearest of the opaque surfaces, first those
/// that planes leave whole.
///
/// any  any of them is enough
template <auto kTraceRay, auto kSide>
inline HitRecord met_by(std::span<const LeveledSurface> surfaces, const LayerBlend &by,
                        const GivenRay &given, bool any) {
  const uint level = level_of_given(given);
  const FrameParams &seen = surfaces.front()[level].frame;
  const LastPlanes last = last_planes(&seen);
  const float voxel = by.rays.voxel * static_cast<float>(1u << level);
  HitRecord nearest = no_hit();
  GivenRay ray = given;
  for (const bool clipped : {false, true}) {
    if (clipped && by.any_is_whole) {
      const RayEntrance at = entrance_of(&by.clip, given, voxel);
      ray = entering(&by.clip, given, at);
      nearest.t = t_from(seen.view.t_scale, nearest.t, at.begin);
    }
    const Ray own = make_given_ray(ray);
    for (const std::size_t place : by.opaque[clipped ? 1 : 0]) {
      const HostLevel &surface = surfaces[place][level];
      HitRecord met;
      if ((meets_cap<kSide>(surface, last, own, &met) ||
           kTraceRay(surface.frame, surface.field, active_box(surface.frame.surface, last), last,
                     own, &met)) &&
          met.t < nearest.t &&
          !(clipped && is_clipped(&by.clip, ray, voxel, met.t / seen.view.t_scale)))
        nearest = with_surface(met, by.numbers[place]);
      if (any && nearest.t != INFINITY) return nearest;
    }
  }
  return nearest;
}

/// The light of a hit, of bounced light the sums of its rays.
template <auto kTraceRay, auto kSide>
inline HitLight light_of_layer_hit(std::span<const LeveledSurface> surfaces, const LayerBlend &by,
                                   uint ray_id, const HitRecord &hit) {
  HitLight light{1, 1, nothing_bounced()};
  const AmbientRays &rays = by.rays;
  if (rays.num_rays == 0 || is_of_slice(&by.colors, hit)) return light;
  const auto level = static_cast<uint>(level_of_hit(surfaces.front(), hit));
  const FrameParams &of_level = surfaces.front()[level].frame;
  const HitRecord placed = placed_hit(&of_level, level, hit);
  const uint pattern = ambient_pattern(rays.seen, ray_id), num_ambient = rays.params.num_ambient,
             num_shadow = rays.num_rays - num_ambient;
  uint num_open[2] = {0, 0};
  for (uint k = 0; k < rays.num_rays; ++k) {
    const GivenRay given = ambient_ray(rays.seen, &rays.params, placed, ray_id, k,
                                       rays.directions[k * ISO_AMBIENT_PATTERNS + pattern]);
    if (!is_given(given)) continue;
    const bool is_shadow = is_shadow_ray(&rays.params, k), brings = rays.bounces && !is_shadow;
    const HitRecord met = met_by<kTraceRay, kSide>(surfaces, by, given, !brings);
    if (met.t == INFINITY) ++num_open[is_shadow];
    if (met.t == INFINITY || !brings) continue;
    const uint row = num_ambient + light_row(num_shadow, k);
    float cosine = 0;
    const GivenRay to_light =
        bounce_ray(&rays.params, given, placed_hit(&of_level, level, met),
                   rays.directions[row * ISO_AMBIENT_PATTERNS + pattern], &cosine);
    if (is_given(to_light) && met_by<kTraceRay, kSide>(surfaces, by, to_light, true).t == INFINITY)
      light.bounced = sum_with(light.bounced, cosine,
                               sent_on(by.shading.params.has_map, &by.colors, surface_of(met)));
  }
  const uchar counts[2] = {static_cast<uchar>(num_open[0]), static_cast<uchar>(num_open[1])};
  light.open = open_share(counts, 0, num_ambient);
  light.lit = open_share(counts, 1, num_shadow);
  return light;
}

/// Blends the layers of some of eight rays. The other arguments are those of HostLoops::blend().
///
/// next  [lane] [surface] their first hits; overwritten
template <auto kTraceBehind, auto kSmooth, auto kTraceRay, auto kSide>
inline uint blend_packet(std::span<const LeveledSurface> surfaces, const LayerBlend &by,
                         const LayerPacket &packet, uint lanes, HitRecord *const *next,
                         const LayersOfRays &to) {
  uint num_hits = 0;
  for (uint left = lanes; left != 0; left &= left - 1)
    to.colors[packet.ray_id(static_cast<uint>(std::countr_zero(left)))] = clear_ray();
  HitRecord at[8], behind[8];
  uint passed[8] = {};  // slices
  for (uint layer = 0; lanes != 0; ++layer) {
    uint on[ISO_MAX_SURFACES] = {};  // rays that go on behind a hit on that surface
    uint on_behind_slices = 0;
    for (uint left = lanes; left != 0; left &= left - 1) {
      const auto lane = static_cast<uint>(std::countr_zero(left));
      const uint ray_id = packet.ray_id(lane);
      std::size_t nearest = 0;
      for (std::size_t k = 1; k < surfaces.size(); ++k) {
        if (next[lane][k].t < next[lane][nearest].t) nearest = k;
      }
      const LeveledSurface &surface = surfaces[nearest];
      HitRecord hit = nearest_on_slices(surface, by, passed[lane], ray_id);
      const bool is_slice = hit.t <= next[lane][nearest].t;
      if (!is_slice) hit = at[lane] = next[lane][nearest];
      if (hit.t == INFINITY) continue;
      if (layer == ISO_MAX_LAYERS) {
        ++to.stats->rays_cut;
        continue;
      }
      if (!is_slice) {
        if (by.is_smooth) kSmooth(surface[level_of_hit(surface, hit)], &hit);
        hit = with_surface(hit, by.numbers[nearest]);
        next[lane][nearest] = no_hit();
      } else {
        passed[lane] |= 1u << (surface_of(hit) - by.colors.num_surfaces);
      }
      const float value = value_of_color(by, surface, hit);
      HitLight light = light_of_layer_hit<kTraceRay, kSide>(surfaces, by, ray_id, hit);
      if (to.layers != nullptr) to.layers[layer].push_back({ray_id, hit, value, light});
      light.bounced = nothing_bounced();  // not filtered yet
      RayColor &color = to.colors[ray_id];
      color = blend_hit(by.finest, &by.shading.params, by.shading.color_map.data(), &by.colors,
                        ray_id, hit, value, light, color);
      if (goes_on(color)) (is_slice ? on_behind_slices : on[nearest]) |= 1u << lane;
      if (is_unseen(&by.colors, hit, value)) continue;
      if (to.hits[ray_id].t == INFINITY) {
        to.hits[ray_id] = hit;
        ++num_hits;
      }
      ++to.stats->hits;
      to.stats->layers = std::max(to.stats->layers, layer + 1);
    }
    lanes = on_behind_slices;
    for (std::size_t k = 0; k < surfaces.size(); ++k) {
      if (on[k] == 0) continue;
      lanes |= on[k];
      std::ranges::fill(behind, no_hit());
      kTraceBehind(surfaces[k], packet, on[k], at, behind);
      for (uint left = on[k]; left != 0; left &= left - 1) {
        const auto lane = static_cast<uint>(std::countr_zero(left));
        next[lane][k] = behind[lane];
      }
    }
  }
  return num_hits;
}

template <auto kTraceBehind, auto kSmooth, auto kTraceRay, auto kSide>
inline uint blend(std::span<const LeveledSurface> surfaces, const LayerBlend &by,
                  const RayTile &tile, HitRecord *next, const LayersOfRays &to) {
  const uint columns = tile.end_x - tile.begin_x;
  uint num_hits = 0;
  for (uint y = tile.begin_y; y < tile.end_y; y += 2) {
    for (uint x = tile.begin_x; x < tile.end_x; x += 4) {
      HitRecord *of_lanes[8] = {};
      uint lanes = 0;
      for (uint lane = 0; lane < 8; ++lane) {
        const uint column = x - tile.begin_x + lane % 4, row = y - tile.begin_y + lane / 4;
        if (column >= columns || row >= tile.end_y - tile.begin_y) continue;
        of_lanes[lane] = next + surfaces.size() * (column + columns * row);
        lanes |= 1u << lane;
      }
      num_hits += blend_packet<kTraceBehind, kSmooth, kTraceRay, kSide>(
          surfaces, by, {x, y, by.finest->view.width}, lanes, of_lanes, to);
    }
  }
  return num_hits;
}

}  // namespace isowave::core
