#pragma once
// The OpenCL devices of this machine.

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace isowave {

struct DeviceInfo {
  std::uint32_t index = 0;  ///< what open_device("2") means
  std::string name, vendor, platform, driver;
  std::string type;                ///< "gpu", "cpu", "accelerator" or "other"
  std::uint64_t memory_bytes = 0;  ///< of the whole device
};

/// Every OpenCL 1.2 device, in the loader's order. Empty when there is none.
std::vector<DeviceInfo> list_devices();

struct DeviceOptions {
  bool profiling =
      false;  ///< measure stages for FrameStatistics::stage_ms: each pass is waited for
};

/// An opened device. Any number of renderers may share one, also from several threads: they take
/// turns, frame by frame. Renderers that are to draw at the same time need devices of their own;
/// open_device() may be called again for the same one. A renderer that is being made keeps the
/// device from all others, minutes where kernels are compiled: a QuickRenderer draws meanwhile.
class Device {
 public:
  ~Device();
  Device(const Device &) = delete;
  Device &operator=(const Device &) = delete;

  const DeviceInfo &info() const;
  /// One line on the operations that this device computes otherwise than the host, so that pictures
  /// may differ from other devices' in last bits; empty: it computes all alike.
  const std::string &notice() const;
  /// Wall clock spent on compiling kernels so far. Once per machine, where the driver keeps them.
  double compile_ms() const;
  /// Bytes of all buffers on the device.
  std::uint64_t memory_in_use() const;

  struct Implementation;
  explicit Device(std::unique_ptr<Implementation> implementation);
  Implementation &implementation() const { return *implementation_; }

 private:
  std::unique_ptr<Implementation> implementation_;
};

/// Opens a device.
///
/// selector  "": what the environment variable ISOWAVE_DEVICE selects, else the first GPU, else the
///           first CPU, else the first device; or an index, a type ("gpu"), or a part of the name
///           of device or platform in any case
/// Throws    Error: there is none, or it lacks what the kernels need
std::shared_ptr<Device> open_device(std::string_view selector = {},
                                    const DeviceOptions &options = {});

}  // namespace isowave
