#include "core/ocl/kernel_cache.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <system_error>

#include "core/base/names_in.hpp"
#include "core/ocl/environment.hpp"

namespace isowave::core::ocl {

namespace {

namespace fs = std::filesystem;

bool is_one_of(const std::string &text, std::initializer_list<const char *> values) {
  for (const char *value : values) {
    if (text == value) return true;
  }
  return false;
}

/// Where programs keep what they can make again: $XDG_CACHE_HOME or ~/.cache.
std::optional<fs::path> user_cache() {
  if (const std::string folder = environment("XDG_CACHE_HOME"); !folder.empty()) return folder;
  if (const std::string home = environment("HOME"); !home.empty()) return fs::path(home) / ".cache";
  return {};
}

std::optional<fs::path> pocl_folder() {
  if (environment("POCL_KERNEL_CACHE") == "0") return {};
  if (const std::string folder = environment("POCL_CACHE_DIR"); !folder.empty()) return folder;
  const auto cache = user_cache();
  return cache ? std::optional(*cache / "pocl" / "kcache") : std::nullopt;
}

std::optional<fs::path> mesa_folder() {
  if (is_one_of(environment("MESA_SHADER_CACHE_DISABLE"), {"1", "true", "yes"})) return {};
  if (const std::string folder = environment("MESA_SHADER_CACHE_DIR"); !folder.empty())
    return fs::path(folder) / "mesa_shader_cache";
  const auto cache = user_cache();
  return cache ? std::optional(*cache / "mesa_shader_cache") : std::nullopt;
}

std::optional<fs::path> nvidia_folder() {
  if (environment("CUDA_CACHE_DISABLE") == "1") return {};
  if (const std::string folder = environment("CUDA_CACHE_PATH"); !folder.empty()) return folder;
  const std::string home = environment("HOME");
  return home.empty() ? std::nullopt : std::optional(fs::path(home) / ".nv" / "ComputeCache");
}

std::optional<fs::path> folder_of(const DeviceInfo &device) {
  if (device.platform == "Portable Computing Language") return pocl_folder();
  if (device.platform == "rusticl" || device.platform == "Clover") return mesa_folder();
  if (device.platform.starts_with("NVIDIA")) return nvidia_folder();
  return {};
}

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
    : folder_(folder_of(device)),
      begin_(fs::file_time_type::clock::now() - std::chrono::milliseconds(10)) {}

bool KernelCache::has_new_kernels() const {
  return folder_ && has_new_kernels(*folder_);
}

bool KernelCache::has_new_kernels(const fs::path &folder) const {
  return std::ranges::any_of(names_in(folder), [&](const std::string &name) {
    const fs::path path = folder / name;
    std::error_code gone;  // drivers make temporary files there
    const fs::file_type type = fs::symlink_status(path, gone).type();
    if (type == fs::file_type::directory) return has_new_kernels(path);
    const auto time = fs::last_write_time(path, gone);
    return !gone && type == fs::file_type::regular && time >= begin_ && holds_kernels(path);
  });
}

}  // namespace isowave::core::ocl
