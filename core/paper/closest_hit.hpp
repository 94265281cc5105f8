#pragma once
// How the closest of a ray's results is found. The picture has the same bits either way.

#include <string_view>

#include "core/ocl/device.hpp"

namespace isowave::core {

enum class ClosestHit {
  kScan,      ///< composite looks at each of them
  kAtomicMin  ///< each work-item with a result offers its index: one word a ray to look at
};
inline constexpr ClosestHit kDefaultClosestHit = ClosestHit::kAtomicMin;

/// "scan", "atomic-min".
std::string_view to_string(ClosestHit closest);
/// Throws  Error naming both
ClosestHit closest_hit_from_string(std::string_view name);

/// The macro for the kernels that take part.
inline ocl::Defines closest_defines(ClosestHit closest) {
  return {{"ISO_CLOSEST_BY_ATOMICS", closest == ClosestHit::kAtomicMin ? "1" : "0"}};
}

}  // namespace isowave::core
