#pragma once
// The devices that tests of kernels run on.
//
//   class ScanTest : public testing::TestWithParam<ocl::DeviceInfo> {};
//   INSTANTIATE_TEST_SUITE_P(Devices, ScanTest, testing::ValuesIn(devices_under_test()),
//   device_test_name);

#include <gtest/gtest.h>

#include <cctype>
#include <cstdlib>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "core/ocl/device.hpp"

namespace isowave::core {

namespace ocl {
/// What GoogleTest prints as the parameter.
inline void PrintTo(const DeviceInfo &info, std::ostream *out) {
  *out << info.index << " '" << info.name << "' (" << info.platform << ")";
}
}  // namespace ocl

/// The device that ISOWAVE_DEVICE chooses when it is set, else every device. Empty when there is
/// none: GoogleTest then fails the suite, since a suite that is instantiated with nothing is an
/// error. Devices other than llvmpipe keep their programs from case to case.
inline std::vector<ocl::DeviceInfo> devices_under_test() {
  const char *chosen = std::getenv("ISOWAVE_DEVICE");
  // With llvmpipe's kernels kept, the process had 2 GB.
  if (!chosen || std::string_view(chosen) != "llvmpipe") ocl::DeviceContext::keep_all();
  if (chosen && *chosen) return {ocl::choose_device()};
  return ocl::list_devices();
}

/// Mesa's llvmpipe, which prepares a kernel anew for each launch: milliseconds of processor time
/// for a small one, a tenth of a second for `intersect`; and compiles `march` for a minute. There
/// the long tests draw fewer frames.
inline bool is_llvmpipe(const ocl::DeviceInfo &device) {
  return device.platform == "rusticl";
}

/// Whether tests may take long: in tools/test --long.
inline bool long_tests() {
  return std::getenv("ISOWAVE_LONG_TESTS") != nullptr;
}

/// Oclgrind, which takes about a second for what others do in a millisecond. What it looks for,
/// races and uninitialised memory, shows in small pictures of one view. The long tests
/// (ISOWAVE_LONG_TESTS) draw there what other devices draw.
inline bool is_simulator(const ocl::DeviceInfo &device) {
  return device.platform == "Oclgrind" && !long_tests();
}

/// "0_rusticl": a device as the suffix of a test's name.
inline std::string device_test_name(const testing::TestParamInfo<ocl::DeviceInfo> &info) {
  std::string name = std::to_string(info.param.index) + "_";
  for (const char c : info.param.platform) {
    if (std::isalnum(static_cast<unsigned char>(c))) name += c;
  }
  return name;
}

}  // namespace isowave::core
