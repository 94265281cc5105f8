#include "reference/twin.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/parallel_for.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/frame/field_values.hpp"
#include "kernels_cl/portable/bounce.h"
#include "kernels_cl/portable/cell_intersect.h"
#include "kernels_cl/portable/clip.h"
#include "reference/scalar_renderer.hpp"

namespace isowave::core {

namespace {

/// Adds to the voxels of each block what its values are lowered or raised by.
void add_offset(const CompressedVolume &level, const ValueOffset &offset,
                std::vector<float> &voxels) {
  const glm::uvec3 dims = level.info.dims, blocks = level.num_blocks();
  float *value = voxels.data();
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x, ++value) {
        const std::size_t block = x / 4 + blocks.x * (y / 4 + std::size_t{blocks.y} * (z / 4));
        *value += offset_of_voxel(offset, level.bounds, block, x % 4 + 4 * (y % 4) + 16 * (z % 4));
      }
    }
  }
}

}  // namespace

Twin::Twin(const CompressedVolume &volume, double voxel_pixels, double voxel_error,
           FieldBound bound)
    : voxel_pixels_(voxel_pixels) {
  check_voxel_pixels(voxel_pixels);
  if (voxel_pixels > 0) check_has_levels(volume);
  for (const CompressedVolume *level : levels_of(volume, voxel_pixels > 0)) {
    const double level_error = voxel_error_of(voxel_error, levels_.size());
    levels_.push_back(level->info);
    voxels_.push_back(decode_with_libzfp(*level, level_error));
    if (bound == FieldBound::kNone) continue;
    const ValueOffset offset =
        value_offset({*level, level == &volume}, bound, plane_error(level->precision, level_error),
                     volume.value_range);
    add_offset(*level, offset, voxels_.back());
  }
}

std::vector<HitRecord> Twin::render(const Camera &camera, ImageSize size, float isovalue,
                                    Solver solver, Normals normals, const Clip &clip) const {
  const std::vector<FrameParams> frames =
      make_level_frames(levels_, camera, size, isovalue, voxel_pixels_);
  std::vector<HitRecord> hits = render_scalar_levels(
      frames, voxels_, solver, 0, make_clip_params(levels_[0], frames[0].view, camera, clip));
  if (normals == Normals::kSmooth) smooth_gradients(frames, voxels_, hits);
  return hits;
}

namespace {

/// A surface at all levels of detail.
using SurfaceFrames = std::vector<FrameParams>;

/// All hits of a ray with a surface, in their order: as many as may be drawn, and one more.
std::vector<HitRecord> hits_of(const SurfaceFrames &frames,
                               std::span<const std::vector<float>> voxels,
                               std::span<const Ray> rays, const ClipParams &clip) {
  std::vector<HitRecord> hits;
  HitRecord hit = trace_scalar_levels(frames, voxels, kDefaultSolver, rays, clip);
  while (std::isfinite(hit.t) && hits.size() <= ISO_MAX_LAYERS) {
    hits.push_back(hit);
    hit = trace_scalar_behind(frames, voxels, rays, hit, clip);
  }
  return hits;
}

/// The place of the finest level that draws.
std::size_t first_drawn(const SurfaceFrames &frames) {
  return static_cast<std::size_t>(std::ranges::find_if(frames, draws) - frames.begin());
}

/// A surface that light rays may meet.
struct Caster {
  SurfaceFrames frames;
  uint surface;
  bool clipped;
};

/// A hit of a layer, and its light: the shares of rays, and the sums of what these bring.
struct LitHit {
  HitRecord hit = no_hit();
  float value = no_value();
  HitLight light{};
};
using LitLayers = std::vector<std::vector<LitHit>>;  ///< [layer][ray]

/// The light rays of hits in layers.
class LayerLight {
 public:
  /// clip          of the surfaces that it clips
  /// any_is_whole  any_is_whole() of the surfaces
  LayerLight(const LightRays &rays, std::span<const VolumeInfo> levels,
             std::span<const std::vector<float>> voxels, const SurfaceFrames &frames,
             const ClipParams &clip, bool any_is_whole)
      : rays_(rays),
        clip_(clip),
        any_is_whole_(any_is_whole),
        frames_(frames),
        first_(first_drawn(frames)),
        params_(make_ambient_params(levels[first_], rays.num_ambient)),
        directions_(make_light_directions(rays)),
        voxels_(voxels) {}

