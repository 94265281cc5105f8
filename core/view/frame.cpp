#include "core/view/frame.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/base/error.hpp"
#include "core/view/trigonometry.hpp"
#include "kernels_cl/portable/block_grid.h"
#include "kernels_cl/portable/grid_dda.h"
#include "kernels_cl/portable/ray_state.h"

namespace isowave::core {

namespace {

/// Denormals and near-denormals of an eye next to a voxel plane would make devices disagree; they
/// are 0.
float flush_tiny(double x) {
  return std::abs(x) < 0x1p-60 ? 0.0f : static_cast<float>(x);
}

double largest_component(const glm::dvec3 &v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// Lengths of a voxel's edges [world units].
std::array<double, 3> edges(const VolumeInfo &info) {
  const glm::dmat3 to_world = info.index_to_world();
  return {glm::length(to_world[0]), glm::length(to_world[1]), glm::length(to_world[2])};
}

std::string spacing_text(const VolumeInfo &info) {
  return fmt::format("{} {} {}", info.spacing.x, info.spacing.y, info.spacing.z);
}

/// Throws Error where float64 tells places beside `place`, a vector of the world, apart only by
/// more than 2^-10 voxels.
void check_places(const VolumeInfo &info, const glm::dvec3 &place, std::string_view what) {
  const double farthest = largest_component(place);
  const double shortest = std::ranges::min(edges(info));
  if (farthest * 0x1p-52 <= shortest * 0x1p-10) return;
  throw Error(
      "{}: {:.3g} world units from the world's origin, float64 cannot tell voxels apart that are "
      "{:.3g} wide",
      what, farthest, shortest);
}

}  // namespace

BlockGrid make_grid(const VolumeInfo &info) {
  const glm::uvec3 dims = info.dims, blocks = (dims + 3u) / 4u;
  return {dims.x, dims.y, dims.z, blocks.x, blocks.y, blocks.z};
}

FrameParams make_grid_params(const VolumeInfo &info) {
  FrameParams frame{};
  frame.grid = make_grid(info);
  frame.place.blocks_x = frame.grid.blocks_x;
  frame.place.blocks_y = frame.grid.blocks_y;
  const glm::vec3 origin(info.brick.first_voxel);
  const glm::uvec3 &before = info.brick.before, &behind = info.brick.behind;
  frame.brick = {origin.x, origin.y, origin.z, before.x, before.y,
                 before.z, behind.x, behind.y, behind.z};
  frame.band = {.begin_t = 0, .end_t = std::numeric_limits<float>::infinity()};
  return frame;
}

void check_image_size(ImageSize size) {
  constexpr std::uint64_t kMaxRays = ISO_MAX_RAYS;
  if (size.samples < 1 || size.samples > ImageSize::kMaxSamples) {
    throw Error("{} x {} rays a pixel cannot be drawn: 1 to {} along each axis can", size.samples,
                size.samples, ImageSize::kMaxSamples);
  }
  if (size.stride % 2 == 0 || size.stride > ImageSize::kMaxStride) {
    throw Error(
        "a sample of one in {} rays along each axis cannot be drawn: odd numbers up to {} can",
        size.stride, ImageSize::kMaxStride);
  }
  const std::uint64_t most = kMaxRays / (size.samples * size.samples);
  if (size.num_pixels() == 0 || size.num_pixels() > most) {
    throw Error("an image of {} x {} pixels cannot be drawn: 1 to {} pixels can", size.width,
                size.height, most);
  }
}

void check_drawable(const VolumeInfo &info, std::string_view what) {
  const glm::u64vec3 blocks((info.dims + 3u) / 4u);
  if (const std::uint64_t count = blocks.x * blocks.y * blocks.z; count >= ISO_MAX_BLOCK_IDS)
    throw Error("{}: a volume of {} blocks cannot be drawn: block ids end at {}", what, count,
                ISO_MAX_BLOCK_IDS);
  check_distances(info, what);
}

void check_distances(const VolumeInfo &info, std::string_view what) {
  // t in world units is a float32, and so is the power of two by which the kernels' t is multiplied
  // to become it (below). An eye is at most 1e7 voxels off and dims are at most 2^16, so t is at
  // most 2^25 voxels' longest edges; and nothing that matters is nearer than 2^-24 of the shortest.
  // Within 2^+-100, neither reaches float32's ends, nor do a level of detail's voxels.
  const std::array<double, 3> voxel = edges(info);
  const double shortest = std::ranges::min(voxel), longest = std::ranges::max(voxel);
  if (!(shortest >= 0x1p-100 && longest <= 0x1p100)) {
    throw Error("{}: spacing {}: distances in float32 allow 2^-100 (8e-31) to 2^100 (1e30)", what,
                spacing_text(info));
  }
  // Rays along the longest edge move that much slower in index space than along the shortest, and
  // directions below 2^-60 are 0.
  if (longest > 0x1p36 * shortest) {
    throw Error("{}: spacing {}: directions in float32 allow one to be 2^36 (7e10) times another",
                what, spacing_text(info));
  }
  check_places(info, info.origin, what);
}

namespace {

/// Rows of the picture's rays, whether all of them are drawn or a sample.
double rows_of(ImageSize size) {
  return double(size.height) * size.samples;
}

/// Parallel rays start in a plane around the eye, where float32 must hold their places.
void check_parallel(double height, ImageSize size, double t_scale, const glm::dvec3 &right,
                    const glm::dvec3 &up) {
  const double v = height / 2 / t_scale, u = v * size.width / size.height;
  const double farthest = u * largest_component(right) + v * largest_component(up);
  const double step = height / rows_of(size) / t_scale;
  if (farthest > 1e7 || step < 0x1p-100) {
    throw Error(
        "a picture of parallel projection that is {:.3g} high cannot be drawn in float32: up to "
        "1e7 voxels from the eye can",
        height);
  }
}

}  // namespace

View make_view(const VolumeInfo &info, const Camera &camera, ImageSize size) {
  check_volume_info(info, "the volume");
  check_camera(camera, "the camera");
  check_image_size(size);
  check_distances(info, "the volume");

  const glm::dmat3 world_to_index = glm::inverse(info.index_to_world());
  const glm::dvec3 eye = world_to_index * (camera.eye - info.origin);
  const CameraAxes axes = axes_of(camera);
  glm::dvec3 fwd = world_to_index * axes.forward;
  glm::dvec3 right = world_to_index * axes.right;
  glm::dvec3 up = world_to_index * axes.up;
  if (!std::isfinite(largest_component(eye)) || largest_component(eye) > 1e7) {
    throw Error(
        "the camera's eye is {:.3g} voxels from the volume's origin: up to 1e7 can be drawn in "
        "float32",
        largest_component(eye));
  }
  check_places(info, camera.eye, "the camera's eye");

  // A power of two takes the voxel size out of t, so that neither tiny nor huge spacings reach
  // float32's ends.
  const double largest =
      std::max({largest_component(fwd), largest_component(right), largest_component(up)});
  const double t_scale = std::exp2(-std::floor(std::log2(largest)));
  fwd *= t_scale;
  right *= t_scale;
  up *= t_scale;
  if (camera.parallel_height) check_parallel(*camera.parallel_height, size, t_scale, right, up);

  return {.width = size.ray_columns(),
          .height = size.ray_rows(),
          .eye_x = flush_tiny(eye.x),
          .eye_y = flush_tiny(eye.y),
          .eye_z = flush_tiny(eye.z),
          .fwd_x = flush_tiny(fwd.x),
          .fwd_y = flush_tiny(fwd.y),
          .fwd_z = flush_tiny(fwd.z),
          .right_x = flush_tiny(right.x),
          .right_y = flush_tiny(right.y),
          .right_z = flush_tiny(right.z),
          .up_x = flush_tiny(up.x),
          .up_y = flush_tiny(up.y),
          .up_z = flush_tiny(up.z),
          .pixel_scale =
              camera.parallel_height
                  ? static_cast<float>(*camera.parallel_height / 2 / rows_of(size) / t_scale)
                  : static_cast<float>(tangent(glm::radians(camera.fovy_deg) / 2) / rows_of(size)),
          .t_scale = static_cast<float>(t_scale),
          .is_parallel = camera.parallel_height ? 1u : 0u,
          .stride = size.stride};
}

bool is_in_picture(const View &view, ImageSize size, std::uint32_t ray) {
  const RayPlace place =
      place_of_ray(&view, static_cast<int>(ray % view.width), static_cast<int>(ray / view.width));
  return std::abs(twice_u(&view, place.column)) < static_cast<int>(size.width * size.samples) &&
         std::abs(twice_v(&view, place.row)) < static_cast<int>(size.height * size.samples);
}

FrameParams make_frame_params(const VolumeInfo &info, const Camera &camera, ImageSize size,
                              float isovalue) {
  const View view = make_view(info, camera, size);
  if (std::isnan(isovalue))
    throw Error("the isovalue is NaN: give a number in the volume's value range");
  FrameParams frame = make_grid_params(info);
  frame.view = view;
  frame.surface.isovalue = isovalue;
  frame.surface.active_end_x = static_cast<int>(num_owning_blocks(info.dims.x));
  frame.surface.active_end_y = static_cast<int>(num_owning_blocks(info.dims.y));
  frame.surface.active_end_z = static_cast<int>(num_owning_blocks(info.dims.z));
  frame.screen = make_screen_box(frame);
  frame.schedule.max_spec_count = 1;
  return frame;
}

ScreenBox make_screen_box(const FrameParams &frame) {
  const BlockGrid &grid = frame.grid;
  const View &view = frame.view;
  const Surface &surface = frame.surface;
  if (surface.active_end_x == 0) return {};
  const glm::dvec2 num_rays(view.width, view.height), size = double(view.stride) * num_rays;
  const glm::dmat3 basis(glm::dvec3(view.fwd_x, view.fwd_y, view.fwd_z),
                         glm::dvec3(view.right_x, view.right_y, view.right_z),
                         glm::dvec3(view.up_x, view.up_y, view.up_z));
  const glm::dmat3 to_view = glm::inverse(basis);
  const glm::dvec3 eye(view.eye_x, view.eye_y, view.eye_z);
  const double pixel = 2.0 * view.pixel_scale;   // step of u and v
  const glm::dvec2 border = 0.5 * pixel * size;  // largest |u|, |v|

  // The direction of a ray is fwd + u right + v up, rounded a few times, or flushed. In units of
  // that basis: by how much?
  const glm::dmat3 sizes(glm::abs(basis[0]), glm::abs(basis[1]), glm::abs(basis[2]));
  const glm::dmat3 to_sizes(glm::abs(to_view[0]), glm::abs(to_view[1]), glm::abs(to_view[2]));
  const bool is_parallel = view.is_parallel != 0;
  const double length = is_parallel ? 1.0 : glm::length(glm::dvec3(1, border.x, border.y));
  const glm::dvec3 largest(1, is_parallel ? 0.0 : border.x, is_parallel ? 0.0 : border.y);
  const glm::dvec3 off =
      to_sizes * (0x1p-21 * (sizes * largest) + double{ISO_SMALLEST_DIRECTION} * length);
  // Parallel rays start at eye + u right + v up, rounded, too.
  const glm::dvec3 off_start =
      to_sizes * (0x1p-21 * (glm::abs(eye) + sizes * glm::dvec3(0, border.x, border.y)));
  const auto margin_at = [&](double t) {
    if (!is_parallel) return 1.0 + (glm::dvec2(off.y, off.z) + border * off.x) / pixel;
    return 1.0 +
           (glm::dvec2(off.y, off.z) * std::abs(t) + glm::dvec2(off_start.y, off_start.z)) / pixel;
  };

  glm::dvec2 begin(std::numeric_limits<double>::infinity()), end = -begin;
  for (int corner = 0; corner < 8; ++corner) {
    const auto plane = [corner](int axis, int first, int behind, uint dim) {
      return (corner >> axis & 1) == 0 ? 4.0 * first : std::min(4.0 * behind, dim - 1.0);
    };
    const glm::dvec3 within(plane(0, surface.active_begin_x, surface.active_end_x, grid.dims_x),
                            plane(1, surface.active_begin_y, surface.active_end_y, grid.dims_y),
                            plane(2, surface.active_begin_z, surface.active_end_z, grid.dims_z));
    const glm::dvec3 at =
        within + glm::dvec3(frame.brick.origin_x, frame.brick.origin_y, frame.brick.origin_z);
    const glm::dvec3 in_view = to_view * (at - eye);
    const glm::dvec2 margin = margin_at(in_view.x);
    if (!((is_parallel || in_view.x > 1e-3) && margin.x < size.x &&
          margin.y < size.y)) {  // beside or behind the eye, or all rounded
      begin = glm::dvec2(0);
      end = size;
      break;
    }
    // See twice_u(), twice_v(): of places in squares of stride x stride, each of which has a ray.
    const glm::dvec2 projected = 0.5 * (size - 1.0) + glm::dvec2(in_view.y, -in_view.z) /
                                                          ((is_parallel ? 1 : in_view.x) * pixel);
    begin = glm::min(begin, projected - margin);
    end = glm::max(end, projected + margin + 1.0);
  }
  begin = glm::clamp(glm::floor(begin / double(view.stride)), glm::dvec2(0), num_rays);
  end = glm::clamp(glm::ceil(end / double(view.stride)), glm::dvec2(0), num_rays);
  if (begin.x >= end.x || begin.y >= end.y) return {};
  return {.begin_x = static_cast<uint>(begin.x) / 8 * 8,
          .begin_y = static_cast<uint>(begin.y) / 4 * 4,
          .end_x = static_cast<uint>(end.x),
          .end_y = static_cast<uint>(end.y)};
}

std::vector<float> depth_of(const std::vector<HitRecord> &hits) {
  std::vector<float> depth(hits.size());
  std::transform(hits.begin(), hits.end(), depth.begin(),
                 [](const HitRecord &hit) { return hit.t; });
  return depth;
}

}  // namespace isowave::core
