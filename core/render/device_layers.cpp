// DeviceRenderer's frames of several and translucent surfaces, and their colours by a field.

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/frame/field_values.hpp"
#include "core/render/device_renderer.hpp"

namespace isowave::core {

namespace {

/// The box around both; an empty one has no part in it.
ScreenBox joined(const ScreenBox &a, const ScreenBox &b) {
  if (a.end_x == 0) return b;
  if (b.end_x == 0) return a;
  return {std::min(a.begin_x, b.begin_x), std::min(a.begin_y, b.begin_y),
          std::max(a.end_x, b.end_x), std::max(a.end_y, b.end_y)};
}

bool any_goes_on(const LayerCounts &counts) {
  return std::ranges::any_of(counts.going_on, [](uint rays) { return rays != 0; });
}

}  // namespace

/// Each wave of layers takes half of what is left.
void DeviceRenderer::Frame::tell(double percent) const {
  if (!on_progress) return;
  const bool is_known = num_waves != 0;
  const std::uint32_t last = is_known ? num_waves - 1 : std::numeric_limits<std::uint32_t>::max();
  const double done = last - waves_left + percent / 100;
  on_progress(is_known ? 100 * done / num_waves : 100 * (1 - std::exp2(-done)));
}

/// Layer by layer: each ray's nearest hit of all surfaces gets its gradient and is blended. Rays
/// that go on find the next hit of that surface.
void DeviceRenderer::draw_layers(const FrameRequest &request, Frame &frame) {
  std::vector<float> isovalues = isovalues_of_layers(request.surfaces);
  FrameStats &stats = frame.stats;
  frame.waves_left = std::numeric_limits<std::uint32_t>::max();  // as many as it takes
  frame.num_waves = 0;
  last_view_.reset();
  const Level &finest = blocks_.levels[0];
  layers_->open(request.surfaces,
                make_layer_params(request.surfaces, request.slices, finest.info, finest.frame.view,
                                  request.camera),
                make_layer_shading(finest.info, request,
                                   request.field_values ? field_->volume_range() : std::nullopt),
                finest.frame);
  layers_->clear(rays_);
  if (!request.slices.planes.empty()) rays_.field_values.fill(no_value());
  has_layers_ = true;
  const ClipParams clip = clip_of(request);
  const std::size_t num_surfaces = find_first_hits(request, clip, isovalues, frame);
  isovalues.resize(num_surfaces);
  stats.rays_hit = 0;
  for (std::uint32_t layer = 0;; ++layer) {
    rays_.set_clip(clip);
    const LayerCounts counts = draw_layer(layer, request, clip, isovalues, frame);
    stats.rays_hit += counts.first_hits;
    if (layer == ISO_MAX_LAYERS) {
      stats.layers.rays_cut = counts.hits;
      break;
    }
    stats.layers.layers += counts.hits != 0 ? 1 : 0;
    stats.layers.hits += counts.hits;
    if (!any_goes_on(counts)) break;
    find_hits_behind(request, clip, isovalues, counts, layer == 0, frame);
    if (stats.cancelled) break;
  }
}

FrameStats DeviceRenderer::render_layers(const FrameRequest &request,
                                         std::vector<std::vector<RayHit>> &layers) {
  const auto forget = [this](void *) { layer_hits_ = nullptr; };
  layer_hits_ = &layers;
  const std::unique_ptr<void, decltype(forget)> forgets(this, forget);
  return render(request);
}

void DeviceRenderer::set_colors(std::span<const RayColor> colors) {
  check_has_picture();
  layers_->colors.write(colors);
}

/// Goes on with the surface at that place. clip: that of the frame.
void DeviceRenderer::show_surface(const FrameRequest &request, const ClipParams &clip,
                                  std::size_t place, float isovalue) {
  const std::uint32_t number = layers_->surface_at(place);
  rays_.set_clip(request.surfaces[number].clipped ? clip : ClipParams{});
  blocks_.show_surface(rays_, place, isovalue, number);
}

/// Gives hits the values of the field: those of all bit planes, also if the frame draws fewer.
void DeviceRenderer::read_field(const FrameRequest &request, Frame &frame) {
  if (frame.stats.cancelled) return;
  const bool draws_others = blocks_.plan.field.shares_blocks && !draws_own_values(request);
  if (draws_others) blocks_.go_on_with(decoded_values({}));
  run(*field_, frame);
  if (draws_others) blocks_.go_on_with(decoded_values(request));
}

/// Returns the number of surfaces that have hits: all, unless the frame is stopped.
std::size_t DeviceRenderer::find_first_hits(const FrameRequest &request, const ClipParams &clip,
                                            std::span<const float> isovalues, Frame &frame) {
  ScreenBox screen{};
  std::size_t num_surfaces = 0;
  while (num_surfaces < isovalues.size() && !frame.stats.cancelled) {
    const std::size_t place = num_surfaces++;
    if (place != 0) show_surface(request, clip, place, isovalues[place]);
    screen = joined(screen, rays_.frame.screen);
    layers_->swap_hits(rays_, place);
    finds_first_of_ = place;
    run(*camera_rays_, frame);
    finds_first_of_.reset();
    layers_->swap_hits(rays_, place);
  }
  const View &view = rays_.frame.view;
  layers_screen_ =
      request.slices.planes.empty() ? screen : ScreenBox{0, 0, view.width, view.height};
  return num_surfaces;
}

/// Casts ambient and shadow rays from the hits of a layer, in rays_.hits.
void DeviceRenderer::light_layer(const FrameRequest &request, const ClipParams &clip,
                                 std::span<const float> isovalues, Frame &frame) {
  const LightRays light_rays = light_rays_of(request);
  for (std::uint32_t round = 0; round < light_rays.count(); ++round) {
    if (light_rays.bounces && round < light_rays.num_ambient) {
      bounce_layer_round(round, request, clip, isovalues, frame);
    } else {
      cast_layer_round(round, request, clip, isovalues, RoundEnd::kBlocks, frame);
    }
  }
  if (frame.stats.cancelled) return;
  count_last_round(light_rays.count(), frame);
  if (!light_rays.bounces) return;
  {
    const auto stage = device_.timer().stage("bounce");
    bounce_->filter(rays_, ISO_LAYER_SUMS);
  }
  add_stage_times(frame.stats.ambient);
}

/// A round of ambient rays that bring the light and the colour of the nearest opaque surface.
void DeviceRenderer::bounce_layer_round(std::uint32_t round, const FrameRequest &request,
                                        const ClipParams &clip, std::span<const float> isovalues,
                                        Frame &frame) {
  if (frame.stats.cancelled) return;
  layers_->forget(rays_, bounce_->nearest);
  cast_layer_round(round, request, clip, isovalues, RoundEnd::kNearest, frame);
  if (frame.stats.cancelled) return;
  {
    const auto stage = device_.timer().stage("bounce");
    rays_.set_clip({});  // what was clipped is no nearest hit
    bounce_->go_to_light(rays_, round, bounce_->nearest);
  }
  cast_layer_round(round, request, clip, isovalues, RoundEnd::kBlocksLight, frame);
  if (frame.stats.cancelled) return;
  const auto stage = device_.timer().stage("bounce");
  bounce_->add_colored(rays_, round, layers_->params(), layers_->has_map());
}

/// Casts one light ray of each hit of a layer, which may meet any opaque surface: first those that
/// clipping planes leave whole. Each goes through its hit's level of detail of all surfaces.
void DeviceRenderer::cast_layer_round(std::uint32_t round, const FrameRequest &request,
                                      const ClipParams &clip, std::span<const float> isovalues,
                                      RoundEnd end, Frame &frame) {
  bool may_enter = clip.num_planes != 0 && any_is_whole(request.surfaces);
  bool goes_on = end == RoundEnd::kBlocksLight;
  ocl::Buffer<HitRecord> *const nearest = end == RoundEnd::kNearest ? &bounce_->nearest : nullptr;
  const bool has_caps = may_enter && clip.with_caps != 0;
  for (const std::size_t place : light_order(request.surfaces)) {
    // A frame that is stopped has the first hits of fewer surfaces.
    if (place >= isovalues.size() || frame.stats.cancelled) break;
    const std::uint32_t number = layers_->surface_at(place);
    const bool enters = request.surfaces[number].clipped && std::exchange(may_enter, false);
    show_surface(request, clip, place, isovalues[place]);
    rays_.frame.screen = layers_screen_;  // of all hits
    rays_.given_at_caps = has_caps && request.surfaces[number].clipped;
    ambient_round_->set_round(round, std::exchange(goes_on, true), enters, nearest);
    run(*ambient_round_, frame);
    if (nearest != nullptr) {
      bounce_->take_nearest(rays_, number);
    } else {
      ambient_->block(rays_);
    }
  }
  rays_.given_at_caps = false;
}

/// Behind the last layer that is drawn, hits are counted alone.
LayerCounts DeviceRenderer::draw_layer(std::uint32_t layer, const FrameRequest &request,
                                       const ClipParams &clip, std::span<const float> isovalues,
                                       Frame &frame) {
  const bool is_further = layer != 0, is_drawn = layer < ISO_MAX_LAYERS;
  const bool is_lit = is_drawn && light_rays_of(request).count() != 0,
             is_smooth = is_drawn && request.normals == Normals::kSmooth,
             has_field = is_drawn && request.field_values;
  if (is_further) layers_->swap_layer(rays_);
  is_in_further_layer_ = is_further;
  rays_.num_ambient = rays_.num_shadow = rays_.num_bounced = 0;
  if (is_further && is_lit) layers_->forget(rays_, rays_.hits);
  layers_->choose(rays_, isovalues.size(), !is_further);
  rays_.frame.screen = layers_screen_;
  if (is_drawn && !request.slices.planes.empty()) {
    slice_values_->set_layer(!is_further, ~0u << request.surfaces.size());
    run(*slice_values_, frame);
  }
  const bool previews = !is_further && frame.on_pass && (is_smooth || is_lit || has_field);
  if (previews) layers_->blend(rays_, true, ISO_PREVIEWS);
  if (is_smooth) run(is_further ? static_cast<Wave &>(*layer_normals_) : normals_of_camera_, frame);
  if (has_field) {
    field_->set_layer(is_further ? &*layers_ : nullptr);
    read_field(request, frame);
  }
  // Hits of a stopped frame may have the values of the layer before. The first layer has none.
  if (is_further && frame.stats.cancelled) rays_.field_values.fill(no_value());
  if (is_lit) light_layer(request, clip, isovalues, frame);
  if (previews) layers_->clear(rays_);
  if (layer_hits_ != nullptr)
    layer_hits_->push_back(layers_->read(
        rays_, !is_further, is_drawn && (has_field || !request.slices.planes.empty())));
  const LayerCounts counts =
      layers_->blend(rays_, !is_further, is_drawn ? ISO_BLENDS : ISO_COUNTS_ALONE);
  layers_->next_layer();
  is_in_further_layer_ = false;
  if (is_further) layers_->swap_layer(rays_);
  return counts;
}

void DeviceRenderer::find_hits_behind(const FrameRequest &request, const ClipParams &clip,
                                      std::span<const float> isovalues, const LayerCounts &counts,
                                      bool is_first_layer, Frame &frame) {
  for (std::size_t place = 0; place < isovalues.size() && !frame.stats.cancelled; ++place) {
    if (counts.going_on[layers_->surface_at(place)] == 0) continue;
    show_surface(request, clip, place, isovalues[place]);
    behind_->set_surface(is_first_layer, place);
    finds_behind_of_ = place;
    run(*behind_, frame);
    finds_behind_of_.reset();
    layers_->swap_hits(rays_, place);
  }
}

}  // namespace isowave::core
