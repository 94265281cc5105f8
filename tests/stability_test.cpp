// The stability suite and the watertight test at a size that every test run can afford (`isowave
// verify` runs them large).

#include "reference/stability_suite.hpp"

#include <gtest/gtest.h>

#include "reference/watertight.hpp"

namespace isowave::core {
namespace {

constexpr std::uint32_t kSeed = 20231;

TEST(StabilitySuite, DefaultSolverMissesNothingAndInventsNothing) {
  for (const StabilityCase &stability_case : stability_cases(600, kSeed)) {
    SCOPED_TRACE(stability_case.name);
    const CaseResult result = run_case(stability_case, kDefaultSolver);
    EXPECT_EQ(result.accuracy.missed, 0u);
    EXPECT_EQ(result.accuracy.false_hits, 0u);
    EXPECT_EQ(result.resumed_differently, 0u);
    EXPECT_TRUE(passes(result)) << quantiles(result.accuracy.residual).p99;
    EXPECT_GE(result.accuracy.rays, 500u);
  }
}

TEST(StabilitySuite, WalksResumeAlikeWithEverySolver) {
  for (const std::string_view name : kSolverNames) {
    for (const StabilityCase &stability_case : stability_cases(200, kSeed)) {
      EXPECT_EQ(run_case(stability_case, solver_from_string(name)).resumed_differently, 0u)
          << name << ", " << stability_case.name;
    }
  }
}

TEST(StabilitySuite, ShowsWhereTheOtherSolversFail) {
  for (const char *name : {"linear", "marmitt", "analytic"}) {
    std::uint64_t failures = 0;
    for (const StabilityCase &stability_case : stability_cases(300, kSeed)) {
      failures += run_case(stability_case, solver_from_string(name)).failures();
    }
    EXPECT_GT(failures, 0u)
        << name << ": a suite that every solver passes proves nothing of the default one";
  }
}

TEST(StabilitySuite, IsTheSameForTheSameSeed) {
  const auto a = stability_cases(50, 7), b = stability_cases(50, 7);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].scenes.size(), b[i].scenes.size());
    EXPECT_EQ(a[i].scenes.front().voxels, b[i].scenes.front().voxels);
  }
}

TEST(Watertight, NotOneRayLeaks) {
  for (const WatertightResult &result : run_watertight(200000, kSeed, kDefaultSolver)) {
    EXPECT_EQ(result.leaks, 0u) << result.surface;
    EXPECT_EQ(result.rays, 200000u);
  }
}

TEST(Watertight, NotOneRayLeaksBetweenLevelsOfDetail) {
  for (const WatertightResult &result :
       run_watertight(100000, kSeed, kDefaultSolver, RayBands::kLevels))
    EXPECT_EQ(result.leaks, 0u) << result.surface;
}

TEST(Watertight, FindsTheLeaksOfALeakySolver) {
  std::uint64_t leaks = 0;
  for (const WatertightResult &result :
       run_watertight(100000, kSeed, solver_from_string("analytic")))
    leaks += result.leaks;
  EXPECT_GT(leaks, 0u);
}

}  // namespace
}  // namespace isowave::core
