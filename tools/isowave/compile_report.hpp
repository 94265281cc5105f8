#pragma once
// Tells the user that kernels are being compiled, which takes long on a new machine.

#include "core/ocl/device.hpp"
#include "core/ocl/kernel_cache.hpp"

namespace isowave::core::tools {

/// On a terminal, shows the kernel that is being compiled. `device` must outlive this.
class CompileReport {
 public:
  explicit CompileReport(ocl::Device &device);
  ~CompileReport();
  CompileReport(const CompileReport &) = delete;
  CompileReport &operator=(const CompileReport &) = delete;

  /// All that is needed now is there. Prints a line of what was compiled since the last call; none
  /// where the driver had kept it.
  void finish();

 private:
  ocl::Device &device_;
  ocl::KernelCache cache_;
  double reported_ms_ = 0;
  int num_kernels_ = 0;
};

}  // namespace isowave::core::tools
