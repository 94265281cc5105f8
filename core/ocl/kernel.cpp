#include "core/ocl/kernel.hpp"

#include <algorithm>
#include <bit>
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

Range Range::each(std::size_t count, std::size_t group_size, const Device &device) {
  return device.info().type == DeviceType::kGpu ? strided(count, group_size, device)
                                                : covering(count, group_size);
}

Range Range::in_parts(std::uint64_t count, const Device &device) const {
  const std::uint64_t most = device.capabilities().elements_per_launch;
  Range range = *this;
  range.parts =
      static_cast<std::uint32_t>(std::max<std::uint64_t>(1, count / most + (count % most != 0)));
  return range;
}

void RawKernel::make() {
  if (kernel_() != nullptr) return;
  device_->announce_kernel(name_);
  max_group_size_ = std::bit_floor(std::size_t{device_->capabilities().max_work_group_size});
  Defines defines = defines_;
  cl::Kernel kernel;
  if (const auto known = defines.find("ISO_GROUP_SIZE"); known != defines.end()) {
    const std::size_t wanted = std::stoul(known->second);
    for (std::size_t size = 0; size != std::min(wanted, max_group_size_);) {
      size = std::min(wanted, max_group_size_);
      known->second = fmt::format("{}u", size);
      if (size < wanted) defines["ISO_GROUP_SHARE"] = fmt::format("{}u", wanted / size);
      kernel = build(defines);
    }
  } else {
    kernel = build(defines);
  }
  kernel_ = std::move(kernel);
  is_new_ = true;
}

cl::Kernel RawKernel::build(const Defines &defines) {
  const cl::Program &program = device_->program(stem_, defines);
  const Device::Compiling compiling = device_->compiling();  // Mesa compiles some of it here
  try {
    cl::Kernel kernel(program, name_.c_str());
    // Its registers may leave room for fewer work-items than the device has for other kernels.
    const std::size_t limit = kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(
        program.getInfo<CL_PROGRAM_DEVICES>()[0]);
    max_group_size_ = std::min(max_group_size_, std::max<std::size_t>(std::bit_floor(limit), 1));
    return kernel;
  } catch (const cl::Error &error) {
    throw Error("{}.cl gives no kernel '{}': {}: {}", stem_, name_, error.what(),
                error_name(error.err()));
  }
}

void RawKernel::launch(const Range &range) {
  if (std::exchange(is_new_, false)) {  // many drivers compile it now
    const Device::Compiling compiling = device_->compiling();
    return launch(range);
  }
  const std::size_t group_size = std::min(range.group_size, max_group_size_);
  const std::size_t num_groups =
      range.keeps_groups
          ? range.num_groups
          : Range::covering(range.num_groups * range.group_size, group_size).num_groups;
  const std::size_t num_items = num_groups * group_size;
  try {
    for (std::size_t part = 0; part < range.parts; ++part) {
      const cl::NDRange begin = part == 0 ? cl::NDRange() : cl::NDRange(part * num_items);
      device_->queue().enqueueNDRangeKernel(kernel_, begin, cl::NDRange(num_items),
                                            cl::NDRange(group_size), nullptr,
                                            device_->timer().next_event());
      if (range.parts > 1) device_->queue().flush();  // or a driver may put them together
    }
  } catch (const cl::Error &error) {
    throw Error("kernel '{}' does not start with {} groups of {}: {}: {}", name_, num_groups,
                group_size, error.what(), error_name(error.err()));
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
