#pragma once
// Exclusive prefix sum and stream compaction with counts that live on the device (Sec. 3.6, 4.2).
// In: a table or a mask; out: sums or the kept entries in order.

#include "core/stages/device_counts.hpp"
#include "kernels/scan.hpp"

namespace isowave::core {

/// values[i] becomes values[0] + ... + values[i-1], in one work-group: for tables of tiles, which
/// are short.
class ExclusiveScan {
 public:
  ExclusiveScan(ocl::Device &device, std::uint32_t group_size);

  /// Scans the first ceil(n / divisor) entries. Sums wrap at 2^32.
  ///
  /// count_field  of `counts`: n
  /// total_field  of `counts`: gets the sum of all; ISO_INVALID_ID: none does
  /// Waits        no
  void operator()(ocl::Buffer<uint> &values, CountsBuffer &counts, uint count_field,
                  uint divisor = 1, uint total_field = ISO_INVALID_ID);

 private:
  std::uint32_t group_size_;
  ocl::Kernel<kernels::scan_exclusive> scan_;
};

/// Keeps the entries whose mask is not 0, in order.
class Compaction {
 public:
  /// max_count  the largest count any call may have
  static ocl::BufferSizes sizes(std::uint64_t max_count, std::uint32_t group_size);
  Compaction(ocl::Device &device, std::size_t max_count, std::uint32_t group_size);

  /// Keeps values[i] of every i < n with mask[i] != 0, in order.
  ///
  /// count_field  of `counts`: n
  /// out          must not be `values`
  /// total_field  of `counts`: gets how many were kept
  /// Waits        no
  void operator()(const ocl::Buffer<uint> &mask, const ocl::Buffer<uint> &values,
                  CountsBuffer &counts, uint count_field, ocl::Buffer<uint> &out, uint total_field);

 private:
  ocl::Range range_;
  std::uint32_t tile_;  ///< entries per tile
  ocl::Buffer<uint> tile_offsets_;
  ExclusiveScan scan_;
  ocl::Kernel<kernels::compact_count> count_;
  ocl::Kernel<kernels::compact_values> values_;
};

}  // namespace isowave::core
