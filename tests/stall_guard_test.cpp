// A frame without progress is an error; slow progress is not.

#include "core/render/stall_guard.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isowave::core {
namespace {

constexpr glm::uvec3 kDims{3, 4, 5};

PassCounts waiting(uint rays) {
  PassCounts counts{};
  counts.active_count = counts.next_active_count = rays;
  return counts;
}

TEST(StallGuard, ThrowsAfterAsManyPassesAsARayHasCells) {
  StallGuard guard(kDims);
  for (int pass = 0; pass < 12; ++pass) guard.check(waiting(7));
  EXPECT_THAT([&] { guard.check(waiting(7)); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("7 rays have waited for")));
}

TEST(StallGuard, AnyProgressStartsAnew) {
  for (const auto field :
       {&PassCounts::requested_count, &PassCounts::decoded_count, &PassCounts::active_count}) {
    StallGuard guard(kDims);
    PassCounts progress = waiting(7);
    progress.*field += 1;
    for (int round = 0; round < 3; ++round) {
      for (int pass = 0; pass < 12; ++pass) guard.check(waiting(7));
      guard.check(progress);
    }
  }
}

}  // namespace
}  // namespace isowave::core