  void add(const Caster &caster) { casters_.push_back(caster); }

  /// bounced: sums of all rays.
  HitLight light_of(const LayerParams &layers, uint has_map, uint pixel,
                    const HitRecord &hit) const {
    std::array<uchar, 2> counts{};
    HitLight light{1, 1, nothing_bounced()};
    if (is_of_slice(&layers, hit)) return light;
    const FrameParams &seen = frames_[first_];
    const std::size_t level = level_of_hit(frames_, hit);
    const auto place = [&](const HitRecord &own) {
      return placed_hit(&frames_[level], static_cast<uint>(level - first_), own);
    };
    const HitRecord placed = place(within_level(frames_[level], hit));
    const uint pattern = ambient_pattern(&seen, pixel);
    for (std::uint32_t k = 0; k < rays_.count(); ++k) {
      const GivenRay given = ambient_ray(&seen, &params_, placed, pixel, k,
                                         directions_[k * ISO_AMBIENT_PATTERNS + pattern]);
      if (!is_given(given)) continue;
      const HitRecord met = nearest_met(level, given);
      const bool is_shadow = is_shadow_ray(&params_, k);
      if (!std::isfinite(met.t)) {
        uchar &count = counts[is_shadow ? 1 : 0];
        count = static_cast<uchar>(count + 1);
      } else if (!is_shadow && rays_.bounces) {
        const std::size_t row = rays_.num_ambient + light_row(rays_.num_shadow, k);
        float cosine = 0;
        const GivenRay to_light =
            bounce_ray(&params_, given, place(met),
                       directions_[row * ISO_AMBIENT_PATTERNS + pattern], &cosine);
        if (is_given(to_light) && !std::isfinite(nearest_met(level, to_light).t))
          light.bounced =
              sum_with(light.bounced, cosine, sent_on(has_map, &layers, surface_of(met)));
      }
    }
    light.open = open_share(counts.data(), 0, rays_.num_ambient);
    light.lit = open_share(counts.data(), 1, rays_.num_shadow);
    return light;
  }

  /// Makes the sums of all hits their shares, filtered layer by layer.
  void filter(const LayerParams &params, LitLayers &layers) const {
    const FrameParams &seen = frames_[first_];
    for (std::vector<LitHit> &layer : layers) {
      std::vector<GivenRay> places(layer.size());
      for (uint ray = 0; ray < layer.size(); ++ray) {
        const HitRecord &hit = layer[ray].hit;
        places[ray] = normal_ray(&seen, &params_, ray, is_of_slice(&params, hit) ? no_hit() : hit);
      }
      for (float BouncedLight::*part :
           {&BouncedLight::own, &BouncedLight::r, &BouncedLight::g, &BouncedLight::b}) {
        std::vector<float> sums(layer.size());
        for (std::size_t ray = 0; ray < layer.size(); ++ray)
          sums[ray] = layer[ray].light.bounced.*part;
        filter_bounced(seen, places, sums);
        for (std::size_t ray = 0; ray < layer.size(); ++ray)
          layer[ray].light.bounced.*part = sums[ray] / static_cast<float>(rays_.num_ambient);
      }
    }
  }

 private:
  /// The nearest of what a ray meets in a level of detail: surfaces that planes leave whole, then
  /// those that they clip. A ray that enters these at a cap within a surface meets the cap.
  HitRecord nearest_met(std::size_t level, const GivenRay &given) const {
    static constexpr ClipParams kWhole{};
    const float t_scale = frames_[level].view.t_scale,
                voxel = std::ldexp(1.0f, static_cast<int>(level));
    HitRecord nearest = no_hit();
    GivenRay ray = given;
    for (const bool clipped : {false, true}) {
      const ClipParams &clip = clipped ? clip_ : kWhole;
      if (clipped && any_is_whole_) {
        const RayEntrance at = entrance_of(&clip, given, voxel);
        ray = entering(&clip, given, at);
        nearest.t = t_from(t_scale, nearest.t, at.begin);
      }
      for (const Caster &caster : casters_) {
        if (caster.clipped != clipped) continue;
        const HitRecord met = trace_scalar(caster.frames[level], voxels_[level], kDefaultSolver,
                                           make_given_ray(ray), clip);
        if (met.t < nearest.t && !is_clipped(&clip, ray, voxel, met.t / t_scale))
          nearest = with_surface(met, caster.surface);
      }
    }
    return nearest;
  }

