// core/ocl/buffer and memory_ledger: transfers, ranges, fills, and what the ledger counts through
// moves.

#include "core/ocl/buffer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;

TEST(MemoryLedger, CountsCurrentAndPeakInAllAndByName) {
  ocl::MemoryLedger ledger;
  ledger.add("a", 100);
  ledger.add("b", 50);
  ledger.remove("a", 100);
  ledger.add("b", 20);
  EXPECT_EQ(ledger.current(), 70u);
  EXPECT_EQ(ledger.peak(), 150u);
  EXPECT_EQ(ledger.by_name().at("a").current, 0u);
  EXPECT_EQ(ledger.by_name().at("a").peak, 100u);
  EXPECT_EQ(ledger.by_name().at("b").current, 70u);
  ledger.remove("unknown", 5);
  ledger.remove("b", 1000);
  EXPECT_EQ(ledger.current(), 0u) << "never below zero";
}

TEST(MemoryLedger, BooksNoMoreThanItsLimit) {
  ocl::MemoryLedger ledger;
  ledger.add("a", 70);
  ledger.set_limit(100);
  EXPECT_THROW(ledger.add("a", 31), Error);
  EXPECT_EQ(ledger.current(), 70u);
  ledger.add("b", 30);
  ledger.set_limit(50);
  EXPECT_THROW(ledger.add("a", 1), Error) << "more than that is booked";
  EXPECT_EQ(ledger.by_name().at("a").current, 70u);
}

class OclBufferOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};

std::vector<std::uint32_t> counting(std::size_t count) {
  std::vector<std::uint32_t> values(count);
  std::iota(values.begin(), values.end(), 1000u);
  return values;
}

TEST_P(OclBufferOnDevice, StartsAsZeros) {
  EXPECT_THAT(ocl::Buffer<std::uint32_t>(device_, "words", 1000).read(), Each(0u));
  EXPECT_THAT(ocl::Buffer<std::uint8_t>(device_, "bytes", 1003).read(), Each(0u));
}

TEST_P(OclBufferOnDevice, WritesAndReadsParts) {
  std::vector<std::uint32_t> expected = counting(100);
  ocl::Buffer<std::uint32_t> buffer(device_, "values", expected);
  EXPECT_EQ(buffer.read(), expected);
  const std::array<std::uint32_t, 3> part = {7, 8, 9};
  buffer.write(part, 97);
  std::copy(part.begin(), part.end(), expected.begin() + 97);
  std::vector<std::uint32_t> tail(5);
  buffer.read(tail, 95);
  EXPECT_EQ(tail, std::vector<std::uint32_t>(expected.end() - 5, expected.end()));
  EXPECT_EQ(buffer.read(), expected);
}

TEST_P(OclBufferOnDevice, SmallCopiesEndWhereTheyAreTold) {
  const std::vector<std::uint32_t> source = counting(10);
  const ocl::Buffer<std::uint32_t> from(device_, "from", source);
  ocl::Buffer<std::uint32_t> to(device_, "to", std::vector<std::uint32_t>(6, 99));
  to.copy(from, 0);
  EXPECT_THAT(to.read(), Each(99u));
  to.copy(from, 4);
  std::vector<std::uint32_t> expected(source.begin(), source.begin() + 4);
  expected.insert(expected.end(), 2, 99);
  EXPECT_EQ(to.read(), expected);
  EXPECT_THROW(to.copy(from, 7), std::invalid_argument);
  ocl::Buffer<std::uint32_t> large(device_, "large", 20);
  EXPECT_THROW(large.copy(from, 11), std::invalid_argument);
}

TEST_P(OclBufferOnDevice, RefusesRangesPastTheEnd) {
  ocl::Buffer<std::uint32_t> buffer(device_, "ray_ids", 10);
  std::vector<std::uint32_t> values(4);
  cl::Event event;
  EXPECT_THROW(buffer.write(values, 7), std::invalid_argument);
  EXPECT_THROW(buffer.read(values, 7), std::invalid_argument);
  EXPECT_THROW(buffer.read(values, 11), std::invalid_argument);
  EXPECT_THROW(buffer.read(values, std::numeric_limits<std::size_t>::max() - 1),
               std::invalid_argument);
  EXPECT_THROW(buffer.read_async(values, event, 7), std::invalid_argument);
  EXPECT_THROW(buffer.fill(1, 8, 3), std::invalid_argument);
  try {
    buffer.write(values, 7);
  } catch (const std::invalid_argument &error) {
    EXPECT_STREQ(error.what(), "4 elements from 7 on do not fit buffer 'ray_ids' of 10");
  }
  EXPECT_THAT(buffer.read(), Each(0u)) << "nothing was written";
  EXPECT_NO_THROW(buffer.write(values, 6));
  EXPECT_NO_THROW(buffer.write({}, 10));
}

template <std::size_t kWords>
void expect_fill(ocl::Device &device) {
  using Pattern = std::array<std::uint32_t, kWords>;
  Pattern pattern;
  std::iota(pattern.begin(), pattern.end(), 1u);
  ocl::Buffer<Pattern> buffer(device, "patterns", 5);
  buffer.fill(pattern, 1, 3);
  const Pattern zeros{};
  EXPECT_EQ(buffer.read(), (std::vector<Pattern>{zeros, pattern, pattern, pattern, zeros}))
      << kWords << " words";
}

