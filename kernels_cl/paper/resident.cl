/// resident.cl -- the floor that benchmarks compare with: the whole volume is decoded, and one
/// launch draws the frame.
///
/// The macrocell masks, walks and cells are those of the pipelines, and so are the bits of the
/// picture; what is missing is all that a bounded memory costs: cache, table, requests, passes.
///
/// values [num_blocks * 64]: block after block in the order of their ids, x + 4y + 16z in a block.
/// Against rows of the whole volume, a cell's corners lie in two to four cache lines instead of
/// four to eight, and a ray's next cell mostly in the same.
#include "device/block_stream.h"
#include "device/block_walk.h"
#include "portable/block_cells.h"
#include "portable/cell_intersect.h"

/// Decodes blocks [first_block, first_block + num_blocks) of the zfp stream, see block_stream.h.
/// Once per volume. Grid-stride.
kernel void resident_decode(global const uint *part_0, global const uint *part_1,
                            global const uint *part_2, global const uint *part_3,
                            global const uint *index, const StreamLayout layout, uint first_block,
                            uint num_blocks, global float *values) {
  for (uint i = get_global_id(0); i < num_blocks; i += get_global_size(0)) {
    const uint block_id = first_block + i;
    float block[ISO_BLOCK_VOXELS];
    decode_block(part_0, part_1, part_2, part_3, index, layout, block_id, 0, block);
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
      values[(ulong)block_id * ISO_BLOCK_VOXELS + v] = block[v];
  }
}

/// inside [num_blocks]: bit x + 4y + 16z of each block: is the voxel inside, value >= isovalue?
/// Once per isovalue. Grid-stride.
kernel void resident_inside(const FrameParams frame_params, uint num_blocks,
                            global const float *values, global ulong *inside) {
  const FrameParams *frame = &frame_params;
  for (uint block_id = get_global_id(0); block_id < num_blocks; block_id += get_global_size(0)) {
    ulong bits = 0;
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v) {
      const float value = values[(ulong)block_id * ISO_BLOCK_VOXELS + v];
      bits |= (ulong)(value - frame->surface.isovalue >= 0.0f) << v;
    }
    inside[block_id] = bits;
  }
}

/// changing [num_blocks]: bit x + 4y + 16z: has the cell of that block corners on both sides?
/// Blocks beyond the volume matter to cells outside it alone: any block stands for them. Once per
/// isovalue. Grid-stride.
kernel void resident_changing(const FrameParams frame_params, uint num_blocks,
                              global const ulong *inside, global ulong *changing) {
  const FrameParams *frame = &frame_params;
  for (uint block_id = get_global_id(0); block_id < num_blocks; block_id += get_global_size(0)) {
    const BlockCoords b = block_coords(frame, block_id);
    ulong bits[8];
    for (uint corner = 0; corner < 8; ++corner) {
      bits[corner] = inside[block_id_at(frame, min(b.x + (corner & 1), frame->grid.blocks_x - 1),
                                        min(b.y + (corner >> 1 & 1), frame->grid.blocks_y - 1),
                                        min(b.z + (corner >> 2), frame->grid.blocks_z - 1))];
    }
    changing[block_id] = changing_cells(bits);
  }
}

/// The corners of dual cell (x,y,z) minus the isovalue, corner x + 2y + 4z.
ISO_INLINE void resident_corners(const FrameParams *frame, global const float *values, int x, int y,
                                 int z, float *w) {
  for (int corner = 0; corner < 8; ++corner) {
    const uint vx = (uint)(x + (corner & 1)), vy = (uint)(y + (corner >> 1 & 1)),
               vz = (uint)(z + (corner >> 2));
    const ulong block_id = block_id_at(frame, vx >> 2, vy >> 2, vz >> 2);
    w[corner] = values[block_id * ISO_BLOCK_VOXELS + (vx & 3) + 4 * (vy & 3) + 16 * (vz & 3)] -
                frame->surface.isovalue;
  }
}

