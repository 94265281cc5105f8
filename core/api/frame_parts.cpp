#include "core/api/frame_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <type_traits>

#include "core/api/convert.hpp"
#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/view/color_maps.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave {

namespace {

FrameStatistics public_statistics(const core::FrameStats &stats, std::uint64_t num_rays) {
  FrameStatistics result;
  result.passes = static_cast<std::uint32_t>(stats.passes.size());
  result.rays = num_rays;
  result.hits = stats.rays_hit;
  result.layers = stats.layers.layers;
  result.layer_hits = stats.layers.hits;
  result.rays_cut = stats.layers.rays_cut;
  for (const core::PassStats &pass : stats.passes) {
    result.decoded_blocks += pass.counts.decoded_count;
    for (const auto &[stage, ms] : pass.stage_ms) result.stage_ms[stage] += ms;
  }
  result.normals_passes = stats.normals.passes;
  result.normals_decoded_blocks = stats.normals.decoded_blocks;
  result.normals_ms = stats.normals.ms;
  result.ambient_passes = stats.ambient.passes;
  result.ambient_ms = stats.ambient.ms;
  result.field_ms = stats.field.ms + stats.slices.ms;
  for (const core::LaterPasses *later :
       {&stats.normals, &stats.behind, &stats.field, &stats.slices, &stats.ambient}) {
    result.passes += later->passes;
    result.decoded_blocks += later->decoded_blocks;
    for (const auto &[stage, ms] : later->stage_ms) result.stage_ms[stage] += ms;
  }
  result.uploaded_bytes = stats.uploaded_bytes;
  result.first_level = static_cast<std::uint32_t>(stats.first_level);
  result.last_level = static_cast<std::uint32_t>(stats.last_level);
  result.total_ms = result.hits_ms = stats.total_ms;
  result.cancelled = stats.cancelled;
  result.complete = stats.complete;
  return result;
}

}  // namespace

core::ImageSize core_size(const ImageSize &size) {
  return {size.width, size.height, size.samples};
}

core::Camera core_camera(const Camera &camera) {
  return {to_glm(camera.eye), to_glm(camera.at), to_glm(camera.up), camera.fovy_degrees,
          camera.parallel_height};
}

Camera public_camera(const core::Camera &camera) {
  return {from_glm(camera.eye), from_glm(camera.at), from_glm(camera.up), camera.fovy_deg,
          camera.parallel_height};
}

core::Viewpoint core_viewpoint(const Viewpoint &from, std::uint32_t num_views) {
  if (num_views == 0 || num_views > core::kMostViews)
    throw core::Error("a turntable of {} views: give 1 to {}", num_views, core::kMostViews);
  if (from.side > Side::kIso) throw core::Error("{} is no side", static_cast<int>(from.side));
  const auto up = from.up ? std::optional(to_glm(*from.up)) : std::nullopt;
  return {static_cast<core::Side>(from.side), up, from.zoom, num_views};
}

std::vector<Camera> public_turntable(const core::Camera &first, const core::VolumeInfo &info,
                                     const core::Viewpoint &from) {
  std::vector<Camera> cameras(from.num_views);
  const glm::dvec3 axis = core::orientation_of(info, from.up).up;
  std::ranges::transform(core::turntable(first, from.num_views, axis), cameras.begin(),
                         public_camera);
  return cameras;
}

core::Clip core_clip(const std::vector<ClipPlane> &planes, bool caps) {
  core::Clip clip{.caps = caps};
  for (const ClipPlane &plane : planes) clip.planes.push_back({to_glm(plane.normal), plane.offset});
  return clip;
}

core::SurfaceStyle core_style(const Surface &surface) {
  core::SurfaceStyle style{.color = to_glm(surface.color),
                           .opacity = surface.opacity,
                           .clipped = surface.clipped,
                           .mapped = surface.mapped};
  for (const std::uint32_t label : surface.labels) {
    if (label >= ISO_NUM_LABELS)
      throw core::Error("{} is no label: labels are 0 to {}", label, ISO_NUM_LABELS - 1);
    style.labels.push_back(static_cast<std::uint16_t>(label));
  }
  return style;
}

