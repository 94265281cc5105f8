#pragma once
// Exclusive prefix sum of a table that may be long and whose length the host knows. ExclusiveScan
// (scan.hpp) is for short ones whose length lives on the device.

#include "core/stages/device_counts.hpp"
#include "kernels/prefix_sum.hpp"

namespace isowave::core {

class PrefixSum {
 public:
  /// max_count  the largest count any call may have
  static ocl::BufferSizes sizes(std::uint64_t max_count, std::uint32_t group_size);
  PrefixSum(ocl::Device &device, std::uint64_t max_count, std::uint32_t group_size);

  /// values[i] becomes values[0] + ... + values[i-1]. Sums wrap at 2^32.
  ///
  /// values  [more than count]; values[count] becomes the sum of all before it
  /// Throws  std::invalid_argument: count is not below values.size(), or above max_count
  /// Waits   no
  void operator()(ocl::Buffer<uint> &values, std::uint32_t count);

 private:
  ocl::Device &device_;
  std::uint64_t max_count_;
  std::uint32_t group_size_;
  ocl::Buffer<uint> tile_sums_;
  ocl::Kernel<kernels::prefix_tile_sums> tile_sums_kernel_;
  ocl::Kernel<kernels::prefix_tile_offsets> tile_offsets_kernel_;
  ocl::Kernel<kernels::prefix_tiles> tiles_kernel_;
};

}  // namespace isowave::core