/// A change of inside, or doubt, in a cell of a block.
typedef struct ResidentChange {
  CellWalk at;
  float w[8];
  CellChange change;
} ResidentChange;

/// Walks on from cell found->at to the next change of inside in the block's `changing` cells, in
/// float. Returns 1, ISO_DOUBTFUL, or 0 when the ray has left the block.
ISO_INLINE int walk_to_change(const FrameParams *frame, global const float *values, const Ray *ray,
                              LastPlanes last, ulong changing, ResidentChange *found) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  const GridWalk *cell = &found->at.cell;
  int result = 0;
  do {
    if ((changing >> cell_in_block(cell) & 1ul) != 0) {
      resident_corners(frame, values, cell->x, cell->y, cell->z, found->w);
      result = change_or_doubt_in_cell(solver, ray, found->w, cell->x, cell->y, cell->z,
                                       found->at.enter, found->at.exit, &found->change);
    }
  } while (!result && next_cell(&found->at, ray, last));
  return result;
}

/// Is there a change of inside on the ray's way through block b, of which those cells change?
ISO_INLINE int resident_block(const FrameParams *frame, global const float *values, ulong changing,
                              const Ray *ray, BlockCoords b, LastPlanes last,
                              ResidentChange *found) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  int result;
  if (changing == 0) return 0;
  found->at = enter_cells(ray, b, region_entry(ray, (int)b.x, (int)b.y, (int)b.z, 4, last), last);
  result = walk_to_change(frame, values, ray, last, changing, found);
  while (result == ISO_DOUBTFUL) { /* rare: its 48-bit arithmetic stays out of the loop of cells */
    const GridWalk *cell = &found->at.cell;
    result = change_in_cell(solver, ray, found->w, cell->x, cell->y, cell->z, found->at.enter,
                            found->at.exit, &found->change);
    if (!result && next_cell(&found->at, ray, last))
      result = walk_to_change(frame, values, ray, last, changing, found);
  }
  return result;
}

/// The frame: hits [pixel]. macrocell_masks: as traverse(). One work-item per pixel, in whole tiles
/// of 8 x 4 pixels.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void resident(
    const FrameParams frame_params, global const uint *macrocell_masks, global const float *values,
    global const ulong *changing, global HitRecord *hits) {
  const FrameParams *frame = &frame_params;
  ISO_SCRATCH_ARRAY(found, ISO_BLOCKS_AT_ONCE);
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  const LastPlanes last = last_planes(frame);
  const PixelBox image = {0, 0, frame->view.width, frame->view.height};
  const uint pixel = tiled_pixel(frame, image, get_global_id(0));
  if (pixel != ISO_INVALID_ID) {
    const uint column = pixel % frame->view.width, row = pixel / frame->view.width;
    const int in_box = column >= frame->screen.begin_x && column < frame->screen.end_x &&
                       row >= frame->screen.begin_y && row < frame->screen.end_y;
    const Ray ray = make_ray(frame, pixel);
    uint next = in_box ? first_block(frame, &ray) : ISO_INVALID_ID;
    int hit = 0;
    ResidentChange change;
    while (next != ISO_INVALID_ID && !hit) {
      const uint num_found = find_blocks(frame, macrocell_masks, &ray, &next, ISO_BLOCKS_AT_ONCE,
                                         found, ISO_SCRATCH_STRIDE);
      for (uint i = 0; i < num_found && !hit; ++i) {
        const uint block_id = found[i * ISO_SCRATCH_STRIDE];
        hit = resident_block(frame, values, changing[block_id], &ray, block_coords(frame, block_id),
                             last, &change);
      }
    }
    const GridWalk *cell = &change.at.cell;
    hits[pixel] =
        hit ? make_hit(frame, &ray, change.w, cell->x, cell->y, cell->z, change.at.enter,
                       change.at.exit, refine(solver, change.change.cubic, change.change.bracket))
            : no_hit();
  }
}
