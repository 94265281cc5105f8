#include "core/ocl/device.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/ocl/arithmetic.hpp"
#include "core/ocl/build_log.hpp"
#include "core/ocl/device_list.hpp"
#include "core/ocl/driver_environment.hpp"
#include "core/ocl/kernel_sources.hpp"

namespace isowave::core::ocl {

namespace {

constexpr std::uint64_t kNeededLocalMemory = 32u << 10;

/// Whether event times are nanoseconds: Mesa rusticl 22.3 gives 0 or the numbers 0, 1, 2, 3 for
/// every command.
bool reports_event_times(const cl::Context &context, const cl::CommandQueue &queue) {
  constexpr std::size_t kBytes = 4096;
  const cl::Buffer buffer(context, CL_MEM_READ_WRITE, kBytes);
  const auto start_of_fill = [&] {
    cl::Event event;
    queue.enqueueFillBuffer(buffer, cl_uint{0}, 0, kBytes, nullptr, &event);
    queue.finish();
    return event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
  };
  try {
    const cl_ulong first = start_of_fill();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    return start_of_fill() >= first + 1'000'000;
  } catch (const cl::Error &) {
    return false;
  }
}

/// Bits agree between devices only under these options (kernels_cl/README.md).
std::string build_options(const DeviceInfo &device, Defines defines) {
  std::string options = "-cl-std=CL1.2";
  if (device.capabilities.correctly_rounded_divide)
    options += " -cl-fp32-correctly-rounded-divide-sqrt";
  if (device.type == DeviceType::kCpu)
    defines.emplace("ISO_CPU", "1");  // grid_dda.h, shared_types.h
  if (device.platform == "Portable Computing Language") {
    // Unrolling takes PoCL half as long again, and loops run no faster for it.
    defines.emplace("ISO_UNROLL", "");
    defines.emplace("ISO_CALLS", "1");  // shared_types.h
  }
  const auto has_space = [](const std::string &text) {
    return std::ranges::any_of(text, [](unsigned char c) { return std::isspace(c) != 0; });
  };
  for (const auto &[name, value] : defines) {
    if (has_space(name) || has_space(value)) {
      throw std::invalid_argument(fmt::format("define '{}={}' contains white space", name, value));
    }
    options += fmt::format(" -D {}={}", name, value);
  }
  return options;
}

/// What to say of drivers that do not know the processor, such as PoCL 3.0 of PyPI on AMD's Zen 5.
std::string_view age_trouble(std::string_view log) {
  return log.find("unknown target CPU") == log.npos ? ""
                                                    : "; this driver is older than the processor: "
                                                      "install a newer one, or draw on the host";
}

cl::Program build_program(const cl::Context &context, const cl::Device &device,
                          const DeviceInfo &info, const ProgramKey &key) {
  const auto &[stem, defines] = key;
  const std::string options = build_options(info, defines);
  try {
    cl::Program program(context, kernel_text(stem));
    program.build(device, options.c_str());
    return program;
  } catch (const cl::BuildError &error) {
    std::string log;
    for (const auto &[at, said] : error.getBuildLog())
      log += with_file_names(said, kernel_text(stem));
    const std::string message =
        fmt::format("{}.cl does not build on '{}' with {}: {}: {}{}{}", stem, info.name, options,
                    error_name(error.err()), first_error(log), cache_trouble(), age_trouble(log));
    throw BuildError(message, std::move(log));
  } catch (const cl::Error &error) {
    throw Error("{}.cl does not build on '{}' with {}: {}: {}", stem, info.name, options,
                error.what(), error_name(error.err()));
  }
}

/// Abilities that kernels need and OpenCL's embedded profile leaves out, or nothing.
std::string lacking(const cl::Device &device, const Capabilities &can) {
  if (device.getInfo<CL_DEVICE_PROFILE>().starts_with("EMBEDDED_PROFILE") &&
      !has_word(device.getInfo<CL_DEVICE_EXTENSIONS>(), "cles_khr_int64"))
    return "OpenCL's embedded profile without 64-bit integers";
  if (!can.rounds_to_nearest) return "float32 arithmetic that does not round to nearest";
  return {};
}

}  // namespace

Device::Device(const DeviceInfo &info, bool profiling) : info_(info), device_(device_handle(info)) {
  const Capabilities &can = info_.capabilities;
  try {
    if (!device_.getInfo<CL_DEVICE_COMPILER_AVAILABLE>()) {
      throw Error("device '{}' has no OpenCL C compiler: choose another device", info_.name);
    }
    if (const std::string lack = lacking(device_, can); !lack.empty()) {
      throw Error("device '{}' has {}: choose another device", info_.name, lack);
    }
    if (can.local_memory < kNeededLocalMemory) {
      throw Error("device '{}' has {} KiB of local memory, {} are needed: choose another device",
                  info_.name, can.local_memory >> 10, kNeededLocalMemory >> 10);
    }
    context_ = DeviceContext::of(device_);
    const cl::Context &context = context_->context;
    TimerSource source = TimerSource::kOff;
    if (profiling) {
      queue_ = cl::CommandQueue(context, device_, CL_QUEUE_PROFILING_ENABLE);
      source =
          reports_event_times(context, queue_) ? TimerSource::kEvents : TimerSource::kWallClock;
    }
    if (source != TimerSource::kEvents) queue_ = cl::CommandQueue(context, device_);
    timer_.start(source, queue_);
  } catch (const cl::Error &error) {
    throw Error("cannot open device '{}' ({}): {}: {}", info_.name, info_.platform, error.what(),
                error_name(error.err()));
  }
  const SelfTest test = self_test(*this);
  notice_ = test.notice;
  // Mesa's llvmpipe says 1024, and 32 of each kernel. Kernels would be compiled for both.
  std::uint32_t &largest_group = info_.capabilities.max_work_group_size;
  largest_group = std::min(largest_group, std::max(1u, test.largest_group));
}

cl::CommandQueue &Device::transfer_queue() {
  if (transfer_queue_() != nullptr) return transfer_queue_;
  try {
    const cl_command_queue_properties properties =
        timer_.source() == TimerSource::kEvents ? CL_QUEUE_PROFILING_ENABLE : 0;
    transfer_queue_ = cl::CommandQueue(context(), device_, properties);
  } catch (const cl::Error &error) {
    throw Error("device '{}' gives no second queue: {}: {}", info_.name, error.what(),
                error_name(error.err()));
  }
  return transfer_queue_;
}

void Device::draw_no_data() {
  if (!info_.capabilities.nan)
    throw Error("device '{}' has no NaN, which voxels without data need: choose another device",
                info_.name);
  draws_no_data_ = true;
}

ProgramKey Device::key_of(std::string_view stem, const Defines &defines) const {
  ProgramKey key(stem, defines);
  if (draws_bricks_) key.second.emplace("ISO_BRICKS", "1");
  if (draws_no_data_) key.second.emplace("ISO_NO_DATA", "1");
  // Programs that do not differ are the same one.
  const std::string text = kernel_text(stem);
  std::erase_if(key.second, [&](const auto &macro) { return text.find(macro.first) == text.npos; });
  return key;
}

const cl::Program &Device::program(std::string_view stem, const Defines &defines) {
  ProgramKey key = key_of(stem, defines);
  if (const auto found = programs_.find(key); found != programs_.end()) return *found->second;
  const Compiling now = compiling();
  const cl::Program &program =
      context_->program(key, [&] { return build_program(context(), device_, info_, key); });
  programs_.emplace(std::move(key), &program);
  return program;
}

cl::Program Device::build(std::string_view stem, const Defines &defines) {
  const Compiling now = compiling();
  return build_program(context(), device_, info_, {std::string(stem), defines});
}

std::vector<std::string> Device::built_programs() const {
  std::vector<std::string> names;
  for (const auto &[key, program] : programs_) {
    names.push_back(key.first);
    for (const auto &[name, value] : key.second)
      names.back() += fmt::format(" -D {}={}", name, value);
  }
  return names;
}

Device::Compiling::Compiling(Device &device)
    : device_(device), begin_(std::chrono::steady_clock::now()) {
  ++device_.compiling_depth_;
}

Device::Compiling::~Compiling() {
  if (--device_.compiling_depth_ > 0) return;
  device_.compile_ms_ += ms_since(begin_);
}

std::uint32_t Device::max_resident_groups() const {
  // Mesa's llvmpipe ends all loops of a work-item, without a word, after 65,535 turns in all. A
  // work-item that strides over many elements gets there; one element each does not.
  if (info_.name.find("llvmpipe") != std::string::npos) return 1u << 20;
  // A GPU's compute unit holds up to 2048 work-items and hides memory latency behind them: 16
  // groups of 64 to 128.
  const std::uint32_t units = info_.capabilities.compute_units;
  if (info_.type == DeviceType::kGpu) return std::max(1u, 16 * units);
  // A CPU driver runs the groups of a unit one after the other; a few per unit even out groups of
  // unequal work. It runs the work-items of a group one after the other, too: the fewer there are
  // in all, the more memory each strides through, before the next one reads beside it. With 8
  // groups on two cores a picture of 1280x720 took 1.6 times as long as with 64.
  return std::max(64u, 4 * units);
}

void Device::finish() {
  try {
    for (cl::CommandQueue *queue : {&transfer_queue_, &queue_}) {
      if ((*queue)() == nullptr) continue;
      // Mesa rusticl 22.3 waits only for what was enqueued since the last flush.
      if (info_.platform == "rusticl") queue->enqueueMarkerWithWaitList();
      queue->finish();
    }
  } catch (const cl::Error &error) {
    context_->abandon();
    throw Error("device '{}' failed: {}: {}", info_.name, error.what(), error_name(error.err()));
  }
}

bool Device::settle() noexcept {
  try {
    finish();
    return true;
  } catch (...) {
    return false;
  }
}

}  // namespace isowave::core::ocl
