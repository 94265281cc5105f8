#include "isowave/device.hpp"

#include "core/api/device_implementation.hpp"
#include "core/api/guarded.hpp"

namespace isowave {

namespace {

DeviceInfo public_info(const core::ocl::DeviceInfo &info) {
  return {info.index,
          info.name,
          info.vendor,
          info.platform,
          info.driver_version,
          std::string(core::ocl::to_string(info.type)),
          info.capabilities.global_memory};
}

}  // namespace

Device::Implementation::Implementation(const core::ocl::DeviceInfo &device_info,
                                       const DeviceOptions &options)
    : info(public_info(device_info)), device(device_info, options.profiling) {}

Device::Device(std::unique_ptr<Implementation> implementation)
    : implementation_(std::move(implementation)) {}
/// In a forked process, a driver would wait for its threads.
Device::~Device() {
  if (core::is_forked()) static_cast<void>(implementation_.release());
}

const DeviceInfo &Device::info() const {
  return implementation_->info;
}

const std::string &Device::notice() const {
  return implementation_->device.notice();
}

double Device::compile_ms() const {
  const TurnOrMine turn(implementation_->mutex);
  return implementation_->device.compile_ms();
}

std::uint64_t Device::memory_in_use() const {
  const TurnOrMine turn(implementation_->mutex);
  return implementation_->device.ledger().current();
}

std::vector<DeviceInfo> list_devices() {
  return core::guarded("listing devices", [] {
    std::vector<DeviceInfo> infos;
    for (const core::ocl::DeviceInfo &info : core::ocl::list_devices())
      infos.push_back(public_info(info));
    return infos;
  });
}

std::shared_ptr<Device> open_device(std::string_view selector, const DeviceOptions &options) {
  return core::guarded("opening a device", [&] {
    return std::make_shared<Device>(
        std::make_unique<Device::Implementation>(core::ocl::choose_device(selector), options));
  });
}

}  // namespace isowave
