#pragma once
// Every way of grouping on every device, for the suites that must not tell them apart.

#include <string>
#include <vector>

#include "core/paper/group.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {

struct GroupingOnDevice {
  ocl::DeviceInfo device;
  Grouping grouping;
};

inline void PrintTo(const GroupingOnDevice &param, std::ostream *out) {
  *out << to_string(param.grouping) << " on " << param.device.name;
}

inline std::vector<GroupingOnDevice> groupings_under_test() {
  std::vector<GroupingOnDevice> params;
  for (const ocl::DeviceInfo &device : devices_under_test()) {
    for (const Grouping grouping : {Grouping::kRadix, Grouping::kCounting})
      params.push_back({device, grouping});
  }
  return params;
}

/// "0_rusticl_counting".
inline std::string grouping_test_name(const testing::TestParamInfo<GroupingOnDevice> &info) {
  return device_test_name({info.param.device, info.index}) + "_" +
         std::string(to_string(info.param.grouping));
}

}  // namespace isowave::core
