#include "core/ocl/pinned_memory.hpp"

namespace isowave::core::ocl {

std::function<std::shared_ptr<void>(std::span<std::byte>)> pin_for(Device &device) {
  if (device.info().type == DeviceType::kCpu) return {};
  return [&device](std::span<std::byte> memory) -> std::shared_ptr<void> {
    try {
      return std::make_shared<cl::Buffer>(device.context(), CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR,
                                          memory.size(), memory.data());
    } catch (const cl::Error &) {
      return nullptr;
    }
  };
}

}  // namespace isowave::core::ocl
