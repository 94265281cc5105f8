// core/stages/prefix_sum against std::exclusive_scan.

#include "core/stages/prefix_sum.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>
#include <vector>

#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

class PrefixSumOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Sums random entries that fill 32 bits, so that sums wrap, or counts as stages have.
  void expect_sums(PrefixSum &sum, uint count, uint largest) {
    SCOPED_TRACE(fmt::format("{} entries up to {}", count, largest));
    constexpr uint kSentinel = 0xDEADBEEFu;
    Random random(count);
    std::vector<uint> values(count + 2);
    for (uint &value : values) value = largest == 0 ? random() : random() % largest;
    values[count + 1] = kSentinel;
    ocl::Buffer<uint> buffer(device_, "values", std::span<const uint>(values));
    sum(buffer, count);
    std::vector<uint> expected(values);
    std::exclusive_scan(values.begin(), values.end() - 1, expected.begin(), 0u);
    EXPECT_EQ(first_difference(buffer.read(), expected), kNoDifference);
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, PrefixSumOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(PrefixSumOnDevice, SmallAwkwardCounts) {
  PrefixSum sum(device_, 3 * 64, 8);
  for (const uint count : awkward_counts(64)) {
    expect_sums(sum, count, 0);
    expect_sums(sum, count, 193);
  }
}

/// Tiles' sums fill more than one tile themselves.
TEST_P(PrefixSumOnDevice, ManyTiles) {
  PrefixSum small_groups(device_, 10'000, 8), usual(device_, 700'000, 64);
  for (const uint count : {4095u, 4096u, 4097u, 10'000u}) expect_sums(small_groups, count, 0);
  for (const uint count : {262'143u, 262'145u, 700'000u}) expect_sums(usual, count, 193);
}

TEST_P(PrefixSumOnDevice, SmallRefusesWhatDoesNotFit) {
  PrefixSum sum(device_, 10, 8);
  ocl::Buffer<uint> values(device_, "values", 20), short_one(device_, "short", 5);
  EXPECT_THROW(sum(values, 11), std::invalid_argument);
  EXPECT_THROW(sum(short_one, 5), std::invalid_argument);
}

}  // namespace
}  // namespace isowave::core
