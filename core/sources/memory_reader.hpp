#pragma once
// A volume in memory, read as if it were a file.

#include <cstddef>
#include <span>

#include "core/volume/volume.hpp"

namespace isowave::core {

class MemoryReader : public VolumeReader {
 public:
  /// voxels: [nz][ny][nx] of info.type, which must outlive the reader.
  MemoryReader(const VolumeInfo &info, std::span<const std::byte> voxels);

  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override;
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override;

 private:
  std::span<const std::byte> layers(std::uint32_t z_begin, std::uint32_t num_layers) const;

  std::span<const std::byte> voxels_;
};

}  // namespace isowave::core
