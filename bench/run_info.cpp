#include "bench/run_info.hpp"

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <fstream>

namespace isowave::core::bench {

std::string clock_name(ocl::TimerSource source) {
  switch (source) {
    case ocl::TimerSource::kOff:
      return "wall clock, profiling off";
    case ocl::TimerSource::kEvents:
      return "OpenCL events";
    case ocl::TimerSource::kWallClock:
      return "wall clock: the driver reports event times of 0";
  }
  return "";
}

std::vector<std::pair<std::string, std::string>> run_info(ocl::Device &device) {
  const ocl::DeviceInfo &info = device.info();
  return {{"device", info.name},
          {"device_type", std::string(to_string(info.type))},
          {"device_version", info.device_version},
          {"driver", info.driver_version},
          {"platform", info.platform},
          {"compute_units", std::to_string(info.capabilities.compute_units)},
          {"clock", clock_name(device.timer().source())},
          {"compiler", ISOWAVE_BUILD},
          {"commit", ISOWAVE_COMMIT}};
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

Spread spread_of(const std::vector<double> &values) {
  if (values.empty()) return {};
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  return {median(values), *min, *max};
}

nlohmann::ordered_json spread_json(const Spread &spread) {
  return {{"median", spread.median}, {"min", spread.min}, {"max", spread.max}};
}

std::uint64_t peak_memory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) return std::strtoull(line.c_str() + 6, nullptr, 10) * 1024;
  }
  return 0;
}

void reset_peak_memory() {
  std::ofstream("/proc/self/clear_refs") << "5";
}

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

}  // namespace isowave::core::bench
