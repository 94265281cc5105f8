// Ids of blocks count on through all levels of detail. Before anything is included.
#define ISO_LEVELS 1
#include "core/host/host_loops.hpp"

#include "core/host/host_bands.hpp"
#include "core/host/host_layers.hpp"
#include "core/host/host_packets.hpp"
#include "core/host/host_rays.hpp"
#include "kernels_cl/portable/whole_number.h"
#include "kernels_cl/portable/zfp_codec.h"

// All that a loop calls becomes part of it, and so is compiled for the processor that it is for.
#define ISO_WHOLE_LOOP __attribute__((flatten))
#define ISO_OF_ITS_OWN __attribute__((noinline))
#if defined(__x86_64__)
#include <immintrin.h>
#define ISO_HAS_WIDE_LOOPS 1
#define ISO_WIDE_LOOP __attribute__((flatten, target("avx2,bmi,bmi2,fma,popcnt")))
#endif

namespace isowave::core {

namespace {

inline void decode(const EncodedBlock &block, float *values) {
  zfp_decode_any_block(block.words, block.first_bit, block.num_bits, block.min_exponent, values);
  if (block.least <= block.greatest) {
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
      values[v] = whole_number(values[v], block.least, block.greatest);
  }
  if (block.no_data == 0) return;
  for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v) {
    if ((block.no_data >> v & 1u) != 0) values[v] = NAN;
  }
}

inline void widen(BlockRange &range, const BlockRange &by) {
  range.min = by.min < range.min ? by.min : range.min;
  range.max = by.max > range.max ? by.max : range.max;
}

inline void ranges_of_parts(const float *values, uint size_x, uint size_y, uint size_z,
                            BlockRange *parts) {
  constexpr BlockRange kNothing = {INFINITY, -INFINITY}; /* NaN widens no range */
  for (uint part = 0; part < 8; ++part) parts[part] = kNothing;
  for (uint z = 0; z < size_z; ++z) {
    for (uint y = 0; y < size_y; ++y) {
      const float *row = values + 4 * y + 16 * z;
      const BlockRange first = {row[0], row[0]};
      BlockRange all = kNothing;
      for (uint x = 0; x < size_x; ++x) widen(all, {row[x], row[x]});
      for (uint layers = 0; layers < 8; layers += 2) {
        if (((layers & 2) != 0 && y != 0) || ((layers & 4) != 0 && z != 0)) continue;
        widen(parts[layers], all);
        widen(parts[layers + 1], first);
      }
    }
  }
}

typedef float Row __attribute__((vector_size(16)));

struct RangesOfRows {
  Row min, max;
};

inline void widen(RangesOfRows &range, const RangesOfRows &by) {
  range.min = by.min < range.min ? by.min : range.min;
  range.max = by.max > range.max ? by.max : range.max;
}

/// ranges_of_parts() of 4 x 4 x 4 voxels, four at a time.
inline void ranges_of_whole(const float *values, BlockRange *parts) {
  constexpr float kMost = INFINITY;
  constexpr RangesOfRows kNothing = {{kMost, kMost, kMost, kMost},
                                     {-kMost, -kMost, -kMost, -kMost}};
  RangesOfRows rows[4] = {kNothing, kNothing, kNothing, kNothing}; /* all; y = 0; z = 0; both */
  for (uint z = 0; z < 4; ++z) {
    RangesOfRows layer = kNothing;
    for (uint y = 0; y < 4; ++y) {
      Row row;
      __builtin_memcpy(&row, values + 4 * y + 16 * z, sizeof(row));
      widen(layer, {row, row});
      if (y == 0) widen(rows[1], layer);
      if (y == 0 && z == 0) rows[3] = layer;
    }
    widen(rows[0], layer);
    if (z == 0) rows[2] = layer;
  }
  for (uint layers = 0; layers < 4; ++layers) {
    const RangesOfRows &from = rows[layers];
    BlockRange all = {from.min[0], from.max[0]};
    parts[2 * layers + 1] = all;
    for (uint x = 1; x < 4; ++x) widen(all, {from.min[x], from.max[x]});
    parts[2 * layers] = all;
  }
}

inline void ranges(const EncodedBlock &block, BlockRange *parts) {
  float values[ISO_BLOCK_VOXELS];
  decode(block, values);
  if (block.size_x == 4 && block.size_y == 4 && block.size_z == 4) {
    ranges_of_whole(values, parts);
  } else {
    ranges_of_parts(values, block.size_x, block.size_y, block.size_z, parts);
  }
}

inline ulong inside(const float *values, float isovalue) {
  ulong bits = 0;
  for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
    bits |= static_cast<ulong>(values[v] - isovalue >= 0.0f) << v;
  return bits;
}

// Several loops trace rays, and blocks behind hits: they call these, which are long.
ISO_OF_ITS_OWN ISO_WHOLE_LOOP bool trace_ray_anywhere(const FrameParams &frame,
                                                      const HostField &field, const ActiveBox &box,
                                                      LastPlanes last, const Ray &ray,
                                                      HitRecord *hit) {
  return walk_ray(frame, field, box, last, ray, hit);
}
ISO_OF_ITS_OWN ISO_WHOLE_LOOP bool trace_block_anywhere(const FrameParams &frame,
                                                        const HostField &field, const Ray &ray,
                                                        const GridWalk &block, RayEvent enter,
                                                        LastPlanes last, HitRecord *hit) {
  return trace_block(frame, field, ray, block, enter, last, hit);
}
ISO_OF_ITS_OWN ISO_WHOLE_LOOP bool trace_ray_in_cell_anywhere(const HostLevel &surface, uint ray_id,
                                                              const HitRecord &hit,
                                                              HitRecord *next) {
  return trace_ray_in_cell(surface, ray_id, hit, next);
}
#ifdef ISO_HAS_WIDE_LOOPS
ISO_OF_ITS_OWN ISO_WIDE_LOOP bool trace_ray_wide(const FrameParams &frame, const HostField &field,
                                                 const ActiveBox &box, LastPlanes last,
                                                 const Ray &ray, HitRecord *hit) {
  return walk_ray(frame, field, box, last, ray, hit);
}
ISO_OF_ITS_OWN ISO_WIDE_LOOP bool trace_block_wide(const FrameParams &frame, const HostField &field,
                                                   const Ray &ray, const GridWalk &block,
                                                   RayEvent enter, LastPlanes last,
                                                   HitRecord *hit) {
  return trace_block(frame, field, ray, block, enter, last, hit);
}
ISO_OF_ITS_OWN ISO_WIDE_LOOP bool trace_ray_in_cell_wide(const HostLevel &surface, uint ray_id,
                                                         const HitRecord &hit, HitRecord *next) {
  return trace_ray_in_cell(surface, ray_id, hit, next);
}
#endif

ISO_OF_ITS_OWN ISO_WHOLE_LOOP uint side_anywhere(const HostLevel &level, const Ray &ray,
                                                 LastPlanes last, float t, BlockCoords *cell) {
  return side_at_border(level, ray, last, t, cell);
}
#ifdef ISO_HAS_WIDE_LOOPS
ISO_OF_ITS_OWN ISO_WIDE_LOOP uint side_wide(const HostLevel &level, const Ray &ray, LastPlanes last,
                                            float t, BlockCoords *cell) {
  return side_at_border(level, ray, last, t, cell);
}
#endif

/// Gives hits of levels smooth gradients, if asked for. Returns num_hits.
template <auto kSmooth>
inline uint smoothed(uint num_hits, std::span<const HostLevel> levels, const RayTile &tile,
                     bool is_smooth, HitRecord *hits) {
  if (!is_smooth || num_hits == 0) return num_hits;
  for (const HostLevel &level : levels) kSmooth(level, tile, hits);
  return num_hits;
}

template <auto kTraceRay>
inline void cast(const FrameParams &frame, const HostField &field, const IndexRay *rays,
                 uint num_rays, bool is_smooth, HitRecord *hits) {
  const LastPlanes last = last_planes(&frame);
  const ActiveBox box = active_box(frame.surface, last);
  for (uint i = 0; i < num_rays; ++i) {
    if (!kTraceRay(frame, field, box, last, make_given_ray(rays[i].ray), hits + i)) continue;
    hits[i].t *= rays[i].t_scale;
    if (is_smooth) smooth_gradient(frame, field, last, hits + i);
  }
}

/// Rays of any origin through a level of detail, for light.
template <auto kTraceRay>
struct LightCaster {
  LightCaster(const HostLevel &through, float voxel_of_level)
      : level(through),
        last(last_planes(&through.frame)),
        box(active_box(through.frame.surface, last)),
        voxel(voxel_of_level) {}

