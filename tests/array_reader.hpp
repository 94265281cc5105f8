#pragma once
// A volume in memory, read as a file would be.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <utility>
#include <vector>

#include "core/volume.hpp"

namespace isowave {

class ArrayReader : public VolumeReader {
 public:
  ArrayReader(const glm::uvec3 &dims, std::vector<float> voxels) : voxels_(std::move(voxels)) {
    info_.dims = dims;
  }
  VolumeInfo &mutable_info() { return info_; }
  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    const std::size_t layer = std::size_t(info_.dims.x) * info_.dims.y;
    std::copy_n(voxels_.begin() + std::ptrdiff_t(z_begin * layer), num_layers * layer, out.begin());
  }
  /// Whatever the type is said to be.
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<double> out) override {
    const std::size_t layer = std::size_t(info_.dims.x) * info_.dims.y;
    std::copy_n(voxels_.begin() + std::ptrdiff_t(z_begin * layer), num_layers * layer, out.begin());
  }

 private:
  std::vector<float> voxels_;
};

}  // namespace isowave