std::string text_of_labels(const Surface &surface) {
  std::string text;
  const std::vector<std::uint32_t> &labels = surface.labels;
  for (std::size_t i = 0; i < labels.size();) {
    std::size_t end = i + 1;
    while (end < labels.size() && labels[end] == labels[end - 1] + 1) ++end;
    text += fmt::format("{}{}", text.empty() ? "" : "+", labels[i]);
    if (end - i > 1) text += fmt::format("-{}", labels[end - 1]);
    i = end;
  }
  return text;
}

std::vector<std::uint16_t> labels_of(const std::vector<Surface> &surfaces) {
  std::vector<std::uint16_t> labels;
  for (const Surface &surface : surfaces) {
    const std::vector<std::uint16_t> more = core_style(surface).labels;
    labels.insert(labels.end(), more.begin(), more.end());
  }
  return labels;
}

core::ColorTable color_table_of(const std::string &map,
                                const std::vector<std::array<float, 3>> &colors) {
  if (colors.empty()) return core::color_map(map);
  core::ColorTable table{};
  if (colors.size() != table.size())
    throw core::Error("a colour table of {} colours cannot be used: give {}", colors.size(),
                      table.size());
  for (std::size_t i = 0; i < table.size(); ++i) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const float value = colors[i][channel];
      if (!(value >= 0 && value <= 1))
        throw core::Error("a colour of {} is out of range: give 0 to 1", value);
      table[i] |= static_cast<std::uint32_t>(std::lround(255 * value)) << 8 * channel;
    }
  }
  return table;
}

std::vector<std::string> color_map_names() {
  const auto names = core::color_map_names();
  return {names.begin(), names.end()};
}

core::Appearance core_appearance(const Appearance &appearance, const core::VolumeInfo &whole) {
  core::Appearance result{.surface = to_glm(appearance.surface),
                          .background = to_glm(appearance.background),
                          .ambient = appearance.ambient,
                          .diffuse = appearance.diffuse,
                          .specular = appearance.specular,
                          .above = appearance.above,
                          .transparent = appearance.transparent};
  if (appearance.background_top) result.background_top = to_glm(*appearance.background_top);
  if (appearance.light_direction) result.towards_light = to_glm(*appearance.light_direction);
  core::check_light(result.towards_light);
  if (appearance.color_by_label && !appearance.color_by_field)
    throw core::Error("colours by label are those of a field: set color_by_field, too");
  if (appearance.color_map.empty() && appearance.color_table.empty()) {
    if (appearance.color_by_field)
      throw core::Error("colours by a field need a colour map: give color_map or color_table");
    return result;
  }
  if (!appearance.color_map.empty() && !appearance.color_table.empty())
    throw core::Error("colours are those of color_map or of color_table: leave out either");
  const core::ColorTable colors = color_table_of(appearance.color_map, appearance.color_table);
  if (appearance.color_by_field) {
    result.color_by_field = {appearance.color_low, appearance.color_high, colors,
                             appearance.color_by_label};
    core::check_color_by_field(*result.color_by_field);
    return result;
  }
  core::ColorByAxis by{.axis = to_glm(appearance.color_axis), .colors = colors};
  core::check_color_by(by);
  const auto [low, high] = core::range_along(whole, by.axis);
  by.low = appearance.color_low.value_or(low);
  by.high = appearance.color_high.value_or(high);
  core::check_color_by(by);
  result.color_by = by;
  return result;
}

