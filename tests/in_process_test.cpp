// core/ocl/in_process: what PoCL, which is this process itself, leaves in its memory.

#include "core/ocl/in_process.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "core/ocl/buffer.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

/// Resident pages [bytes] of this process: private ones that were written to; of LLVM and Clang, in
/// mappings that cannot be written to.
struct Resident {
  std::uint64_t written = 0, compiler = 0;
};

Resident resident() {
  Resident result;
  std::ifstream maps("/proc/self/smaps");
  bool is_compiler = false;
  for (std::string line; std::getline(maps, line);) {
    const auto kibibytes = [&](std::size_t skip) { return std::stoull(line.substr(skip)) << 10; };
    if (line.starts_with("Rss:")) {
      if (is_compiler) result.compiler += kibibytes(4);
    } else if (line.starts_with("Private_Dirty:")) {
      result.written += kibibytes(14);
      if (is_compiler) result.compiler -= kibibytes(14);  // what the loader wrote, then protected
    } else if (line.find('-') < line.find(' ') && line.find(':') > line.find(' ')) {
      const bool is_named = line.find("/libLLVM") != std::string::npos ||
                            line.find("/libclang-cpp") != std::string::npos;
      is_compiler =
          is_named && line.find(" r") != std::string::npos && line.find(" rw") == std::string::npos;
    }
  }
  return result;
}

constexpr std::uint64_t kMiB = 1 << 20;

class InProcessOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void SetUp() override {
    if (!ocl::is_in_process(device_.info()))
      GTEST_SKIP() << "this device's memory is not the process's";
  }
  ocl::Device device_{GetParam()};
};

TEST_P(InProcessOnDevice, PagesAreThereWhenTheyAreWrittenTo) {
  constexpr std::size_t kCount = 64 * kMiB / sizeof(std::uint32_t);
  const std::uint64_t before = resident().written;
  {
    ocl::Buffer<std::uint32_t> buffer(device_, "large", kCount);
    EXPECT_EQ(device_.ledger().current(), 64 * kMiB) << "booked all the same";
    EXPECT_LT(resident().written, before + 4 * kMiB);
    std::vector<std::uint32_t> end(2, 1);
    buffer.read(end, kCount - 2);
    EXPECT_EQ(end, (std::vector<std::uint32_t>{0, 0}));
    buffer.fill(7, 0, kCount / 2);
    buffer.read(end, kCount / 2 - 1);
    EXPECT_EQ(end, (std::vector<std::uint32_t>{7, 0}));
    EXPECT_GT(resident().written, before + 30 * kMiB);
    EXPECT_LT(resident().written, before + 36 * kMiB);
    buffer.fill(8);  // under way when the buffer goes
  }
  device_.finish();
  EXPECT_LT(resident().written, before + 4 * kMiB) << "what a buffer had is given back";
}

TEST_P(InProcessOnDevice, CompilersCodeIsGivenBackAndStillWorks) {
  device_.build("scan", {{"ISO_GROUP_SIZE", "64"}});
  const std::uint64_t before = resident().compiler;
  if (before == 0) GTEST_SKIP() << "this PoCL has LLVM within itself";
  EXPECT_GT(before, 4 * kMiB);
  ocl::give_back_compiler(device_.info());
  EXPECT_LT(resident().compiler, 2 * kMiB);
  device_.build("scan", {{"ISO_GROUP_SIZE", "64"}, {"ISO_NOT_USED", "1"}});
  EXPECT_GT(resident().compiler, 2 * kMiB);
}

INSTANTIATE_TEST_SUITE_P(Devices, InProcessOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
