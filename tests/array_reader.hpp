#pragma once
// A volume in memory, read as a file would be.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/volume/volume.hpp"

namespace isowave::core {

class ArrayReader : public VolumeReader {
 public:
  template <class Value>
  ArrayReader(const VolumeInfo &info, const std::vector<Value> &voxels)
      : voxels_(voxels.begin(), voxels.end()) {
    info_ = info;
  }
  /// On a unit grid.
  template <class Value>
  ArrayReader(const glm::uvec3 &dims, const std::vector<Value> &voxels,
              VoxelType type = VoxelType::kFloat32)
      : voxels_(voxels.begin(), voxels.end()) {
    info_.dims = dims;
    info_.type = type;
  }
  VolumeInfo &mutable_info() { return info_; }
  const std::vector<double> &voxels() const { return voxels_; }

  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    std::ranges::transform(layers(z_begin, num_layers), out.begin(),
                           [](double v) { return static_cast<float>(v); });
  }
  /// Whatever the type is said to be.
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override {
    std::ranges::copy(layers(z_begin, num_layers), out.begin());
  }

 private:
  std::span<const double> layers(std::uint32_t z_begin, std::uint32_t num_layers) const {
    const std::size_t layer = std::size_t(info_.dims.x) * info_.dims.y;
    return std::span(voxels_).subspan(z_begin * layer, num_layers * layer);
  }

  std::vector<double> voxels_;
};

}  // namespace isowave::core
