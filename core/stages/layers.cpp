#include "core/stages/layers.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numeric>

namespace isowave::core {

namespace {

std::string name_of(std::uint32_t surface) {
  return fmt::format("hits of surface {}", surface);
}

}  // namespace

ocl::BufferSizes Layers::sizes(const Limits &limits) {
  ocl::BufferSizes sizes{ocl::buffer_size<RayColor>("colours of rays", limits.num_rays),
                         ocl::buffer_size<HitRecord>("hits of a layer", limits.num_rays),
                         ocl::buffer_size<uint>("rays of a layer", limits.num_rays),
                         ocl::buffer_size<uint>("rays of the next layer", limits.num_rays),
                         ocl::buffer_size<LayerParams>("surfaces", 1),
                         ocl::buffer_size<uint>("colours of layers", ISO_MAP_COLORS),
                         ocl::buffer_size<uchar>("slices that rays have passed", limits.num_rays),
                         ocl::buffer_size<LayerCounts>("layer counts", 1),
                         ocl::buffer_size<LayerCounts>("layer counts, next", 1)};
  for (std::uint32_t surface = 0; surface < limits.max_surfaces; ++surface)
    sizes.add({ocl::buffer_size<HitRecord>(name_of(surface), limits.num_rays)});
  return sizes;
}

Layers::Layers(ocl::Device &device, const Limits &limits, std::uint32_t group_size, bool levels)
    : Layers(device, limits, sizes(limits), group_size, levels) {}

Layers::Layers(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
               std::uint32_t group_size, bool levels)
    : colors(device, sizes["colours of rays"]),
      range_(ocl::Range::strided(limits.num_rays, group_size, device)),
      further_hits_(device, sizes["hits of a layer"]),
      params_(device, sizes["surfaces"]),
      color_map_(device, sizes["colours of layers"]),
      passed_(device, sizes["slices that rays have passed"]),
      listed_(device, sizes["rays of a layer"]),
      next_listed_(device, sizes["rays of the next layer"]),
      counts_(device, sizes["layer counts"]),
      next_counts_(device, sizes["layer counts, next"]),
      choose_(device, group_defines(group_size), levels),
      forget_(device, group_defines(group_size)),
      blend_(device, group_defines(group_size)),
      begin_(device, group_defines(group_size)) {
  for (std::uint32_t surface = 0; surface < limits.max_surfaces; ++surface)
    surface_hits_.emplace_back(device, sizes[name_of(surface)]);
}

void Layers::compile(Wavefront &rays) {
  order_ = {0};
  static constexpr LayerParams kNone{};
  params_.write({&kNone, 1});
  finest_ = rays.frame;
  clear(rays);
  forget(rays, rays.hits);
  choose(rays, 1, true);
  blend(rays, true);
}

void Layers::open(const std::vector<SurfaceStyle> &surfaces, const LayerParams &params,
                  const Shading &light, const FrameParams &finest) {
  order_ = innermost_first(surfaces);
  finest_ = finest;
  light_ = light.params;
  color_map_.write(light.color_map);
  params_.write({&params, 1});
}

void Layers::choose(Wavefront &rays, std::size_t num_surfaces, bool is_first) {
  for (std::size_t place = 0; place < num_surfaces; ++place)
    choose_.of(rays)(range_, rays.frame, rays.level_frames, rays.num_level_frames, order_[place],
                     place == 0 ? 1 : 0, is_first ? 1 : 0, rays.clip, params_, counts_, listed_,
                     surface_hits_[place], passed_, rays.hits);
}

void Layers::clear(const Wavefront &rays) {
  colors.fill(clear_ray(), 0, std::size_t{rays.frame.view.width} * rays.frame.view.height);
}

void Layers::forget(const Wavefront &rays, ocl::Buffer<HitRecord> &hits) {
  forget_(range_, rays.frame, hits);
}

LayerCounts Layers::blend(Wavefront &rays, bool is_first, uint how) {
  static constexpr LayerCounts kNone{};
  next_counts_.write_async({&kNone, 1});
  // While rays.hits are those of a further layer, those of the first are in further_hits_.
  blend_(range_, finest_, light_, color_map_, how, is_first ? 1 : 0, params_, counts_, listed_,
         rays.field_values, rays.open_counts, rays.num_ambient, rays.num_shadow, rays.bounced,
         rays.num_bounced, rays.hits, further_hits_, passed_, colors, next_counts_, next_listed_);
  return next_counts_.read().front();
}

std::vector<RayHit> Layers::read(const Wavefront &rays, bool is_first, bool with_values) const {
  const std::uint32_t num_rays = rays.frame.view.width * rays.frame.view.height;
  std::vector<HitRecord> hits(num_rays);
  rays.hits.read(hits);
  std::vector<float> values(with_values ? num_rays : 0);
  if (with_values) rays.field_values.read(values);
  std::vector<uint> listed(is_first ? num_rays : counts_.read().front().rays);
  if (is_first) {
    std::iota(listed.begin(), listed.end(), 0u);
  } else if (!listed.empty()) {
    listed_.read(listed);
  }
  std::vector<RayHit> result;
  result.reserve(listed.size());
  for (const uint ray : listed) {
    if (std::isfinite(hits[ray].t))
      result.push_back({ray, hits[ray], with_values ? values[ray] : 0.0f});
  }
  return result;
}

void Layers::begin(Wavefront &rays, const ocl::Buffer<HitRecord> &layer,
                   std::optional<std::size_t> place) {
  begin_(range_, rays.frame, place ? order_[*place] : ISO_INVALID_ID, counts_, listed_, layer,
         rays.counts, rays.next_counts, rays.next_active_ray_ids, rays.ray_block_ids);
}

}  // namespace isowave::core
