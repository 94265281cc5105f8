#pragma once
// The machine and the program of a measurement: part of every JSON that bench/ writes.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/ocl/device.hpp"

namespace isowave::core::bench {

/// Name -> value: device, driver, platform, clock, compiler, commit.
std::vector<std::pair<std::string, std::string>> run_info(ocl::Device &device);

/// The source of a device's stage times: "OpenCL events", ...
std::string clock_name(ocl::TimerSource source);

/// Middle of the sorted values, the mean of both middles for an even count; 0 of none.
double median(std::vector<double> values);

/// Median, least and most; 0 of none.
struct Spread {
  double median = 0, min = 0, max = 0;
};
Spread spread_of(const std::vector<double> &values);
nlohmann::ordered_json spread_json(const Spread &spread);

/// VmHWM of /proc/self/status [bytes]: the most memory that the process has had since
/// reset_peak_memory(), or its start; 0 where the system does not say.
std::uint64_t peak_memory();
void reset_peak_memory();

/// "2026-11-21T09:30:00Z": now.
std::string utc_now();

}  // namespace isowave::core::bench
