#include "core/ocl/kernel_cache.hpp"

#include <chrono>
#include <string>
#include <system_error>

#include "core/ocl/driver_environment.hpp"

namespace isowave::core::ocl {

namespace {

namespace fs = std::filesystem;

/// Others are written whenever a kernel is looked up: PoCL's last_accessed and tempfile_*, NVIDIA's
/// index, Mesa's index and *.idx.
bool holds_kernels(const fs::path &file) {
  const std::string name = file.filename().string();
  return name != "index" && name != "last_accessed" && !name.starts_with("tempfile_") &&
         file.extension() != ".idx";
}

}  // namespace

KernelCache::KernelCache(const DeviceInfo &device)
    // A file's time is that of the kernel's last tick, up to 10 ms ago.
    : folder_(kernel_folder(device.platform)),
      begin_(fs::file_time_type::clock::now() - std::chrono::milliseconds(10)) {}

bool KernelCache::has_new_kernels() const {
  if (!folder_) return false;
  std::error_code failure;
  for (fs::recursive_directory_iterator file(*folder_, failure), end; !failure && file != end;
       file.increment(failure)) {
    std::error_code gone;  // drivers make temporary files there
    const auto time = file->last_write_time(gone);
    if (!gone && time >= begin_ && file->is_regular_file(gone) && holds_kernels(file->path()))
      return true;
  }
  return false;
}

}  // namespace isowave::core::ocl
