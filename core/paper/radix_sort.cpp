#include "core/paper/radix_sort.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "kernels_cl/portable/radix_sort.h"

namespace isowave::core {

namespace {

ocl::Defines radix_defines(std::uint32_t group_size, RadixRanking ranking) {
  ocl::Defines defines = group_defines(group_size);
  defines.emplace("ISO_RADIX_SERIAL", ranking == RadixRanking::kSerial ? "1" : "0");
  return defines;
}

RadixRanking ranking_for(const ocl::Device &device) {
  return device.info().type == ocl::DeviceType::kCpu ? RadixRanking::kSerial
                                                     : RadixRanking::kTogether;
}

}  // namespace

ocl::BufferSizes RadixSort::sizes(std::uint64_t max_count, std::uint32_t group_size) {
  // The table has the pairs of each digit, and those of each digit and tile.
  const std::uint64_t tiles = num_tiles(max_count, group_size, ISO_RADIX_ITEMS);
  return {ocl::buffer_size<uint>("sort keys, other half", max_count),
          ocl::buffer_size<uint>("sort values, other half", max_count),
          ocl::buffer_size<uint>("sort digit table", ISO_RADIX_DIGITS * (1 + tiles))};
}

RadixSort::RadixSort(ocl::Device &device, std::size_t max_count, std::uint32_t group_size,
                     RadixRanking ranking)
    : max_count_(max_count),
      group_size_(group_size),
      tiles_range_(ocl::Range::strided((max_count + ISO_RADIX_ITEMS - 1) / ISO_RADIX_ITEMS,
                                       group_size, device)),
      other_keys_(device, sizes(max_count, group_size)["sort keys, other half"]),
      other_values_(device, sizes(max_count, group_size)["sort values, other half"]),
      table_(device, sizes(max_count, group_size)["sort digit table"]),
      histogram_(device, radix_defines(group_size, ranking)),
      scan_(device, radix_defines(group_size, ranking)),
      scatter_(device, radix_defines(group_size, ranking)) {}

RadixSort::RadixSort(ocl::Device &device, std::size_t max_count, std::uint32_t group_size)
    : RadixSort(device, max_count, group_size, ranking_for(device)) {}

void RadixSort::operator()(ocl::Buffer<uint> &keys, ocl::Buffer<uint> &values, CountsBuffer &counts,
                           uint count_field, uint key_bits) {
  if (key_bits < 1 || key_bits > 32) {
    throw std::invalid_argument(
        fmt::format("RadixSort: {} key bits; 1 to 32 can be sorted", key_bits));
  }
  for (const ocl::Buffer<uint> *buffer : {&keys, &values}) {
    if (buffer->size() < max_count_) {
      throw std::invalid_argument(fmt::format("RadixSort: {} pairs do not fit '{}' of {} entries",
                                              max_count_, buffer->name(), buffer->size()));
    }
  }
  // As few passes as there can be, and the bits dealt out among them: fewer digits are cheaper.
  uint passes_left = (key_bits + ISO_RADIX_BITS - 1) / ISO_RADIX_BITS;
  for (uint shift = 0; passes_left != 0; --passes_left) {
    const uint bits = (key_bits - shift + passes_left - 1) / passes_left;
    histogram_(tiles_range_, keys, counts, count_field, shift, bits, table_);
    scan_(ocl::Range::groups(std::size_t{1} << bits, group_size_), counts, count_field, bits,
          table_);
    scatter_(tiles_range_, keys, values, counts, count_field, shift, bits, table_, other_keys_,
             other_values_);
    std::swap(keys, other_keys_);
    std::swap(values, other_values_);
    shift += bits;
  }
}

}  // namespace isowave::core