  /// Does the ray meet a surface that is drawn? met: where it does.
  bool meets(const GivenRay &given, HitRecord *met) const {
    return kTraceRay(level.frame, level.field, box, last, make_given_ray(given), met) &&
           (level.clip == nullptr ||
            !is_clipped(level.clip, given, voxel, met->t / level.frame.view.t_scale));
  }

  const HostLevel &level;
  LastPlanes last;
  ActiveBox box;
  float voxel;  ///< AmbientRays::voxel
};

/// The light that an ambient ray of a round brings from what it has met.
template <auto kTraceRay>
inline float bounced_light(const LightCaster<kTraceRay> &caster, const AmbientRays &rays,
                           const GivenRay &given, const HitRecord &met, uint round, uint pattern) {
  const uint num_ambient = rays.params.num_ambient;
  const uint row = num_ambient + light_row(rays.num_rays - num_ambient, round);
  float cosine = 0;
  HitRecord between;
  const GivenRay to_light =
      bounce_ray(&rays.params, given, placed_hit(&caster.level.frame, rays.level, met),
                 rays.directions[row * ISO_AMBIENT_PATTERNS + pattern], &cosine);
  return is_given(to_light) && !caster.meets(to_light, &between) ? cosine : 0.0f;
}

template <auto kTraceRay>
inline void ambient(const HostLevel &level, const RayTile &tile, const AmbientRays &rays,
                    const HitRecord *hits, uchar *open_counts, float *bounced) {
  const FrameParams &frame = level.frame;
  const LightCaster<kTraceRay> caster(level, rays.voxel);
  HitRecord met;
  for (uint y = tile.begin_y; y < tile.end_y; ++y) {
    for (uint x = tile.begin_x; x < tile.end_x; ++x) {
      const uint ray_id = x + frame.view.width * y;
      if (!is_hit_of(frame, hits[ray_id])) continue;
      const HitRecord placed = placed_hit(&frame, rays.level, hits[ray_id]);
      const uint pattern = ambient_pattern(&frame, ray_id);
      uint num_open[2] = {0, 0};
      float brought = 0;
      for (uint k = 0; k < rays.num_rays; ++k) {
        const GivenRay given = ambient_ray(rays.seen, &rays.params, placed, ray_id, k,
                                           rays.directions[k * ISO_AMBIENT_PATTERNS + pattern]);
        if (!is_given(given)) continue;
        const bool is_shadow = is_shadow_ray(&rays.params, k), meets = caster.meets(given, &met);
        num_open[is_shadow] += !meets;
        if (meets && !is_shadow && rays.bounces)
          brought += bounced_light(caster, rays, given, met, k, pattern);
      }
      if (rays.bounces) bounced[ray_id] = brought;
      open_counts[ray_id] = static_cast<uchar>(num_open[0]);
      if (rays.num_rays != rays.params.num_ambient)
        open_counts[frame.view.width * frame.view.height + ray_id] =
            static_cast<uchar>(num_open[1]);
    }
  }
}

inline void place_hits(const FrameParams &frame, const AmbientParams &params, uint row,
                       const HitRecord *hits, GivenRay *places) {
  const uint width = frame.view.width;
  for (uint ray_id = width * row; ray_id < width * (row + 1); ++ray_id)
    places[ray_id] = normal_ray(&frame, &params, ray_id, hits[ray_id]);
}

inline void filter_bounced(const View &view, uint row, uint apart, const GivenRay *places,
                           const float *bounced, float *filtered) {
  for (uint ray_id = view.width * row; ray_id < view.width * (row + 1); ++ray_id)
    filtered[ray_id] = filtered_light(view.width, view.height, places, bounced, ray_id, apart);
}

inline void blend_lit(const FrameParams &frame, const LayerBlend &by,
                      std::span<const LayerHit> layer, const float *sums, RayColor *colors) {
  for (const LayerHit &at : layer) {
    HitLight light = at.light;
    light.bounced = share_of_sum(bounced_sum(sums, frame.view.width * frame.view.height, at.ray),
                                 by.rays.params.num_ambient);
    colors[at.ray] = blend_hit(&frame, &by.shading.params, by.shading.color_map.data(), &by.colors,
                               at.ray, at.hit, at.value, light, colors[at.ray]);
  }
}

inline void store_pixel(uint rgba, uint channels, std::uint8_t *pixel) {
  for (uint channel = 0; channel < 3; ++channel)
    pixel[channel] = static_cast<std::uint8_t>(rgba >> (8 * channel));
  if (channels == 4) pixel[3] = static_cast<std::uint8_t>(rgba >> 24);
}

inline void shade(const FrameParams &frame, const Shading &shading, uint samples, uint row,
                  const HitRecord *hits, const LightOfHits &light, const float *field_values,
                  std::uint8_t *picture) {
  const uint columns = frame.view.width / samples, channels = num_channels(&shading.params);
  for (uint column = 0; column < columns; ++column, picture += channels) {
    store_pixel(shade_pixel(&frame, &shading.params, shading.color_map.data(), samples, column, row,
                            hits, &light, field_values),
                channels, picture);
  }
}

inline void shade_layers(const FrameParams &frame, const ShadeParams &params, uint samples,
                         uint row, const RayColor *colors, std::uint8_t *picture) {
  const uint columns = frame.view.width / samples, channels = num_channels(&params);
  for (uint column = 0; column < columns; ++column, picture += channels)
    store_pixel(layered_pixel(&frame, &params, samples, column, row, colors), channels, picture);
}

ISO_WHOLE_LOOP void decode_anywhere(const EncodedBlock &block, float *values) {
  decode(block, values);
}
ISO_WHOLE_LOOP void ranges_anywhere(const EncodedBlock &block, BlockRange *parts) {
  ranges(block, parts);
}
ISO_WHOLE_LOOP ulong inside_anywhere(const float *values, float isovalue) {
  return inside(values, isovalue);
}
ISO_OF_ITS_OWN ISO_WHOLE_LOOP void smooth_anywhere(const HostLevel &level, const RayTile &tile,
                                                   HitRecord *hits) {
  smooth(level.frame, level.field, tile, hits);
}
ISO_OF_ITS_OWN ISO_WHOLE_LOOP uint trace_rays_of_levels_anywhere(std::span<const HostLevel> levels,
                                                                 const RayTile &tile,
                                                                 bool is_smooth, HitRecord *hits) {
  return smoothed<smooth_anywhere>(
      trace_rays_of_levels<trace_ray_anywhere, side_anywhere>(levels, tile, hits), levels, tile,
      is_smooth, hits);
}
ISO_WHOLE_LOOP void cast_anywhere(const FrameParams &frame, const HostField &field,
                                  const IndexRay *rays, uint num_rays, bool is_smooth,
                                  HitRecord *hits) {
  cast<trace_ray_anywhere>(frame, field, rays, num_rays, is_smooth, hits);
}
ISO_WHOLE_LOOP void ambient_anywhere(const HostLevel &level, const RayTile &tile,
                                     const AmbientRays &rays, const HitRecord *hits,
                                     uchar *open_counts, float *bounced) {
  ambient<trace_ray_anywhere>(level, tile, rays, hits, open_counts, bounced);
}
ISO_WHOLE_LOOP void place_hits_anywhere(const FrameParams &frame, const AmbientParams &params,
                                        uint row, const HitRecord *hits, GivenRay *places) {
  place_hits(frame, params, row, hits, places);
}
ISO_WHOLE_LOOP void filter_bounced_anywhere(const View &view, uint row, uint apart,
                                            const GivenRay *places, const float *bounced,
                                            float *filtered) {
  filter_bounced(view, row, apart, places, bounced, filtered);
}
ISO_WHOLE_LOOP void shade_anywhere(const FrameParams &frame, const Shading &shading, uint samples,
                                   uint row, const HitRecord *hits, const LightOfHits &light,
                                   const float *field_values, std::uint8_t *picture) {
  shade(frame, shading, samples, row, hits, light, field_values, picture);
}

ISO_OF_ITS_OWN ISO_WHOLE_LOOP void smooth_hit_anywhere(const HostLevel &level, HitRecord *hit) {
  smooth_gradient(level.frame, level.field, last_planes(&level.frame), hit);
}
ISO_OF_ITS_OWN ISO_WHOLE_LOOP bool trace_ray_behind_anywhere(std::span<const HostLevel> surface,
                                                             uint ray_id, const HitRecord &hit,
                                                             HitRecord *next) {
  return trace_ray_behind<trace_ray_anywhere, trace_ray_in_cell_anywhere, trace_block_anywhere,
                          side_anywhere>(surface, ray_id, hit, next);
}
uint blend_rays_anywhere(std::span<const LeveledSurface> surfaces, const LayerBlend &by,
                         const RayTile &tile, HitRecord *next, const LayersOfRays &to) {
  return blend<trace_rays_behind<trace_ray_behind_anywhere>, smooth_hit_anywhere,
               trace_ray_anywhere, side_anywhere>(surfaces, by, tile, next, to);
}
ISO_WHOLE_LOOP void blend_lit_anywhere(const FrameParams &frame, const LayerBlend &by,
                                       std::span<const LayerHit> layer, const float *sums,
                                       RayColor *colors) {
  blend_lit(frame, by, layer, sums, colors);
}
ISO_WHOLE_LOOP void shade_layers_anywhere(const FrameParams &frame, const ShadeParams &params,
                                          uint samples, uint row, const RayColor *colors,
                                          std::uint8_t *picture) {
  shade_layers(frame, params, samples, row, colors, picture);
}

/// One level is a special case of several.
template <auto kTraceLevels>
uint trace_rays(const FrameParams &frame, const HostField &field, const RayTile &tile,
                bool is_smooth, HitRecord *hits) {
  const HostLevel level{frame, field};
  return kTraceLevels({&level, 1}, tile, is_smooth, hits);
}

#ifdef ISO_HAS_PACKETS
// Packets in registers of four, among loops for any processor.
template <auto kTracePackets>
uint trace_narrow(const FrameParams &frame, const HostField &field, const RayTile &tile,
                  bool is_smooth, HitRecord *hits) {
  const HostLevel level{frame, field};
  return smoothed<smooth_anywhere>(kTracePackets(frame, field, tile, hits), {&level, 1}, tile,
                                   is_smooth, hits);
}
template <auto kTraceBand>
uint trace_levels_narrow(std::span<const HostLevel> levels, const RayTile &tile, bool is_smooth,
                         HitRecord *hits) {
  return smoothed<smooth_anywhere>(trace_levels<kTraceBand, side_anywhere>(levels, tile, hits),
                                   levels, tile, is_smooth, hits);
}
#endif

#ifdef ISO_HAS_WIDE_LOOPS
ISO_WIDE_LOOP void decode_wide(const EncodedBlock &block, float *values) {
  decode(block, values);
}
ISO_WIDE_LOOP void ranges_wide(const EncodedBlock &block, BlockRange *parts) {
  ranges(block, parts);
}
/// By hand: compilers shift 64 numbers of 64 bits.
ISO_WIDE_LOOP ulong inside_wide(const float *values, float isovalue) {
  const __m256 from = _mm256_set1_ps(isovalue), zero = _mm256_setzero_ps();
  ulong bits = 0;
  for (uint v = 0; v < ISO_BLOCK_VOXELS; v += 8) {
    const __m256 w = _mm256_sub_ps(_mm256_loadu_ps(values + v), from);
    const int inside = _mm256_movemask_ps(_mm256_cmp_ps(w, zero, _CMP_GE_OQ));
    bits |= static_cast<ulong>(static_cast<uint>(inside)) << v;
  }
  return bits;
}
ISO_OF_ITS_OWN ISO_WIDE_LOOP void smooth_wide(const HostLevel &level, const RayTile &tile,
                                              HitRecord *hits) {
  smooth(level.frame, level.field, tile, hits);
}
uint trace_wide(const FrameParams &frame, const HostField &field, const RayTile &tile,
                bool is_smooth, HitRecord *hits) {
  const HostLevel level{frame, field};
  return smoothed<smooth_wide>(trace_packets(frame, field, tile, hits), {&level, 1}, tile,
                               is_smooth, hits);
}
ISO_WIDE_LOOP uint trace_levels_wide(std::span<const HostLevel> levels, const RayTile &tile,
                                     bool is_smooth, HitRecord *hits) {
  return smoothed<smooth_wide>(trace_levels<trace_band_packet, side_wide>(levels, tile, hits),
                               levels, tile, is_smooth, hits);
}
ISO_OF_ITS_OWN ISO_WIDE_LOOP uint trace_rays_of_levels_wide(std::span<const HostLevel> levels,
                                                            const RayTile &tile, bool is_smooth,
                                                            HitRecord *hits) {
  return smoothed<smooth_wide>(trace_rays_of_levels<trace_ray_wide, side_wide>(levels, tile, hits),
                               levels, tile, is_smooth, hits);
}
ISO_WIDE_LOOP void cast_wide(const FrameParams &frame, const HostField &field, const IndexRay *rays,
                             uint num_rays, bool is_smooth, HitRecord *hits) {
  cast<trace_ray_wide>(frame, field, rays, num_rays, is_smooth, hits);
}
ISO_WIDE_LOOP void ambient_wide(const HostLevel &level, const RayTile &tile,
                                const AmbientRays &rays, const HitRecord *hits, uchar *open_counts,
                                float *bounced) {
  ambient<trace_ray_wide>(level, tile, rays, hits, open_counts, bounced);
}
ISO_WIDE_LOOP void place_hits_wide(const FrameParams &frame, const AmbientParams &params, uint row,
                                   const HitRecord *hits, GivenRay *places) {
  place_hits(frame, params, row, hits, places);
}
ISO_WIDE_LOOP void filter_bounced_wide(const View &view, uint row, uint apart,
                                       const GivenRay *places, const float *bounced,
                                       float *filtered) {
  filter_bounced(view, row, apart, places, bounced, filtered);
}
ISO_WIDE_LOOP void shade_wide(const FrameParams &frame, const Shading &shading, uint samples,
                              uint row, const HitRecord *hits, const LightOfHits &light,
                              const float *field_values, std::uint8_t *picture) {
  shade(frame, shading, samples, row, hits, light, field_values, picture);
}
ISO_OF_ITS_OWN ISO_WIDE_LOOP void smooth_hit_wide(const HostLevel &level, HitRecord *hit) {
  smooth_gradient(level.frame, level.field, last_planes(&level.frame), hit);
}
ISO_OF_ITS_OWN ISO_WIDE_LOOP bool trace_ray_behind_wide(std::span<const HostLevel> surface,
                                                        uint ray_id, const HitRecord &hit,
                                                        HitRecord *next) {
  return trace_ray_behind<trace_ray_wide, trace_ray_in_cell_wide, trace_block_wide, side_wide>(
      surface, ray_id, hit, next);
}
ISO_WIDE_LOOP uint blend_wide(std::span<const LeveledSurface> surfaces, const LayerBlend &by,
                              const RayTile &tile, HitRecord *next, const LayersOfRays &to) {
  return blend<trace_packets_behind<trace_ray_in_cell_wide, trace_packet_behind, trace_band_packet,
                                    side_wide>,
               smooth_hit_wide, trace_ray_wide, side_wide>(surfaces, by, tile, next, to);
}
ISO_WIDE_LOOP uint blend_rays_wide(std::span<const LeveledSurface> surfaces, const LayerBlend &by,
                                   const RayTile &tile, HitRecord *next, const LayersOfRays &to) {
  return blend<trace_rays_behind<trace_ray_behind_wide>, smooth_hit_wide, trace_ray_wide,
               side_wide>(surfaces, by, tile, next, to);
}
ISO_WIDE_LOOP void blend_lit_wide(const FrameParams &frame, const LayerBlend &by,
                                  std::span<const LayerHit> layer, const float *sums,
                                  RayColor *colors) {
  blend_lit(frame, by, layer, sums, colors);
}
ISO_WIDE_LOOP void shade_layers_wide(const FrameParams &frame, const ShadeParams &params,
                                     uint samples, uint row, const RayColor *colors,
                                     std::uint8_t *picture) {
  shade_layers(frame, params, samples, row, colors, picture);
}

uint blend_sse4(std::span<const LeveledSurface> surfaces, const LayerBlend &by, const RayTile &tile,
                HitRecord *next, const LayersOfRays &to) {
  return blend<trace_packets_behind<trace_ray_in_cell_anywhere, trace_packet_behind_sse4,
                                    trace_band_packet_sse4, side_anywhere>,
               smooth_hit_anywhere, trace_ray_anywhere, side_anywhere>(surfaces, by, tile, next,
                                                                       to);
}

/// With fused multiply-add, single rays are faster.
bool is_narrow() {
  return __builtin_cpu_supports("sse4.1") && __builtin_cpu_supports("popcnt") &&
         !__builtin_cpu_supports("fma");
}
bool is_wide() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") &&
         __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("fma") &&
         __builtin_cpu_supports("popcnt");
}
#endif

