/// shared_types.h -- the only structs and constants that cross the host/device border.
/// Scalars only: no float3 (16 bytes in OpenCL C, 12 in GLM), bool, size_t, pointers or bit-fields.
#ifndef ISOWAVE_SHARED_TYPES_H
#define ISOWAVE_SHARED_TYPES_H

#ifdef __OPENCL_C_VERSION__    /* offline clang sets this one, not __OPENCL_VERSION__ */
#pragma OPENCL FP_CONTRACT OFF /* once, for every kernel: device bits must be host bits */
#define ISO_CHECK_SIZE(T, n) typedef char T##_has_wrong_size[sizeof(T) == (n) ? 1 : -1]
#define ISO_NAMESPACE_BEGIN
#define ISO_NAMESPACE_END
#define ISO_GLOBAL global      ///< address space of buffers
#define ISO_CONSTANT constant  ///< address space of tables
/// In a kernel's parameters: the host's buffer has elements of the struct T, and the kernel takes
/// them as words (README.md of kernels_cl: a cast from the struct is what Mesa rusticl gets wrong).
#define ISO_WORDS(T) uint
#ifndef ISO_UNROLL /* by -D: empty if it makes programs slower to compile, not to run */
#define ISO_UNROLL _Pragma("unroll")
#endif
#ifdef ISO_CPU /* the host says so, of PoCL and llvmpipe: PoCL would call functions in inner \
                  loops, which takes a fifth longer */
#define ISO_INLINE static inline __attribute__((always_inline))
#else /* Oclgrind, too, which knows no scopes of inlined arguments */
#define ISO_INLINE static inline
#endif
#ifdef ISO_CALLS /* the host says so, of PoCL */
/// A long function that is called once a block or a ray. PoCL compiles the text of a kernel three
/// times, and such a function once. Give it no pointer to local memory, which all threads would
/// then share, and do not let it ask for its work-item.
#define ISO_LONG static __attribute__((noinline, unused))
/// Scratch of a work-item: private on PoCL, else in local memory, elements of a work-item
/// ISO_SCRATCH_STRIDE apart. Private arrays are slow on GPUs, and slow to compile on llvmpipe.
#define ISO_SCRATCH private
#define ISO_SCRATCH_STRIDE 1u
#define ISO_SCRATCH_ARRAY(name, count) uint name[count]
#else
#define ISO_LONG ISO_INLINE
#define ISO_SCRATCH local
#define ISO_SCRATCH_STRIDE ISO_GROUP_SIZE
#define ISO_SCRATCH_ARRAY(name, count)                \
  local uint name##_of_group[(count)*ISO_GROUP_SIZE]; \
  local uint *const name = name##_of_group + get_local_id(0)
#endif
#else
#include <bit>
#include <cmath>
#include <cstdint>
#if !defined(__GLIBC__) && !defined(__FP_FAST_FMAF)
#include <kernels_cl/portable/fma_by_double.h>  // <>: not put into kernels
#endif
#define ISO_CHECK_SIZE(T, n) static_assert(sizeof(T) == (n), #T " layout changed")
#define ISO_NAMESPACE_BEGIN namespace isowave::core {
#define ISO_NAMESPACE_END }
#define ISO_GLOBAL
#define ISO_CONSTANT
#define ISO_UNROLL
#define ISO_INLINE static inline
#define ISO_LONG ISO_INLINE
#endif

ISO_NAMESPACE_BEGIN

#ifndef __OPENCL_C_VERSION__
using uint = std::uint32_t;
using ulong = std::uint64_t;
using ushort = std::uint16_t;
using uchar = std::uint8_t;
using std::ceil;
using std::fabs;
using std::floor;
#ifdef ISOWAVE_FMA_BY_DOUBLE_H
inline float fma(float a, float b, float c) {
  return fma_by_double(a, b, c);
}
#else
using std::fma;
#endif
using std::rint;
using std::sqrt;
inline uint popcount(uint x) {
  return static_cast<uint>(std::popcount(x));
}
#endif

