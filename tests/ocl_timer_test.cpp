// core/ocl/stage_timer: off, from events or from the wall clock, whichever the driver allows.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "kernels/launch_probe.hpp"
#include "kernels_cl/portable/shared_types.h"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::Contains;
using testing::Key;
using testing::UnorderedElementsAre;

class OclTimerOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Enough work to take measurable time.
  static void work(ocl::Device &device) {
    constexpr uint kCount = 1u << 14;
    const ocl::Buffer<uint> input(device, "input", kCount);
    ocl::Buffer<uint> output(device, "output", kCount);
    ocl::Kernel<kernels::scale_values> scale(device);
    scale(ocl::Range::strided(kCount, 64, device), input, kCount, 3, output);
  }
};

TEST_P(OclTimerOnDevice, CountsCommandsOnAndOff) {
  for (const bool profiling : {false, true}) {
    SCOPED_TRACE(profiling);
    ocl::Device device(GetParam(), profiling);
    ocl::Kernel<kernels::launch_empty> empty(device);
    ocl::Buffer<uint> buffer(device, "buffer", 4);
    const std::uint64_t before = device.timer().num_commands();
    empty({1, 1});
    empty({0, 1});  // enqueues nothing
    buffer.fill(7);
    empty({1, 1});
    EXPECT_EQ(device.timer().num_commands() - before, 3u);
  }
}

TEST_P(OclTimerOnDevice, OffKeepsNothing) {
  ocl::Device device(GetParam());
  EXPECT_EQ(device.timer().source(), ocl::TimerSource::kOff);
  EXPECT_EQ(device.timer().next_event(), nullptr);
  {
    const auto stage = device.timer().stage("work");
    work(device);
  }
  EXPECT_TRUE(device.timer().collect().empty());
}

TEST_P(OclTimerOnDevice, OnBooksTheInnermostStage) {
  ocl::Device device(GetParam(), true);
  ASSERT_NE(device.timer().source(), ocl::TimerSource::kOff);
  {
    const auto outer = device.timer().stage("outer");
    work(device);
    {
      const auto inner = device.timer().stage("inner");
      work(device);
      work(device);
    }
    work(device);
  }
  const std::map<std::string, double> times = device.timer().collect();
  EXPECT_THAT(times, UnorderedElementsAre(Key("outer"), Key("inner")));
  for (const auto &[name, milliseconds] : times) {
    EXPECT_GT(milliseconds, 0.0) << name;
    EXPECT_LT(milliseconds, 60e3) << name;
  }
  EXPECT_TRUE(device.timer().collect().empty()) << "collect() starts again";
}

TEST_P(OclTimerOnDevice, OutsideOfStages) {
  ocl::Device device(GetParam(), true);
  work(device);
  const std::map<std::string, double> times = device.timer().collect();
  if (device.timer().source() == ocl::TimerSource::kEvents) {
    EXPECT_THAT(times, UnorderedElementsAre(Key("other")));
  } else {
    EXPECT_TRUE(times.empty()) << "the wall clock would count the host";
  }
}

TEST_P(OclTimerOnDevice, CollectInsideAStageCountsEveryMomentOnce) {
  ocl::Device device(GetParam(), true);
  const auto stage = device.timer().stage("work");
  work(device);
  EXPECT_THAT(device.timer().collect(), Contains(Key("work")));
  work(device);
  EXPECT_THAT(device.timer().collect(), Contains(Key("work")));
}

TEST_P(OclTimerOnDevice, TransfersAndAsyncReadsAreBooked) {
  ocl::Device device(GetParam(), true);
  ocl::Buffer<uint> buffer(device, "values", 1000);
  EXPECT_TRUE(device.timer().collect().empty()) << "allocating belongs to no stage";
  std::vector<uint> values(1000);
  cl::Event event;
  {
    const auto stage = device.timer().stage("transfer");
    buffer.read_async(values, event);
    buffer.fill(3);
    buffer.write(values);
  }
  event.wait();
  EXPECT_THAT(device.timer().collect(), UnorderedElementsAre(Key("transfer")));
}

INSTANTIATE_TEST_SUITE_P(Devices, OclTimerOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
