#include "reference/twin.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/parallel_for.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/frame/field_values.hpp"
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

/// All crossings of a ray with a surface, in their order: as many as may be drawn, and one more.
std::vector<HitRecord> crossings(const FrameParams &frame, const std::vector<float> &voxels,
                                 const Ray &ray, const ClipParams &clip) {
  std::vector<HitRecord> hits;
  HitRecord hit = trace_scalar_levels({&frame, 1}, {&voxels, 1}, kDefaultSolver, {&ray, 1}, clip);
  while (std::isfinite(hit.t) && hits.size() <= ISO_MAX_LAYERS) {
    hits.push_back(hit);
    hit = trace_scalar_behind(frame, voxels, ray, hit);
  }
  return hits;
}

/// A surface that light rays may meet.
struct Caster {
  FrameParams frame;
  ClipParams clip;
};

/// The light rays of hits in layers.
class LayerLight {
 public:
  /// any_is_whole: any_is_whole() of the surfaces
  LayerLight(const LightRays &rays, const VolumeInfo &info, const std::vector<float> &voxels,
             bool any_is_whole)
      : rays_(rays),
        any_is_whole_(any_is_whole),
        params_(make_ambient_params(info, rays.num_ambient)),
        directions_(make_light_directions(rays)),
        voxels_(voxels) {}

  void add(const Caster &caster) { casters_.push_back(caster); }

  /// The rays of a hit that meet nothing: ambient rays, and shadow rays.
  std::array<uchar, 2> count_open(const FrameParams &seen, uint pixel, const HitRecord &hit) const {
    std::array<uchar, 2> counts{};
    const HitRecord placed = placed_hit(&seen, 0, hit);
    for (std::uint32_t k = 0; k < rays_.count(); ++k) {
      const GivenRay given =
          ambient_ray(&seen, &params_, placed, pixel, k,
                      directions_[k * ISO_AMBIENT_PATTERNS + ambient_pattern(&seen, pixel)]);
      if (!is_given(given) || meets_any(given)) continue;
      uchar &count = counts[is_shadow_ray(&params_, k) ? 1 : 0];
      count = static_cast<uchar>(count + 1);
    }
    return counts;
  }

 private:
  bool meets_any(const GivenRay &given) const {
    return std::ranges::any_of(casters_, [&](const Caster &caster) {
      const GivenRay ray = any_is_whole_ ? entering(&caster.clip, given, 1.0f) : given;
      const HitRecord met =
          trace_scalar(caster.frame, voxels_, kDefaultSolver, make_given_ray(ray));
      return std::isfinite(met.t) &&
             !is_clipped(&caster.clip, ray, 1.0f, met.t / caster.frame.view.t_scale);
    });
  }

  LightRays rays_;
  bool any_is_whole_;
  AmbientParams params_;
  std::vector<AmbientDirection> directions_;
  const std::vector<float> &voxels_;
  std::vector<Caster> casters_;
};

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

/// The frame of each surface, in that order.
std::vector<FrameParams> frames_of(const FrameRequest &request, const VolumeInfo &finest,
                                   const std::vector<std::uint32_t> &order) {
  std::vector<FrameParams> frames;
  frames.reserve(order.size());
  for (const std::uint32_t surface : order)
    frames.push_back(make_frame_params(finest, request.camera, *request.size,
                                       request.surfaces[surface].isovalue));
  return frames;
}

}  // namespace

LayeredFrame Twin::render_layers(const FrameRequest &request, const FieldTwin *field) const {
  const std::vector<SurfaceStyle> &surfaces = request.surfaces;
  const LightRays light_rays = light_rays_of(request);
  check_surfaces(surfaces, request.slices);
  const std::vector<std::uint32_t> order = innermost_first(surfaces);
  const VolumeInfo &finest = levels_[0];
  const std::vector<FrameParams> frames = frames_of(request, finest, order);
  const ClipParams clip = make_clip_params(finest, frames[0].view, request.camera, request.clip);
  const bool has_field = field != nullptr && request.field_values;
  const Shading shading =
      make_layer_shading(finest, request, has_field ? field->volume_range() : std::nullopt);
  const LayerParams colors =
      make_layer_params(surfaces, request.slices, finest, frames[0].view, request.camera);
  LayerLight lights(light_rays, finest, voxels_[0], any_is_whole(surfaces));
  for (std::size_t k = 0; k < order.size(); ++k) {
    const SurfaceStyle &surface = surfaces[order[k]];
    if (surface.opacity == 1) lights.add({frames[k], surface.clipped ? clip : ClipParams{}});
  }
  const FieldReading of_slices{make_field_map({&finest, 1}, finest)};
  const uint num_slices = colors.slices.num_planes;
  const std::size_t num_rays = request.size->num_rays();
  LayeredFrame result;
  result.layers.assign(ISO_MAX_LAYERS, std::vector<HitRecord>(num_rays, no_hit()));
  result.first_hits.assign(num_rays, no_hit());
  result.colors.assign(num_rays, clear_ray());
  std::vector<uchar> cut(num_rays);
  parallel_for(num_rays, 0, [&](std::uint64_t i, std::uint32_t) {
    const auto pixel = static_cast<uint>(i);
    std::vector<std::vector<HitRecord>> left;  // [slice, then surface] in their order
    for (uint slice = 0; slice < num_slices; ++slice) {
      const HitRecord hit = slice_hit(frames.data(), &clip, &colors, slice, pixel);
      left.emplace_back(std::isfinite(hit.t) ? 1 : 0, hit);
    }
    for (std::size_t k = 0; k < frames.size(); ++k) {
      const FrameParams &frame = frames[k];
      Ray ray = in_band(frame, make_ray(&frame, pixel));
      const bool clips = surfaces[order[k]].clipped;
      if (clips) clip_ray(&frame, &clip, pixel, &ray);
      left.push_back(crossings(frame, voxels_[0], ray, clips ? clip : ClipParams{}));
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
      if (request.normals == Normals::kSmooth) smooth_gradients(frames[0], voxels_[0], {&hit, 1});
      float value = no_value();
      if (is_of_slice(&colors, hit)) {
        value = value_at_hit(of_slices, finest.dims, voxels_[0], hit);
      } else if (has_field) {
        value = field->values({&finest, 1}, {&hit, 1}, request)[0];
      }
      if (is_unseen(&colors, hit, value)) continue;
      result.layers[layer][i] = hit;
      if (!std::isfinite(result.first_hits[i].t)) result.first_hits[i] = hit;
      std::array<uchar, 2> open{};
      if (!is_of_slice(&colors, hit)) open = lights.count_open(frames[0], pixel, hit);
      color = blend_hit(frames.data(), &shading.params, shading.color_map.data(), &colors, pixel,
                        hit, value, open_share(open.data(), 0, light_rays.num_ambient),
                        open_share(open.data(), 1, light_rays.num_shadow), color);
    }
  });
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