#define ISO_INVALID_ID 0xFFFFFFFFu   ///< "no block", "no ray": UINT_MAX in R_BID (Sec. 3.3)
#define ISO_BLOCK_VOXELS 64u         ///< 4^3
#define ISO_MAX_SPECULATION 64u      ///< cap of N_spec (Sec. 4)
#define ISO_MACROCELL_BLOCKS 4       ///< blocks along the edge of a coarse macrocell: 16 voxels
#define ISO_DUAL_GRID_VERTICES 125u  ///< 5^3
/// Work-items that each one stands for, if a device gives a kernel smaller groups than its stage
/// asks for: a tile keeps its length, and each of the fewer work-items has more of it.
#ifndef ISO_GROUP_SHARE
#define ISO_GROUP_SHARE 1u
#endif
#define ISO_SCAN_ITEMS (8u * ISO_GROUP_SHARE)   ///< entries per work-item and tile in scan.cl
#define ISO_GROUP_ITEMS (4u * ISO_GROUP_SHARE)  ///< pairs per work-item and tile in group.cl
#define ISO_EVICTION_RANKS 256u  ///< orders of eviction that the cache tells apart (slot_stamps.h)

#ifndef ISO_CHECK_RACES /* by -D, from tests/run_under_oclgrind.sh */
#define ISO_CHECK_RACES                                                                      \
  0 /* 1: what work-items share without order, since any outcome is right, is ordered or not \
       shared */
#endif

#ifndef ISO_BRICKS /* by -D, of devices that draw bricks: ocl::Device::draw_bricks() */
#ifdef __OPENCL_C_VERSION__
#define ISO_BRICKS 0 /* BrickPlace is all zero, which takes 1 to 2 % less time */
#else
#define ISO_BRICKS 1
#endif
#endif

#ifndef ISO_LABELS   /* by -D, of renderers of labels (core/frame/labels.hpp) */
#define ISO_LABELS 0 /* 1: voxels are labels, and values in the cache are bit masks of groups */
#endif

#ifndef ISO_NO_DATA /* by -D, of devices that draw such volumes: ocl::Device::draw_no_data() */
#ifdef __OPENCL_C_VERSION__
#define ISO_NO_DATA 0 /* no voxel is NaN */
#else
#define ISO_NO_DATA 1
#endif
#endif

#ifndef ISO_LEVELS /* by -D */
#define ISO_LEVELS \
  0 /* 1: frames are drawn in bands of several levels of detail (core/view/detail.hpp) */
#endif

#ifndef ISO_GIVEN_RAYS /* by -D */
#define ISO_GIVEN_RAYS                                                                            \
  0 /* 1: rays are read from a list (GivenRay) instead of made from the camera; each stays in one \
       level of detail */
#endif

#ifndef ISO_BEHIND_HITS   /* by -D */
#define ISO_BEHIND_HITS 0 /* 1: rays of the camera go on behind hits that they have (layers.h) */
#endif
#define ISO_BANDS (ISO_LEVELS && !ISO_GIVEN_RAYS) /* rays go from level to level */

#ifndef ISO_CLIP /* by -D */
#ifdef __OPENCL_C_VERSION__
#define ISO_CLIP 0 /* 1: rays of the camera are clipped (clip.h) */
#else
#define ISO_CLIP 1
#endif
#endif
#define ISO_INTERVALS                                                         \
  (ISO_BANDS || ISO_CLIP) /* rays begin and end elsewhere than at 0, INFINITY \
                           */

/// The voxels of a volume, or of one of its levels of detail, and the blocks that hold them.
typedef struct BlockGrid {
  uint dims_x, dims_y, dims_z;        ///< voxels; dual cells are one fewer
  uint blocks_x, blocks_y, blocks_z;  ///< blocks of 4^3 voxels, partial ones counted
} BlockGrid;
ISO_CHECK_SIZE(BlockGrid, 24);

