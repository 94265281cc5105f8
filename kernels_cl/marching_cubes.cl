/// marching_cubes.cl -- triangles and vertices of listed blocks, whose values are cached
/// (Block-Compressed Marching Cubes, Usher and Pascucci 2020).
///
///   marching_cubes_count -> prefix sums of both counts -> marching_cubes_write
///
/// Counting looks at signs alone, 64 of them in a word. Vertices are numbered through all listed
/// blocks, in the order of the list, so that triangles name those of neighbours.
#include "device/dual_grid_inside.h"
#include "device/slot_values.h"
#include "device/work_group.h"
#include "portable/cells_with_data.h"
#include "portable/marching_cubes.h"

/// Entries [begin, end) of the list.
///
/// cell_triangles  [256 * ISO_CASE_BYTES] core/mesh/cell_triangles.hpp
/// index, no_data_begin  the table of no_data.h: NoDataTable
/// Out             edges, num_vertices, num_triangles [list]
/// Launch          grid-stride over entries
kernel void marching_cubes_count(const FrameParams frame_params, uint begin, uint end,
                                 global const uint *block_ids, global const uint *table,
                                 global const ulong *inside, global const uchar *cell_triangles,
                                 global const uint *index, uint no_data_begin,
                                 global BlockEdges *edges, global uint *num_vertices,
                                 global uint *num_triangles) {
  const FrameParams *frame = &frame_params;
  const BlockGrid grid = frame_params.grid;
  const NoDataTable no_data = {index, no_data_begin};
  for (uint i = begin + get_global_id(0); i < end; i += get_global_size(0)) {
    const BlockCoords b = block_coords(frame, block_ids[i]);
    ulong of_blocks[8], v[8];
    dual_grid_inside(frame, table, inside, b, of_blocks);
    corners_inside(of_blocks, v);
    const BlockEdges own = edges_with_data(frame, &grid, no_data, b, crossed_edges(&grid, b, v));
    edges[i].x = own.x;
    edges[i].y = own.y;
    edges[i].z = own.z;
    num_vertices[i] = vertex_count(own);
    num_triangles[i] =
        count_triangles(cells_with_data(frame, &grid, no_data, b), of_blocks, v, cell_triangles);
  }
}

/// The cached neighbourhood of a block.
typedef struct Neighbourhood {
  local const uint *slots; /* [27] of blocks -1 .. 1 along x, y, z */
  global const SlotValue *values;
} Neighbourhood;

/// The voxel (x,y,z), -4 .. 7 along each axis, counted from the block's first one.
ISO_INLINE float voxel_near(const Neighbourhood *n, int x, int y, int z) {
  const uint vx = (uint)(x + 4), vy = (uint)(y + 4), vz = (uint)(z + 4);
  const uint slot = n->slots[(vx >> 2) + 3 * (vy >> 2) + 9 * (vz >> 2)];
  return n->values[slot * ISO_BLOCK_VOXELS + (vx & 3) + 4 * (vy & 3) + 16 * (vz & 3)];
}

/// The central differences at a voxel of block b or next to it; one-sided at the domain's border.
ISO_INLINE void voxel_gradient(const BlockGrid *grid, const Neighbourhood *n, BlockCoords b, int x,
                               int y, int z, float *gradient) {
  const int px = (int)(4 * b.x) + x, py = (int)(4 * b.y) + y, pz = (int)(4 * b.z) + z;
  const int last_x = (int)grid->dims_x - 1, last_y = (int)grid->dims_y - 1,
            last_z = (int)grid->dims_z - 1;
  const float at = ISO_NO_DATA ? voxel_near(n, x, y, z) : 0.0f; /* not read without */
  gradient[0] = derivative_with_data(voxel_near(n, x - (px > 0), y, z), at,
                                     voxel_near(n, x + (px < last_x), y, z), px, last_x);
  gradient[1] = derivative_with_data(voxel_near(n, x, y - (py > 0), z), at,
                                     voxel_near(n, x, y + (py < last_y), z), py, last_y);
  gradient[2] = derivative_with_data(voxel_near(n, x, y, z - (pz > 0)), at,
                                     voxel_near(n, x, y, z + (pz < last_z)), pz, last_z);
}

