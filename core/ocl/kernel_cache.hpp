#pragma once
// Where drivers keep the kernels that they have compiled, for the next program that asks for them.
// isowave keeps none itself.

#include <filesystem>
#include <optional>

#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

class KernelCache {
 public:
  /// What is there from now on is new.
  explicit KernelCache(const DeviceInfo &device);

  /// Nothing where the driver keeps no kernels, or that is not known.
  const std::optional<std::filesystem::path> &folder() const { return folder_; }
  /// Whether kernels came to it since this was made, from whomever. Looks at every file.
  bool has_new_kernels() const;

 private:
  bool has_new_kernels(const std::filesystem::path &folder) const;

  std::optional<std::filesystem::path> folder_;
  std::filesystem::file_time_type begin_;
};

}  // namespace isowave::core::ocl