/// The places of a level's blocks, ranges and masks among those of all levels of detail. Ids of
/// blocks count on through all levels: block (x,y,z) of this one is number
/// x + blocks_x (y + blocks_y (begin_z + z)).
typedef struct LevelPlace {
  uint blocks_x, blocks_y;         ///< blocks of the finest level
  uint begin_z;                    ///< layers of blocks of the levels before this one
  uint ranges_begin, masks_begin;  ///< first entries of this level (macrocells.cl)
} LevelPlace;
ISO_CHECK_SIZE(LevelPlace, 20);

/// A brick of a volume: a box of its blocks, drawn by itself, with the blocks around that its cells
/// and normals have voxels of. All that a frame counts is the brick's own, blocks and cells from
/// its first on; rays, eye and planes stay in the index space of the whole volume. All zero: a
/// volume that is not cut.
typedef struct BrickPlace {
  float origin_x, origin_y, origin_z;  ///< the brick's first voxel, multiples of 4 [voxels]
  /// Layers of its blocks, before and behind along each axis, that are other bricks': no surface is
  /// looked for in them.
  uint before_x, before_y, before_z, behind_x, behind_y, behind_z;
} BrickPlace;
ISO_CHECK_SIZE(BrickPlace, 36);

/// The camera and the rays of its picture.
typedef struct View {
  uint width, height;         ///< rays: those of the image, or several for each of its pixels along
                              ///< both axes
  float eye_x, eye_y, eye_z;  ///< camera position, index space; of parallel rays, the middle of
                              ///< the plane that they start in
  /// Camera basis mapped to index space, divided by t_scale (see make_ray).
  float fwd_x, fwd_y, fwd_z, right_x, right_y, right_z, up_x, up_y, up_z;
  /// Half a ray's step of u and v: tan(fovy / 2) / height; of parallel rays, half of their distance
  /// [t of the kernels].
  float pixel_scale;
  float t_scale;     ///< power of two: ray parameter t of the kernels -> world units
  uint is_parallel;  ///< 1: all rays have the direction fwd, and start at eye + u right + v up
  uint stride;       ///< above 1: the rays are a sample of those of a frame, see place_of_ray()
} View;
ISO_CHECK_SIZE(View, 72);

/// The part of the rays that one level of detail draws [t of the kernels].
typedef struct Band {
  float begin_t, end_t;
} Band;
ISO_CHECK_SIZE(Band, 8);

#define ISO_MAX_CLIP_PLANES 14  ///< eight planes and a box

/// A clipping plane. Distances from it are positive on the side that stays [world units /
/// ClipParams::t_scale].
typedef struct PlaneParams {
  float eye;             ///< distance of the eye; of parallel rays, of the middle of their plane
  float fwd, right, up;  ///< its growth along the axes of the camera, of length 1
  float grad_x, grad_y, grad_z;  ///< its growth for each voxel of the finest level
  float first_voxel;             ///< distance of voxel (0,0,0)
} PlaneParams;
ISO_CHECK_SIZE(PlaneParams, 32);

/// The part of a volume that is drawn (clip.h): what is in front of all planes.
typedef struct ClipParams {
  PlaneParams planes[ISO_MAX_CLIP_PLANES];
  uint num_planes;
  uint with_caps;  ///< 1: what is inside the surface hits where it is cut
  float t_scale;   ///< View::t_scale of the finest level
} ClipParams;
ISO_CHECK_SIZE(ClipParams, 460);

/// The isosurface, and the box of its blocks.
typedef struct Surface {
  float isovalue;
  uint isovalue_index;  ///< the first threshold of macrocells.cl that is >= it; of a renderer of
                        ///< labels, the number of its group
  /// Box around the active blocks, whole macrocells: from begin to below end [blocks]; empty if
  /// active_end_x = 0.
  int active_begin_x, active_begin_y, active_begin_z, active_end_x, active_end_y, active_end_z;
} Surface;
ISO_CHECK_SIZE(Surface, 32);

/// The rays that may meet the box of the active blocks, in whole tiles of 8 x 4: from begin to
/// below end.
typedef struct ScreenBox {
  uint begin_x, begin_y, end_x, end_y;
} ScreenBox;
ISO_CHECK_SIZE(ScreenBox, 16);

