#pragma once
// The folder where a driver keeps the kernels that it has compiled, for the next program that asks
// for them. isowave keeps none itself.

#include <filesystem>
#include <optional>

#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

class KernelCache {
 public:
  /// Kernels that come from now on are new.
  explicit KernelCache(const DeviceInfo &device);

  /// Nothing if the driver keeps no kernels, or its folder is not known.
  const std::optional<std::filesystem::path> &folder() const { return folder_; }
  /// Whether kernels came to the folder since this was made, from any program. Looks at every file.
  bool has_new_kernels() const;

 private:
  bool has_new_kernels(const std::filesystem::path &folder) const;

  std::optional<std::filesystem::path> folder_;
  std::filesystem::file_time_type begin_;
};

}  // namespace isowave::core::ocl
