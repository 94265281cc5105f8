#include "core/ocl/kernel_cache.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <system_error>

#include "core/ocl/driver_environment.hpp"
#include "core/platform/names_in.hpp"

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
  return folder_ && has_new_kernels(*folder_);
}

bool KernelCache::has_new_kernels(const fs::path &folder) const {
  return std::ranges::any_of(platform::names_in(folder), [&](const std::string &name) {
    const fs::path path = folder / name;
    std::error_code gone;  // drivers make temporary files there
    const fs::file_type type = fs::symlink_status(path, gone).type();
    if (type == fs::file_type::directory) return has_new_kernels(path);
    const auto time = fs::last_write_time(path, gone);
    return !gone && type == fs::file_type::regular && time >= begin_ && holds_kernels(path);
  });
}

}  // namespace isowave::core::ocl
