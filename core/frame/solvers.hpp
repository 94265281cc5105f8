#pragma once
// The family of root finders by name. kernels_cl/portable/solver.h says what each guarantees, and
// when it fails.

#include <array>
#include <string_view>

#include "kernels_cl/portable/solver.h"

namespace isowave::core {

/// The cheapest that passes the whole stability suite (reference/README.md).
inline constexpr Solver kDefaultSolver{ISO_SOLVER_BERNSTEIN, 32};

inline constexpr std::array<std::string_view, 4> kSolverNames{"linear", "marmitt", "analytic",
                                                              "bernstein"};

/// The name of a solver: "linear", "marmitt", "analytic", "bernstein".
std::string_view to_string(Solver solver);
/// The solver of that name with the steps its authors use: linear and marmitt 4, bernstein 32 (it
/// stops by itself after 3 to 5).
///
/// Throws  Error naming the solvers
Solver solver_from_string(std::string_view name);

/// Whether the solver misses no crossing, and converges.
inline bool finds_all(Solver solver) {
  return solver.kind == kDefaultSolver.kind && solver.max_steps >= kDefaultSolver.max_steps;
}

}  // namespace isowave::core
