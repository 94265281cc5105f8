// The devices that there are, what they can do, and which one to take.

#include "core/ocl/device_list.hpp"

#include <algorithm>
#include <cstdlib>
#include <optional>

#include "core/base/error.hpp"
#include "core/base/fork.hpp"
#include "core/base/parallel_for.hpp"
#include "core/base/text.hpp"
#include "core/ocl/driver_environment.hpp"
#include "core/platform/loaded_code.hpp"
#include "core/platform/memory.hpp"

namespace isowave::core::ocl {

namespace {

struct ListedDevice {
  cl::Device handle;
  DeviceInfo info;
};

/// Drivers pad their strings with spaces and zeros.
std::string trimmed(std::string text) {
  const auto is_padding = [](char c) {
    return c == '\0' || std::isspace(static_cast<unsigned char>(c));
  };
  while (!text.empty() && is_padding(text.back())) text.pop_back();
  text.erase(text.begin(), std::find_if_not(text.begin(), text.end(), is_padding));
  return text;
}

/// "OpenCL 1.2 ..." -> 102; 0 when the text is something else.
std::uint32_t parse_version(std::string_view text) {
  constexpr std::string_view kPrefix = "OpenCL ";
  if (!text.starts_with(kPrefix)) return 0;
  text.remove_prefix(kPrefix.size());
  text = text.substr(0, text.find(' '));
  const std::size_t dot = text.find('.');
  if (dot == std::string_view::npos) return 0;
  const auto major = parse_all<std::uint32_t>(text.substr(0, dot)),
             minor = parse_all<std::uint32_t>(text.substr(dot + 1));
  return major && minor ? *major * 100 + *minor : 0;
}

DeviceType device_type(cl_device_type bits) {
  if (bits & CL_DEVICE_TYPE_GPU) return DeviceType::kGpu;
  if (bits & CL_DEVICE_TYPE_ACCELERATOR) return DeviceType::kAccelerator;
  if (bits & CL_DEVICE_TYPE_CPU) return DeviceType::kCpu;
  return DeviceType::kOther;
}

/// Sub-groups became core in OpenCL 2.1 and optional in 3.0, where a count of 0 says that there are
/// none.
bool probe_sub_groups(const cl::Device &device, std::string_view extensions,
                      std::uint32_t version) {
  if (has_word(extensions, "cl_khr_subgroups")) return true;
  if (version < 201) return false;
  constexpr cl_device_info kMaxNumSubGroups =
      0x105C;  // CL_DEVICE_MAX_NUM_SUB_GROUPS, not in 1.2's headers
  cl_uint count = 0;
  try {
    device.getInfo(kMaxNumSubGroups, &count);
  } catch (const cl::Error &) {
    return false;
  }
  return count > 0;
}

/// Whether the system ends launches that take seconds, as those with a desktop do. NVIDIA says so;
/// of other GPUs it is assumed.
bool has_watchdog(const cl::Device &device, std::string_view extensions) {
  if ((device.getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_GPU) == 0) return false;
  if (!has_word(extensions, "cl_nv_device_attribute_query")) return true;
  constexpr cl_device_info kKernelExecTimeout = 0x4005;  // CL_DEVICE_KERNEL_EXEC_TIMEOUT_NV
  cl_bool times_out = CL_TRUE;
  try {
    device.getInfo(kKernelExecTimeout, &times_out);
  } catch (const cl::Error &) {
    return true;
  }
  return times_out == CL_TRUE;
}

/// An estimate, not a measurement on slow GPUs: an H100 (132 units, 1980 MHz) takes 1 ns for a ray
/// of a cold frame (bench/h100.md). By units and clock, a GPU of 3 units at 1400 MHz takes 62 ns,
/// so its launches of 67,200 rays take 4 ms, and rays that are 20 times as long stay below 0.1 s.
std::uint64_t elements_before_watchdog(std::uint32_t units, std::uint32_t megahertz) {
  constexpr std::uint64_t kElementsPerUnitMegahertz = 16, kLeast = 1u << 16;
  return std::max(kLeast, kElementsPerUnitMegahertz * units * megahertz);
}

Capabilities probe(const cl::Device &device, std::uint32_t version) {
  const std::string extensions = device.getInfo<CL_DEVICE_EXTENSIONS>();
  const cl_device_fp_config floats = device.getInfo<CL_DEVICE_SINGLE_FP_CONFIG>();
  Capabilities result;
  result.int64_atomics = has_word(extensions, "cl_khr_int64_base_atomics") &&
                         has_word(extensions, "cl_khr_int64_extended_atomics");
  result.fp64 =
      has_word(extensions, "cl_khr_fp64") || device.getInfo<CL_DEVICE_DOUBLE_FP_CONFIG>() != 0;
  result.sub_groups = probe_sub_groups(device, extensions, version);
  result.correctly_rounded_divide = (floats & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT) != 0;
  result.denormals = (floats & CL_FP_DENORM) != 0;
  result.nan = (floats & CL_FP_INF_NAN) != 0;
  result.rounds_to_nearest = (floats & CL_FP_ROUND_TO_NEAREST) != 0;
  result.global_memory = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
  result.largest_allocation = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  result.local_memory = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
  const std::vector<std::size_t> edges = device.getInfo<CL_DEVICE_MAX_WORK_ITEM_SIZES>();
  result.max_work_group_size =
      static_cast<std::uint32_t>(std::min(device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>(),
                                          edges.empty() ? std::size_t{1} : edges.front()));
  result.compute_units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
  if (has_watchdog(device, extensions))
    result.elements_per_launch = elements_before_watchdog(
        result.compute_units, device.getInfo<CL_DEVICE_MAX_CLOCK_FREQUENCY>());
  result.native_float_width = device.getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>();
  return result;
}

/// Appends one platform's devices. Mesa lists platforms without devices, and some of OpenCL 1.1.
void append_devices(const cl::Platform &platform, std::vector<ListedDevice> &result) {
  std::vector<cl::Device> devices;
  platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
  const std::string platform_name = trimmed(platform.getInfo<CL_PLATFORM_NAME>());
  for (const cl::Device &device : devices) {
    DeviceInfo info;
    info.device_version = trimmed(device.getInfo<CL_DEVICE_VERSION>());
    const std::uint32_t version = parse_version(info.device_version);
    if (version < 102 || !device.getInfo<CL_DEVICE_AVAILABLE>()) continue;
    info.index = static_cast<std::uint32_t>(result.size());
    info.name = trimmed(device.getInfo<CL_DEVICE_NAME>());
    info.vendor = trimmed(device.getInfo<CL_DEVICE_VENDOR>());
    info.platform = platform_name;
    info.driver_version = trimmed(device.getInfo<CL_DRIVER_VERSION>());
    info.type = device_type(device.getInfo<CL_DEVICE_TYPE>());
    info.capabilities = probe(device, version);
    result.push_back({device, std::move(info)});
  }
}

/// Address space that PoCL maps with LLVM, and for the stack of a thread for each processor.
std::size_t bytes_of_driver() {
  return (std::size_t{256} << 20) + thread_count(0) * (std::size_t{8} << 20);
}

/// Whether there was room for a driver before any was loaded. Without room, OpenCL's loader passes
/// over drivers without a word, and PoCL 3.1 may end the process.
bool has_room_for_driver() {
  static const bool has_room = platform::has_address_space(bytes_of_driver());
  return has_room;
}

std::vector<ListedDevice> enumerate() {
  check_not_forked();
  if (!has_room_for_driver()) return {};
  begin_threads();  // of drivers
  std::vector<cl::Platform> platforms;
  if (!platform::has_opencl()) return {};
  prepare_for_drivers();  // before a driver is loaded
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error &) {
    return {};  // the loader's way of saying that no driver is installed
  }
  std::vector<ListedDevice> result;
  for (const cl::Platform &platform : platforms) {
    try {
      append_devices(platform, result);
    } catch (const cl::Error &) {
      // A driver that cannot name its devices cannot run them; the other drivers still can.
    }
  }
  return result;
}

/// "0 'name' (cpu, platform), 1 ..."
std::string describe(std::span<const DeviceInfo> devices) {
  std::string text;
  for (const DeviceInfo &info : devices) {
    if (!text.empty()) text += ", ";
    text +=
        fmt::format("{} '{}' ({}, {})", info.index, info.name, to_string(info.type), info.platform);
  }
  return text;
}

/// The selector that stands for the host, which is no device.
constexpr std::string_view kHost = "host";

std::string_view environment_selector() {
  const char *environment = std::getenv("ISOWAVE_DEVICE");
  return environment != nullptr ? environment : "";
}

std::optional<DeviceType> type_named(std::string_view name) {
  for (const DeviceType type : {DeviceType::kCpu, DeviceType::kGpu, DeviceType::kAccelerator}) {
    if (name == to_string(type)) return type;
  }
  return std::nullopt;
}

}  // namespace

