#pragma once
// Several surfaces, and what is seen through translucent ones (kernels_cl/portable/layers.h): rays
// go on from their hits, ray by ray and in packets of eight. Only host_loops.cpp includes this
// file.

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

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

/// The next hit of a ray in the cell of one that it has on the same surface, which is no cap.
///
/// Returns  whether there is one
inline bool trace_ray_in_cell(const HostLevel &surface, uint ray_id, const HitRecord &hit,
                              HitRecord *next) {
  const Ray ray = ray_of_level(surface, ray_id);
  const CellWalk at = cell_of_hit(surface.frame, last_planes(&surface.frame), ray, hit);
  return find_in_cell(surface.frame, surface.field, ray, at, hit, next);
}

/// The hit of a ray behind one that it has on the same surface, as the scalar twin finds it.
///
/// kTraceRay, kTraceRayInCell, kTraceBlock  walk_ray(), trace_ray_in_cell() and trace_block() as
///                                          functions of their own: they are long
/// Returns  whether there is one
template <auto kTraceRay, auto kTraceRayInCell, auto kTraceBlock>
inline bool trace_ray_behind(const HostLevel &surface, uint ray_id, const HitRecord &hit,
                             HitRecord *next) {
  const FrameParams &frame = surface.frame;
  const LastPlanes last = last_planes(&frame);
  const Ray ray = ray_of_level(surface, ray_id);
  const ActiveBox box = active_box(frame.surface, last);
  // A cap lies where the ray begins, maybe outside the box.
  if (is_cap(hit)) return kTraceRay(frame, surface.field, box, last, ray, next);
  return kTraceRayInCell(surface, ray_id, hit, next) ||
         walk_behind<kTraceBlock>(frame, surface.field, box, last, ray,
                                  cell_of_hit(frame, last, ray, hit), next);
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
inline void trace_rays_behind(const HostLevel &surface, const LayerPacket &packet, uint lanes,
                              const HitRecord *hits, HitRecord *next) {
  for (uint left = lanes; left != 0; left &= left - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(left));
    kTraceRayBehind(surface, packet.ray_id(lane), hits[lane], next + lane);
  }
}

#ifdef ISO_HAS_PACKETS
/// The same: in the cells of the hits ray by ray, and behind them in packets.
template <auto kTraceRayInCell, auto kTracePacket>
inline void trace_packets_behind(const HostLevel &surface, const LayerPacket &packet, uint lanes,
                                 const HitRecord *hits, HitRecord *next) {
  uint behind = 0, capped = 0;
  for (uint left = lanes; left != 0; left &= left - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(left));
    if (is_cap(hits[lane])) {
      capped |= 1u << lane;
    } else if (!kTraceRayInCell(surface, packet.ray_id(lane), hits[lane], next + lane)) {
      behind |= 1u << lane;
    }
  }
  if ((behind | capped) != 0) kTracePacket(surface, packet.x, packet.y, behind, capped, hits, next);
}
#endif

/// The value that a hit's colour is by: of the volume on a slice, of the field on a surface.
inline float value_of_color(const LayerBlend &by, const HostLevel &level, const HitRecord &hit) {
  float value = no_value();
  if (is_of_slice(&by.colors, hit)) {
    value = value_at_hit(by.slice_map, level.frame, level.field, hit);
  } else if (by.field != nullptr && has_value_color(&by.shading.params, &by.colors, hit)) {
    (*by.field)({&hit, 1}, &value);
  }
  return value;
}

/// What a light ray meets: the nearest of the opaque surfaces, first those that planes leave whole.
///
/// any  any of them is enough
template <auto kTraceRay>
inline HitRecord met_by(std::span<const HostLevel> surfaces, const LayerBlend &by,
                        const GivenRay &given, bool any) {
  const FrameParams &seen = surfaces.front().frame;
  const LastPlanes last = last_planes(&seen);
  HitRecord nearest = no_hit();
  GivenRay ray = given;
  for (const bool clipped : {false, true}) {
    if (clipped && by.any_is_whole) {
      const float begin = entry_of(&by.clip, given, by.rays.voxel);
      ray = ray_from(given, begin);
      nearest.t = t_from(&seen, nearest.t, begin);
    }
    for (const std::size_t place : by.opaque[clipped ? 1 : 0]) {
      const HostLevel &surface = surfaces[place];
      HitRecord met;
      if (kTraceRay(surface.frame, surface.field, active_box(surface.frame.surface, last), last,
                    make_given_ray(ray), &met) &&
          met.t < nearest.t &&
          !(clipped && is_clipped(&by.clip, ray, by.rays.voxel, met.t / seen.view.t_scale)))
        nearest = with_surface(met, by.numbers[place]);
      if (any && nearest.t != INFINITY) return nearest;
    }
  }
  return nearest;
}

