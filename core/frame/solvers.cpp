#include "core/frame/solvers.hpp"

#include <fmt/ranges.h>

#include "core/base/error.hpp"

namespace isowave::core {

std::string_view to_string(Solver solver) {
  return kSolverNames.at(static_cast<std::size_t>(solver.kind));
}

Solver solver_from_string(std::string_view name) {
  constexpr std::array<int, kSolverNames.size()> kSteps{4, 4, 0, kDefaultSolver.max_steps};
  for (int kind = 0; kind < static_cast<int>(kSolverNames.size()); ++kind) {
    const auto i = static_cast<std::size_t>(kind);
    if (kSolverNames[i] == name) return {kind, kSteps[i]};
  }
  throw Error("no solver is called '{}'; there are: {}", name, fmt::join(kSolverNames, ", "));
}

}  // namespace isowave::core
