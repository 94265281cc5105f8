#include "core/paper/scan.hpp"

#include <algorithm>

namespace isowave::core {

namespace {

/// One work-group does the whole scan: on a GPU a large one, or most of the device's width stays
/// idle.
std::uint32_t scan_group_size(const ocl::Device &device, std::uint32_t group_size) {
  const bool gpu = device.info().type == ocl::DeviceType::kGpu;
  return gpu ? std::max(group_size, 256u) : group_size;
}

}  // namespace

ExclusiveScan::ExclusiveScan(ocl::Device &device, std::uint32_t group_size)
    : group_size_(scan_group_size(device, group_size)), scan_(device, group_defines(group_size_)) {}

void ExclusiveScan::operator()(ocl::Buffer<uint> &values, CountsBuffer &counts, uint count_field,
                               uint divisor, uint total_field) {
  scan_(ocl::Range::groups(1, group_size_), values, counts, count_field, divisor, total_field);
}

ocl::BufferSizes Compaction::sizes(std::uint64_t max_count, std::uint32_t group_size) {
  return {
      ocl::buffer_size<uint>("scan tile sums", num_tiles(max_count, group_size, ISO_SCAN_ITEMS))};
}

Compaction::Compaction(ocl::Device &device, std::size_t max_count, std::uint32_t group_size)
    : tile_(group_size * ISO_SCAN_ITEMS),
      tile_offsets_(device, sizes(max_count, group_size)["scan tile sums"]),
      scan_(device, group_size),
      count_(device, group_defines(group_size)),
      values_(device, group_defines(group_size)) {
  range_ =
      ocl::Range::strided((max_count + ISO_SCAN_ITEMS - 1) / ISO_SCAN_ITEMS, group_size, device);
}

void Compaction::operator()(const ocl::Buffer<uint> &mask, const ocl::Buffer<uint> &values,
                            CountsBuffer &counts, uint count_field, ocl::Buffer<uint> &out,
                            uint total_field) {
  count_(range_, mask, counts, count_field, tile_offsets_);
  scan_(tile_offsets_, counts, count_field, tile_, total_field);
  values_(range_, mask, values, counts, count_field, tile_offsets_, out);
}

}  // namespace isowave::core
