#pragma once
// The inner loops of drawing on the host: decoding blocks, and walking rays through them. Each loop
// is compiled twice: for any processor of its kind, and for processors with fused multiply-add,
// which the C library otherwise computes in software. The program chooses when it runs. Both give
// the same bits.

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/frame/appearance.hpp"
#include "core/frame/surfaces.hpp"
#include "core/host/block_pages.hpp"
#include "core/view/given_rays.hpp"
#include "kernels_cl/portable/bounce.h"
#include "kernels_cl/portable/clip.h"
#include "kernels_cl/portable/layers.h"
#include "kernels_cl/portable/ray_state.h"
#include "kernels_cl/portable/shade.h"

namespace isowave::core {

/// The smallest and the largest of some voxels.
struct BlockRange {
  float min, max;
};

/// A block of a compressed stream.
struct EncodedBlock {
  const uint *words;  ///< two words behind the one with its last bit are read, too
  ulong first_bit;
  uint num_bits;
  int min_exponent;             ///< of BlockPrecision
  float least, greatest;        ///< of WholeNumbers
  uint size_x, size_y, size_z;  ///< voxels within the volume, 1 to 4
  ulong no_data;                ///< bit x + 4y + 16z: the voxel has no data
};

/// Decodes blocks when the first ray comes to them. Thread-safe.
class BlockMaker {
 public:
  /// Makes the data that a ray needs in a block: the voxels of its dual grid, and its changing
  /// cells.
  ///
  /// Throws  ChunkIsMissing; and decode(), too
  virtual void open(std::size_t block) = 0;
  /// Decodes some blocks, up to eight.
  virtual void decode(std::span<const std::size_t> blocks) = 0;

 protected:
  ~BlockMaker() = default;
};

/// A volume whose blocks are decoded when rays come to them, and the cells that an isovalue
/// crosses. Decoded blocks stay as long as rays are traced. For a thread that traces alone
/// (HostBlocks::run) they stay until the next call of open() or of the maker.
struct HostField {
  BlockItems<float> values;  ///< [block][64] x + 4y + 16z; of decoded blocks
  BlockItems<ulong>
      changing;        ///< [open block] bit x + 4y + 16z: do the corners of the cell differ?
  const ulong *masks;  ///< [macrocell] bit x + 4y + 16z: may the block have a cell that does?
  /// [macrocell][64] largest value of the block's cells; of blocks without a bit in masks, it is on
  /// the side of all of them. Null: not known, but that of the macrocells' cells.
  const float *highs;
  const float *macrocell_highs;       ///< [macrocell] the same
  bool has_gaps;                      ///< voxels without data
  const std::atomic<uchar> *decoded;  ///< [block] kDecoded: its values are there
  const std::atomic<uchar> *opened;   ///< [block] selection: it is open
  uchar selection;                    ///< the isovalue that blocks are open for
  BlockMaker *maker;

  static constexpr uchar kDecoded = 2;

