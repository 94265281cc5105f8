#pragma once
// How far each level of detail is from the volume it stands for: measured block by block while the pyramid is built, and what
// frames make of it.

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/zfp_stream.hpp"

namespace isowave {

/// Compares a level's field with that of the next coarser level, in memory of a few layers and 4 bytes per coarse block.
///
/// Both fields are trilinear, and planes of the coarse grid are planes of the fine one: in a fine cell their difference is trilinear,
/// too, and largest at a voxel. The bound of a coarse block is the largest one in all cells that touch a voxel of it. So the field that
/// has these bounds at its voxels, piecewise constant there, trilinear between, is at least the difference everywhere.
class LevelBounds {
 public:
  LevelBounds(const glm::uvec3 &fine_dims, const glm::uvec3 &coarse_dims, std::uint32_t num_threads);
  /// The next layers [n][ny][nx] of each.
  void add_fine(std::span<const float> layers);
  void add_coarse(std::span<const float> layers);
  /// The bounds of the coarse level's blocks against the finest level: finer are those of the fine level's; none: it is the finest.
  std::vector<float> finish(std::span<const float> finer) const;

 private:
  void compare_ready_layers();
  void compare_layer(std::uint32_t z, const std::vector<float> &layer);

  glm::uvec3 fine_, coarse_, blocks_;
  std::uint32_t num_threads_;
  std::deque<std::vector<float>> fine_layers_, coarse_layers_;
  std::uint32_t fine_z_ = 0, coarse_z_ = 0;  ///< of the first that are kept
  std::vector<float> bounds_;                ///< [coarse blocks]
};

/// Never below.
BlockBounds encode_bounds(std::span<const float> bounds);
/// Exponents that they can have.
inline constexpr std::int32_t kMinBoundExponent = -126, kMaxBoundExponent = 127;

/// A field that bounds the volume's from below or above, instead of the volume.
enum class FieldBound { kNone, kLower, kUpper };
inline constexpr std::size_t kNumFieldBounds = 3;

/// Largest error of a volume's voxels, measured or, at fixed accuracy, as zfp promises; nothing where that is not known.
std::optional<double> known_max_error(const CompressedVolume &volume);

/// How far a level's decoded values may be off.
struct LevelError {
  /// finest: else its blocks must have bounds for anything to be known.
  LevelError(const CompressedVolume &level, bool finest);

  std::optional<double> uniform;  ///< of every value; nothing is known without it
  float unit = 0;                 ///< and of its block's bound besides
};
float largest_bound(const BlockBounds &bounds);

/// How far decoded values may be from those of all bit planes where coarser(bound, value_error) leaves planes out.
double plane_error(const ErrorBound &bound, double value_error);

/// What is added to a level's decoded values for a field bound: uniform + unit * the block's bound, or the voxel's share of it
/// (StreamLayout).
struct ValueOffset {
  float uniform = 0, unit = 0;
};
/// plane_error: of values of fewer bit planes, against those of all. magnitude: of the values that occur, of which what sums lose in
/// float32 counts as error, too. Throws Error where the level's error is not known.
ValueOffset value_offset(const LevelError &error, FieldBound bound, double plane_error, double magnitude);

/// What is added to a voxel's value, voxel: x + 4 y + 16 z in its block: as decode_block() in kernels_cl/block_stream.h adds it up.
float offset_of_voxel(const ValueOffset &offset, const BlockBounds &bounds, std::size_t block,
                      std::uint32_t voxel);

/// The largest magnitude in a volume's range. Throws Error where that is not known.
double magnitude_of(const std::array<float, 2> &value_range);

}  // namespace isowave
