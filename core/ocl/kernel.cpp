#include "core/ocl/kernel.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/error.hpp"

namespace isowave::ocl {

Range Range::strided(std::size_t max_count, std::size_t group_size, const Device &device,
                     std::size_t oversubscribe) {
  Range range = covering(max_count, group_size);
  range.num_groups = std::min<std::size_t>(range.num_groups, oversubscribe * device.max_resident_groups());
  return range;
}

RawKernel::RawKernel(Device &device, std::string_view stem, const char *kernel_name, const Defines &defines)
    : device_(&device), name_(kernel_name) {
  const cl::Program &program = device.program(stem, defines);
  try {
    kernel_ = cl::Kernel(program, kernel_name);
    num_args_ = kernel_.getInfo<CL_KERNEL_NUM_ARGS>();
  } catch (const cl::Error &error) {
    throw Error("{}.cl gives no kernel '{}': {}: {}", stem, name_, error.what(), error_name(error.err()));
  }
}

void RawKernel::check_arity(std::size_t num_params) const {
  if (num_args_ == num_params) return;
  throw std::invalid_argument(
      fmt::format("kernel '{}' takes {} arguments, its C++ type names {}", name_, num_args_, num_params));
}

void RawKernel::launch(const Range &range) {
  if (range.num_groups == 0) return;
  try {
    device_->queue().enqueueNDRangeKernel(
        kernel_, cl::NullRange, cl::NDRange(range.num_groups * range.group_size),
        cl::NDRange(range.group_size), nullptr, device_->timer().next_event());
  } catch (const cl::Error &error) {
    throw Error("kernel '{}' does not start with {} groups of {}: {}: {}", name_, range.num_groups,
                range.group_size, error.what(), error_name(error.err()));
  }
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
    throw Error("kernel '{}', argument {}: {}: {}", name_, index, error.what(), error_name(error.err()));
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

}  // namespace isowave::ocl