  LightRays rays_;
  ClipParams clip_;
  bool any_is_whole_;
  SurfaceFrames frames_;
  std::size_t first_;  ///< level that draws
  AmbientParams params_;
  std::vector<AmbientDirection> directions_;
  std::span<const std::vector<float>> voxels_;
  std::vector<Caster> casters_;
};

/// All layers of each ray.
std::vector<RayColor> blended(const FrameParams &frame, const Shading &shading,
                              const LayerParams &params, const LitLayers &layers) {
  std::vector<RayColor> colors(layers.front().size(), clear_ray());
  for (const std::vector<LitHit> &layer : layers) {
    for (uint ray = 0; ray < colors.size(); ++ray)
      colors[ray] = blend_hit(&frame, &shading.params, shading.color_map.data(), &params, ray,
                              layer[ray].hit, layer[ray].value, layer[ray].light, colors[ray]);
  }
  return colors;
}

/// rays_cut is left out.
LayerStats stats_of(const std::vector<std::vector<HitRecord>> &layers) {
  LayerStats stats;
  const auto is_hit = [](const HitRecord &hit) { return std::isfinite(hit.t); };
  for (const std::vector<HitRecord> &layer : layers) {
    const auto hits = static_cast<std::uint64_t>(std::ranges::count_if(layer, is_hit));
    stats.hits += hits;
    if (hits != 0) ++stats.layers;
  }
  return stats;
}

/// The place of the list whose next hit, its last, is nearest; left.size(): none has one.
std::size_t nearest_of(const std::vector<std::vector<HitRecord>> &left) {
  std::size_t nearest = left.size();
  for (std::size_t k = 0; k < left.size(); ++k) {
    if (left[k].empty()) continue;
    if (nearest == left.size() || left[k].back().t < left[nearest].back().t) nearest = k;
  }
  return nearest;
}

/// The frames of each surface, in that order.
std::vector<SurfaceFrames> frames_of(const FrameRequest &request,
                                     std::span<const VolumeInfo> levels, double voxel_pixels,
                                     const std::vector<std::uint32_t> &order) {
  std::vector<SurfaceFrames> frames;
  frames.reserve(order.size());
  for (const std::uint32_t surface : order)
    frames.push_back(make_level_frames(levels, request.camera, *request.size,
                                       request.surfaces[surface].isovalue, voxel_pixels));
  return frames;
}

/// A ray of the camera at each level, with its interval there.
std::vector<Ray> rays_of(const SurfaceFrames &frames, const ClipParams *clip, uint pixel) {
  std::vector<Ray> rays;
  for (const FrameParams &frame : frames) {
    rays.push_back(in_band(frame, make_ray(&frame, pixel)));
    if (clip != nullptr) clip_ray(&frame, clip, pixel, &rays.back());
  }
  return rays;
}

/// A ray's hit on a slice: the voxels of the level in whose band it lies show.
HitRecord hit_on_slice(const SurfaceFrames &frames, const ClipParams &clip,
                       const LayerParams &layers, uint slice, uint pixel) {
  for (const FrameParams &frame : frames) {
    if (!draws(frame)) continue;
    const HitRecord hit = slice_hit(&frame, &clip, &layers, slice, pixel);
    if (std::isfinite(hit.t)) return among_levels(frame, hit);
  }
  return no_hit();
}

}  // namespace