/// Types of the values in cache slots: integers, or masks of the groups of labels.
#define ISO_SLOTS_FLOAT32 0u
#define ISO_SLOTS_UINT8 1u
#define ISO_SLOTS_INT8 2u
#define ISO_SLOTS_UINT16 3u
#define ISO_SLOTS_INT16 4u
#define ISO_SLOTS_GROUPS 5u

/// How passes share out rays and cache slots.
typedef struct Schedule {
  uint max_spec_count;       ///< 1..ISO_MAX_SPECULATION; 1 turns speculation off
  uint per_ray_speculation;  ///< each ray looks ahead by what it has missed, not all alike
  uint cache_slots;          ///< of the block cache
  uint scanned_pairs;        ///< pipeline `blocks`: rays have as many places for pairs as they fill
                             ///< (ray_pairs.h)
} Schedule;
ISO_CHECK_SIZE(Schedule, 16);

/// All that a frame's kernels need besides buffers. Kernels get it by value: NVIDIA's compiler
/// reads a pointer to constant memory through the cache, again in every turn of a loop.
typedef struct FrameParams {
  BlockGrid grid;
  LevelPlace place;  ///< only read if ISO_LEVELS is 1
  BrickPlace brick;
  View view;
  Band band;  ///< only read if ISO_LEVELS is 1
  Surface surface;
  ScreenBox screen;
  Schedule schedule;
} FrameParams;
ISO_CHECK_SIZE(FrameParams, 224);

#define ISO_NO_HIT 64u  ///< PairHit::cell of a pair that was tested and misses
#define ISO_NOT_TESTED \
  65u  ///< PairHit::cell of a pair whose dual grid got no cache slots in this pass
#define ISO_IN_DOUBT \
  128u  ///< added to PairHit::cell if the pair's walk stopped for settle_doubts()

/// The result of one ray-block pair: which of the block's 64 dual cells the ray hits first, and
/// where.
typedef struct PairHit {
  uint cell;  ///< x + 4 y + 16 z in the block, ISO_NO_HIT or ISO_NOT_TESTED; between kernels also +
              ///< ISO_IN_DOUBT
  float s;    ///< position between the ray's entry (0) and exit (1) of that cell
} PairHit;
ISO_CHECK_SIZE(PairHit, 8);

/// The pairs of a visible block among those gathered by block: from begin to below end.
typedef struct BlockRays {
  uint begin, end;
} BlockRays;
ISO_CHECK_SIZE(BlockRays, 8);

#define ISO_CAP 64u  ///< added to HitRecord::cell of a hit on a clipping plane
/// HitRecord::cell has the number of the crossing in its cell from this bit on: 0..2. Only rays
/// that have gone on from a hit (layers.h) have others than the first.
#define ISO_CROSSING_BIT 7
/// Instead of that number, of a hit at a border between levels of detail, which is no crossing: one
/// of the levels has the ray inside there, and the other one outside.
#define ISO_AT_BORDER (3u << ISO_CROSSING_BIT)
#define ISO_SURFACE_BIT 9   ///< and the number of the surface from this one on
#define ISO_MAX_SURFACES 8  ///< of a frame
#define ISO_MAX_LAYERS 16   ///< hits of a ray that are drawn

/// One pixel's hit (design: a hit is cell + local position; t is derived from it).
typedef struct HitRecord {
  float t;        ///< distance from the eye [world units]; INFINITY: no hit
  uint block_id;  ///< bx + blocks_x * (by + blocks_y * bz); of several levels, see LevelPlace
  uint cell;      ///< x + 4 y + 16 z in the block, bits 0..5; above: ISO_CAP, ISO_CROSSING_BIT,
                  ///< ISO_SURFACE_BIT
  float x, y, z;  ///< position in the dual cell, [0,1]^3
  float grad_x, grad_y,
      grad_z;  ///< gradient there, see smooth_gradient.h [value per voxel], index space; of a cap,
               ///< along the plane's normal
} HitRecord;
ISO_CHECK_SIZE(HitRecord, 36);

