#pragma once
// The watertight test: rays at closed surfaces, none of which may pass through.

#include <cstdint>
#include <string>
#include <vector>

#include "core/frame/solvers.hpp"

namespace isowave::core {

struct WatertightResult {
  std::string surface;  ///< "sphere", "torus", "gyroid shell"; with ", levels" behind it
  std::uint64_t rays =
      0;  ///< half of them start inside the surface, half outside aim at a point inside
  std::uint64_t leaks = 0;  ///< rays that reach the other side without a hit
};

/// The levels of detail that rays go through.
enum class RayBands {
  kOne,    ///< the volume's own grid
  kLevels  ///< three levels of detail, whose borders are anywhere on the ray, before and behind the
           ///< surface and at it
};

/// Shoots num_rays rays at each of three closed surfaces with the twin, on all cores. A ray that
/// starts at an inside point must hit something; one from outside must hit before it reaches the
/// inside point it aims at. A third of the rays run along lattice directions through lattice
/// points, where walks go wrong first. A point is inside where it is at every level. The same for
/// the same seed.
std::vector<WatertightResult> run_watertight(std::uint64_t num_rays, std::uint32_t seed,
                                             Solver solver, RayBands bands = RayBands::kOne);

}  // namespace isowave::core
