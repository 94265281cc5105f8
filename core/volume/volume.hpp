#pragma once
// Uncompressed volumes: what a file says of its grid, and its voxels as float32, layer by layer.
//
// Index space: voxel (i,j,k) at integer coordinates. World = origin + direction * (spacing *
// index). Voxels are ordered x fastest, then y, then z.

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace isowave::core {

enum class VoxelType {
  kUint8,
  kInt8,
  kUint16,
  kInt16,
  kUint32,
  kInt32,
  kFloat32,
  kFloat64,
  kUint64,
  kInt64
};

/// "uint8", "int8", ... "float64".
std::string_view to_string(VoxelType type);
/// Throws  Error naming the accepted types
VoxelType voxel_type_from_string(std::string_view name);
/// Bytes per voxel.
std::size_t size_of(VoxelType type);
bool is_integer(VoxelType type);
/// Whether float32 holds every value of the type.
bool fits_float32(VoxelType type);

/// Returns use(T{}), where T is the type of such voxels in C++.
template <class Use>
auto with_voxel_type(VoxelType type, const Use &use) {
  switch (type) {
    case VoxelType::kUint8:
      return use(std::uint8_t{});
    case VoxelType::kInt8:
      return use(std::int8_t{});
    case VoxelType::kUint16:
      return use(std::uint16_t{});
    case VoxelType::kInt16:
      return use(std::int16_t{});
    case VoxelType::kUint32:
      return use(std::uint32_t{});
    case VoxelType::kInt32:
      return use(std::int32_t{});
    case VoxelType::kFloat32:
      return use(float{});
    case VoxelType::kUint64:
      return use(std::uint64_t{});
    case VoxelType::kInt64:
      return use(std::int64_t{});
    case VoxelType::kFloat64:
      break;
  }
  return use(double{});
}

/// Place of a brick in the volume that it is a part of; the defaults: it is the whole.
struct BrickOf {
  glm::uvec3 first_voxel{0};  ///< of the brick, in the whole volume; multiples of 4
  /// Layers of 4^3 blocks before and behind, along each axis, that belong to other bricks.
  glm::uvec3 before{0}, behind{0};

  bool operator==(const BrickOf &) const = default;
};

/// The grid of a volume. Plain data; the defaults are a unit grid at the origin.
struct VolumeInfo {
  glm::uvec3 dims{0};         ///< voxels along x, y, z
  glm::dvec3 spacing{1.0};    ///< world units between voxels along each index axis, > 0
  glm::dvec3 origin{0.0};     ///< world position of voxel (0,0,0), of a brick the whole's
  glm::dmat3 direction{1.0};  ///< column a: unit world direction of index axis a
  VoxelType type = VoxelType::kFloat32;  ///< as stored in the source file
  BrickOf brick{};
  /// World space is a patient's, LPS: +x left, +y posterior, +z superior.
  bool is_anatomical = false;

  std::uint64_t num_voxels() const { return std::uint64_t(dims.x) * dims.y * dims.z; }
  /// World vector of one index step along each axis, as columns: direction * diag(spacing).
  glm::dmat3 index_to_world() const;
};

/// `what` names the file in the message.
///
/// Throws  Error if any dimension is below 2 or above kMaxDim, spacing is not finite and positive,
///         the origin is not finite, or the direction is not invertible
void check_volume_info(const VolumeInfo &info, std::string_view what);
inline constexpr std::uint32_t kMaxDim = 1u << 16;
inline constexpr double kLeastDeterminant = 1e-6;  ///< of a direction that can be inverted

/// Voxels that a device can make where they are needed. Rooms that know devices say how
/// (core/stages/zfp_encode.hpp).
class DeviceVoxels {
 public:
  virtual ~DeviceVoxels() = default;
};

/// Reads a volume as float32 without holding all of it. Not thread-safe.
class VolumeReader {
 public:
  virtual ~VolumeReader() = default;
  const VolumeInfo &info() const { return info_; }
  /// Lines for users that say how the file's header was understood.
  const std::vector<std::string> &notices() const { return notices_; }

  /// Reads voxel layers [z_begin, z_begin + num_layers) to `out` [num_layers * ny * nx]. Calls must
  /// ask for ascending, non-overlapping layers (gzip streams cannot go back). Integer types are
  /// converted exactly up to 2^24 and rounded beyond. NaN and Inf pass through.
  ///
  /// Throws  Error on a short or unreadable file
  virtual void read_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                           std::span<float> out) = 0;

  /// As read_layers(), but every voxel exactly as the file has it. Throws Error also on integers of
  /// 64 bits that float64 does not hold. A reader of types that float32
  /// does not hold (fits_float32()) must override this one, which throws std::logic_error for them.
  virtual void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                                 std::span<double> out);
  /// The voxels of read_layers(), made by a device; null: they must be read. Lives as long as this.
  virtual DeviceVoxels *on_device() { return nullptr; }

 protected:
  VolumeInfo info_;
  std::vector<std::string> notices_;
};

}  // namespace isowave::core
