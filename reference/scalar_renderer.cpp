#include "reference/scalar_renderer.hpp"

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "core/base/parallel_for.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/bounce.h"
#include "kernels_cl/portable/cell_intersect.h"
#include "kernels_cl/portable/clip.h"
#include "kernels_cl/portable/layers.h"
#include "kernels_cl/portable/smooth_gradient.h"

namespace isowave::core {

namespace {

/// The eight corners of dual cell (x,y,z), minus the isovalue; corner x + 2y + 4z.
void load_corners(const FrameParams &frame, const float *voxels, int x, int y, int z, float *w) {
  const std::size_t row = frame.grid.dims_x, layer = row * frame.grid.dims_y;
  const float *v = voxels + static_cast<std::size_t>(x) + row * static_cast<std::size_t>(y) +
                   layer * static_cast<std::size_t>(z);
  const std::size_t offsets[8] = {0,     1,         row,         row + 1,
                                  layer, layer + 1, layer + row, layer + row + 1};
  for (int corner = 0; corner < 8; ++corner)
    w[corner] = v[offsets[corner]] - frame.surface.isovalue;
}

/// Cells [begin, end) along each axis.
struct CellBox {
  glm::ivec3 begin, end;
};

bool contains(const CellBox &box, const GridWalk &w) {
  const glm::ivec3 at(w.x, w.y, w.z);
  return glm::all(glm::greaterThanEqual(at, box.begin)) && glm::all(glm::lessThan(at, box.end));
}

GridWalk enter_box(const Ray &ray, RayEvent enter, int size, const CellBox &box, LastPlanes last) {
  return walk_from(&ray, locate(ray.x, 0, enter, size, box.begin.x, box.end.x - 1),
                   locate(ray.y, 1, enter, size, box.begin.y, box.end.y - 1),
                   locate(ray.z, 2, enter, size, box.begin.z, box.end.z - 1), size, last);
}

/// Calls visit(cell, enter, exit) for each cell of `box` along the ray, which enters it by `enter`,
/// until visit returns true.
template <class Visit>
void walk_cells(const FrameParams &frame, const Ray &ray, RayEvent enter, const CellBox &box,
                Visit visit) {
  const LastPlanes last = last_planes(&frame);
  GridWalk cell = enter_box(ray, enter, 1, box, last);
  while (contains(box, cell)) {
    const RayEvent exit = walk_exit(&cell, &ray);
    if (visit(cell, enter, exit)) return;
    walk_step(&cell, &ray, exit, 1, last);
    enter = exit;
  }
}

/// The first hit in the cells of `box`, which the ray enters by `enter`.
HitRecord trace_box(const FrameParams &frame, const float *voxels, Solver solver, const Ray &ray,
                    RayEvent enter, const CellBox &box) {
  HitRecord hit = no_hit();
  walk_cells(frame, ray, enter, box,
             [&](const GridWalk &cell, RayEvent cell_enter, RayEvent cell_exit) {
               CellChange change;
               float w[8];
               load_corners(frame, voxels, cell.x, cell.y, cell.z, w);
               if (!change_in_cell(solver, &ray, w, cell.x, cell.y, cell.z, cell_enter, cell_exit,
                                   &change))
                 return false;
               hit = make_hit(&frame, &ray, w, cell.x, cell.y, cell.z, cell_enter, cell_exit,
                              refine(solver, change.cubic, change.bracket));
               return true;
             });
  return hit;
}

HitRecord trace(const FrameParams &frame, const float *voxels, Solver solver, const Ray &ray) {
  const LastPlanes last = last_planes(&frame);
  RayEvent enter;
  if (!domain_entry(&ray, last, &enter)) return no_hit();
  return trace_box(frame, voxels, solver, ray, enter, {glm::ivec3(0), {last.x, last.y, last.z}});
}

/// Where a ray goes on from.
struct BandStart {
  GridWalk cell;
  RayEvent enter;   ///< by which it enters the cell, or begins there
  uint number = 0;  ///< of changes in the cell that lie before
  /// The side on which it was before it begins there; none: it was on none, or this does not
  /// matter.
  std::optional<bool> before = std::nullopt;
};

/// The first hit of a ray in its interval in one level, from a place of its way on. inside: out,
/// where the interval ends, if the ray gets there within the domain, in a cell that has all its
/// data.
HitRecord trace_band_from(const FrameParams &frame, const float *voxels, Solver solver,
                          const Ray &ray, const ClipParams &clip, const BandStart &start,
                          std::optional<bool> &inside) {
  const LastPlanes last = last_planes(&frame);
  const RayEvent end = border_event(ray.end_t);
  const CellBox domain{glm::ivec3(0), {last.x, last.y, last.z}};
  GridWalk cell = start.cell;
  RayEvent enter = start.enter;
  bool begins_on_side = start.before.has_value();
  const bool was_inside = start.before.value_or(false);
  for (uint number = start.number; contains(domain, cell); number = 0) {
    RayEvent exit = walk_exit(&cell, &ray);
    const bool ends = !event_before(exit, end);
    if (ends) exit = end;
    CellChange change;
    float w[8];
    load_corners(frame, voxels, cell.x, cell.y, cell.z, w);
    const auto hit_at = [&](float s) {
      return make_hit(&frame, &ray, w, cell.x, cell.y, cell.z, enter, exit, s);
    };
    const auto inside_now = [&](RayEvent event, bool leaving) {
      return inside_at(&ray, w, event, cell.x, cell.y, cell.z, leaving) != 0;
    };
    if (begins_on_side && !lacks_data(w) && inside_now(enter, false) != was_inside) {
      HitRecord hit = hit_at(0.0f);
      mark_beginning(&clip, &ray, &hit);
      return hit;
    }
    begins_on_side = false;
    const bool changes =
        number == 0
            ? change_in_cell(solver, &ray, w, cell.x, cell.y, cell.z, enter, exit, &change) != 0
            : numbered_change_in_cell(&ray, w, cell.x, cell.y, cell.z, enter, exit, number, 1,
                                      &change) != 0;
    if (changes) {
      HitRecord hit = hit_at(refine(solver, change.cubic, change.bracket));
      hit.cell |= number << ISO_CROSSING_BIT;
      return hit;
    }
    if (ends) {
      if (!lacks_data(w)) inside = inside_now(exit, true);
      break;
    }
    walk_step(&cell, &ray, exit, 1, last);
    enter = exit;
  }
  return no_hit();
}

/// The same from where the interval begins. inside: in, is the ray there, if it comes from another
/// level.
HitRecord trace_band(const FrameParams &frame, const float *voxels, Solver solver, const Ray &ray,
                     const ClipParams &clip, std::optional<bool> &inside) {
  const LastPlanes last = last_planes(&frame), zero{};
  RayEvent enter = border_event(ray.begin_t), exit = border_event(ray.end_t);
  std::optional<bool> before = std::exchange(inside, std::nullopt);
  if (begins_at_cap(&clip, &ray)) before = false;
  if (!clip_to_box(&ray, zero, last, &enter, &exit)) return no_hit();
  if (enter.axis != ISO_AXIS_START) before.reset();
  const CellBox domain{glm::ivec3(0), {last.x, last.y, last.z}};
  return trace_band_from(frame, voxels, solver, ray, clip,
                         {enter_box(ray, enter, 1, domain, last), enter, 0, before}, inside);
}

/// The same behind a hit, whose block is one of the level's own.
HitRecord trace_band_behind(const FrameParams &frame, const float *voxels, const Ray &ray,
                            const ClipParams &clip, const HitRecord &hit,
                            std::optional<bool> &inside) {
  const LastPlanes last = last_planes(&frame);
  const RayEvent begin = border_event(ray.begin_t);
  const BlockCoords b = block_coords(&frame, hit.block_id);
  const GridWalk cell = walk_from(&ray, static_cast<int>(4 * b.x + (hit.cell & 3u)),
                                  static_cast<int>(4 * b.y + (hit.cell >> 2 & 3u)),
                                  static_cast<int>(4 * b.z + (hit.cell >> 4 & 3u)), 1, last);
  RayEvent enter = region_entry(&ray, cell.x, cell.y, cell.z, 1, last);
  if (event_before(enter, begin)) enter = begin;
  return trace_band_from(frame, voxels, kDefaultSolver, ray, clip,
                         {cell, enter, crossings_up_to(hit)}, inside);
}

/// hit: its block is number block_id of the frame's own level.
void smooth_gradient(const FrameParams &frame, const float *voxels, uint block_id, HitRecord &hit) {
  if (is_cap(hit)) return;
  const BlockCoords block = block_coords(&frame, block_id);
  const Stencil s = stencil_of(block, hit.cell, last_planes(&frame));
  const CellPoint at = {hit.x, hit.y, hit.z};
  const StencilAxis axes[3] = {s.x, s.y, s.z};
  float corners[8], beyond[8], gradient[3];
  const auto voxel = [&](const int(&place)[3]) {
    return voxels[static_cast<std::size_t>(place[0]) +
                  frame.grid.dims_x *
                      (static_cast<std::size_t>(place[1]) +
                       std::size_t{frame.grid.dims_y} * static_cast<std::size_t>(place[2]))];
  };
  for (uint axis = 0; axis < 3; ++axis) {
    for (int corner = 0; corner < 8; ++corner) {
      int place[3] = {s.x.cell + (corner & 1), s.y.cell + (corner >> 1 & 1),
                      s.z.cell + (corner >> 2)};
      corners[corner] = voxel(place);
      place[axis] = (corner >> axis & 1) != 0 ? axes[axis].above : axes[axis].below;
      beyond[corner] = voxel(place);
    }
    gradient[axis] = smooth_derivative(corners, beyond, 1u << axis, axes[axis], at);
  }
  if (is_no_gradient({gradient[0], gradient[1], gradient[2]})) return;
  hit.grad_x = gradient[0];
  hit.grad_y = gradient[1];
  hit.grad_z = gradient[2];
}

void check_voxels(const FrameParams &frame, std::span<const float> voxels) {
  if (voxels.size() != std::size_t{frame.grid.dims_x} * frame.grid.dims_y * frame.grid.dims_z) {
    throw std::invalid_argument("scalar renderer: the voxels do not fit the frame's dims");
  }
}

/// The hits [height * width] of trace_pixel(pixel), by several threads.
template <class TracePixel>
std::vector<HitRecord> trace_pixels(const FrameParams &frame, unsigned threads,
                                    TracePixel trace_pixel) {
  std::vector<HitRecord> hits(std::size_t{frame.view.width} * frame.view.height);
  parallel_for(frame.view.height, threads, [&](std::uint64_t row, std::uint32_t) {
    const auto first = static_cast<std::uint32_t>(row * frame.view.width);
    for (std::uint32_t pixel = first; pixel < first + frame.view.width; ++pixel)
      hits[pixel] = trace_pixel(pixel);
  });
  return hits;
}

}  // namespace

void append_segments(const FrameParams &frame, std::span<const float> voxels, const Ray &ray,
                     std::vector<CellSegment> &segments) {
  check_voxels(frame, voxels);
  const LastPlanes last = last_planes(&frame);
  RayEvent enter;
  if (!domain_entry(&ray, last, &enter)) return;
  const CellBox domain{glm::ivec3(0), {last.x, last.y, last.z}};
  walk_cells(
      frame, ray, enter, domain,
      [&](const GridWalk &cell, RayEvent cell_enter, RayEvent cell_exit) {
        CellChange change;
        float w[8];
        load_corners(frame, voxels.data(), cell.x, cell.y, cell.z, w);
        if (!corners_differ(w)) return false;
        const CellPoint a = event_position(&ray, cell_enter, cell.x, cell.y, cell.z, 0),
                        b = event_position(&ray, cell_exit, cell.x, cell.y, cell.z, 1);
        segments.push_back({segment_cubic(w, a, b), std::hypot(b.x - a.x, b.y - a.y, b.z - a.z)});
        return change_in_cell(kDefaultSolver, &ray, w, cell.x, cell.y, cell.z, cell_enter,
                              cell_exit, &change) != 0;
      });
}

Ray in_band(const FrameParams &frame, Ray ray) {
  ray.begin_t = frame.band.begin_t;
  ray.end_t = frame.band.end_t;
  return ray;
}

HitRecord trace_scalar(const FrameParams &frame, std::span<const float> voxels, Solver solver,
                       const Ray &ray, const ClipParams &clip) {
  check_voxels(frame, voxels);
  std::optional<bool> inside;
  return ray.cut_by == ISO_NOT_CUT ? trace(frame, voxels.data(), solver, ray)
                                   : trace_band(frame, voxels.data(), solver, ray, clip, inside);
}

HitRecord trace_scalar_by_blocks(const FrameParams &frame, std::span<const float> voxels,
                                 Solver solver, const Ray &ray) {
  check_voxels(frame, voxels);
  const LastPlanes last = last_planes(&frame);
  const glm::ivec3 end_cell(last.x, last.y, last.z);
  const CellBox blocks{glm::ivec3(0), (end_cell + 3) / 4};
  RayEvent enter;
  if (!domain_entry(&ray, last, &enter)) return no_hit();
  GridWalk block = enter_box(ray, enter, 4, blocks, last);
  while (contains(blocks, block)) {
    const glm::ivec3 begin(4 * block.x, 4 * block.y, 4 * block.z);
    const HitRecord hit = trace_box(frame, voxels.data(), solver, ray,
                                    region_entry(&ray, block.x, block.y, block.z, 4, last),
                                    {begin, glm::min(begin + 4, end_cell)});
    if (std::isfinite(hit.t)) return hit;
    block = walk_from(&ray, block.x, block.y, block.z, 4, last);  // all that is kept between passes
    walk_step(&block, &ray, walk_exit(&block, &ray), 4, last);
  }
  return no_hit();
}

std::vector<HitRecord> render_scalar(const FrameParams &frame, std::span<const float> voxels,
                                     Solver solver, unsigned threads) {
  check_voxels(frame, voxels);
  return trace_pixels(frame, threads, [&](std::uint32_t pixel) {
    return trace(frame, voxels.data(), solver, make_ray(&frame, pixel));
  });
}

namespace {

/// The first hit in the levels from a given one on. inside: as trace_band()
HitRecord trace_levels_from(std::size_t level, std::span<const FrameParams> frames,
                            std::span<const std::vector<float>> voxels, Solver solver,
                            std::span<const Ray> rays, const ClipParams &clip,
                            std::optional<bool> inside) {
  HitRecord hit = no_hit();
  for (; level < frames.size() && !std::isfinite(hit.t); ++level) {
    if (!draws(frames[level])) continue;
    hit = trace_band(frames[level], voxels[level].data(), solver, rays[level], clip, inside);
    if (std::isfinite(hit.t)) hit = among_levels(frames[level], hit);
  }
  return hit;
}

}  // namespace

HitRecord trace_scalar_levels(std::span<const FrameParams> frames,
                              std::span<const std::vector<float>> voxels, Solver solver,
                              std::span<const Ray> rays, const ClipParams &clip) {
  return trace_levels_from(0, frames, voxels, solver, rays, clip, std::nullopt);
}

HitRecord trace_scalar_behind(std::span<const FrameParams> frames,
                              std::span<const std::vector<float>> voxels, std::span<const Ray> rays,
                              const HitRecord &hit, const ClipParams &clip) {
  const std::size_t level = level_of_hit(frames, hit);
  std::optional<bool> inside;
  const HitRecord next = trace_band_behind(frames[level], voxels[level].data(), rays[level], clip,
                                           within_level(frames[level], hit), inside);
  return std::isfinite(next.t)
             ? among_levels(frames[level], next)
             : trace_levels_from(level + 1, frames, voxels, kDefaultSolver, rays, clip, inside);
}

std::size_t level_of_hit(std::span<const FrameParams> frames, const HitRecord &hit) {
  std::size_t level = 0;
  while (level + 1 < frames.size() &&
         level_block_of(&frames[level], hit.block_id) == ISO_INVALID_ID)
    ++level;
  return level;
}

HitRecord among_levels(const FrameParams &frame, HitRecord hit) {
  const uint x = hit.block_id % frame.grid.blocks_x,
             y = hit.block_id / frame.grid.blocks_x % frame.grid.blocks_y,
             z = hit.block_id / frame.grid.blocks_x / frame.grid.blocks_y;
  hit.block_id = x + frame.place.blocks_x * (y + frame.place.blocks_y * (frame.place.begin_z + z));
  return hit;
}

HitRecord within_level(const FrameParams &frame, HitRecord hit) {
  hit.block_id = level_block_of(&frame, hit.block_id);
  return hit;
}

void smooth_gradients(std::span<const FrameParams> frames,
                      std::span<const std::vector<float>> voxels, std::span<HitRecord> hits,
                      unsigned threads) {
  constexpr std::size_t kRun = 1024;
  for (std::size_t level = 0; level < frames.size(); ++level)
    check_voxels(frames[level], voxels[level]);
  parallel_for((hits.size() + kRun - 1) / kRun, threads, [&](std::uint64_t run, std::uint32_t) {
    const std::size_t begin = run * kRun;
    for (HitRecord &hit : hits.subspan(begin, std::min(kRun, hits.size() - begin))) {
      for (std::size_t level = 0; std::isfinite(hit.t) && level < frames.size(); ++level) {
        const uint block_id = level_block_of(&frames[level], hit.block_id);
        if (block_id == ISO_INVALID_ID) continue;
        smooth_gradient(frames[level], voxels[level].data(), block_id, hit);
        break;
      }
    }
  });
}

void filter_bounced(const FrameParams &seen, std::span<const GivenRay> places,
                    std::vector<float> &bounced) {
  for (uint step = 0; step < ISO_BOUNCE_STEPS; ++step) {
    const std::vector<float> before = bounced;
    for (uint ray = 0; ray < places.size(); ++ray)
      bounced[ray] = filtered_light(seen.view.width, seen.view.height, places.data(), before.data(),
                                    ray, 1u << step);
  }
}

OpenCounts open_of(std::span<const FrameParams> frames, std::span<const VolumeInfo> levels,
                   std::span<const std::vector<float>> voxels, std::span<const HitRecord> hits,
                   const LightRays &rays, Solver solver, unsigned threads, const ClipParams &clip) {
  const std::size_t first =
      static_cast<std::size_t>(std::ranges::find_if(frames, draws) - frames.begin());
  const FrameParams &seen = frames[first];
  const AmbientParams params = make_ambient_params(levels[first], rays.num_ambient);
  const std::vector<AmbientDirection> directions = make_light_directions(rays);
  OpenCounts open{std::vector<uchar>((rays.num_shadow != 0 ? 2 : 1) * hits.size()),
                  rays.num_ambient, rays.num_shadow};
  if (rays.bounces) {
    open.bounced.resize(hits.size());
    open.num_bounced = rays.num_ambient;
  }
  const auto meets = [&](const GivenRay &given, std::size_t level, HitRecord *met) {
    *met = trace(frames[level], voxels[level].data(), solver, make_given_ray(given));
    return std::isfinite(met->t) &&
           !is_clipped(&clip, given, std::ldexp(1.0f, static_cast<int>(level)),
                       met->t / frames[level].view.t_scale);
  };
  parallel_for(seen.view.height, threads, [&](std::uint64_t row, std::uint32_t) {
    for (uint column = 0; column < seen.view.width; ++column) {
      const uint pixel = static_cast<uint>(row) * seen.view.width + column;
      HitRecord hit = hits[pixel];
      if (!std::isfinite(hit.t)) continue;
      std::size_t level = first;
      while (frames.size() > 1 && level_block_of(&frames[level], hit.block_id) == ISO_INVALID_ID)
        ++level;
      if (frames.size() > 1) hit.block_id = level_block_of(&frames[level], hit.block_id);
      const HitRecord placed = placed_hit(&frames[level], static_cast<uint>(level - first), hit);
      for (std::uint32_t k = 0; k < rays.count(); ++k) {
        const GivenRay given =
            ambient_ray(&seen, &params, placed, pixel, k,
                        directions[k * ISO_AMBIENT_PATTERNS + ambient_pattern(&seen, pixel)]);
        if (!is_given(given)) continue;
        HitRecord met;
        const bool is_shadow = is_shadow_ray(&params, k), is_open = !meets(given, level, &met);
        uchar &count = open.counts[pixel + (is_shadow ? hits.size() : 0)];
        count = static_cast<uchar>(count + is_open);
        if (is_open || is_shadow || !rays.bounces) continue;
        const std::size_t lit_by = rays.num_ambient + light_row(rays.num_shadow, k);
        float cosine = 0;
        const GivenRay to_light = bounce_ray(
            &params, given, placed_hit(&frames[level], static_cast<uint>(level - first), met),
            directions[lit_by * ISO_AMBIENT_PATTERNS + ambient_pattern(&seen, pixel)], &cosine);
        if (is_given(to_light) && !meets(to_light, level, &met)) open.bounced[pixel] += cosine;
      }
    }
  });
  if (!rays.bounces) return open;
  std::vector<GivenRay> places(hits.size());
  for (uint ray = 0; ray < hits.size(); ++ray)
    places[ray] = normal_ray(&seen, &params, ray, hits[ray]);
  filter_bounced(seen, places, open.bounced);
  return open;
}

void smooth_gradients(const FrameParams &frame, std::span<const float> voxels,
                      std::span<HitRecord> hits) {
  check_voxels(frame, voxels);
  for (HitRecord &hit : hits) {
    if (std::isfinite(hit.t)) smooth_gradient(frame, voxels.data(), hit.block_id, hit);
  }
}

std::vector<HitRecord> render_scalar_levels(std::span<const FrameParams> frames,
                                            std::span<const std::vector<float>> voxels,
                                            Solver solver, unsigned threads,
                                            const ClipParams &clip) {
  for (std::size_t level = 0; level < frames.size(); ++level)
    check_voxels(frames[level], voxels[level]);
  return trace_pixels(frames[0], threads, [&](std::uint32_t pixel) {
    std::vector<Ray> rays;
    for (const FrameParams &frame : frames) {
      rays.push_back(in_band(frame, make_ray(&frame, pixel)));
      clip_ray(&frame, &clip, pixel, &rays.back());
    }
    return trace_scalar_levels(frames, voxels, solver, rays, clip);
  });
}

}  // namespace isowave::core