core::Appearance core_appearance(const FrameRequest &request, const core::VolumeInfo &whole) {
  if (!request.appearance.color_by_depth) return core_appearance(request.appearance, whole);
  if (request.max_image_error && request.series.size() > 1)
    throw core::Error(
        "colours by depth differ from view to view: draw one view within an error of the picture, "
        "or colour along an axis");
  Appearance along_view = request.appearance;
  for (std::size_t i = 0; i < 3; ++i)
    along_view.color_axis[i] = request.camera.at[i] - request.camera.eye[i];
  return core_appearance(along_view, whole);
}

core::Slices core_slices(const std::vector<Slice> &slices, const Appearance &appearance,
                         const std::array<float, 2> &value_range) {
  core::Slices result;
  if (slices.empty()) return result;
  for (const Slice &slice : slices)
    result.planes.push_back({{to_glm(slice.normal), slice.offset}, slice.opacity, slice.clipped});
  result.colors = color_table_of(appearance.slice_map, appearance.slice_table);
  result.low = appearance.slice_low.value_or(value_range[0]);
  result.high = appearance.slice_high.value_or(value_range[1]);
  if (!appearance.slice_low && !appearance.slice_high) {
    if (!std::isfinite(result.low))
      throw core::Error(
          "the volume does not state its range of values, which colours of slices have: give "
          "slice_low and slice_high");
    if (result.low == result.high) result.high = std::nextafter(value_range[1], 3.4e38f);
  }
  return result;
}

core::FrameRequest core_request(const FrameRequest &request, const core::CompressedVolume &volume) {
  core::FrameRequest result;
  result.camera = core_camera(request.camera);
  for (const Surface &surface : request.surfaces) {
    result.surfaces.push_back(core_style(surface));
    if (surface.labels.empty())
      result.surfaces.back().isovalue = core::drawn_isovalue(volume, surface.isovalue);
  }
  result.slices = core_slices(request.slices, request.appearance, volume.value_range);
  if (result.surfaces.empty() && !request.slices.empty())
    result.surfaces.push_back(
        {core::drawn_isovalue(volume, request.isovalue), to_glm(request.appearance.surface)});
  // Several surfaces have their own isovalues.
  result.isovalue = result.surfaces.empty() ? core::drawn_isovalue(volume, request.isovalue)
                                            : result.surfaces.front().isovalue;
  result.light = core_appearance(request, volume.info);
  result.size = core_size(request.size);
  result.clip = core_clip(request.clip, request.caps);
  result.voxel_pixels = request.voxel_pixels;
  result.voxel_error = request.voxel_error;
  result.bound = static_cast<core::FieldBound>(request.bound);
  const bool shows_normals =
      request.want_picture || request.want_normals || request.want_hits || request.on_pass;
  result.normals =
      shows_normals ? static_cast<core::Normals>(request.normals) : core::Normals::kCell;
  const bool has_colors = request.want_picture || request.on_pass;
  result.field_values = request.want_field || (request.appearance.color_by_field && has_colors);
  result.field_on_caps = request.appearance.color_caps_alone;
  result.field_labels = request.appearance.color_by_label;
  if (has_colors) {
    result.ambient_rays = request.ambient_rays;
    result.shadow_rays = request.appearance.shadow_rays;
    result.bounce_rays = request.appearance.bounce_rays;
  }
  result.light_angle = request.appearance.light_angle;
  result.max_surface_error = request.max_surface_error;
  result.by = static_cast<core::Evidence>(request.by);
  result.max_image_error = request.max_image_error;
  std::ranges::transform(request.series, std::back_inserter(result.series), core_camera);
  result.time_budget_ms = request.time_budget_ms;
  return result;
}

