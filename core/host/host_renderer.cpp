#include "core/host/host_renderer.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <numeric>
#include <thread>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/frame/field_values.hpp"
#include "core/frame/labels.hpp"
#include "core/frame/surface_camera.hpp"
#include "core/platform/memory.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/cell_intersect.h"

namespace isowave::core {

namespace {

/// Rays along a tile's edge, about: neighbours walk through the same blocks.
constexpr std::uint32_t kTileRays = 16;
/// The same of a volume in chunks: the rays of a tile wait together.
constexpr std::uint32_t kWaitingTileRays = 8;
/// Missing chunks that a tile may note before it waits: in a frame's first call, and at most. Each
/// further call doubles them, so no tile waits often, and few of them read much in vain.
constexpr std::uint32_t kFirstGuesses = 4, kMostGuesses = 1u << 16;
/// Tiles of a band for each thread: enough that no thread waits long for the last.
constexpr std::uint32_t kTilesPerThread = 8;

std::uint64_t mebibytes(std::uint64_t bytes) {
  return (bytes + (1u << 20) - 1) >> 20;
}

std::uint64_t limit_of(std::uint64_t memory_limit) {
  return memory_limit != 0 ? memory_limit : platform::host_memory() / 4;
}

/// Returns the memory limit. Throws Error if frames of num_surfaces surfaces need more.
std::uint64_t checked_limit(const CompressedVolume &volume, std::uint64_t memory_limit,
                            std::size_t num_surfaces, std::uint64_t field_bytes = 0,
                            bool at_levels = false) {
  const std::uint64_t needed =
                          HostLevels::least_bytes(volume, num_surfaces, at_levels) + field_bytes,
                      limit = limit_of(memory_limit);
  if (needed <= limit) return limit;
  throw Error(
      "drawing {}on the host takes {} MiB of memory at least, for value ranges of all blocks, and "
      "{} MiB are allowed: raise the limit, or draw on a device",
      num_surfaces == 1 ? "" : fmt::format("{} surfaces ", num_surfaces), mebibytes(needed),
      limit >> 20);
}

/// The part of a tile in which rays may hit something.
RayTile within(const RayTile &tile, const ScreenBox &box) {
  return {std::max(tile.begin_x, box.begin_x), std::max(tile.begin_y, box.begin_y),
          std::min(tile.end_x, box.end_x), std::min(tile.end_y, box.end_y)};
}

/// Clips levels or surfaces of a frame. screen: of its whole volume.
void clip_levels(std::span<HostLevel> drawing, const ClipParams &clip, const ScreenBox &screen) {
  if (clip.num_planes == 0) return;
  for (HostLevel &level : drawing) {
    level.clip = &clip;
    level.frame.screen = screen;  // caps lie outside the box of active blocks, too
  }
}

template <class Count>
Count rounded_up(Count count, std::uint32_t unit) {
  return (count + unit - 1) / unit;
}

/// The work of a frame's loops, in their order; that for the camera's rays is 1. In frames of
/// several surfaces, one loop does all.
std::array<double, 3> work_of(const FrameRequest &request) {
  if (!request.surfaces.empty()) return {1, 0, 0};
  const LightRays rays = light_rays_of(request);
  const double num_rays = rays.count() + (rays.bounces ? rays.num_ambient : 0);
  return {1, request.field_values ? 1.0 : 0.0, num_rays};
}

}  // namespace

HostRenderer::HostRenderer(const CompressedVolume &volume, const HostRendererOptions &options)
    : volume_(volume),
      info_(volume.info),
      abilities_(abilities_of(volume)),
      num_threads_(options.num_threads),
      memory_limit_(options.memory_limit),
      levels_(volume, checked_limit(volume, memory_limit_, 1), options.num_threads),
      setup_ms_(0) {
  check_image_size(options.largest);
  abilities_.largest = options.largest;
  if (volume.chunks) chunks_.push_back(volume.chunks.get());
  for (const CompressedVolume &level : volume.coarser_levels) {
    if (level.chunks) chunks_.push_back(level.chunks.get());
  }
  if (options.field != nullptr) {
    check_volume_info(options.field->info, "the field");
    const bool is_own = options.field == &volume;
    if (!is_own) checked_limit(volume, memory_limit_, 1, HostBlocks::bytes(options.field->info));
    field_.emplace(*options.field, is_own ? &levels_.finest() : nullptr, levels_.infos(),
                   levels_.room(), num_threads_);
    abilities_.field_labels = are_labels(*options.field);
    abilities_.field = true;
  }
  setup_ms_ = ms_since(begin_);
}

bool HostRenderer::fits(const CompressedVolume &volume, std::uint64_t memory_limit) {
  return HostLevels::least_bytes(volume) <= limit_of(memory_limit);
}

Abilities HostRenderer::abilities_of(const CompressedVolume &volume) {
  Abilities abilities;
  abilities.levels = !volume.coarser_levels.empty();
  abilities.clipping = abilities.fewer_planes = abilities.bounds = abilities.given_rays =
      abilities.kept_picture = true;
  abilities.most_surfaces = ISO_MAX_SURFACES;
  abilities.labels = abilities.bounce = true;
  return abilities;
}

FrameStats HostRenderer::render(const FrameRequest &request) {
  const auto begin = std::chrono::steady_clock::now();
  any_waits_ = false;
  guesses_ = goes_on_ ? std::min(2 * guesses_, kMostGuesses) : kFirstGuesses;
  check(request, abilities());
  const ImageSize size = size_of(request, abilities());
  if (rows_[0] >= std::min(rows_[1], size.height))
    throw Error("rows {} to {} of a picture of {}: there are none", rows_[0], rows_[1],
                size.height);
  if (light_rays_of(request).bounces && rows_[1] - rows_[0] < size.height)
    throw Error("light bounces in whole pictures alone, not in rows {} to {}", rows_[0], rows_[1]);
  const std::vector<FrameParams> frames = make_level_frames(levels_.infos(), request.camera, size,
                                                            request.isovalue, request.voxel_pixels);
  FrameStats stats;
  if (request.surfaces.empty()) {
    draw_one(request, frames, size, stats);
  } else {
    draw_surfaces(request, frames, size, stats);
  }
  stats.complete = !stats.cancelled;
  stats.total_ms = ms_since(begin);
  return stats;
}

/// Calls draw(), which draws another picture. If it throws, there is none.
template <class Draw>
void HostRenderer::draw_picture(const FrameParams &frame, ImageSize size,
                                std::vector<RayColor> colors, Draw draw) {
  frame_ = frame;
  size_ = size;
  if (!goes_on_) {
    open_ = {};
    field_values_.clear();
    layers_.clear();
    colors_ = std::move(colors);
    for (std::vector<std::uint8_t> &tiles : finished_) tiles.clear();
  }
  try {
    draw();
  } catch (...) {
    hits_.clear();
    colors_.clear();
    field_values_.clear();
    throw;
  }
}

/// The surface of one isovalue, by levels of detail.
void HostRenderer::draw_one(const FrameRequest &request, std::span<const FrameParams> frames,
                            ImageSize size, FrameStats &stats) {
  if (request.field_values) checked_limit(volume_, memory_limit_, 1, field_->own_bytes(request));
  std::vector<HostLevel> drawing = levels_.open(frames, request.voxel_error, request.bound);
  if (request.field_values) field_->begin_frame(request);
  stats.first_level =
      static_cast<std::size_t>(std::ranges::find_if(frames, draws) - frames.begin());
  stats.last_level = stats.first_level + drawing.size() - 1;
  const ClipParams clip =
      make_clip_params(info_, frames.front().view, request.camera, request.clip);
  clip_levels(drawing, clip, frames[stats.first_level].screen);
  const bool is_smooth = request.normals == Normals::kSmooth;
  draw_picture(frames.front(), size, {}, [&] {
    draw_bands(
        request,
        [&](const RayTile &tile, bool is_alone) {
          return trace(drawing, tile, is_alone, is_smooth);
        },
        stats);
    if (request.field_values && !stats.cancelled) add_field_values(request, stats);
    if (light_rays_of(request).count() != 0 && !stats.cancelled)
      add_ambient(request, drawing, stats);
  });
}

/// The surfaces of a frame, in that order.
std::vector<LeveledSurface> HostRenderer::open_surfaces(const FrameRequest &request,
                                                        std::span<const FrameParams> frames,
                                                        std::span<const std::uint32_t> order) {
  const std::uint64_t of_field = request.field_values ? field_->own_bytes(request) : 0;
  if (!request.surfaces.front().labels.empty()) {
    check_labels(volume_);
    checked_limit(volume_, memory_limit_, 1,
                  HostLevels::bytes_of_labels(info_, request.surfaces.size()) + of_field);
    std::vector<std::vector<std::uint16_t>> groups;
    for (const std::uint32_t number : order) groups.push_back(request.surfaces[number].labels);
    return levels_.open_labels(frames.front(), groups);
  }
  checked_limit(volume_, memory_limit_, request.surfaces.size(), of_field,
                request.voxel_pixels != 0);
  std::vector<float> isovalues;
  for (const std::uint32_t number : order) isovalues.push_back(request.surfaces[number].isovalue);
  return levels_.open_surfaces(frames, isovalues, request.voxel_error);
}

/// How a frame's surfaces are blended.
///
/// directions  make_light_directions()
LayerBlend HostRenderer::blend_of(const FrameRequest &request, std::span<const FrameParams> frames,
                                  std::span<const AmbientDirection> directions) const {
  const LightRays light_rays = light_rays_of(request);
  const View &view = frames.front().view;
  const auto first = static_cast<std::size_t>(std::ranges::find_if(frames, draws) - frames.begin());
  const std::vector<FieldMap> own_maps = make_own_maps(levels_.infos());
  LayerBlend by{
      .shading = make_layer_shading(info_, request,
                                    request.field_values ? field_->volume_range() : std::nullopt),
      .colors = make_layer_params(request.surfaces, request.slices, info_, view, request.camera),
      .numbers = innermost_first(request.surfaces),
      .is_smooth = request.normals == Normals::kSmooth,
      .clip = make_clip_params(info_, view, request.camera, request.clip),
      .finest = &frames.front(),
      .slice_maps = {own_maps.begin() + static_cast<std::ptrdiff_t>(first), own_maps.end()},
      .field = request.field_values ? &*field_ : nullptr};
  by.rays = {make_ambient_params(levels_.infos()[first], light_rays.num_ambient),
             directions.data(),
             light_rays.count(),
             &frames[first],
             0,
             std::ldexp(1.0f, static_cast<int>(first)),
             light_rays.bounces};
  by.any_is_whole = any_is_whole(request.surfaces);
  for (const std::size_t place : light_order(request.surfaces))
    by.opaque[request.surfaces[by.numbers[place]].clipped ? 1 : 0].push_back(place);
  return by;
}

/// Several or translucent surfaces: in each tile, first hits on each of them, and then their
/// layers.
void HostRenderer::draw_surfaces(const FrameRequest &request, std::span<const FrameParams> frames,
                                 ImageSize size, FrameStats &stats) {
  const FrameParams &frame = frames.front();
  const LightRays light_rays = light_rays_of(request);
  const std::vector<AmbientDirection> directions = make_light_directions(light_rays);
  const LayerBlend by = blend_of(request, frames, directions);
  std::vector<LeveledSurface> surfaces = open_surfaces(request, frames, by.numbers);
  if (request.field_values) field_->begin_frame(request);
  stats.first_level =
      static_cast<std::size_t>(std::ranges::find_if(frames, draws) - frames.begin());
  stats.last_level = stats.first_level + surfaces.front().size() - 1;
  for (std::size_t k = 0; k < surfaces.size(); ++k) {
    if (request.surfaces[by.numbers[k]].clipped)
      clip_levels(surfaces[k], by.clip, frames[stats.first_level].screen);
  }
  std::mutex mutex;
  const auto draw_tile = [&](const RayTile &tile, bool is_alone) {
    const std::uint32_t columns = tile.end_x - tile.begin_x,
                        num_rays = columns * (tile.end_y - tile.begin_y);
    std::vector<HitRecord> next(num_rays * surfaces.size(), no_hit());
    for (std::size_t k = 0; k < surfaces.size(); ++k) {
      if (trace(surfaces[k], tile, is_alone, false) == 0) continue;
      for (std::uint32_t i = 0; i < num_rays; ++i) {
        const std::size_t ray = tile.begin_x + i % columns +
                                std::size_t{frame.view.width} * (tile.begin_y + i / columns);
        next[k + surfaces.size() * i] = std::exchange(hits_[ray], no_hit());
      }
    }
    LayerStats of_tile;
    LayerHits layers_of_tile(layers_.size());
    const auto blend = is_alone ? host_loops().blend_rays : host_loops().blend;
    const std::uint64_t num_hits = blend(surfaces, by, tile, next.data(),
                                         {hits_.data(), colors_.data(), &of_tile,
                                          layers_.empty() ? nullptr : layers_of_tile.data()});
    if (has_guessed()) return num_hits;
    const std::scoped_lock lock(mutex);
    stats.layers.add(of_tile);
    for (std::size_t layer = 0; layer < layers_.size(); ++layer)
      layers_[layer].insert(layers_[layer].end(), layers_of_tile[layer].begin(),
                            layers_of_tile[layer].end());
    return num_hits;
  };
  draw_picture(frame, size, std::vector<RayColor>(size.num_rays(), clear_ray()), [&] {
    if (layers_.empty() && light_rays.bounces) layers_.resize(ISO_MAX_LAYERS);
    draw_bands(request, draw_tile, stats);
    if (light_rays.bounces && !stats.cancelled) blend_bounced(frame, by);
    if (!stats.cancelled) layers_.clear();
  });
}

/// Blends all layers again, with the light that ambient rays have brought to them, filtered.
void HostRenderer::blend_bounced(const FrameParams &frame, const LayerBlend &by) {
  constexpr std::size_t kRun = 4096;
  const std::size_t num_rays = hits_.size();
  std::ranges::fill(colors_, clear_ray());
  for (const std::vector<LayerHit> &layer : layers_) {
    if (layer.empty()) break;
    std::vector<HitRecord> hits(num_rays, no_hit());
    std::array<std::vector<float>, ISO_LAYER_SUMS> parts;
    for (std::vector<float> &part : parts) part.assign(num_rays, 0);
    for (const LayerHit &at : layer) {
      const BouncedLight &sum = at.light.bounced;
      parts[0][at.ray] = sum.own;
      parts[1][at.ray] = sum.r;
      parts[2][at.ray] = sum.g;
      parts[3][at.ray] = sum.b;
      if (!is_of_slice(&by.colors, at.hit)) hits[at.ray] = at.hit;
    }
    const std::vector<GivenRay> places = places_of(*by.rays.seen, by.rays.params, hits);
    std::vector<float> sums;
    for (std::vector<float> &part : parts) {
      filter_bounced(frame.view, places, part);
      sums.insert(sums.end(), part.begin(), part.end());
    }
    parallel_for(
        rounded_up(layer.size(), kRun), num_threads_, [&](std::uint64_t run, std::uint32_t) {
          const std::size_t begin = run * kRun;
          host_loops().blend_lit(
              frame, by, std::span(layer).subspan(begin, std::min(kRun, layer.size() - begin)),
              sums.data(), colors_.data());
        });
  }
}

/// Traces a tile's rays, whose hits are no_hit() before.
std::uint64_t HostRenderer::trace(std::span<const HostLevel> drawing, const RayTile &tile,
                                  bool is_alone, bool is_smooth) {
  const HostLevel &first = drawing.front();
  const RayTile part = within(tile, first.frame.screen);
  const HostLoops &loops = host_loops();
  if (is_alone) return loops.trace_rays_of_levels(drawing, part, is_smooth, hits_.data());
  if (drawing.size() == 1 && first.clip == nullptr)
    return loops.trace(first.frame, first.field, part, is_smooth, hits_.data());
  return loops.trace_levels(drawing, part, is_smooth, hits_.data());
}

/// Band by band, so that the picture so far can be shown; without on_pass, one has all. Each tile
/// first gets no hits, while it is in the processor's cache; what on_pass may see of others before
/// that, too.
///
/// draw_tile  (tile, is_alone) -> number of rays that hit something
template <class DrawTile>
void HostRenderer::draw_bands(const FrameRequest &request, DrawTile draw_tile, FrameStats &stats) {
  const std::size_t num_rays = std::size_t{frame_.view.width} * frame_.view.height;
  if (request.surfaces.empty() && request.field_values && field_values_.empty())
    field_values_.assign(num_rays, no_value());
  if (request.on_pass) {
    hits_.assign(num_rays, no_hit());
  } else {
    hits_.resize(num_rays);
  }
  std::atomic<std::uint64_t> num_hits = 0;
  stats.cancelled = !for_bands(
      request, Loop::kHits,
      [&](const RayTile &tile, bool is_alone) {
        for (std::size_t y = tile.begin_y; y < tile.end_y; ++y) {
          const auto row = hits_.begin() + static_cast<std::ptrdiff_t>(y * frame_.view.width);
          std::fill(row + tile.begin_x, row + tile.end_x, no_hit());
        }
        const std::uint64_t num_hits_of_tile = draw_tile(tile, is_alone);
        if (!has_guessed()) num_hits += num_hits_of_tile;
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

/// All light gets to all hits.
void HostRenderer::begin_light(const LightRays &light_rays) {
  open_ = {{}, light_rays.num_ambient, light_rays.num_shadow};
  if (light_rays.bounces) {
    open_.bounced.assign(hits_.size(), 0.0f);
    open_.num_bounced = light_rays.num_ambient;
  }
  open_.counts.assign(hits_.size(), static_cast<uchar>(light_rays.num_ambient));
  if (light_rays.num_shadow != 0)
    open_.counts.resize(2 * hits_.size(), static_cast<uchar>(light_rays.num_shadow));
}

/// All rays of each hit at once: bands that are not there yet show all of the sky. Each ray stays
/// in the level of detail of its hit.
void HostRenderer::add_ambient(const FrameRequest &request, std::span<const HostLevel> drawing,
                               FrameStats &stats) {
  const auto begin = std::chrono::steady_clock::now();
  const LightRays light_rays = light_rays_of(request);
  const std::vector<AmbientDirection> directions = make_light_directions(light_rays);
  const AmbientParams params =
      make_ambient_params(levels_.infos()[stats.first_level], light_rays.num_ambient);
  const FrameParams &seen = drawing.front().frame;
  if (open_.counts.empty()) begin_light(light_rays);  // or the tiles that are finished have theirs
  stats.cancelled = !for_bands(
      request, Loop::kLight,
      [&](const RayTile &tile, bool) {
        for (uint level = 0; level < drawing.size(); ++level) {
          const float voxel = std::ldexp(1.0f, static_cast<int>(stats.first_level + level));
          const AmbientRays rays{params, directions.data(), light_rays.count(), &seen, level,
                                 voxel,  light_rays.bounces};
          host_loops().ambient(drawing[level], within(tile, seen.screen), rays, hits_.data(),
                               open_.counts.data(), open_.bounced.data());
        }
      },
      [&](std::uint32_t) {
        PassStats pass;
        pass.completed_percent = 100;
        ++stats.ambient.passes;
        return pass;
      });
  if (light_rays.bounces && !stats.cancelled)
    filter_bounced(seen.view, places_of(seen, params, hits_), open_.bounced);
  stats.ambient.ms = ms_since(begin);
}

/// The normal_ray()s of hits [height * width].
std::vector<GivenRay> HostRenderer::places_of(const FrameParams &frame, const AmbientParams &params,
                                              std::span<const HitRecord> hits) const {
  std::vector<GivenRay> places(hits.size());
  parallel_for(frame.view.height, num_threads_, [&](std::uint64_t row, std::uint32_t) {
    host_loops().place_hits(frame, params, static_cast<uint>(row), hits.data(), places.data());
  });
  return places;
}

/// light: [height * width]
void HostRenderer::filter_bounced(const View &view, std::span<const GivenRay> places,
                                  std::vector<float> &light) const {
  std::vector<float> filtered(light.size());
  for (uint step = 0; step < ISO_BOUNCE_STEPS; ++step) {
    parallel_for(view.height, num_threads_, [&](std::uint64_t row, std::uint32_t) {
      host_loops().filter_bounced(view, static_cast<uint>(row), 1u << step, places.data(),
                                  light.data(), filtered.data());
    });
    light.swap(filtered);
  }
}

/// Calls draw(tile, is_alone), as HostBlocks::run() does, for the tiles of all of the frame's rays,
/// in bands of whole rows of pixels from the top; after each band, on_pass(after(rows that are
/// done)). Returns false if on_pass says to stop, and there is more to draw: bands or other loops;
/// or if tiles wait for chunks.
template <class Draw, class After>
bool HostRenderer::for_bands(const FrameRequest &request, Loop loop, Draw draw, After after) {
  const OnPass &on_pass = request.on_pass;
  const bool more_follows = (loop != Loop::kLight && light_rays_of(request).count() != 0) ||
                            (loop == Loop::kHits && request.field_values);
  const std::array<double, 3> work = work_of(request);
  const auto own = static_cast<std::size_t>(loop);
  const double before = std::reduce(work.begin(), work.begin() + own),
               all = std::reduce(work.begin(), work.end());
  const std::thread::id own_thread = std::this_thread::get_id();
  std::atomic<std::uint64_t> num_tiles = 0;
  const std::array<std::uint32_t, 2> drawn = rows_of_rays();
  const std::uint32_t begin_row = drawn[0], rows = drawn[1], width = frame_.view.width,
                      tile_rays = volume_.chunks ? kWaitingTileRays : kTileRays,
                      tile_rows = std::max(tile_rays / size_.samples, 1u) * size_.samples;
  const std::uint32_t columns = rounded_up(width, tile_rays);
  const std::uint32_t band =
      on_pass ? tile_rows * rounded_up(kTilesPerThread * thread_count(num_threads_), columns)
              : rows - begin_row;
  if (volume_.chunks && finished_[own].empty())
    finished_[own].assign(std::size_t{columns} * rounded_up(rows - begin_row, tile_rows), 0);
  for (std::uint32_t row = begin_row; row < rows; row += band) {
    const std::uint32_t end_row = std::min(rows - row, band) + row;
    levels_.room().run(
        std::uint64_t{columns} * rounded_up(end_row - row, tile_rows),
        [&](std::uint64_t tile, bool is_alone) {
          const auto x = static_cast<std::uint32_t>(tile % columns * tile_rays),
                     y = static_cast<std::uint32_t>(row + tile / columns * tile_rows);
          draw_or_wait(loop, tile, [&] {
            draw(RayTile{x, y, std::min(x + tile_rays, width), std::min(y + tile_rows, end_row)},
                 is_alone);
          });
          const double share =
              double(++num_tiles) / (columns * rounded_up(rows - begin_row, tile_rows));
          if (request.on_progress && std::this_thread::get_id() == own_thread)
            request.on_progress(100 * (before + std::min(share, 1.0) * work.at(own)) / all);
        });
    const PassStats pass = after(end_row);
    if (on_pass && !on_pass(pass) && (end_row < rows || more_follows)) return false;
  }
  return !any_waits_;
}

/// Calls draw() unless the tile is finished already. A tile whose chunks are not there waits.
template <class Draw>
void HostRenderer::draw_or_wait(Loop loop, std::uint64_t tile, Draw draw) {
  if (!volume_.chunks) return draw();
  std::uint8_t &finished = finished_[static_cast<std::size_t>(loop)][tile];
  if (finished != 0) return;
  const auto may_guess = [&](std::uint32_t most) {
    for (BlockChunks *of_level : chunks_) of_level->begin_guesses(most);
  };
  may_guess(guesses_);
  try {
    draw();
    finished = has_guessed() ? 0 : 1;
  } catch (const ChunkIsMissing &) {
  }
  may_guess(0);
  if (finished == 0) any_waits_ = true;
}

/// Whether the tile that is drawn has gone past chunks that are not there.
bool HostRenderer::has_guessed() const {
  return std::ranges::any_of(chunks_, &BlockChunks::has_guessed);
}

std::array<std::uint32_t, 2> HostRenderer::rows_of_rays() const {
  if (size_.stride > 1) return {0, size_.ray_rows()};
  return {rows_[0] * size_.samples, std::min(rows_[1], size_.height) * size_.samples};
}

/// The hits' values of the field, in the same bands.
void HostRenderer::add_field_values(const FrameRequest &request, FrameStats &stats) {
  const auto begin = std::chrono::steady_clock::now();
  stats.cancelled = !for_bands(
      request, Loop::kField,
      [&](const RayTile &tile, bool) {
        for (std::size_t y = tile.begin_y; y < tile.end_y; ++y) {
          const std::size_t first = y * frame_.view.width + tile.begin_x;
          (*field_)(std::span(hits_).subspan(first, tile.end_x - tile.begin_x),
                    field_values_.data() + first);
        }
      },
      [&](std::uint32_t) {
        PassStats pass;
        pass.completed_percent = 100;
        ++stats.field.passes;
        return pass;
      });
  stats.field.ms = ms_since(begin);
}

void HostRenderer::clear_cache() {
  levels_.forget();
  if (field_) field_->forget();
}

Camera HostRenderer::label_camera(std::span<const std::uint16_t> labels,
                                  std::optional<ImageSize> size, const Viewpoint &from) {
  const ImageSize of_picture = size.value_or(abilities().largest);
  check_image_size(of_picture);
  check_labels(volume_);
  checked_limit(volume_, memory_limit_, 1, HostLevels::bytes_of_labels(info_, 1));
  return surface_camera(info_, levels_.label_box(labels), of_picture, from);
}

}  // namespace isowave::core
