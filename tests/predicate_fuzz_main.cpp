// The walk's float filter against two-float alone (predicate_fuzz.hpp), for as many rays as asked:
//
//   predicate_fuzz [rays] [seed]
//
// Succeeds if no decision differs. Built with a weaker filter, it must fail (mutants.cmake).

#include <cstdio>
#include <cstdlib>

#include "tests/predicate_fuzz.hpp"

int main(int argc, char **argv) {
  using namespace isowave::core::test;
  const std::uint64_t rays = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 100000;
  const auto seed = static_cast<std::uint32_t>(argc > 2 ? std::atoi(argv[2]) : 1);
  std::uint64_t wrong = 0;
  const auto report = [&](const char *what, const PredicateFuzz &result) {
    std::printf("%s: %llu rays, %llu decisions, %llu in doubt, %llu differ\n", what,
                static_cast<unsigned long long>(result.rays),
                static_cast<unsigned long long>(result.decisions),
                static_cast<unsigned long long>(result.doubts),
                static_cast<unsigned long long>(result.wrong));
    wrong += result.wrong;
  };
  report("walks", check_walks(rays, seed));
  report("near ties", check_near_ties(10 * rays, seed));
  return wrong == 0 ? 0 : 1;
}
