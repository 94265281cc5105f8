#include "core/ocl/device_context.hpp"

#include <vector>

namespace isowave::core::ocl {

namespace {

struct Contexts {
  std::mutex mutex;
  std::map<cl_device_id, std::weak_ptr<DeviceContext>> of_device;
  bool keeps_all = false;
  std::vector<std::shared_ptr<DeviceContext>> kept;
};

/// Never destroyed: drivers may be gone by then.
Contexts &contexts() {
  static auto *const all = new Contexts;
  return *all;
}

}  // namespace

std::shared_ptr<DeviceContext> DeviceContext::of(const cl::Device &device) {
  Contexts &all = contexts();
  const std::lock_guard lock(all.mutex);
  std::weak_ptr<DeviceContext> &known = all.of_device[device()];
  if (auto context = known.lock()) return context;
  auto context = std::make_shared<DeviceContext>(device);
  known = context;
  if (all.keeps_all) all.kept.push_back(context);
  return context;
}

void DeviceContext::keep_all() {
  Contexts &all = contexts();
  const std::lock_guard lock(all.mutex);
  all.keeps_all = true;
}

const cl::Program &DeviceContext::program(const ProgramKey &key,
                                          const std::function<cl::Program()> &build) {
  const std::lock_guard lock(mutex_);
  if (const auto found = programs_.find(key); found != programs_.end()) return found->second;
  return programs_.emplace(key, build()).first->second;
}

void DeviceContext::abandon() noexcept {
  Contexts &all = contexts();
  const std::lock_guard lock(all.mutex);
  std::erase_if(all.of_device,
                [this](const auto &entry) { return entry.second.lock().get() == this; });
}

}  // namespace isowave::core::ocl
