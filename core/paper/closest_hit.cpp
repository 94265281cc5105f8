#include "core/paper/closest_hit.hpp"

#include "core/base/error.hpp"

namespace isowave::core {

std::string_view to_string(ClosestHit closest) {
  return closest == ClosestHit::kScan ? "scan" : "atomic-min";
}

ClosestHit closest_hit_from_string(std::string_view name) {
  for (const ClosestHit closest : {ClosestHit::kScan, ClosestHit::kAtomicMin}) {
    if (name == to_string(closest)) return closest;
  }
  throw Error("no way to the closest hit is called '{}'; there are: scan, atomic-min", name);
}

}  // namespace isowave::core
