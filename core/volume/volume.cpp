#include "core/volume/volume.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

struct TypeEntry {
  VoxelType type;
  std::string_view name;
  std::size_t size;
};
constexpr std::array<TypeEntry, 10> kVoxelTypes{{{VoxelType::kUint8, "uint8", 1},
                                                 {VoxelType::kInt8, "int8", 1},
                                                 {VoxelType::kUint16, "uint16", 2},
                                                 {VoxelType::kInt16, "int16", 2},
                                                 {VoxelType::kUint32, "uint32", 4},
                                                 {VoxelType::kInt32, "int32", 4},
                                                 {VoxelType::kFloat32, "float32", 4},
                                                 {VoxelType::kFloat64, "float64", 8},
                                                 {VoxelType::kUint64, "uint64", 8},
                                                 {VoxelType::kInt64, "int64", 8}}};

const TypeEntry &entry(VoxelType type) {
  return kVoxelTypes.at(std::size_t(type));
}

}  // namespace

std::string_view to_string(VoxelType type) {
  return entry(type).name;
}
std::size_t size_of(VoxelType type) {
  return entry(type).size;
}
bool is_integer(VoxelType type) {
  return type != VoxelType::kFloat32 && type != VoxelType::kFloat64;
}
bool fits_float32(VoxelType type) {
  return type == VoxelType::kFloat32 || size_of(type) < 4;
}

VoxelType voxel_type_from_string(std::string_view name) {
  for (const TypeEntry &candidate : kVoxelTypes) {
    if (candidate.name == name) return candidate.type;
  }
  throw Error(
      "unknown voxel type '{}': use uint8, int8, uint16, int16, uint32, int32, uint64, int64, "
      "float32 or float64",
      name);
}

glm::dmat3 VolumeInfo::index_to_world() const {
  return glm::dmat3(direction[0] * spacing.x, direction[1] * spacing.y, direction[2] * spacing.z);
}

void check_volume_info(const VolumeInfo &info, std::string_view what) {
  const auto finite = [](const glm::dvec3 &v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
  };
  for (int axis = 0; axis < 3; ++axis) {
    if (info.dims[axis] < 2 || info.dims[axis] > kMaxDim) {
      throw Error("{}: dims {}x{}x{}: each must be 2 to {}", what, info.dims.x, info.dims.y,
                  info.dims.z, kMaxDim);
    }
  }
  // Sizes of memory are computed from this count, in std::size_t. Where addresses have 32 bits, a
  // volume may stay in parts: what holds all voxels refuses it.
  constexpr std::uint64_t kMaxVoxels = sizeof(std::size_t) < sizeof(std::uint64_t)
                                           ? std::uint64_t{1} << 36
                                           : std::numeric_limits<std::size_t>::max() / 8;
  if (const std::uint64_t voxels = info.num_voxels(); voxels > kMaxVoxels) {
    throw Error("{}: {} voxels: this build, whose addresses have {} bits, takes at most {}", what,
                voxels, 8 * sizeof(std::size_t), kMaxVoxels);
  }
  if (!finite(info.spacing) || glm::any(glm::lessThanEqual(info.spacing, glm::dvec3(0.0)))) {
    throw Error("{}: spacing {} {} {}: each must be finite and above 0", what, info.spacing.x,
                info.spacing.y, info.spacing.z);
  }
  if (!finite(info.origin)) throw Error("{}: the origin is not finite", what);
  const double determinant = glm::determinant(info.direction);
  if (!(std::abs(determinant) > kLeastDeterminant) || !std::isfinite(determinant)) {
    throw Error("{}: the direction matrix is singular or not finite", what);
  }
}

void VolumeReader::read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                                     std::span<double> out) {
  if (!fits_float32(info_.type)) throw std::logic_error("this reader has voxels in float32 only");
  std::vector<float> voxels(out.size());
  read_layers(z_begin, num_layers, voxels);
  std::ranges::copy(voxels, out.begin());
}

}  // namespace isowave::core