/// The light of a hit, of bounced light the sums of its rays.
template <auto kTraceRay>
inline HitLight light_of_layer_hit(std::span<const HostLevel> surfaces, const LayerBlend &by,
                                   uint ray_id, const HitRecord &hit) {
  HitLight light{1, 1, nothing_bounced()};
  const AmbientRays &rays = by.rays;
  if (rays.num_rays == 0 || is_of_slice(&by.colors, hit)) return light;
  const FrameParams &seen = surfaces.front().frame;
  const HitRecord placed = placed_hit(&seen, 0, hit);
  const uint pattern = ambient_pattern(&seen, ray_id), num_ambient = rays.params.num_ambient,
             num_shadow = rays.num_rays - num_ambient;
  uint num_open[2] = {0, 0};
  for (uint k = 0; k < rays.num_rays; ++k) {
    const GivenRay given = ambient_ray(&seen, &rays.params, placed, ray_id, k,
                                       rays.directions[k * ISO_AMBIENT_PATTERNS + pattern]);
    if (!is_given(given)) continue;
    const bool is_shadow = is_shadow_ray(&rays.params, k), brings = rays.bounces && !is_shadow;
    const HitRecord met = met_by<kTraceRay>(surfaces, by, given, !brings);
    if (met.t == INFINITY) ++num_open[is_shadow];
    if (met.t == INFINITY || !brings) continue;
    const uint row = num_ambient + light_row(num_shadow, k);
    float cosine = 0;
    const GivenRay to_light =
        bounce_ray(&rays.params, given, placed_hit(&seen, 0, met),
                   rays.directions[row * ISO_AMBIENT_PATTERNS + pattern], &cosine);
    if (is_given(to_light) && met_by<kTraceRay>(surfaces, by, to_light, true).t == INFINITY)
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
template <auto kTraceBehind, auto kSmooth, auto kTraceRay>
inline uint blend_packet(std::span<const HostLevel> surfaces, const LayerBlend &by,
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
      const HostLevel &surface = surfaces[nearest];
      HitRecord hit = nearest_slice(&surface.frame, &by.clip, &by.colors, passed[lane], ray_id);
      const bool is_slice = hit.t <= next[lane][nearest].t;
      if (!is_slice) hit = at[lane] = next[lane][nearest];
      if (hit.t == INFINITY) continue;
      if (layer == ISO_MAX_LAYERS) {
        ++to.stats->rays_cut;
        continue;
      }
      if (!is_slice) {
        if (by.is_smooth) kSmooth(surface, &hit);
        hit = with_surface(hit, by.numbers[nearest]);
        next[lane][nearest] = no_hit();
      } else {
        passed[lane] |= 1u << (surface_of(hit) - by.colors.num_surfaces);
      }
      const float value = value_of_color(by, surface, hit);
      HitLight light = light_of_layer_hit<kTraceRay>(surfaces, by, ray_id, hit);
      if (to.layers != nullptr) to.layers[layer].push_back({ray_id, hit, value, light});
      light.bounced = nothing_bounced();  // not filtered yet
      RayColor &color = to.colors[ray_id];
      color = blend_hit(&surface.frame, &by.shading.params, by.shading.color_map.data(), &by.colors,
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

template <auto kTraceBehind, auto kSmooth, auto kTraceRay>
inline uint blend(std::span<const HostLevel> surfaces, const LayerBlend &by, const RayTile &tile,
                  HitRecord *next, const LayersOfRays &to) {
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
      num_hits += blend_packet<kTraceBehind, kSmooth, kTraceRay>(
          surfaces, by, {x, y, surfaces.front().frame.view.width}, lanes, of_lanes, to);
    }
  }
  return num_hits;
}

}  // namespace isowave::core
