#pragma once
// Every device buffer of a renderer, computed before any of them is made: what a memory budget is held to.

#include <cstdint>
#include <string>
#include <vector>

#include "core/ocl/device.hpp"
#include "core/pipeline.hpp"
#include "core/zfp_stream.hpp"

namespace isowave {

/// What the memory of a renderer depends on, besides its volume.
struct MemoryRequest {
  std::uint64_t num_pixels = 0;
  PipelineKind pipeline = PipelineKind::kRays;  ///< kBlocks or kRays
  Grouping grouping = kDefaultGrouping;
  std::uint32_t group_size = 64;
};

struct MemoryPlan {
  struct Buffer {
    std::string name;  ///< as in the device's MemoryLedger
    std::uint64_t bytes = 0;
  };
  std::vector<Buffer> buffers;    ///< that live as long as the renderer
  std::uint64_t setup_bytes = 0;  ///< all that exists while the value ranges are built, scratch included
  std::uint32_t cache_slots = 0;

  std::uint64_t total() const;  ///< bytes of buffers
  std::uint64_t peak() const;   ///< bytes: the most that ever exists
};

/// The plan with so many cache slots. The one place that knows all sizes; tests compare it with what is booked.
MemoryPlan plan_memory(const CompressedVolume &volume, const MemoryRequest &request,
                       std::uint32_t cache_slots);

/// The plan with the most cache slots, up to `max_slots`, whose peak is within `budget` bytes and whose buffers the device can
/// allocate. Throws Error, with the smallest budget that would do, when 8 slots are too many.
MemoryPlan plan_within(const ocl::Device &device, const CompressedVolume &volume,
                       const MemoryRequest &request, std::uint64_t budget, std::uint32_t max_slots);

}  // namespace isowave
