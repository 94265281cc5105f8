#include "core/radix_sort.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

namespace isowave {

RadixSort::RadixSort(ocl::Device &device, std::size_t max_count, std::uint32_t group_size)
    : max_count_(max_count),
      tile_(group_size * ISO_RADIX_ITEMS),
      range_(ocl::Range::strided((max_count + ISO_RADIX_ITEMS - 1) / ISO_RADIX_ITEMS, group_size, device)),
      other_keys_(device, "sort keys, other half", max_count),
      other_values_(device, "sort values, other half", max_count),
      table_(device, "sort digit table", ISO_RADIX_DIGITS * ((max_count + tile_ - 1) / tile_)),
      scan_(device, group_size),
      histogram_(device, "radix_sort", "radix_histogram", group_defines(group_size)),
      scatter_(device, "radix_sort", "radix_scatter", group_defines(group_size)) {}

void RadixSort::operator()(ocl::Buffer<uint> &keys, ocl::Buffer<uint> &values, CountsBuffer &counts,
                           uint count_field, uint key_bits) {
  if (key_bits < 1 || key_bits > 32) {
    throw std::invalid_argument(fmt::format("RadixSort: {} key bits; 1 to 32 can be sorted", key_bits));
  }
  for (const ocl::Buffer<uint> *buffer : {&keys, &values}) {
    if (buffer->size() < max_count_) {
      throw std::invalid_argument(fmt::format("RadixSort: {} pairs do not fit '{}' of {} entries", max_count_,
                                              buffer->name(), buffer->size()));
    }
  }
  for (uint shift = 0; shift < key_bits; shift += ISO_RADIX_BITS) {
    histogram_(range_, keys, counts, count_field, shift, table_);
    scan_(table_, counts, count_field, tile_, ISO_RADIX_DIGITS);
    scatter_(range_, keys, values, counts, count_field, shift, table_, other_keys_, other_values_);
    std::swap(keys, other_keys_);
    std::swap(values, other_values_);
  }
}

}  // namespace isowave