LayeredFrame Twin::render_layers(const FrameRequest &request, const FieldTwin *field) const {
  const std::vector<SurfaceStyle> &surfaces = request.surfaces;
  const LightRays light_rays = light_rays_of(request);
  check_surfaces(surfaces, request.slices);
  const std::vector<std::uint32_t> order = innermost_first(surfaces);
  const VolumeInfo &finest = levels_[0];
  const std::vector<SurfaceFrames> frames = frames_of(request, levels_, voxel_pixels_, order);
  const SurfaceFrames &levels = frames[0];
  const ClipParams clip = make_clip_params(finest, levels[0].view, request.camera, request.clip),
                   whole{};
  const bool has_field = field != nullptr && request.field_values;
  const Shading shading =
      make_layer_shading(finest, request, has_field ? field->volume_range() : std::nullopt);
  const LayerParams colors =
      make_layer_params(surfaces, request.slices, finest, levels[0].view, request.camera);
  LayerLight lights(light_rays, levels_, voxels_, levels, clip, any_is_whole(surfaces));
  for (std::size_t k = 0; k < order.size(); ++k) {
    const SurfaceStyle &surface = surfaces[order[k]];
    if (surface.opacity == 1) lights.add({frames[k], order[k], surface.clipped});
  }
  const std::vector<FieldMap> of_slices = make_own_maps(levels_);
  const uint num_slices = colors.slices.num_planes;
  const std::size_t num_rays = request.size->num_rays();
  LayeredFrame result;
  result.layers.assign(ISO_MAX_LAYERS, std::vector<HitRecord>(num_rays, no_hit()));
  result.first_hits.assign(num_rays, no_hit());
  result.colors.assign(num_rays, clear_ray());
  std::vector<uchar> cut(num_rays);
  LitLayers lit(light_rays.bounces ? ISO_MAX_LAYERS : 0, std::vector<LitHit>(num_rays));
  const auto value_of = [&](const HitRecord &hit) {
    if (is_of_slice(&colors, hit)) {
      const std::size_t level = level_of_hit(levels, hit);
      return value_at_hit({of_slices[level]}, levels_[level].dims, voxels_[level], hit);
    }
    return has_field ? field->values(levels_, {&hit, 1}, request)[0] : no_value();
  };
  parallel_for(num_rays, 0, [&](std::uint64_t i, std::uint32_t) {
    const auto pixel = static_cast<uint>(i);
    std::vector<std::vector<HitRecord>> left;  // [slice, then surface] in their order
    for (uint slice = 0; slice < num_slices; ++slice) {
      const HitRecord hit = hit_on_slice(levels, clip, colors, slice, pixel);
      left.emplace_back(std::isfinite(hit.t) ? 1 : 0, hit);
    }
    for (std::size_t k = 0; k < frames.size(); ++k) {
      const bool clips = surfaces[order[k]].clipped;
      left.push_back(hits_of(frames[k], voxels_, rays_of(frames[k], clips ? &clip : nullptr, pixel),
                             clips ? clip : whole));
      std::ranges::reverse(left.back());
      for (HitRecord &hit : left.back()) hit = with_surface(hit, order[k]);
    }
    RayColor &color = result.colors[i];
    for (std::size_t layer = 0; goes_on(color); ++layer) {
      const std::size_t nearest = nearest_of(left);
      if (nearest == left.size()) break;
      if (layer == ISO_MAX_LAYERS) {
        cut[i] = 1;
        break;
      }
      HitRecord hit = left[nearest].back();
      left[nearest].pop_back();
      if (request.normals == Normals::kSmooth) smooth_gradients(levels, voxels_, {&hit, 1}, 1);
      const float value = value_of(hit);
      if (is_unseen(&colors, hit, value)) continue;
      result.layers[layer][i] = hit;
      if (!std::isfinite(result.first_hits[i].t)) result.first_hits[i] = hit;
      const HitLight light = lights.light_of(colors, shading.params.has_map, pixel, hit);
      if (light_rays.bounces) lit[layer][i] = {hit, value, light};
      color = blend_hit(levels.data(), &shading.params, shading.color_map.data(), &colors, pixel,
                        hit, value, light, color);
    }
  });
  if (light_rays.bounces) {
    lights.filter(colors, lit);
    result.colors = blended(levels[0], shading, colors, lit);
  }
  result.stats = stats_of(result.layers);
  result.stats.rays_cut = static_cast<std::uint64_t>(std::ranges::count(cut, 1));
  return result;
}

OpenCounts Twin::open(const Camera &camera, ImageSize size, float isovalue,
                      const std::vector<HitRecord> &hits, const LightRays &rays, Solver solver,
                      const Clip &clip) const {
  const std::vector<FrameParams> frames =
      make_level_frames(levels_, camera, size, isovalue, voxel_pixels_);
  return open_of(frames, levels_, voxels_, hits, rays, solver, 0,
                 make_clip_params(levels_[0], frames[0].view, camera, clip));
}

}  // namespace isowave::core