/// Block b of a list, and those behind it (x + 2y + 4z) whose vertices its triangles have.
typedef struct ListedBlocks {
  local const uint *first_vertex;                 /* [8] on the list, of each block */
  local const ulong *edges_x, *edges_y, *edges_z; /* [8] BlockEdges */
} ListedBlocks;

/// The place of a block in the list of blocks, ISO_INVALID_ID: it is not there.
ISO_INLINE uint listed_entry(const BlockGrid *grid, global const uint *listed_masks,
                             global const uint *listed_offsets, uint x, uint y, uint z) {
  const uint coarse_x = (grid->blocks_x + 3) / 4, coarse_y = (grid->blocks_y + 3) / 4;
  const uint coarse = x / 4 + coarse_x * (y / 4 + coarse_y * (z / 4));
  const uint bit = (x & 3) + 4 * (y & 3) + 16 * (z & 3);
  const ulong mask = (ulong)listed_masks[2 * coarse + 1] << 32 | listed_masks[2 * coarse];
  if ((mask >> bit & 1) == 0) return ISO_INVALID_ID;
  return listed_offsets[coarse] + count_bits(mask & (((ulong)1 << bit) - 1));
}

/// Writes the vertex on the edge of a voxel along an axis.
///
/// entry     of the block in the batch
/// gradient  [3] not written unless with_gradients
ISO_INLINE void write_vertex(const FrameParams *frame, const Neighbourhood *n, BlockCoords b,
                             uint entry, uint voxel, uint axis, uint with_gradients,
                             global MeshVertex *vertex, global float *gradient) {
  const int x = voxel & 3, y = voxel >> 2 & 3, z = voxel >> 4;
  const int ux = x + (axis == 0), uy = y + (axis == 1), uz = z + (axis == 2);
  const float lower = voxel_near(n, x, y, z), upper = voxel_near(n, ux, uy, uz);
  const float t = edge_crossing(lower, upper, frame->surface.isovalue);
  vertex->edge = entry << ISO_VERTEX_BLOCK_SHIFT | axis << 6 | voxel;
  vertex->t = t;
  if (with_gradients != 0) {
    float at_lower[3], at_upper[3];
    voxel_gradient(&frame->grid, n, b, x, y, z, at_lower);
    voxel_gradient(&frame->grid, n, b, ux, uy, uz, at_upper);
    const Gradient g = vertex_gradient(at_lower, at_upper, t, axis, upper - lower);
    gradient[0] = g.x;
    gradient[1] = g.y;
    gradient[2] = g.z;
  }
}

/// The number on the list of a vertex of the cell of a voxel.
ISO_INLINE uint vertex_number(const ListedBlocks *blocks, uint voxel, uint edge) {
  const uint corner = edge_corner(edge);
  const uint x = (voxel & 3) + (corner & 1), y = (voxel >> 2 & 3) + (corner >> 1 & 1),
             z = (voxel >> 4) + (corner >> 2);
  const uint block = (x >> 2) + 2 * (y >> 2) + 4 * (z >> 2);
  return blocks->first_vertex[block] + vertex_rank(blocks->edges_x[block], blocks->edges_y[block],
                                                   blocks->edges_z[block], edge_axis(edge),
                                                   (x & 3) + 4 * (y & 3) + 16 * (z & 3));
}

