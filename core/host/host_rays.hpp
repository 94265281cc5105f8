#pragma once
// A ray alone through the blocks of a HostField, and the smooth gradient of its hit. Only
// host_loops.cpp includes this file: it says for which processors all of it is compiled.

#include <cstddef>

#include "core/frame/solvers.hpp"
#include "core/host/host_loops.hpp"
#include "kernels_cl/portable/block_cells.h"
#include "kernels_cl/portable/cell_intersect.h"
#include "kernels_cl/portable/clip.h"
#include "kernels_cl/portable/level_border.h"
#include "kernels_cl/portable/smooth_gradient.h"

namespace isowave::core {

inline float voxel_at(const FrameParams &frame, const HostField &field, int x, int y, int z) {
  const auto vx = static_cast<uint>(x), vy = static_cast<uint>(y), vz = static_cast<uint>(z);
  const ulong block = level_block_at(&frame, vx >> 2, vy >> 2, vz >> 2);
  return field.values[block * ISO_BLOCK_VOXELS + (vx & 3) + 4 * (vy & 3) + 16 * (vz & 3)];
}

/// The corners of dual cell (x,y,z) minus the isovalue, corner x + 2y + 4z.
inline void load_corners(const FrameParams &frame, const HostField &field, int x, int y, int z,
                         float *w) {
  for (int corner = 0; corner < 8; ++corner) {
    w[corner] = voxel_at(frame, field, x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)) -
                frame.surface.isovalue;
  }
}

/// Decodes the blocks that the voxels of a smooth gradient are in.
inline void decode_stencil(const FrameParams &frame, const HostField &field, const Stencil &s) {
  const BlockCoords base = stencil_base(&s);
  const uint corners = stencil_blocks(&s);
  std::size_t blocks[8], num_blocks = 0;
  bool all_decoded = true;
  for (uint corner = 0; corner < 8; ++corner) {
    if ((corners >> corner & 1u) == 0) continue;
    const std::size_t block = level_block_at(&frame, base.x + (corner & 1),
                                             base.y + (corner >> 1 & 1), base.z + (corner >> 2));
    blocks[num_blocks++] = block;
    all_decoded = all_decoded && field.is_decoded(block);
  }
  if (!all_decoded) field.maker->decode({blocks, num_blocks});
}

/// Is it a hit in this level of detail?
inline bool is_hit_of(const FrameParams &frame, const HitRecord &hit) {
  return hit.t != INFINITY && level_block_of(&frame, hit.block_id) != ISO_INVALID_ID;
}

/// Gives a hit the smooth gradient, if there is one. Caps keep theirs.
inline void smooth_gradient(const FrameParams &frame, const HostField &field, LastPlanes last,
                            HitRecord *hit) {
  if (is_cap(*hit)) return;
  const Stencil s = stencil_of(block_coords(&frame, hit->block_id), hit->cell, last);
  decode_stencil(frame, field, s);
  const StencilAxis axes[3] = {s.x, s.y, s.z};
  float corners[8], beyond[8], derivatives[3];
  for (uint axis = 0; axis < 3; ++axis) {
    for (int corner = 0; corner < 8; ++corner) {
      int at[3] = {s.x.cell + (corner & 1), s.y.cell + (corner >> 1 & 1), s.z.cell + (corner >> 2)};
      corners[corner] = voxel_at(frame, field, at[0], at[1], at[2]);
      at[axis] = (corner >> axis & 1) != 0 ? axes[axis].above : axes[axis].below;
      beyond[corner] = voxel_at(frame, field, at[0], at[1], at[2]);
    }
    derivatives[axis] =
        smooth_derivative(corners, beyond, 1u << axis, axes[axis], {hit->x, hit->y, hit->z});
  }
  if (is_no_gradient({derivatives[0], derivatives[1], derivatives[2]})) return;
  hit->grad_x = derivatives[0];
  hit->grad_y = derivatives[1];
  hit->grad_z = derivatives[2];
}

/// The first hit of a ray in a block's changing cells from `at` on, within its interval.
inline bool trace_cells(const FrameParams &frame, const HostField &field, const Ray &ray,
                        std::size_t block, CellWalk at, LastPlanes last, HitRecord *hit) {
  const ulong changing = field.changing[block];
  do {
    if (passes_border(at.exit, ray.end_t)) at.exit = border_event(ray.end_t);
    if ((changing >> cell_in_block(&at.cell) & 1u) == 0) continue;
    const int x = at.cell.x, y = at.cell.y, z = at.cell.z;
    float w[8];
    CellChange change;
    load_corners(frame, field, x, y, z, w);
    if (!change_in_cell(kDefaultSolver, &ray, w, x, y, z, at.enter, at.exit, &change)) continue;
    *hit = make_hit(&frame, &ray, w, x, y, z, at.enter, at.exit,
                    refine(kDefaultSolver, change.cubic, change.bracket));
    return true;
  } while (at.exit.axis != ISO_AXIS_START && next_cell(&at, &ray, last));
  return false;
}

/// The first hit of a ray in a block. enter: by which it enters the block.
inline bool trace_block(const FrameParams &frame, const HostField &field, const Ray &ray,
                        const GridWalk &block, RayEvent enter, LastPlanes last, HitRecord *hit) {
  const BlockCoords b = {static_cast<uint>(block.x), static_cast<uint>(block.y),
                         static_cast<uint>(block.z)};
  const std::size_t block_number = level_block_at(&frame, b.x, b.y, b.z);
  field.open(block_number);
  return trace_cells(frame, field, ray, block_number, enter_cells(&ray, b, enter, last), last, hit);
}

