#pragma once
// How far each level of detail is from the volume it stands for: measured block by block while the
// pyramid is built, and what frames make of it.

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Measures, block by block, how far the field of the next coarser level is from a level's own: as
/// it was made, and as it is decoded. The decoded one is compared with the fine level itself:
/// bounds of what making loses and of what compressing loses, added up, would be larger. Memory: a
/// few layers, and 8 bytes per coarse block.
///
/// Both fields are trilinear, and planes of the coarse grid are planes of the fine one. So in a
/// fine cell their difference is trilinear, too, and largest at a voxel. The bound of a coarse
/// block is the largest difference in all cells that touch a voxel of it. A field that has these
/// bounds at the coarse voxels, and is trilinear between them, is nowhere below the difference.
/// If either has no data at a voxel, there is no difference.
class LevelBounds {
 public:
  LevelBounds(const glm::uvec3 &fine_dims, const glm::uvec3 &coarse_dims,
              std::uint32_t num_threads);
  /// The next layers [n][ny][nx] of each. NaN in `layers`: voxels without data.
  void add_fine(std::span<const float> layers);
  void add_coarse(std::span<const float> layers, std::span<const float> decoded);

  /// How far the coarse level's blocks are from the source.
  struct Off {
    std::vector<float> made, decoded;
  };
  /// The errors of all blocks, after all layers.
  ///
  /// finer  how far the fine level's blocks are from the source, as they were made; for the finest
  ///        level, what its voxels lost (Chunk::lost); empty if that is nothing
  Off finish(std::span<const float> finer) const;

 private:
  struct CoarseLayer {
    std::vector<float> made, decoded;
  };

  void compare_ready_layers();
  void compare_layer(std::uint32_t z, const std::vector<float> &layer);
  /// Fine layer z with the coarse field that two coarse layers make there, for a row of coarse
  /// blocks.
  void compare_rows(std::uint32_t z, std::uint64_t by, const std::vector<float> &layer,
                    const std::vector<float> &below, const std::vector<float> &above,
                    std::vector<float> &off);

  glm::uvec3 fine_, coarse_, blocks_;
  std::uint32_t num_threads_;
  std::deque<std::vector<float>> fine_layers_;
  std::deque<CoarseLayer> coarse_layers_;
  std::uint32_t fine_z_ = 0, coarse_z_ = 0;  ///< of the first that are kept
  Off off_;                                  ///< against the fine level
};

/// Bounds as codes, which are never below them.
BlockBounds encode_bounds(std::span<const float> bounds);
/// The same for a part of a level's blocks. largest: the largest bound of the whole level.
BlockBounds encode_bounds(std::span<const float> bounds, float largest);
/// Exponents that they can have.
inline constexpr std::int32_t kMinBoundExponent = -126, kMaxBoundExponent = 127;

/// A field that bounds the volume's from below or above, instead of the volume.
enum class FieldBound { kNone, kLower, kUpper };
inline constexpr std::size_t kNumFieldBounds = 3;

/// Largest error of a volume's voxels, measured or, at fixed accuracy, as zfp promises; nothing
/// if that is not known.
std::optional<double> known_voxel_error(const CompressedVolume &volume);

/// How far a level's decoded values may be off.
struct LevelError {
  /// finest: else its blocks must have bounds for anything to be known.
  LevelError(const CompressedVolume &level, bool finest);

  std::optional<double> uniform;  ///< of every value; nothing is known without it
  float unit = 0;                 ///< and of its block's bound besides
  double largest = 0;             ///< of all values
};
/// The largest bound of the whole level, even if `bounds` are a brick's.
float largest_bound(const BlockBounds &bounds);

/// How far decoded values may be from those of all bit planes if with_fewer_planes(bound,
/// voxel_error) leaves planes out.
double plane_error(const BlockPrecision &bound, double voxel_error);

/// Offset of a level's decoded values for a field bound: uniform + unit * the block's bound, or the
/// voxel's share of it (StreamLayout).
struct ValueOffset {
  float uniform = 0, unit = 0;
};
/// Throws Error if the level's error or the range of values is not known.
///
/// plane_error  how far values of fewer bit planes are from those of all
/// value_range  of the volume before compression; what sums of such values lose in float32 is part
///              of the offset
ValueOffset value_offset(const LevelError &error, FieldBound bound, double plane_error,
                         const std::array<float, 2> &value_range);

/// Offset of the value of voxel x + 4 y + 16 z of a block, added up in the order of decode_block()
/// in kernels_cl/device/block_stream.h.
float offset_of_voxel(const ValueOffset &offset, const BlockBounds &bounds, std::size_t block,
                      std::uint32_t voxel);

}  // namespace isowave::core