/// Entries [begin, end) of the list, a work-group each, in rows of a work-item for each voxel and
/// its cell.
///
/// listed_masks, listed_offsets  of active_blocks.cl
/// index, no_data_begin          as marching_cubes_count
/// edges                         [list] of marching_cubes_count
/// vertex_offsets                [list + 1] prefix sums of its counts; triangle_offsets as well
/// with_gradients                0: gradients are not written
/// Out     from the first vertex and triangle of entry `begin` on: vertices, gradients (x, y, z of
///         each), triangles, which name vertices by their number among those of the whole list
/// Launch  groups of up to 64, which stride over entries
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void marching_cubes_write(
    const FrameParams frame_params, uint begin, uint end, uint with_gradients,
    global const uint *block_ids, global const uint *listed_masks,
    global const uint *listed_offsets, global const uint *table,
    global const SlotValue *cache_values, global const ulong *inside,
    global const uchar *cell_triangles, global const uint *index, uint no_data_begin,
    global const BlockEdges *edges, global const uint *vertex_offsets,
    global const uint *triangle_offsets, global MeshVertex *vertices, global float *gradients,
    global MeshTriangle *triangles) {
  const FrameParams *frame = &frame_params;
  const BlockGrid grid = frame_params.grid;
  local uint slots[27], first_vertex[8], sums[ISO_GROUP_SIZE];
  local ulong edges_x[8], edges_y[8], edges_z[8], of_blocks[8];
  const uint item = get_local_id(0);
  const Neighbourhood near_block = {slots, cache_values};
  const ListedBlocks blocks = {first_vertex, edges_x, edges_y, edges_z};
  const NoDataTable no_data = {index, no_data_begin};
  for (uint i = begin + get_group_id(0); i < end; i += get_num_groups(0)) {
    const BlockCoords b = block_coords(frame, block_ids[i]);
    barrier(CLK_LOCAL_MEM_FENCE); /* all are through with the block before */
    for (uint n = item; n < 27; n += ISO_GROUP_SIZE) {
      const uint nx = b.x + n % 3 - 1, ny = b.y + n / 3 % 3 - 1, nz = b.z + n / 9 - 1;
      slots[n] = nx < grid.blocks_x && ny < grid.blocks_y && nz < grid.blocks_z
                     ? cached_slot(frame, table, nx, ny, nz)
                     : ISO_BLOCK_ABSENT;
    }
    for (uint n = item; n < 8; n += ISO_GROUP_SIZE) {
      const uint nx = b.x + (n & 1), ny = b.y + (n >> 1 & 1), nz = b.z + (n >> 2);
      uint entry = ISO_INVALID_ID, slot = ISO_BLOCK_ABSENT;
      if (dual_grid_block(frame, b, n) != ISO_INVALID_ID) {
        entry = listed_entry(&grid, listed_masks, listed_offsets, nx, ny, nz);
        slot = cached_slot(frame, table, nx, ny, nz);
      }
      of_blocks[n] = slot == ISO_BLOCK_ABSENT ? 0 : inside[slot];
      first_vertex[n] = entry == ISO_INVALID_ID ? 0 : vertex_offsets[entry];
      edges_x[n] = entry == ISO_INVALID_ID ? 0 : edges[entry].x;
      edges_y[n] = entry == ISO_INVALID_ID ? 0 : edges[entry].y;
      edges_z[n] = entry == ISO_INVALID_ID ? 0 : edges[entry].z;
    }
    barrier(CLK_LOCAL_MEM_FENCE);

    const ulong cells = cells_with_data(frame, &grid, no_data, b);
    const uint first_of_batch = vertex_offsets[begin];
    uint before = triangle_offsets[i] - triangle_offsets[begin]; /* triangles of the rows before */
    for (uint row = 0; row < ISO_BLOCK_VOXELS; row += ISO_GROUP_SIZE) {
      const uint voxel = row + item;
      for (uint axis = 0; axis < 3; ++axis) {
        const ulong own = axis == 0 ? edges_x[0] : axis == 1 ? edges_y[0] : edges_z[0];
        if ((own >> voxel & 1) != 0) {
          const uint place = first_vertex[0] - first_of_batch +
                             vertex_rank(edges_x[0], edges_y[0], edges_z[0], axis, voxel);
          write_vertex(frame, &near_block, b, i - begin, voxel, axis, with_gradients,
                       &vertices[place], gradients + 3 * place);
        }
      }

      uint total;
      const uint signs = signs_of_cell(cells, of_blocks, voxel & 3, voxel >> 2 & 3, voxel >> 4);
      global const uchar *own_triangles = cell_triangles + ISO_CASE_BYTES * signs;
      const uint num_triangles = own_triangles[0];
      const uint place = before + group_scan(sums, num_triangles, &total);
      for (uint triangle = 0; triangle < num_triangles; ++triangle) {
        global const uchar *own_edges = own_triangles + 1 + 3 * triangle;
        triangles[place + triangle].a = vertex_number(&blocks, voxel, own_edges[0]);
        triangles[place + triangle].b = vertex_number(&blocks, voxel, own_edges[1]);
        triangles[place + triangle].c = vertex_number(&blocks, voxel, own_edges[2]);
      }
      before += total;
    }
  }
}
