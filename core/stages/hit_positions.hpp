#pragma once
// Hit buffer -> positions in the world (kernels_cl/hit_positions.cl), for devices with doubles.

#include <cstddef>

#include "core/ocl/kernel.hpp"
#include "kernels/hit_positions.hpp"
#include "kernels_cl/portable/world_position.h"

namespace isowave::core {

class HitPositions {
 public:
  explicit HitPositions(ocl::Device &device) : device_(device), kernel_(device) {}

  /// Whether the device can compute them.
  static bool suits(const ocl::Device &device) { return device.capabilities().fp64; }

  /// Enqueues the positions of hits [begin, begin + count), see hit_position(). The kernel is
  /// compiled at the first call.
  ///
  /// Out  positions: double [count][3]
  void operator()(const HitMap &map, uint begin, uint count, const ocl::Buffer<HitRecord> &hits,
                  ocl::Buffer<std::byte> &positions) {
    kernel_(ocl::Range::each(count, ocl::kGroupSize, device_), map, begin, count, hits, positions);
  }

 private:
  ocl::Device &device_;
  ocl::Kernel<kernels::hit_positions> kernel_;
};

}  // namespace isowave::core
