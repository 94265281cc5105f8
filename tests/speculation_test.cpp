// core/speculation: what a pass opens with, of the counts that the last one left.

#include "core/paper/speculation.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr uint kWidth = 16, kHeight = 12, kPixels = kWidth * kHeight;

class SpeculationOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
  Speculation speculation_{device_};
};

TEST_P(SpeculationOnDevice, SmallCountsOfEveryPass) {
  Wavefront rays(device_, {kPixels});
  rays.frame.view.width = kWidth;
  rays.frame.view.height = kHeight;
  for (const uint most : {1u, 7u, 64u}) {
    rays.frame.schedule.max_spec_count = most;
    for (const uint active :
         {0u, 1u, 2u, 3u, 5u, kPixels / 7, kPixels / 2 + 1, kPixels - 1, kPixels}) {
      for (const bool scarce : {false, true}) {
        SCOPED_TRACE(fmt::format("at most {}, {} active, slots {}", most, active,
                                 scarce ? "ran out" : "sufficed"));
        const PassCounts before = [&] {
          PassCounts counts = distinct_counts();
          counts.next_active_count = active;
          counts.window_count = 40;
          counts.requested_count = 100;
          counts.decoded_count = scarce ? 25 : 100;
          return counts;
        }();
        rays.counts.write({&before, 1});
        speculation_.begin_pass(rays);
        PassCounts expected = before;  // ray_count, free_count and next_active_count stay
        expected.pass = before.pass + 1;
        expected.active_count = active;
        expected.spec_count = active == 0 ? 0 : std::min(most, kPixels / active);
        expected.window_count = std::min(active, scarce ? 10u : 51u);
        expected.pair_slot_count = expected.window_count * expected.spec_count;
        expected.pair_count = expected.ahead_count = expected.granted_count =
            expected.visible_count = 0;
        expected.requested_count = expected.decoded_count = expected.recycled_count =
            expected.hit_count = 0;
        expect_counts(rays.counts, expected);
      }
    }
  }
}

TEST_P(SpeculationOnDevice, SmallRaysLeftBecomeActive) {
  Wavefront rays(device_, {kPixels});
  rays.frame.view.width = kWidth;
  rays.frame.view.height = kHeight;
  rays.frame.schedule.max_spec_count = 64;
  std::vector<uint> left(kPixels, 7);
  rays.next_active_ray_ids.write(left);
  speculation_.begin_pass(rays);
  EXPECT_EQ(rays.active_ray_ids.read(), left);
}

INSTANTIATE_TEST_SUITE_P(Devices, SpeculationOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
