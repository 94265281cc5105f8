#pragma once
// The stability suite: small fields and rays at which intersectors fail, each case named and
// seeded. What must come out is decided by the root oracle, not stored.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/frame/solvers.hpp"
#include "kernels_cl/portable/grid_dda.h"
#include "reference/accuracy.hpp"

namespace isowave::core {

/// One field and the rays that are shot at it. Index space.
struct StabilityScene {
  std::array<std::uint32_t, 3> dims{2, 2, 2};
  std::vector<float> voxels;  ///< [nz][ny][nx]
  float isovalue = 0;
  std::vector<Ray> rays;
};

/// A kind of trouble: many scenes, judged together.
struct StabilityCase {
  std::string name;         ///< "double roots"
  std::string description;  ///< one line: what is hard about it
  std::vector<StabilityScene> scenes;
};

struct CaseResult {
  Accuracy accuracy;
  std::uint64_t resumed_differently =
      0;  ///< rays whose hit has other bits when walked block by block

  /// Rays missed, false, in a wrong cell, in a wrong place or resumed differently.
  std::uint64_t failures() const { return accuracy.failures() + resumed_differently; }
};

/// Every case, with about `rays_per_case` rays each. The same for the same seed on every machine.
std::vector<StabilityCase> stability_cases(std::uint32_t rays_per_case, std::uint32_t seed);

/// A case's rays through the twin with one solver, judged by the root oracle; each is walked twice,
/// at once and block by block.
CaseResult run_case(const StabilityCase &stability_case, Solver solver);

/// Largest 99th percentile of |f - iso| / |grad f| that the default solver may have [voxels]. It
/// may have no failures.
inline constexpr double kResidualLimit = 1e-4;
bool passes(const CaseResult &result);

}  // namespace isowave::core
