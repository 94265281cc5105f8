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
#include "core/view/detail.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave {

namespace {

FrameStatistics public_statistics(const core::FrameStats &stats, std::uint64_t num_rays) {
  FrameStatistics result;
  result.passes =
      static_cast<std::uint32_t>(stats.passes.size()) + stats.normals.passes + stats.ambient.passes;
  result.rays = num_rays;
  result.hits = stats.rays_hit;
  for (const core::PassStats &pass : stats.passes) {
    result.decoded_blocks += pass.counts.decoded_count;
    for (const auto &[stage, ms] : pass.stage_ms) result.stage_ms[stage] += ms;
  }
  result.normals_passes = stats.normals.passes;
  result.normals_decoded_blocks = stats.normals.decoded_blocks;
  result.normals_ms = stats.normals.ms;
  result.ambient_passes = stats.ambient.passes;
  result.ambient_ms = stats.ambient.ms;
  result.decoded_blocks += stats.normals.decoded_blocks + stats.ambient.decoded_blocks;
  for (const core::LaterPasses *later : {&stats.normals, &stats.ambient}) {
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

core::Camera core_camera(const Camera &camera) {
  return {to_glm(camera.eye), to_glm(camera.at), to_glm(camera.up), camera.fovy_degrees,
          camera.parallel_height};
}

}  // namespace

core::ImageSize core_size(const ImageSize &size) {
  return {size.width, size.height, size.samples};
}

Camera public_camera(const core::Camera &camera) {
  return {from_glm(camera.eye), from_glm(camera.at), from_glm(camera.up), camera.fovy_deg,
          camera.parallel_height};
}

core::Appearance core_appearance(const Appearance &appearance) {
  return {to_glm(appearance.surface), to_glm(appearance.background), appearance.ambient,
          appearance.diffuse,         appearance.specular,           appearance.above,
          appearance.transparent};
}

core::FrameRequest core_request(const FrameRequest &request, const core::CompressedVolume &volume) {
  core::FrameRequest result;
  result.camera = core_camera(request.camera);
  result.isovalue = core::drawn_isovalue(volume, request.isovalue);
  result.size = core_size(request.size);
  for (const ClipPlane &plane : request.clip)
    result.clip.planes.push_back({to_glm(plane.normal), plane.offset});
  result.clip.caps = request.caps;
  result.voxel_pixels = request.voxel_pixels;
  result.voxel_error = request.voxel_error;
  result.bound = static_cast<core::FieldBound>(request.bound);
  const bool shows_normals =
      request.want_picture || request.want_normals || request.want_hits || request.on_pass;
  result.normals =
      shows_normals ? static_cast<core::Normals>(request.normals) : core::Normals::kCell;
  if (request.want_picture || request.on_pass) result.ambient_rays = request.ambient_rays;
  result.max_surface_error = request.max_surface_error;
  result.by = static_cast<core::Evidence>(request.by);
  std::ranges::transform(request.series, std::back_inserter(result.series), core_camera);
  result.time_budget_ms = request.time_budget_ms;
  return result;
}

void check_wanted(const FrameRequest &request, const core::Abilities &abilities) {
  if ((request.want_positions || request.want_hits) && !abilities.cells)
    throw core::Error("a team's hits have no cells: leave out want_positions and want_hits");
  if (!request.want_bounds) return;
  if (request.time_budget_ms)
    throw core::Error("a picture within a time has no bounds of its error: leave out want_bounds");
  if (request.bound != FieldBound::kNone)
    throw core::Error("the surface of a bound has no error: draw the volume itself");
  if (!request.clip.empty())
    throw core::Error("errors are bounded of whole surfaces: leave out clip, or want_bounds");
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
    if constexpr (requires { field.has_value(); }) {
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
    } else if constexpr (std::is_same_v<Field, std::vector<ClipPlane>>) {
      add(field.size());
      for (const ClipPlane &plane : field) for_each_plane_field(plane, visit);
    } else {
      visit(name, field);
    }
  });
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
  return result;
}

void describe_frame(const FrameRequest &request, const core::FrameStats &stats, Frame &frame) {
  frame.size = request.size;
  const core::ImageSize size = core_size(request.size);
  frame.rows = size.ray_rows();
  frame.columns = size.ray_columns();
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
  frame.positions = public_array(std::move(arrays.positions));
}

Array<Hit> public_hits(std::span<const core::HitRecord> records,
                       const core::CompressedVolume &volume, bool with_levels) {
  const core::HitMap map = core::make_hit_map(core::level_infos(volume, with_levels));
  core::HostMemory memory;
  core::HostArray<Hit> hits = memory.array<Hit>(records.size());
  core::fill_from_hits(hits, records, [&](const core::HitRecord &record) {
    Hit hit{.t = record.t};
    if (std::isinf(record.t)) return hit;
    const core::HitCell cell = core::hit_cell(&map, record.block_id, record.cell);
    hit.level = cell.level;
    hit.cell = {cell.x, cell.y, cell.z};
    hit.position = {record.x, record.y, record.z};
    hit.gradient = {record.grad_x, record.grad_y, record.grad_z};
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
  frame.hits = public_hits(hits, volume, with_levels);
  return frame;
}

}  // namespace isowave
