#include "core/sources/memory_reader.hpp"

#include <bit>
#include <stdexcept>

#include "core/io/raw_reader.hpp"

namespace isowave::core {

// Voxels in memory are converted as the bytes of files are, which are little endian.
static_assert(std::endian::native == std::endian::little);

MemoryReader::MemoryReader(const VolumeInfo &info, std::span<const std::byte> voxels)
    : voxels_(voxels) {
  info_ = info;
  if (voxels.size() != info.num_voxels() * size_of(info.type))
    throw std::invalid_argument("MemoryReader: the bytes are not those of the grid");
}

std::span<const std::byte> MemoryReader::layers(std::uint32_t z_begin,
                                                std::uint32_t num_layers) const {
  const std::size_t layer = std::size_t{info_.dims.x} * info_.dims.y * size_of(info_.type);
  return voxels_.subspan(z_begin * layer, num_layers * layer);
}

void MemoryReader::read_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                               std::span<float> out) {
  convert_to_float(info_.type, layers(z_begin, num_layers), out);
}

void MemoryReader::read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                                     std::span<double> out) {
  convert_to_double(info_.type, layers(z_begin, num_layers), out);
}

}  // namespace isowave::core
