#pragma once
// Stable radix sort of (key, value) pairs on the device (Sec. 3.6).

#include "core/stages/device_counts.hpp"
#include "kernels/radix_sort.hpp"

namespace isowave::core {

/// The work-items that rank the pairs of a tile (radix_sort.cl). The result is the same.
enum class RadixRanking {
  kTogether,  ///< all work-items of a group, a bit for each pair
  kSerial     ///< one work-item of a group, on devices whose work-items are turns of a loop
};

class RadixSort {
 public:
  /// max_count: the largest number of pairs any call may sort; scratch is O(max_count).
  static ocl::BufferSizes sizes(std::uint64_t max_count, std::uint32_t group_size);
  RadixSort(ocl::Device &device, std::size_t max_count, std::uint32_t group_size,
            RadixRanking ranking);
  /// Ranks as suits the device.
  RadixSort(ocl::Device &device, std::size_t max_count, std::uint32_t group_size);

  /// Sorts the first n pairs by key, ascending; equal keys keep their order. Takes time in
  /// proportion to n * key_bits.
  ///
  /// keys, values  at least max_count entries; those past n are undefined afterwards, since the
  ///               buffers trade places with scratch ones
  /// count_field   of `counts`: n
  /// key_bits      1..32; every key must be < 2^key_bits
  /// Throws        std::invalid_argument: buffers smaller than max_count, key_bits out of range
  /// Waits         no
  void operator()(ocl::Buffer<uint> &keys, ocl::Buffer<uint> &values, CountsBuffer &counts,
                  uint count_field, uint key_bits);

 private:
  std::size_t max_count_;
  std::uint32_t group_size_;
  ocl::Range tiles_range_;
  ocl::Buffer<uint> other_keys_, other_values_, table_;
  ocl::Kernel<kernels::radix_histogram> histogram_;
  ocl::Kernel<kernels::radix_scan> scan_;
  ocl::Kernel<kernels::radix_scatter> scatter_;
};

}  // namespace isowave::core
