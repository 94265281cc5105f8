#include "tools/isowave/device_choice.hpp"

#include <fmt/format.h>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/base/text.hpp"

namespace isowave::core::tools {

std::string first_given(const CLI::App &command, std::initializer_list<const char *> names) {
  for (const char *name : names) {
    if (command.count(name) > 0) return name;
  }
  return {};
}

ocl::DrawsOn choose_device_or_host(const std::string &selector, const std::string &device_option) {
  const ocl::DrawsOn chosen = ocl::choose_drawing(selector);
  if (device_option.empty() || chosen == ocl::DrawsOn::kDevice) return chosen;
  if (chosen == ocl::DrawsOn::kHost)
    throw Error("{}: the host has no such option: leave it out, or name a device", device_option);
  if (ocl::list_devices().empty())
    throw Error("{}: it needs an OpenCL device, and there is none: leave it out", device_option);
  return ocl::DrawsOn::kDevice;
}

std::unique_ptr<ocl::Device> open_and_say(const ocl::DeviceInfo &info, bool profiling) {
  fmt::print("device {}: {} ({}); choose another with --device or ISOWAVE_DEVICE\n", info.index,
             info.name, info.platform);
  return std::make_unique<ocl::Device>(info, profiling);
}

void say_host() {
  const std::uint32_t num_threads = thread_count(0);
  fmt::print("host: {} {}; choose a device with --device or ISOWAVE_DEVICE\n", num_threads,
             plural(num_threads, "thread", "threads"));
}

}  // namespace isowave::core::tools
