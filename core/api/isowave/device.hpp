#pragma once
// The OpenCL devices of this machine.

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace isowave {

struct DeviceInfo {
  std::uint32_t index = 0;  ///< place in list_devices(): open_device("2") opens index 2
  std::string name, vendor, platform, driver;
  std::string type;                ///< "gpu", "cpu", "accelerator" or "other"
  std::uint64_t memory_bytes = 0;  ///< of the whole device
};

/// Every OpenCL 1.2 device, in the loader's order. Empty if there is none.
std::vector<DeviceInfo> list_devices();

struct DeviceOptions {
  /// Measures stages for FrameStatistics::stage_ms. The host then waits for each pass.
  bool profiling = false;
};

/// An opened device. Any number of renderers and threads may share a device: their frames take
/// turns. Renderers draw at the same time only if each has its own Device; open_device() may open
/// the same device again. While a renderer is made, all others of its Device wait: minutes if
/// kernels are compiled. make_quick_renderer() draws meanwhile.
class Device {
 public:
  ~Device();
  Device(const Device &) = delete;
  Device &operator=(const Device &) = delete;

  const DeviceInfo &info() const;
  /// One line that names operations whose results differ from the host's; empty if none do.
  /// Pictures of such a device may differ from those of other devices in last bits.
  const std::string &notice() const;
  /// Wall clock spent on compiling kernels so far: once per machine if the driver keeps them.
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
/// selector  an index, a type ("gpu"), or a part of the name of device or platform in any case;
///           "": the environment variable ISOWAVE_DEVICE, else the first GPU, else the first
///           accelerator, else the first CPU, else the first device
/// Throws    Error: there is no such device, or it lacks what the kernels need
std::shared_ptr<Device> open_device(std::string_view selector = {},
                                    const DeviceOptions &options = {});

}  // namespace isowave