constexpr HostLoops kLoops[] = {
    {decode_anywhere, ranges_anywhere, inside_anywhere, trace_rays<trace_rays_of_levels_anywhere>,
     trace_rays<trace_rays_of_levels_anywhere>, trace_rays_of_levels_anywhere,
     trace_rays_of_levels_anywhere, cast_anywhere, ambient_anywhere, place_hits_anywhere,
     filter_bounced_anywhere, shade_anywhere, blend_rays_anywhere, blend_rays_anywhere,
     blend_lit_anywhere, shade_layers_anywhere},
#ifdef ISO_HAS_WIDE_LOOPS
    {decode_anywhere, ranges_anywhere, inside_anywhere, trace_narrow<trace_packets_sse4>,
     trace_rays<trace_rays_of_levels_anywhere>, trace_levels_narrow<trace_band_packet_sse4>,
     trace_rays_of_levels_anywhere, cast_anywhere, ambient_anywhere, place_hits_anywhere,
     filter_bounced_anywhere, shade_anywhere, blend_sse4, blend_rays_anywhere, blend_lit_anywhere,
     shade_layers_anywhere},
    {decode_wide, ranges_wide, inside_wide, trace_wide, trace_rays<trace_rays_of_levels_wide>,
     trace_levels_wide, trace_rays_of_levels_wide, cast_wide, ambient_wide, place_hits_wide,
     filter_bounced_wide, shade_wide, blend_wide, blend_rays_wide, blend_lit_wide,
     shade_layers_wide},
#elif defined(ISO_HAS_PACKETS)
    {decode_anywhere, ranges_anywhere, inside_anywhere, trace_narrow<trace_packets>,
     trace_rays<trace_rays_of_levels_anywhere>, trace_levels_narrow<trace_band_packet>,
     trace_rays_of_levels_anywhere, cast_anywhere, ambient_anywhere, place_hits_anywhere,
     filter_bounced_anywhere, shade_anywhere, blend_rays_anywhere, blend_rays_anywhere,
     blend_lit_anywhere, shade_layers_anywhere},  // pages are small: no packets behind hits
#endif
};

}  // namespace

std::span<const HostLoops> all_host_loops() {
#ifdef ISO_HAS_WIDE_LOOPS
  static const std::size_t count = is_wide() ? 3 : is_narrow() ? 2 : 1;
  return std::span(kLoops).first(count);
#elif defined(ISO_HAS_PACKETS)
  static const std::size_t count = fma_is_fused() ? 2 : 1;
  return std::span(kLoops).first(count);
#else
  return kLoops;
#endif
}

}  // namespace isowave::core