/// A ray of any origin. Position = o + t d; d = 0: there is no ray.
typedef struct GivenRay {
  float o_x, o_y, o_z;  ///< index space of its level of detail
  float d_x, d_y, d_z;  ///< [voxels of the level per t]
  uint level;           ///< see level_of_given(), cut_of_given()
} GivenRay;
ISO_CHECK_SIZE(GivenRay, 28);

/// The places of a compressed volume's blocks in its zfp stream, and how they are decoded.
typedef struct StreamLayout {
  uint bits_per_block;  ///< at a fixed rate; 0: blocks have lengths of their own, see block_index.h
  uint words_per_part;  ///< of a stream in several buffers: see block_stream.h
  int min_exponent;  ///< bit planes end where the error is at most 2^min_exponent; ISO_ALL_PLANES:
                     ///< with the block's bits; ISO_REVERSIBLE
  /// Decoded values are rounded to integers in this range (whole_number.h); least > greatest: they
  /// are not rounded.
  float least, greatest;
  /// Added to a block's values, to draw a bound of the volume: value_offset + bound_unit *
  /// block_bound() of its code, of codes that begin with word bounds_begin of the index. Both 0:
  /// nothing.
  float value_offset, bound_unit;
  uint bounds_begin;     ///< of a renderer of labels, the same word of the table of label_table.h
  uint bounds_by_place;  ///< not 0: of its block's bound, a voxel has bound_share() of its place
  uint no_data_begin;    ///< word of the index that the table of no_data.h begins with;
                         ///< ISO_INVALID_ID: all voxels have data. Only read if ISO_NO_DATA is 1
} StreamLayout;
ISO_CHECK_SIZE(StreamLayout, 40);

/// Values of some voxels of a block (macrocells.cl).
typedef struct VoxelRange {
  float min, max;  ///< min > max: no voxel
} VoxelRange;
ISO_CHECK_SIZE(VoxelRange, 8);

#define ISO_ALL_PLANES (-1074)  ///< StreamLayout::min_exponent, and zfp's own
#define ISO_REVERSIBLE (-1075)  ///< the same of a reversible stream: other blocks (zfp_codec.h)

/// The work of one pass, counted on the device; the host reads it one pass behind. Stages whose
/// input is "the first n entries" take n from a field of this struct, so that no launch waits for
/// the host.
typedef struct PassCounts {
  uint ray_count;   ///< width * height of the frame
  uint pass;        ///< number of the pass since the cache was made: the clock of its slots' stamps
  uint frame_pass;  ///< number of the frame's first pass
  uint last_frame_pass;  ///< and of the first pass of the frame before
  uint active_count;     ///< N_Act: rays at work at the start of the pass
  uint spec_count;       ///< N_Spec of the pass; 0 when no ray is active
  uint window_count;     ///< of the active rays, the first so many take part in the pass
  uint pair_slot_count;  ///< entries of the pair arrays in use: window_count * spec_count, or the
                         ///< pairs themselves (ray_pairs.h)
  uint pair_count;   ///< ray-block pairs: blocks that rays looked ahead at, summed over the rays
  uint ahead_count;  ///< blocks that rays were to look ahead at, summed over the rays of the window
  uint granted_count;    ///< of those, pairs whose dual grid was in the cache and were intersected
  uint visible_count;    ///< distinct blocks those belong to
  uint requested_count;  ///< blocks asked for that were not cached
  uint decoded_count;    ///< of those, blocks that got a slot; and blocks decoded on demand
  uint recycled_count;  ///< blocks freed for them that this frame had asked for, too: it needs more
                        ///< than there are slots
  uint hit_count;       ///< rays that hit in this pass
  uint next_active_count;  ///< rays left for the next pass
  uint free_count;         ///< cache slots left without a block
} PassCounts;
ISO_CHECK_SIZE(PassCounts, 72);

ISO_NAMESPACE_END

#endif