void check_wanted(const FrameRequest &request, const core::Abilities &abilities) {
  if ((request.want_positions || request.want_hits) && !abilities.cells)
    throw core::Error("a team's hits have no cells: leave out want_positions and want_hits");
  if (request.want_field && !request.surfaces.empty())
    throw core::Error(
        "values of a field are those of one opaque surface: leave out surfaces, or want_field");
  if (!request.want_bounds) return;
  if (request.time_budget_ms)
    throw core::Error("a picture within a time has no bounds of its error: leave out want_bounds");
  if (request.bound != FieldBound::kNone)
    throw core::Error("the surface of a bound has no error: draw the volume itself");
  if (!request.clip.empty())
    throw core::Error("errors are bounded of whole surfaces: leave out clip, or want_bounds");
  if (!labels_of(request.surfaces).empty())
    throw core::Error("labels are drawn without an error: leave out want_bounds");
  if (!abilities.bounds) {
    throw core::Error(
        "this renderer knows no bounds of the error: leave out want_bounds, or draw on the host, "
        "or on a device by a renderer that was made with_bounds");
  }
}

bool can_draw(const FrameRequest &request, const core::Abilities &abilities,
              const core::CompressedVolume &volume) {
  try {
    check_wanted(request, abilities);
    core::check(core_request(request, volume), abilities);
    return true;
  } catch (const core::Error &) {
    return false;
  }
}

std::string text_of(const FrameRequest &request) {
  std::string text;
  const auto add = [&]<class Value>(const Value &value) {
    if constexpr (std::is_enum_v<Value>) {
      text += fmt::format("{} ", static_cast<int>(value));
    } else {
      text += fmt::format("{} ", value);
    }
  };
  const auto visit = [&]<class Field>(const char *, const Field &field) {
    if constexpr (requires { field->begin(); }) {
      add(field.has_value());
      for (const auto value : field.value_or(typename Field::value_type{})) add(value);
    } else if constexpr (requires { field.has_value(); }) {
      add(field.has_value());
      add(field.value_or(0));
    } else if constexpr (requires { field.begin(); }) {
      for (const auto &value : field) add(value);
    } else {
      add(field);
    }
  };
  for_each_field(request, [&]<class Field>(const char *name, const Field &field) {
    if constexpr (std::is_same_v<Field, std::vector<Camera>>) {
      add(field.size());
      for (const Camera &camera : field) for_each_camera_field(camera, visit);
    } else if constexpr (std::is_same_v<Field, std::vector<std::array<float, 3>>>) {
      add(field.size());
      for (const auto &color : field) visit(name, color);
    } else if constexpr (std::is_same_v<Field, std::vector<ClipPlane>>) {
      add(field.size());
      for (const ClipPlane &plane : field) for_each_plane_field(plane, visit);
    } else if constexpr (std::is_same_v<Field, std::vector<Surface>>) {
      add(field.size());
      for (const Surface &surface : field) for_each_surface_field(surface, visit);
    } else if constexpr (std::is_same_v<Field, std::vector<Slice>>) {
      add(field.size());
      for (const Slice &slice : field) for_each_slice_field(slice, visit);
    } else {
      visit(name, field);
    }
  });
  add(bool(request.on_pass));
  return text;
}

bool ProgressInTurns::show(const core::PassStats &pass,
                           const std::function<bool(const Progress &)> &on_pass) {
  // Other threads see both only while it is open.
  passes_ = pass.begins_anew ? 1 : passes_ + 1;
  completed_percent_ = pass.completed_percent;
  set_open(true);
  bool goes_on = false;
  try {
    goes_on = on_pass(*this);
  } catch (...) {
    set_open(false);
    throw;
  }
  set_open(false);
  return goes_on;
}

void ProgressInTurns::set_open(bool is_open) {
  const std::lock_guard lock(mutex_);
  is_open_ = is_open;
}

std::unique_lock<std::mutex> ProgressInTurns::turn() const {
  std::unique_lock lock(mutex_);
  if (!is_open_) throw core::Error("this pass is over: look at it within on_pass");
  return lock;
}

std::uint32_t ProgressInTurns::passes() const {
  const auto lock = turn();
  return passes_;
}

double ProgressInTurns::completed_percent() const {
  const auto lock = turn();
  return completed_percent_;
}

