#pragma once
// Counts that live on the device (PassCounts), named by field, and the macro every work-group
// kernel is built with.

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/ocl/buffer.hpp"
#include "core/ocl/device.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// The `count_field` argument of kernels: which uint of PassCounts says how many entries there are.
#define ISO_COUNT_FIELD(field) \
  static_cast<std::uint32_t>(offsetof(::isowave::core::PassCounts, field) / sizeof(std::uint32_t))

using CountsBuffer = ocl::Buffer<PassCounts>;

/// Work-items per group of every kernel with a required work-group size.
inline ocl::Defines group_defines(std::uint32_t group_size) {
  return {{"ISO_GROUP_SIZE", std::to_string(group_size) + "u"}};
}

/// Tiles of group_size * items entries that hold `count`.
inline std::uint64_t num_tiles(std::uint64_t count, std::uint32_t group_size, std::uint32_t items) {
  const std::uint64_t tile = std::uint64_t{group_size} * items;
  return (count + tile - 1) / tile;
}

/// For kernels of frames that may be drawn at several levels of detail.
inline ocl::Defines with_levels(ocl::Defines defines, bool levels) {
  if (levels) defines.insert({"ISO_LEVELS", "1"});
  return defines;
}

}  // namespace isowave::core
