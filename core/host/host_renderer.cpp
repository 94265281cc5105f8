#include "core/host/host_renderer.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/frame/surface_camera.hpp"
#include "core/platform/memory.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/cell_intersect.h"
#include "kernels_cl/portable/kept_pixel.h"

namespace isowave::core {

namespace {

/// Rays along a tile's edge, about: neighbours walk through the same blocks.
constexpr std::uint32_t kTileRays = 16;
/// Tiles of a band for each thread: enough that no thread waits long for the last.
constexpr std::uint32_t kTilesPerThread = 8;
/// Rays of any origin that a thread takes at a time.
constexpr std::uint32_t kRunRays = 1024;

std::uint64_t mebibytes(std::uint64_t bytes) {
  return (bytes + (1u << 20) - 1) >> 20;
}

std::uint64_t limit_of(std::uint64_t memory_limit) {
  return memory_limit != 0 ? memory_limit : platform::host_memory() / 4;
}

/// The memory limit, if the volume can be drawn within it.
std::uint64_t checked_limit(const CompressedVolume &volume, const HostRendererOptions &options) {
  const std::uint64_t needed = HostLevels::least_bytes(volume),
                      limit = limit_of(options.memory_limit);
  if (needed <= limit) return limit;
  throw Error(
      "drawing on the host takes {} MiB of memory at least, for value ranges of all blocks, and {} "
      "MiB are allowed: raise the limit, or draw on a device",
      mebibytes(needed), limit >> 20);
}

/// The part of a tile in which rays may hit something.
RayTile within(const RayTile &tile, const ScreenBox &box) {
  return {std::max(tile.begin_x, box.begin_x), std::max(tile.begin_y, box.begin_y),
          std::min(tile.end_x, box.end_x), std::min(tile.end_y, box.end_y)};
}

template <class Count>
Count rounded_up(Count count, std::uint32_t unit) {
  return (count + unit - 1) / unit;
}

}  // namespace

HostRenderer::HostRenderer(const CompressedVolume &volume, const HostRendererOptions &options)
    : info_(volume.info),
      abilities_(abilities_of(volume)),
      num_threads_(options.num_threads),
      levels_(volume, checked_limit(volume, options), options.num_threads),
      setup_ms_(ms_since(begin_)) {
  check_image_size(options.largest);
  abilities_.largest = options.largest;
}

bool HostRenderer::fits(const CompressedVolume &volume, std::uint64_t memory_limit) {
  return HostLevels::least_bytes(volume) <= limit_of(memory_limit);
}

Abilities HostRenderer::abilities_of(const CompressedVolume &volume) {
  Abilities abilities;
  abilities.levels = !volume.coarser_levels.empty();
  abilities.clipping = abilities.fewer_planes = abilities.bounds = abilities.given_rays =
      abilities.kept_picture = true;
  return abilities;
}

FrameStats HostRenderer::render(const FrameRequest &request) {
  const auto begin = std::chrono::steady_clock::now();
  check(request, abilities());
  const ImageSize size = size_of(request, abilities());
  const std::vector<FrameParams> frames = make_level_frames(levels_.infos(), request.camera, size,
                                                            request.isovalue, request.voxel_pixels);
  std::vector<HostLevel> drawing = levels_.open(frames, request.voxel_error, request.bound);
  frame_ = frames.front();
  size_ = size;
  open_ = {};
  FrameStats stats;
  stats.first_level =
      static_cast<std::size_t>(std::ranges::find_if(frames, draws) - frames.begin());
  stats.last_level = stats.first_level + drawing.size() - 1;
  const ClipParams clip =
      make_clip_params(info_, frames.front().view, request.camera, request.clip);
  if (clip.num_planes != 0) {
    for (HostLevel &level : drawing) level.clip = &clip;
    // Caps lie outside the box of active blocks, too.
    drawing.front().frame.screen = frames[stats.first_level].screen;
  }
  try {
    draw_bands(request, drawing, stats);
    if (request.ambient_rays != 0 && !stats.cancelled) add_ambient(request, drawing, stats);
  } catch (...) {
    hits_.clear();
    throw;
  }
  stats.complete = !stats.cancelled;
  stats.total_ms = ms_since(begin);
  return stats;
}

/// Band by band, so that the picture so far can be shown; without on_pass, one has all. Each tile
/// first gets no hits, while it is in the processor's cache; what on_pass may see of others before
/// that, too.
void HostRenderer::draw_bands(const FrameRequest &request, std::span<const HostLevel> drawing,
                              FrameStats &stats) {
  const std::size_t num_rays = std::size_t{frame_.view.width} * frame_.view.height;
  if (request.on_pass) {
    hits_.assign(num_rays, no_hit());
  } else {
    hits_.resize(num_rays);
  }
  std::atomic<std::uint64_t> num_hits = 0;
  const HostLevel &first = drawing.front();
  const bool is_smooth = request.normals == Normals::kSmooth;
  stats.cancelled = !for_bands(
      request.on_pass, request.ambient_rays != 0,
      [&](const RayTile &tile, bool is_alone) {
        for (std::size_t y = tile.begin_y; y < tile.end_y; ++y) {
          const auto row = hits_.begin() + static_cast<std::ptrdiff_t>(y * frame_.view.width);
          std::fill(row + tile.begin_x, row + tile.end_x, no_hit());
        }
        const RayTile part = within(tile, first.frame.screen);
        const HostLoops &loops = host_loops();
        if (is_alone) {
          num_hits += loops.trace_rays_of_levels(drawing, part, is_smooth, hits_.data());
        } else if (drawing.size() == 1 && first.clip == nullptr) {
          num_hits += loops.trace(first.frame, first.field, part, is_smooth, hits_.data());
        } else {
          num_hits += loops.trace_levels(drawing, part, is_smooth, hits_.data());
        }
      },
      [&](std::uint32_t rows) {
        PassStats pass;
        pass.counts.hit_count = static_cast<uint>(num_hits.exchange(0));
        pass.counts.next_active_count = frame_.view.width * (frame_.view.height - rows);
        pass.completed_percent = 100.0 * rows / frame_.view.height;
        stats.rays_hit += pass.counts.hit_count;
        stats.passes.push_back(pass);
        return pass;
      });
}

/// All rays of each hit at once: bands that are not there yet show all of the sky. Each ray stays
/// in the level of detail of its hit.
void HostRenderer::add_ambient(const FrameRequest &request, std::span<const HostLevel> drawing,
                               FrameStats &stats) {
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<AmbientDirection> directions = make_ambient_directions(request.ambient_rays);
  const AmbientParams params = make_ambient_params(levels_.infos()[stats.first_level]);
  const FrameParams &seen = drawing.front().frame;
  open_.counts.assign(hits_.size(), static_cast<uchar>(request.ambient_rays));
  open_.num_ambient = request.ambient_rays;
  stats.cancelled = !for_bands(
      request.on_pass, false,
      [&](const RayTile &tile, bool) {
        for (uint level = 0; level < drawing.size(); ++level) {
          const float voxel = std::ldexp(1.0f, static_cast<int>(stats.first_level + level));
          const AmbientRays rays{params, directions.data(), request.ambient_rays, &seen, level,
                                 voxel};
          host_loops().ambient(drawing[level], within(tile, seen.screen), rays, hits_.data(),
                               open_.counts.data());
        }
      },
      [&](std::uint32_t) {
        PassStats pass;
        pass.completed_percent = 100;
        ++stats.ambient.passes;
        return pass;
      });
  stats.ambient.ms = ms_since(begin);
}

/// Calls draw(tile, is_alone), as HostBlocks::run() does, for the tiles of all of the frame's rays,
/// in bands of whole rows of pixels from the top; after each band, on_pass(after(rows that are
/// done)). Returns false if on_pass says to stop, and there is more to draw: bands,
/// or what follows.
template <class Draw, class After>
bool HostRenderer::for_bands(const OnPass &on_pass, bool more_follows, Draw draw, After after) {
  const std::uint32_t width = frame_.view.width, rows = frame_.view.height,
                      tile_rows = std::max(kTileRays / size_.samples, 1u) * size_.samples;
  const std::uint32_t columns = rounded_up(width, kTileRays);
  const std::uint32_t band =
      on_pass ? tile_rows * rounded_up(kTilesPerThread * thread_count(num_threads_), columns)
              : rows;
  for (std::uint32_t row = 0; row < rows; row += band) {
    const std::uint32_t end_row = std::min(rows - row, band) + row;
    levels_.room().run(
        std::uint64_t{columns} * rounded_up(end_row - row, tile_rows),
        [&](std::uint64_t tile, bool is_alone) {
          const auto x = static_cast<std::uint32_t>(tile % columns * kTileRays),
                     y = static_cast<std::uint32_t>(row + tile / columns * tile_rows);
          draw(RayTile{x, y, std::min(x + kTileRays, width), std::min(y + tile_rows, end_row)},
               is_alone);
        });
    const PassStats pass = after(end_row);
    if (on_pass && !on_pass(pass) && (end_row < rows || more_follows)) return false;
  }
  return true;
}

std::vector<HitRecord> HostRenderer::cast_rays(std::span<const WorldRay> rays, float isovalue,
                                               Normals normals) {
  if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
  const std::vector<IndexRay> index_rays = make_index_rays(info_, rays);
  FrameParams frame = make_grid_params(info_);
  frame.view.t_scale = 1;
  HostBlocks &blocks = levels_.open_finest(isovalue);
  frame.surface = blocks.surface();
  std::vector<HitRecord> hits(rays.size(), no_hit());
  const HostField field = blocks.field();
  blocks.run(rounded_up(rays.size(), kRunRays), [&](std::uint64_t run, bool) {
    const std::size_t begin = run * kRunRays;
    host_loops().cast(frame, field, index_rays.data() + begin,
                      static_cast<uint>(std::min<std::size_t>(kRunRays, rays.size() - begin)),
                      normals == Normals::kSmooth, hits.data() + begin);
  });
  return hits;
}

Camera HostRenderer::camera(std::span<const float> isovalues, std::optional<ImageSize> size) {
  const ImageSize of_picture = size.value_or(abilities().largest);
  check_image_size(of_picture);
  std::optional<BlockBox> box;
  for (const float isovalue : isovalues) {
    if (std::isnan(isovalue)) throw Error("the isovalue is NaN: give a number");
    const std::optional<BlockBox> blocks = levels_.finest().rounded_box(isovalue);
    if (!blocks) continue;
    if (!box) box = blocks;
    box->begin = glm::min(box->begin, blocks->begin);
    box->end = glm::max(box->end, blocks->end);
  }
  return surface_camera(info_, box, of_picture);
}

void HostRenderer::keep_picture() {
  check_has_picture();
  kept_ = hits_;
  kept_size_ = size_;
}

void HostRenderer::enlarge_kept(const FrameRequest &request) {
  core::check(request, abilities());
  const ImageSize size = size_of(request, abilities());
  frame_ = make_frame_params(info_, request.camera, size, request.isovalue);
  size_ = size;
  open_ = {};
  hits_.resize(size.num_rays());
  show_kept(true);
}

/// Fills the picture from the kept one, enlarged: rays without a hit, or all.
void HostRenderer::show_kept(bool everywhere) {
  check_has_picture();
  if (kept_.empty()) throw Error("there is no picture: none was kept");
  parallel_for(frame_.view.height, num_threads_, [&](std::uint64_t row, std::uint32_t) {
    const auto first = static_cast<uint>(row * frame_.view.width);
    for (uint ray = first; ray < first + frame_.view.width; ++ray) {
      if (!everywhere && hits_[ray].t < INFINITY) continue;
      hits_[ray] =
          kept_[kept_pixel(&frame_.view, kept_size_.ray_columns(), kept_size_.ray_rows(), ray)];
    }
  });
}

void HostRenderer::check_has_picture() const {
  if (hits_.empty()) throw Error("there is no picture: no frame has been drawn");
}

std::vector<HitRecord> HostRenderer::hits() {
  check_has_picture();
  return hits_;
}

FrameArrays HostRenderer::fetch(const WantedArrays &wanted, const Appearance &appearance) {
  check_has_picture();
  check_arrays(wanted, size_);
  const ShadeParams params = make_shade_params(info_, appearance);
  FrameArrays arrays;
  if (wanted.picture) {
    const std::size_t channels = num_channels(&params);
    arrays.picture = memory_.array<std::uint8_t>(channels * size_.num_pixels());
    parallel_for(size_.height, num_threads_, [&](std::uint64_t row, std::uint32_t) {
      host_loops().shade(frame_, params, size_.samples, static_cast<uint>(row), hits_.data(),
                         open_.counts.data(), open_.num_ambient,
                         arrays.picture.data() + channels * size_.width * row);
    });
  }
  const HitMap map = make_hit_map(levels());
  add_hit_arrays(wanted, hits_, params, &map, memory_, arrays);
  return arrays;
}

}  // namespace isowave::core