ImageSize ProgressInTurns::size() const {
  const auto lock = turn();
  return current_size();
}

Array<std::uint8_t> ProgressInTurns::picture() const {
  const auto lock = turn();
  return draw_picture();
}

DetailChoice public_choice(const core::DetailChoice &choice) {
  DetailChoice result{choice.detail.voxel_pixels, choice.detail.voxel_error, choice.reachable,
                      choice.advice};
  if (choice.sample) {
    result.sample = {choice.sample->num_rays, choice.sample->num_hits, choice.sample->num_within,
                     choice.sample->lowest};
  }
  if (const auto &image = choice.image)
    result.image = {image->samples, image->num_tiles, image->mean, image->highest};
  return result;
}

void describe_frame(const FrameRequest &request, const core::FrameStats &stats, Frame &frame) {
  frame.size = request.size;
  if (stats.detail && stats.detail->image) frame.size.samples = stats.detail->image->samples;
  const core::ImageSize size = core_size(frame.size);
  frame.rows = size.ray_rows();
  frame.columns = size.ray_columns();
  frame.camera = request.camera;
  frame.statistics = public_statistics(stats, size.num_rays());
}

std::vector<core::WorldRay> world_rays(std::span<const Ray> rays) {
  std::vector<core::WorldRay> result(rays.size());
  std::ranges::transform(rays, result.begin(), [](const Ray &ray) {
    return core::WorldRay{to_glm(ray.origin), to_glm(ray.direction)};
  });
  return result;
}

void move_arrays(core::FrameArrays &&arrays, Frame &frame) {
  frame.picture = public_array(std::move(arrays.picture));
  frame.depth = public_array(std::move(arrays.depth));
  frame.normals = public_array(std::move(arrays.normals));
  frame.field = public_array(std::move(arrays.field_values));
  frame.positions = public_array(std::move(arrays.positions));
}

Array<Hit> public_hits(std::span<const core::HitRecord> records,
                       const core::CompressedVolume &volume, bool with_levels,
                       core::HostMemory &memory) {
  const core::HitMap map = core::make_hit_map(core::level_infos(volume, with_levels));
  core::HostArray<Hit> hits = memory.array<Hit>(records.size());
  core::fill_from_hits(hits, records, [&](const core::HitRecord &record) {
    Hit hit{.t = record.t};
    if (std::isinf(record.t)) return hit;
    const core::HitCell cell = core::hit_cell(&map, record.block_id, record.cell);
    hit.level = cell.level;
    hit.cell = {cell.x, cell.y, cell.z};
    hit.position = {record.x, record.y, record.z};
    hit.gradient = {record.grad_x, record.grad_y, record.grad_z};
    hit.surface = core::surface_of(record);
    hit.cap = (record.cell & ISO_CAP) != 0;
    return hit;
  });
  return public_array(std::move(hits));
}

Frame frame_of_rays(const std::vector<core::HitRecord> &hits, const core::CompressedVolume &volume,
                    bool with_levels) {
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (std::isinf(hits[i].t) && hits[i].block_id != ISO_INVALID_ID) {
      throw core::Error(
          "ray {} hits the surface more than 3.4e38 lengths of its direction away, which float32 "
          "does not hold: give a longer direction",
          i);
    }
  }
  Frame frame;
  frame.rows = 1;
  frame.columns = static_cast<std::uint32_t>(hits.size());
  core::HostMemory memory;
  core::FrameArrays arrays;
  const core::HitMap map = core::make_hit_map(core::level_infos(volume, with_levels));
  core::add_hit_arrays({.depth = true, .normals = true, .positions = true}, hits,
                       core::make_shade_params(volume.info, {}), &map, memory, arrays);
  move_arrays(std::move(arrays), frame);
  frame.hits = public_hits(hits, volume, with_levels, memory);
  return frame;
}

}  // namespace isowave
