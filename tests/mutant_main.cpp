// A program built with one planted bug in the portable headers (mutants.cmake). Succeeds if the
// stability suite or the watertight test finds it.

#include <fmt/format.h>

#include "reference/stability_suite.hpp"
#include "reference/watertight.hpp"

int main() {
  using namespace isowave::core;
  std::uint64_t failed_cases = 0, leaks = 0;
  for (const StabilityCase &stability_case : stability_cases(600, 20231)) {
    const CaseResult result = run_case(stability_case, kDefaultSolver);
    if (passes(result)) continue;
    ++failed_cases;
    fmt::print("{}: {} missed, {} false, {} resumed differently, residual p99 {:.1e}\n",
               stability_case.name, result.accuracy.missed, result.accuracy.false_hits,
               result.resumed_differently, quantiles(result.accuracy.residual).p99);
  }
  for (const WatertightResult &result : run_watertight(100000, 20231, kDefaultSolver))
    leaks += result.leaks;
  fmt::print("{} cases failed, {} leaks\n", failed_cases, leaks);
  return failed_cases + leaks > 0 ? 0 : 1;
}
