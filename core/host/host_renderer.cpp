#include "core/host/host_renderer.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>

#include "core/base/error.hpp"
#include "core/base/host_memory.hpp"
#include "core/base/parallel_for.hpp"
#include "core/render/surface_camera.hpp"
#include "core/stages/shade.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/cell_intersect.h"

namespace isowave::core {

namespace {

/// Rays along a tile's edge, about: neighbours walk through the same blocks.
constexpr std::uint32_t kTileRays = 16;
/// Of a band, for each thread, so that none waits long for the last.
constexpr std::uint32_t kTilesPerThread = 8;
/// Rays of any origin that a thread takes at a time.
constexpr std::uint32_t kRunRays = 1024;

std::uint64_t mebibytes(std::uint64_t bytes) {
  return (bytes + (1u << 20) - 1) >> 20;
}

const CompressedVolume &checked(const CompressedVolume &volume,
                                const HostRendererOptions &options) {
  const std::uint64_t needed = HostBlocks::bytes(volume.info),
                      limit = options.memory_limit != 0 ? options.memory_limit : host_memory() / 4;
  if (needed <= limit) return volume;
  throw Error(
      "drawing on the host takes {} MiB of memory for the decoded volume, and {} MiB are allowed: "
      "raise the limit, or draw on a device",
      mebibytes(needed), limit >> 20);
}

template <class Count>
Count rounded_up(Count count, std::uint32_t unit) {
  return (count + unit - 1) / unit;
}

/// number: of the ray, for messages.
IndexRay index_ray(const glm::dvec3 &origin, const glm::dvec3 &direction, std::size_t number) {
  const auto largest = [](const glm::dvec3 &v) {
    return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  };
  const double length = largest(direction), away = largest(origin);
  if (!std::isfinite(length + direction.x + direction.y + direction.z) || length == 0)
    throw Error("ray {} has no direction: give three finite numbers that are not all 0", number);
  if (!std::isfinite(away + origin.x + origin.y + origin.z) || away > 1e7) {
    throw Error("ray {} begins {:.3g} voxels from the volume's origin: up to 1e7 can be traced",
                number, away);
  }
  int exponent = 0;
  std::frexp(length, &exponent);
  const glm::vec3 o(origin), d(direction * std::exp2(-exponent));
  return {{o.x, o.y, o.z}, {d.x, d.y, d.z}, static_cast<float>(std::exp2(-exponent))};
}

}  // namespace

HostRenderer::HostRenderer(const CompressedVolume &volume, const HostRendererOptions &options)
    : info_(volume.info),
      num_threads_(options.num_threads),
      blocks_(checked(volume, options), options.num_threads) {}

void HostRenderer::check(const FrameRequest &request) {
  if (request.voxel_pixels != 0)
    throw Error("levels of detail are drawn on devices alone: leave out voxel_pixels");
  if (request.voxel_error != 0)
    throw Error("voxels of fewer bit planes are drawn on devices alone: leave out voxel_error");
  if (request.bound != FieldBound::kNone)
    throw Error("bounds of the field are drawn on devices alone: leave out bound");
}

FrameStats HostRenderer::render(const FrameRequest &request) {
  const auto begin = std::chrono::steady_clock::now();
  check(request);
  const ImageSize size = request.size.value_or(ImageSize{});
  FrameParams frame = make_frame_params(info_, request.camera, size, request.isovalue);
  blocks_.select(request.isovalue);
  frame.surface = blocks_.surface();
  frame.screen = make_screen_box(frame.grid, frame.view, frame.surface);
  frame_ = frame;
  samples_ = size.samples;
  normals_ = request.normals;
  hits_.assign(size.num_rays(), no_hit());

  // Bands have whole rows of pixels; without a callback, one has all.
  const std::uint32_t rows = size.ray_rows(), tiles = rounded_up(size.ray_columns(), kTileRays),
                      tile_rows = std::max(kTileRays / size.samples, 1u) * size.samples;
  const std::uint32_t band =
      request.on_pass ? tile_rows * rounded_up(kTilesPerThread * thread_count(num_threads_), tiles)
                      : rows;
  FrameStats stats;
  for (std::uint32_t row = 0; row < rows && !stats.cancelled; row += band) {
    const std::uint32_t end = std::min(rows - row, band) + row;
    PassStats pass;
    pass.counts.hit_count = static_cast<uint>(draw_band(row, end, tile_rows));
    pass.completed_percent = 100.0 * end / rows;
    stats.rays_hit += pass.counts.hit_count;
    stats.passes.push_back(pass);
    stats.cancelled = request.on_pass && !request.on_pass(pass) && end < rows;
  }
  stats.total_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  return stats;
}

/// Returns how many of the band's rays hit something.
std::uint64_t HostRenderer::draw_band(std::uint32_t begin_row, std::uint32_t end_row,
                                      std::uint32_t tile_rows) {
  const ScreenBox &screen = frame_.screen;
  const std::uint32_t begin_y = std::max(begin_row, screen.begin_y),
                      end_y = std::min(end_row, screen.end_y);
  if (begin_y >= end_y || screen.begin_x >= screen.end_x) return 0;
  const std::uint32_t tiles = rounded_up(screen.end_x - screen.begin_x, kTileRays);
  const HostField field = blocks_.field();
  const HostLoops &loops = host_loops();
  std::atomic<std::uint64_t> num_hits = 0;
  parallel_for(
      std::uint64_t{tiles} * rounded_up(end_y - begin_y, tile_rows), num_threads_,
      [&](std::uint64_t tile, std::uint32_t) {
        const auto x = static_cast<std::uint32_t>(screen.begin_x + tile % tiles * kTileRays),
                   y = static_cast<std::uint32_t>(begin_y + tile / tiles * tile_rows);
        num_hits += loops.trace(
            frame_, field,
            {x, y, std::min(x + kTileRays, screen.end_x), std::min(y + tile_rows, end_y)},
            normals_ == Normals::kSmooth, hits_.data());
      });
  return num_hits;
}

std::vector<HitRecord> HostRenderer::cast_rays(std::span<const WorldRay> rays, float isovalue,
                                               Normals normals) {
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  const glm::dmat3 world_to_index = glm::inverse(info_.index_to_world());
  std::vector<IndexRay> index_rays(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const glm::dvec3 origin = world_to_index * (rays[i].origin - info_.origin);
    index_rays[i] = index_ray(origin, world_to_index * rays[i].direction, i);
  }
  FrameParams frame = make_grid_params(info_);
  frame.view.t_scale = 1;
  frame.surface.isovalue = isovalue;
  blocks_.select(isovalue);
  frame.surface = blocks_.surface();
  std::vector<HitRecord> hits(rays.size(), no_hit());
  const HostField field = blocks_.field();
  parallel_for(
      rounded_up(rays.size(), kRunRays), num_threads_, [&](std::uint64_t run, std::uint32_t) {
        const std::size_t begin = run * kRunRays;
        host_loops().cast(frame, field, index_rays.data() + begin,
                          static_cast<uint>(std::min<std::size_t>(kRunRays, rays.size() - begin)),
                          normals == Normals::kSmooth, hits.data() + begin);
      });
  return hits;
}

Camera HostRenderer::camera(float isovalue, ImageSize size) const {
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  check_image_size(size);
  return surface_camera(info_, blocks_.rounded_box(isovalue), size);
}

Image8 HostRenderer::shade(const Appearance &appearance) const {
  if (hits_.empty()) throw Error("there is no picture: no frame has been drawn");
  const ShadeParams params = make_shade_params(info_, appearance);
  Image8 image{frame_.view.width / samples_, frame_.view.height / samples_, 3, {}};
  image.pixels.resize(std::size_t{3} * image.width * image.height);
  parallel_for(image.height, num_threads_, [&](std::uint64_t row, std::uint32_t) {
    host_loops().shade(frame_, params, samples_, static_cast<uint>(row), hits_.data(),
                       image.pixels.data() + 3 * image.width * row);
  });
  return image;
}

std::uint64_t HostRenderer::memory_bytes() const {
  return HostBlocks::bytes(info_);
}

}  // namespace isowave::core
