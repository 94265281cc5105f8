#pragma once
// What a number was measured on and with: part of every JSON that bench/ writes.

#include <string>
#include <utility>
#include <vector>

#include "core/ocl/device.hpp"

namespace isowave::bench {

/// Name -> value: device, driver, platform, clock, compiler, commit.
std::vector<std::pair<std::string, std::string>> run_info(ocl::Device &device);

/// What the stage times of a device come from: "OpenCL events", ...
std::string clock_name(ocl::TimerSource source);

/// Middle of the sorted values, the mean of both middles for an even count; 0 of none.
double median(std::vector<double> values);

}  // namespace isowave::bench