std::string_view to_string(DeviceType type) {
  switch (type) {
    case DeviceType::kCpu:
      return "cpu";
    case DeviceType::kGpu:
      return "gpu";
    case DeviceType::kAccelerator:
      return "accelerator";
    case DeviceType::kOther:
      break;
  }
  return "other";
}

bool has_word(std::string_view list, std::string_view word) {
  for (std::size_t begin = 0; begin < list.size();) {
    const std::size_t end = std::min(list.find(' ', begin), list.size());
    if (list.substr(begin, end - begin) == word) return true;
    begin = end + 1;
  }
  return false;
}

std::vector<DeviceInfo> list_devices() {
  std::vector<DeviceInfo> result;
  for (ListedDevice &device : enumerate()) result.push_back(std::move(device.info));
  return result;
}

cl::Device device_handle(const DeviceInfo &info) {
  demand_private_kernels(info.platform);
  for (const ListedDevice &device : enumerate()) {
    if (device.info.index == info.index && device.info.name == info.name &&
        device.info.platform == info.platform) {
      return device.handle;
    }
  }
  throw Error("device {} '{}' ({}) is not there any more: list the devices again", info.index,
              info.name, info.platform);
}

const DeviceInfo &pick_device(std::span<const DeviceInfo> devices, std::string_view selector,
                              std::string_view environment) {
  const std::string_view source = selector.empty() ? " (from ISOWAVE_DEVICE)" : "";
  const std::string wanted = lower_case(selector.empty() ? environment : selector);
  if (wanted == kHost) {
    throw Error("'host'{} is no OpenCL device, and this needs one: name a device, such as 'cpu'",
                source);
  }
  if (devices.empty() && !has_room_for_driver()) {
    throw Error(
        "out of memory: an OpenCL driver needs {} MiB of address space, and this process cannot "
        "get as much: raise its limit (ulimit -v)",
        bytes_of_driver() >> 20);
  }
  if (devices.empty()) {
    throw Error(
        "no OpenCL 1.2 device found: install a driver, for the CPU PoCL (apt install "
        "pocl-opencl-icd; without root and from Python, pip install isowave[cpu]){}",
        cache_trouble());
  }
  const auto first = [&](auto &&matches) -> const DeviceInfo * {
    const auto found = std::ranges::find_if(devices, matches);
    return found == devices.end() ? nullptr : &*found;
  };
  const auto first_of_type = [&](DeviceType type) {
    return first([type](const DeviceInfo &info) { return info.type == type; });
  };

  if (wanted.empty()) {
    for (const DeviceType type : {DeviceType::kGpu, DeviceType::kAccelerator, DeviceType::kCpu}) {
      if (const DeviceInfo *found = first_of_type(type)) return *found;
    }
    return devices.front();
  }
  const DeviceInfo *match = nullptr;
  if (const auto index = parse_all<std::uint32_t>(wanted)) {
    match = first([&](const DeviceInfo &info) { return info.index == *index; });
  } else if (const auto type = type_named(wanted)) {
    match = first_of_type(*type);
  } else {
    match = first([&](const DeviceInfo &info) {
      return lower_case(info.name).find(wanted) != std::string::npos ||
             lower_case(info.platform).find(wanted) != std::string::npos;
    });
  }
  if (!match) {
    throw Error("no device is '{}'{}; there are: {}", selector.empty() ? environment : selector,
                source, describe(devices));
  }
  return *match;
}

DeviceInfo choose_device(std::string_view selector) {
  const std::vector<DeviceInfo> devices = list_devices();
  return pick_device(devices, selector, environment_selector());
}

DrawsOn pick_drawing(const std::function<std::vector<DeviceInfo>()> &list,
                     std::string_view selector, std::string_view environment) {
  const std::string wanted = lower_case(selector.empty() ? environment : selector);
  if (wanted == kHost) return DrawsOn::kHost;
  if (!wanted.empty()) return DrawsOn::kDevice;
  const bool has_fast_device = std::ranges::any_of(list(), [](const DeviceInfo &info) {
    return info.type == DeviceType::kGpu || info.type == DeviceType::kAccelerator;
  });
  return has_fast_device ? DrawsOn::kDevice : DrawsOn::kHostByDefault;
}

DrawsOn choose_drawing(std::string_view selector) {
  return pick_drawing(list_devices, selector, environment_selector());
}

}  // namespace isowave::core::ocl
