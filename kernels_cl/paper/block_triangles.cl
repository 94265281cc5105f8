/// block_triangles.cl -- triangles of listed blocks, whose values are cached, with vertices of
/// their own (Block-Compressed Marching Cubes, Usher and Pascucci 2020).
///
///   block_triangles_count -> prefix sum of the counts -> block_triangles_write
///
/// Triangles that are only drawn need no more than that: no neighbour's vertices, and no gradients.
/// marching_cubes.cl makes meshes whose triangles share their vertices.
#include "device/dual_grid_inside.h"
#include "device/slot_values.h"
#include "device/work_group.h"
#include "portable/block_vertex.h"
#include "portable/cells_with_data.h"
#include "portable/marching_cubes.h"

/// Entries [begin, end) of the list.
///
/// cell_triangles  [256 * ISO_CASE_BYTES] core/mesh/cell_triangles.hpp
/// index, no_data_begin  the table of no_data.h: NoDataTable
/// Out             num_triangles: of entry i at i - first
/// Launch          grid-stride over entries
kernel void block_triangles_count(const FrameParams frame_params, uint begin, uint end, uint first,
                                  global const uint *block_ids, global const uint *table,
                                  global const ulong *inside, global const uchar *cell_triangles,
                                  global const uint *index, uint no_data_begin,
                                  global uint *num_triangles) {
  const FrameParams *frame = &frame_params;
  const BlockGrid grid = frame_params.grid;
  const NoDataTable no_data = {index, no_data_begin};
  for (uint i = begin + get_global_id(0); i < end; i += get_global_size(0)) {
    const BlockCoords b = block_coords(frame, block_ids[i]);
    ulong of_blocks[8], v[8];
    dual_grid_inside(frame, table, inside, b, of_blocks);
    corners_inside(of_blocks, v);
    num_triangles[i - first] =
        count_triangles(cells_with_data(frame, &grid, no_data, b), of_blocks, v, cell_triangles);
  }
}

/// Voxel (x,y,z) of a dual grid, 0 to 4 along each axis. slots [8]: of its blocks.
ISO_INLINE float dual_grid_voxel(local const uint *slots, global const SlotValue *values, uint x,
                                 uint y, uint z) {
  const uint slot = slots[(x >> 2) + 2 * (y >> 2) + 4 * (z >> 2)];
  return values[slot * ISO_BLOCK_VOXELS + (x & 3) + 4 * (y & 3) + 16 * (z & 3)];
}

/// The vertex on an edge of cell (x,y,z) of a block.
ISO_INLINE uint edge_steps(local const uint *slots, global const SlotValue *values, float isovalue,
                           uint x, uint y, uint z, uint edge) {
  const uint corner = edge_corner(edge), axis = edge_axis(edge);
  const uint lx = x + (corner & 1), ly = y + (corner >> 1 & 1), lz = z + (corner >> 2);
  const float t = edge_crossing(
      dual_grid_voxel(slots, values, lx, ly, lz),
      dual_grid_voxel(slots, values, lx + (axis == 0), ly + (axis == 1), lz + (axis == 2)),
      isovalue);
  return pack_steps((float)lx + (axis == 0 ? t : 0.0f), (float)ly + (axis == 1 ? t : 0.0f),
                    (float)lz + (axis == 2 ? t : 0.0f));
}

/// Entries [begin, end) of the list, a work-group each, in rows of a work-item for each cell.
///
/// index, no_data_begin  as block_triangles_count
/// offsets  prefix sums of the counts: of entry i at i - first
/// Out      vertices [3 * triangles]: triangle offsets[i - first] + k - skipped for the k-th of
///          entry i, counter-clockwise seen from where values are lower
/// Launch   groups of up to 64, which stride over entries
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void block_triangles_write(
    const FrameParams frame_params, uint begin, uint end, uint first, uint skipped,
    global const uint *block_ids, global const uint *table, global const SlotValue *cache_values,
    global const ulong *inside, global const uchar *cell_triangles, global const uint *index,
    uint no_data_begin, global const uint *offsets, global BlockVertex *vertices) {
  const FrameParams *frame = &frame_params;
  const BlockGrid grid = frame_params.grid;
  const NoDataTable no_data = {index, no_data_begin};
  local uint slots[8], sums[ISO_GROUP_SIZE];
  local ulong of_blocks[8];
  const uint item = get_local_id(0);
  for (uint i = begin + get_group_id(0); i < end; i += get_num_groups(0)) {
    const uint block_id = block_ids[i];
    const BlockCoords b = block_coords(frame, block_id);
    barrier(CLK_LOCAL_MEM_FENCE); /* all are through with the block before */
    for (uint n = item; n < 8; n += ISO_GROUP_SIZE) {
      slots[n] = ISO_BLOCK_ABSENT;
      if (dual_grid_block(frame, b, n) != ISO_INVALID_ID)
        slots[n] = cached_slot(frame, table, b.x + (n & 1), b.y + (n >> 1 & 1), b.z + (n >> 2));
      of_blocks[n] = slots[n] == ISO_BLOCK_ABSENT ? 0 : inside[slots[n]];
    }
    barrier(CLK_LOCAL_MEM_FENCE);

    const ulong cells = cells_with_data(frame, &grid, no_data, b);
    uint before = offsets[i - first] - skipped; /* triangles of the rows before */
    for (uint row = 0; row < ISO_BLOCK_VOXELS; row += ISO_GROUP_SIZE) {
      const uint cell = row + item, x = cell & 3, y = cell >> 2 & 3, z = cell >> 4;
      uint total;
      const uint signs = signs_of_cell(cells, of_blocks, x, y, z);
      global const uchar *own_triangles = cell_triangles + ISO_CASE_BYTES * signs;
      const uint num_triangles = own_triangles[0];
      const uint place = before + group_scan(sums, num_triangles, &total);
      for (uint k = 0; k < 3 * num_triangles; ++k) {
        vertices[3 * place + k].steps =
            edge_steps(slots, cache_values, frame->surface.isovalue, x, y, z, own_triangles[1 + k]);
        vertices[3 * place + k].block_id = block_id;
      }
      before += total;
    }
  }
}