  /// Call it before a ray looks into a block. The ray can then read what the thread that made the
  /// block has written, since that thread released opened[block] afterwards.
  void open(std::size_t block) const {
    if (__builtin_expect(opened[block].load(std::memory_order_acquire) != selection, 0))
      maker->open(block);
  }
  bool is_decoded(std::size_t block) const {
    return decoded[block].load(std::memory_order_acquire) == kDecoded;
  }
};

/// A level of detail that draws the rays of a frame in its band.
struct HostLevel {
  FrameParams frame;  ///< its surface's box is that of the field's active blocks
  HostField field;
  const ClipParams *clip = nullptr;  ///< null: the whole volume is drawn
};

/// A ray of the camera in a level of detail, with its interval there.
inline Ray ray_of_level(const HostLevel &level, uint ray_id) {
  Ray ray = make_ray(&level.frame, ray_id);
  ray.begin_t = level.frame.band.begin_t;
  ray.end_t = level.frame.band.end_t;
  if (level.clip != nullptr) clip_ray(&level.frame, level.clip, ray_id, &ray);
  return ray;
}

/// The side on which a whole block is; unknown if it may have cells that change.
inline uint side_of_block(const FrameParams &frame, const HostField &field, BlockCoords b) {
  constexpr uint kBlocks = ISO_MACROCELL_BLOCKS;
  const uint columns = (frame.grid.blocks_x + 3) / 4, rows = (frame.grid.blocks_y + 3) / 4;
  const ulong macrocell =
      b.x / kBlocks + columns * (b.y / kBlocks + static_cast<ulong>(rows) * (b.z / kBlocks));
  const uint bit = b.x % kBlocks + 4 * (b.y % kBlocks) + 16 * (b.z % kBlocks);
  if (field.has_gaps || (field.masks[macrocell] >> bit & 1u) != 0) return ISO_SIDE_UNKNOWN;
  const float high =
      field.highs != nullptr ? field.highs[64 * macrocell + bit] : field.macrocell_highs[macrocell];
  return high - frame.surface.isovalue >= 0.0f ? ISO_SIDE_INSIDE : ISO_SIDE_OUTSIDE;
}

class HostFieldValues;

struct RayTile {
  uint begin_x, begin_y, end_x, end_y;  ///< of the frame's rays
};

/// The ambient and shadow rays of a frame's hits in one level of detail.
struct AmbientRays {
  AmbientParams params;
  const AmbientDirection *directions;  ///< [num_rays][ISO_AMBIENT_PATTERNS]
  uint num_rays;                       ///< of each hit, both
  const FrameParams *seen;             ///< the frame of the finest level that draws
  uint level;                          ///< of the hits, counted from that one
  float voxel;                         ///< of the level [voxels of the finest level]
  bool bounces = false;                ///< ambient rays bring light (portable/bounce.h)
};

/// How the surfaces of a frame are blended.
struct LayerBlend {
  Shading shading;
  LayerParams colors{};
  std::vector<std::uint32_t> numbers{};    ///< innermost_first()
  bool is_smooth = true;                   ///< Normals::kSmooth
  ClipParams clip{};                       ///< of slices, and of surfaces that are clipped
  const FrameParams *finest = nullptr;     ///< for shading; this level need not draw
  std::vector<FieldMap> slice_maps{};      ///< [level that draws] from hits on slices to its voxels
  const HostFieldValues *field = nullptr;  ///< for colours of the surfaces; null: none
  AmbientRays rays{};                      ///< of the hits of each layer: level is 0
  /// The surfaces that such rays may meet: those that clipping planes leave whole, and the others.
  std::array<std::vector<std::size_t>, 2> opaque{};
  bool any_is_whole = false;  ///< of all surfaces
};

/// A surface of a frame, at each of the levels of detail that draw it, the finest first.
using LeveledSurface = std::vector<HostLevel>;

/// A hit of a layer on a surface or a slice, with its light: sums of what ambient rays bring.
struct LayerHit {
  uint ray;
  HitRecord hit;
  float value;  ///< by which its colour is: see blend_hit()
  HitLight light;
};

/// The layers of a frame's rays.
struct LayersOfRays {
  HitRecord *hits;    ///< [height * width] the first layer, of rays that hit something
  RayColor *colors;   ///< [height * width]
  LayerStats *stats;  ///< what is blended is added
  std::vector<LayerHit> *layers = nullptr;  ///< [ISO_MAX_LAYERS] get the hits; null: no one asks
};

struct HostLoops {
  /// Decodes a block to values [64]; voxels without data are NaN.
  void (*decode)(const EncodedBlock &block, float *values);
  /// Value ranges of parts [8] of a block, over voxels with data within the volume. Part 0 is the
  /// whole block. Another part has the first layer along each axis whose bit is set (x 1, y 2, z
  /// 4): the voxels that dual cells of the block before it along these axes have.
  void (*ranges)(const EncodedBlock &block, BlockRange *parts);
  /// Bit i: whether value i of 64, such as the voxels of a block, is inside.
  ulong (*inside)(const float *values, float isovalue);
  /// Writes the hits of a tile of the frame's rays into hits [height * width], only for rays that
  /// hit something. Traces eight rays at a time if the processor can (host_packets.hpp).
  ///
  /// frame      its surface's box is that of the field's active blocks
  /// is_smooth  hits have smooth gradients (Normals::kSmooth)
  /// Returns    number of hits
  uint (*trace)(const FrameParams &frame, const HostField &field, const RayTile &tile,
                bool is_smooth, HitRecord *hits);
  /// The same, ray by ray; trace() is compared with it.
  uint (*trace_rays)(const FrameParams &frame, const HostField &field, const RayTile &tile,
                     bool is_smooth, HitRecord *hits);
  /// The same as trace() for a frame that is clipped, or that several levels of detail draw, the
  /// finest first, each its band.
  uint (*trace_levels)(std::span<const HostLevel> levels, const RayTile &tile, bool is_smooth,
                       HitRecord *hits);
  /// The same, ray by ray.
  uint (*trace_rays_of_levels)(std::span<const HostLevel> levels, const RayTile &tile,
                               bool is_smooth, HitRecord *hits);
  /// Writes the hits of rays into hits [num_rays], only for rays that hit something.
  ///
  /// frame      as for trace(); its view is not used
  void (*cast)(const FrameParams &frame, const HostField &field, const IndexRay *rays,
               uint num_rays, bool is_smooth, HitRecord *hits);
  /// Counts the ambient rays of a tile's hits in a level of detail that meet nothing in that level,
  /// or what is clipped, into open_counts [height * width], and such shadow rays behind them.
  ///
  /// bounced  [height * width] gets sums of the light that ambient rays bring, if they do
  void (*ambient)(const HostLevel &level, const RayTile &tile, const AmbientRays &rays,
                  const HitRecord *hits, uchar *open_counts, float *bounced);
  /// The normal_ray()s of a row of rays, into places [height * width].
  void (*place_hits)(const FrameParams &frame, const AmbientParams &params, uint row,
                     const HitRecord *hits, GivenRay *places);
  /// A step of the filter of bounced light, for a row of rays, see filtered_light().
  ///
  /// bounced   [height * width]
  /// filtered  [height * width]; gets the row
  void (*filter_bounced)(const View &view, uint row, uint apart, const GivenRay *places,
                         const float *bounced, float *filtered);
  /// Shades a row of the picture of the frame's hits [height * width].
  ///
  /// samples      rays per pixel along each axis
  /// field_values [height * width] of the field; not read unless colours are by it
  /// picture      [width / samples][num_channels()]
  void (*shade)(const FrameParams &frame, const Shading &shading, uint samples, uint row,
                const HitRecord *hits, const LightOfHits &light, const float *field_values,
                std::uint8_t *picture);
  /// Blends a tile's hits on surfaces with those behind them, eight rays at a time if the processor
  /// can.
  ///
  /// surfaces  [surface] innermost first
  /// next      [ray of the tile][surface] their first hits, with gradients of cells; overwritten
  /// to        those of the tile's rays are set
  /// Returns   number of rays that hit something
  uint (*blend)(std::span<const LeveledSurface> surfaces, const LayerBlend &by, const RayTile &tile,
                HitRecord *next, const LayersOfRays &to);
  /// The same, ray by ray.
  uint (*blend_rays)(std::span<const LeveledSurface> surfaces, const LayerBlend &by,
                     const RayTile &tile, HitRecord *next, const LayersOfRays &to);
  /// Blends hits of a layer behind the layers before, with the filtered light of their sums.
  ///
  /// sums    [ISO_LAYER_SUMS][height * width] of bounced light: see LightOfHits
  /// colors  [height * width]
  void (*blend_lit)(const FrameParams &frame, const LayerBlend &by, std::span<const LayerHit> layer,
                    const float *sums, RayColor *colors);
  /// As shade(), of blended rays. colors: [height * width]
  void (*shade_layers)(const FrameParams &frame, const ShadeParams &params, uint samples, uint row,
                       const RayColor *colors, std::uint8_t *picture);
};

/// The loops that this processor can run, the fastest last.
std::span<const HostLoops> all_host_loops();
inline const HostLoops &host_loops() {
  return all_host_loops().back();
}

}  // namespace isowave::core
