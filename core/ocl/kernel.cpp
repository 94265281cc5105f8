#include "core/ocl/kernel.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/base/error.hpp"

namespace isowave::core::ocl {

Range Range::strided(std::size_t max_count, std::size_t group_size, const Device &device,
                     std::size_t oversubscribe) {
  Range range = covering(max_count, group_size);
  range.num_groups =
      std::min<std::size_t>(range.num_groups, oversubscribe * device.max_resident_groups());
  return range;
}

void RawKernel::make(std::size_t num_params) {
  if (kernel_() != nullptr) return;
  device_->announce_kernel(name_);
  const cl::Program &program = device_->program(stem_, defines_);
  const Device::Compiling compiling = device_->compiling();  // Mesa compiles some of it here
  std::size_t num_args = 0;
  try {
    cl::Kernel kernel(program, name_.c_str());
    num_args = kernel.getInfo<CL_KERNEL_NUM_ARGS>();
    if (num_args == num_params) kernel_ = std::move(kernel);
    is_new_ = true;
  } catch (const cl::Error &error) {
    throw Error("{}.cl gives no kernel '{}': {}: {}", stem_, name_, error.what(),
                error_name(error.err()));
  }
  if (num_args != num_params) {
    throw std::invalid_argument(fmt::format("kernel '{}' takes {} arguments, its C++ type names {}",
                                            name_, num_args, num_params));
  }
}

void RawKernel::launch(const Range &range) {
  if (std::exchange(is_new_, false)) {  // many drivers compile it now
    const Device::Compiling compiling = device_->compiling();
    return launch(range);
  }
  try {
    device_->queue().enqueueNDRangeKernel(
        kernel_, cl::NullRange, cl::NDRange(range.num_groups * range.group_size),
        cl::NDRange(range.group_size), nullptr, device_->timer().next_event());
  } catch (const cl::Error &error) {
    throw Error("kernel '{}' does not start with {} groups of {}: {}: {}", name_, range.num_groups,
                range.group_size, error.what(), error_name(error.err()));
  }
  if (device_->is_compiling()) device_->finish();
}

void RawKernel::set_mem(cl_uint index, const cl::Buffer &mem) {
  // OpenCL takes a null buffer as an argument, and the kernel then writes to address 0.
  if (mem() == nullptr) {
    throw std::invalid_argument(
        fmt::format("kernel '{}', argument {}: the buffer was moved from", name_, index));
  }
  try {
    kernel_.setArg(index, mem);
  } catch (const cl::Error &error) {
    throw Error("kernel '{}', argument {}: {}: {}", name_, index, error.what(),
                error_name(error.err()));
  }
}

void RawKernel::set_bytes(cl_uint index, std::size_t bytes, const void *data) {
  try {
    kernel_.setArg(index, bytes, data);
  } catch (const cl::Error &error) {
    throw Error("kernel '{}', argument {} of {} bytes: {}: {}", name_, index, bytes, error.what(),
                error_name(error.err()));
  }
}

}  // namespace isowave::core::ocl
