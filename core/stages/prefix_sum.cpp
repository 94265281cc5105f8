#include "core/stages/prefix_sum.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace isowave::core {

ocl::BufferSizes PrefixSum::sizes(std::uint64_t max_count, std::uint32_t group_size) {
  return {
      ocl::buffer_size<uint>("prefix tile sums", num_tiles(max_count, group_size, ISO_SCAN_ITEMS))};
}

PrefixSum::PrefixSum(ocl::Device &device, std::uint64_t max_count, std::uint32_t group_size)
    : device_(device),
      max_count_(max_count),
      group_size_(group_size),
      tile_sums_(device, sizes(max_count, group_size)["prefix tile sums"]),
      tile_sums_kernel_(device, group_defines(group_size)),
      tile_offsets_kernel_(device, group_defines(group_size)),
      tiles_kernel_(device, group_defines(group_size)) {}

void PrefixSum::operator()(ocl::Buffer<uint> &values, std::uint32_t count) {
  if (count > max_count_ || count >= values.size()) {
    throw std::invalid_argument(fmt::format("PrefixSum: {} entries of '{}', which has {}, with {}",
                                            count, values.name(), values.size(), max_count_));
  }
  const ocl::Range tiles = ocl::Range::strided(
      (std::uint64_t{count} + ISO_SCAN_ITEMS - 1) / ISO_SCAN_ITEMS, group_size_, device_);
  tile_sums_kernel_(tiles, values, count, tile_sums_);
  tile_offsets_kernel_(ocl::Range::groups(1, group_size_), count, tile_sums_, values);
  tiles_kernel_(tiles, values, count, tile_sums_);
}

}  // namespace isowave::core