TEST_P(OclBufferOnDevice, FillsWithPatternsOfEverySize) {
  expect_fill<1>(device_);
  expect_fill<2>(device_);
  expect_fill<4>(device_);
  expect_fill<8>(device_);
  expect_fill<16>(device_);
  expect_fill<32>(device_);
  ocl::Buffer<std::uint8_t> bytes(device_, "bytes", 7);
  bytes.fill(3);
  EXPECT_THAT(bytes.read(), Each(3u));
  ocl::Buffer<std::uint16_t> shorts(device_, "shorts", 7);
  shorts.fill(0x1234);
  EXPECT_THAT(shorts.read(), Each(0x1234u));
}

TEST_P(OclBufferOnDevice, AsyncReadsArriveInQueueOrder) {
  ocl::Buffer<std::uint32_t> buffer(device_, "counts", counting(64));
  std::vector<std::uint32_t> before(64), after(32);
  cl::Event before_event, after_event;
  buffer.read_async(before, before_event);
  buffer.fill(5);
  buffer.read_async(after, after_event, 32);
  after_event.wait();
  before_event.wait();
  EXPECT_EQ(before, counting(64));
  EXPECT_THAT(after, Each(5u));
}

TEST_P(OclBufferOnDevice, FinishWaitsForReadsThatWereFlushed) {
  const ocl::Buffer<std::uint32_t> buffer(device_, "many", std::size_t{1} << 24);
  std::vector<std::uint32_t> values(buffer.size());
  cl::Event event;
  buffer.read_async(values, event);
  device_.finish();
  EXPECT_EQ(event.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>(), CL_COMPLETE);
  event.wait();
}

TEST_P(OclBufferOnDevice, EmptyBuffersWork) {
  ocl::Buffer<std::uint32_t> buffer(device_, "none", 0);
  EXPECT_EQ(buffer.size(), 0u);
  EXPECT_TRUE(buffer.read().empty());
  buffer.write({});
  buffer.fill(1);
  cl::Event event;
  buffer.read_async({}, event);
  event.wait();
  EXPECT_EQ(device_.ledger().current(), 1u) << "OpenCL has no empty buffers";
}

TEST_P(OclBufferOnDevice, LedgerFollowsMoves) {
  ocl::MemoryLedger &ledger = device_.ledger();
  {
    ocl::Buffer<std::uint32_t> a(device_, "a", counting(100));
    EXPECT_EQ(ledger.current(), 400u);
    ocl::Buffer<std::uint32_t> b(std::move(a));
    EXPECT_EQ(ledger.current(), 400u);
    EXPECT_EQ(a.size(), 0u);  // NOLINT(bugprone-use-after-move): moved-from buffers hold nothing
    EXPECT_THROW(a.fill(1, 0, 1), std::invalid_argument);
    EXPECT_EQ(b.read(), counting(100));

    ocl::Buffer<std::uint32_t> c(device_, "c", 50);
    EXPECT_EQ(ledger.current(), 600u);
    c = std::move(b);
    EXPECT_EQ(ledger.current(), 400u);
    EXPECT_EQ(ledger.by_name().at("c").current, 0u);
    EXPECT_EQ(c.name(), "a");
    EXPECT_EQ(c.read(), counting(100));
    EXPECT_EQ(b.size(), 0u);  // NOLINT(bugprone-use-after-move)
    b = ocl::Buffer<std::uint32_t>(device_, "d", 10);
    EXPECT_EQ(ledger.current(), 440u);
    EXPECT_EQ(b.read().size(), 10u);
  }
  EXPECT_EQ(ledger.current(), 0u);
  EXPECT_EQ(ledger.peak(), 600u);
  EXPECT_EQ(ledger.by_name().at("a").peak, 400u);
}

TEST_P(OclBufferOnDevice, SwapKeepsTheBooks) {
  ocl::Buffer<std::uint32_t> a(device_, "a", 10), b(device_, "b", 20);
  std::swap(a, b);
  EXPECT_EQ(a.name(), "b");
  EXPECT_EQ(a.size(), 20u);
  EXPECT_EQ(device_.ledger().by_name().at("a").current, 40u);
  EXPECT_EQ(device_.ledger().by_name().at("b").current, 80u);
}

TEST_P(OclBufferOnDevice, TooLargeIsRefusedBeforeAnyWork) {
  const std::uint64_t largest = device_.capabilities().largest_allocation;
  for (const std::size_t count :
       {std::size_t(largest / 4 + 1), std::numeric_limits<std::size_t>::max()}) {
    try {
      ocl::Buffer<std::uint32_t> huge(device_, "huge", count);
      FAIL() << "was allocated";
    } catch (const Error &error) {
      EXPECT_THAT(
          error.what(),
          AllOf(HasSubstr("'huge'"), HasSubstr("MiB"), HasSubstr(GetParam().name),
                HasSubstr(fmt::format("{:.1f}", static_cast<double>(largest) / (1 << 20)))));
    }
  }
  EXPECT_EQ(device_.ledger().peak(), 0u);
}

INSTANTIATE_TEST_SUITE_P(Devices, OclBufferOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
