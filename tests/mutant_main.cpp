// A program built with one planted bug in the portable headers (tests/CMakeLists.txt, mutants). Succeeds if the stability
// suite or the watertight test finds it.

#include <fmt/format.h>

#include "reference/stability_suite.hpp"
#include "reference/watertight.hpp"

int main() {
  using namespace isowave;
  std::uint64_t missed = 0, false_hits = 0, leaks = 0;
  for (const StabilityCase &stability_case : stability_cases(600, 20231)) {
    const Accuracy tally = run_case(stability_case, kDefaultSolver);
    missed += tally.missed;
    false_hits += tally.false_hits;
  }
  for (const WatertightResult &result : run_watertight(100000, 20231, kDefaultSolver)) leaks += result.leaks;
  fmt::print("missed {}, false {}, leaks {}\n", missed, false_hits, leaks);
  return missed + false_hits + leaks > 0 ? 0 : 1;
}