/// The block of a macrocell that the ray is in just after `enter`, by which it entered that.
inline GridWalk enter_macrocell(const Ray &ray, const GridWalk &macrocell, RayEvent enter,
                                LastPlanes last) {
  const auto block = [&](RayAxis a, int axis, int coarse, int last_plane) {
    const int first = coarse * ISO_MACROCELL_BLOCKS, end = first + ISO_MACROCELL_BLOCKS - 1,
              domain_end = (last_plane - 1) / 4;
    return locate(a, axis, enter, 4, first, end < domain_end ? end : domain_end);
  };
  return walk_from(&ray, block(ray.x, 0, macrocell.x, last.x), block(ray.y, 1, macrocell.y, last.y),
                   block(ray.z, 2, macrocell.z, last.z), 4, last);
}

/// The box of active blocks.
struct ActiveBox {
  LastPlanes begin, end;    ///< planes
  LastPlanes first, final;  ///< macrocells
};

inline ActiveBox active_box(const Surface &surface, LastPlanes last) {
  const auto end = [](int blocks, int last_plane) {
    return 4 * blocks < last_plane ? 4 * blocks : last_plane;
  };
  constexpr int kBlocks = ISO_MACROCELL_BLOCKS;
  return {{4 * surface.active_begin_x, 4 * surface.active_begin_y, 4 * surface.active_begin_z},
          {end(surface.active_end_x, last.x), end(surface.active_end_y, last.y),
           end(surface.active_end_z, last.z)},
          {surface.active_begin_x / kBlocks, surface.active_begin_y / kBlocks,
           surface.active_begin_z / kBlocks},
          {(surface.active_end_x - 1) / kBlocks, (surface.active_end_y - 1) / kBlocks,
           (surface.active_end_z - 1) / kBlocks}};
}

constexpr int kMacrocellVoxels = 4 * ISO_MACROCELL_BLOCKS;

/// The bits of a macrocell's blocks.
inline ulong macrocell_mask(const FrameParams &frame, const HostField &field,
                            const GridWalk &macrocell) {
  const uint columns = (frame.grid.blocks_x + 3) / 4, rows = (frame.grid.blocks_y + 3) / 4;
  return field.masks[static_cast<ulong>(macrocell.x) +
                     columns * (static_cast<ulong>(macrocell.y) +
                                static_cast<ulong>(rows) * static_cast<ulong>(macrocell.z))];
}

/// How a walk through a part of the volume ends.
enum class WalkEnd { kHit, kNoHit, kLeft };

/// Walks from block to block of a macrocell, `block` the first.
///
/// kTraceBlock  trace_block(), or a function of its own that calls it: it is long
/// enter    by which the ray enters that block; Out: by which it leaves the macrocell
/// Returns  kNoHit: its interval ends before that
template <auto kTraceBlock = trace_block>
inline WalkEnd walk_blocks(const FrameParams &frame, const HostField &field, LastPlanes last,
                           const Ray &ray, const GridWalk &macrocell, ulong mask, GridWalk block,
                           RayEvent *enter, HitRecord *hit) {
  for (;;) {
    if ((mask >> cell_in_block(&block) & 1u) != 0 &&
        kTraceBlock(frame, field, ray, block, *enter, last, hit))
      return WalkEnd::kHit;
    *enter = walk_exit(&block, &ray);
    if (passes_border(*enter, ray.end_t)) return WalkEnd::kNoHit;
    if (leaves(&block, &macrocell, *enter)) return WalkEnd::kLeft;
    walk_step(&block, &ray, *enter, 4, last);
  }
}

/// Walks from macrocell to macrocell, `coarse` the first, in those with an active block from block
/// to block, and in active blocks from cell to cell.
///
/// enter        by which the ray enters that macrocell
/// kTraceBlock  as walk_blocks()
template <auto kTraceBlock = trace_block>
inline bool walk_macrocells(const FrameParams &frame, const HostField &field, const ActiveBox &box,
                            LastPlanes last, const Ray &ray, GridWalk coarse, RayEvent enter,
                            HitRecord *hit) {
  while (coarse.x >= box.first.x && coarse.x <= box.final.x && coarse.y >= box.first.y &&
         coarse.y <= box.final.y && coarse.z >= box.first.z && coarse.z <= box.final.z) {
    const ulong mask = macrocell_mask(frame, field, coarse);
    if (mask == 0) {
      enter = walk_exit(&coarse, &ray);
      if (passes_border(enter, ray.end_t)) return false;
    } else {
      const WalkEnd end =
          walk_blocks<kTraceBlock>(frame, field, last, ray, coarse, mask,
                                   enter_macrocell(ray, coarse, enter, last), &enter, hit);
      if (end != WalkEnd::kLeft) return end == WalkEnd::kHit;
    }
    walk_step(&coarse, &ray, enter, kMacrocellVoxels, last);
  }
  return false;
}

/// The first hit of a ray in its interval in a level.
inline bool walk_ray(const FrameParams &frame, const HostField &field, const ActiveBox &box,
                     LastPlanes last, const Ray &ray, HitRecord *hit) {
  RayEvent enter = border_event(ray.begin_t), exit = border_event(ray.end_t);
  if (!clip_to_box(&ray, box.begin, box.end, &enter, &exit)) return false;
  const GridWalk first = walk_from(
      &ray, locate(ray.x, 0, enter, kMacrocellVoxels, box.first.x, box.final.x),
      locate(ray.y, 1, enter, kMacrocellVoxels, box.first.y, box.final.y),
      locate(ray.z, 2, enter, kMacrocellVoxels, box.first.z, box.final.z), kMacrocellVoxels, last);
  return walk_macrocells(frame, field, box, last, ray, first, enter, hit);
}

}  // namespace isowave::core
