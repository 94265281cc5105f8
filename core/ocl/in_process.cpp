#include "core/ocl/in_process.hpp"

#include <string_view>

#include "core/platform/loaded_code.hpp"
#include "core/platform/memory.hpp"

namespace isowave::core::ocl {

namespace {

bool is_compiler(std::string_view path) {
  const std::string_view name = path.substr(path.rfind('/') + 1);
  return name.starts_with("libLLVM") || name.starts_with("libclang-cpp");
}

}  // namespace

bool is_in_process(const DeviceInfo &device) {
  return device.platform == "Portable Computing Language" && device.type == DeviceType::kCpu;
}

void give_back_compiler(const DeviceInfo &device) {
  if (!is_in_process(device)) return;
  platform::give_back_code(is_compiler);
  platform::give_back_heap();
}

}  // namespace isowave::core::ocl
