#include "core/ocl/driver_environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <mutex>
#include <system_error>
#include <vector>

#include "core/base/error.hpp"
#include "core/ocl/environment.hpp"
#include "core/platform/names_in.hpp"
#include "core/platform/new_file.hpp"
#include "core/platform/private_folder.hpp"
#include "core/platform/process.hpp"

namespace isowave::core::ocl {

namespace fs = std::filesystem;

namespace {

constexpr std::uintmax_t kNeededBytes = 64u << 20;  ///< kernels of one device, compiled, take less
constexpr std::size_t kLongestName =
    700;  ///< PoCL ends the process where names of files in it exceed 1,024 bytes

/// $XDG_CACHE_HOME or ~/.cache, which are for what programs can make again.
std::optional<fs::path> user_cache() {
  if (const std::string folder = environment("XDG_CACHE_HOME"); !folder.empty()) return folder;
  if (std::getenv("HOME") != nullptr) return environment("HOME") + "/.cache";
  return {};
}

/// By PoCL 3.1's rule; without a home it takes /tmp/pocl, which any user can make first.
std::optional<fs::path> usual_pocl_folder() {
  const auto cache = user_cache();
  if (!cache) return {};
  return *cache / "pocl" / (environment("POCL_KERNEL_CACHE") == "0" ? "uncached" : "kcache");
}

/// NVIDIA's driver keeps no kernels without a home, nor if CUDA_CACHE_PATH is empty.
std::optional<fs::path> usual_nvidia_folder() {
  if (std::getenv("HOME") == nullptr || std::getenv("CUDA_CACHE_PATH") != nullptr) return {};
  return environment("HOME") + "/.nv/ComputeCache";
}

/// Mesa takes the home from the list of users, whatever HOME is.
std::optional<fs::path> usual_mesa_folder() {
  if (const std::string folder = environment("XDG_CACHE_HOME"); !folder.empty()) return folder;
  const auto home = platform::home_by_list();
  return home ? std::optional(*home / ".cache") : std::nullopt;
}

struct Driver {
  const char *name;                         ///< of its folder among isowave's
  std::vector<std::string_view> platforms;  ///< how their names begin
  const char *variable;                     ///< names the folder
  std::optional<fs::path> (*usual_folder)();
  /// Folders in it that hold kernels: "" for itself.
  std::vector<const char *> parts;
  const char *off, *value_of_off;  ///< the variable that has the driver keep none
};

enum : std::size_t { kPocl, kNvidia, kMesa, kNumDrivers };

const std::array<Driver, kNumDrivers> &drivers() {
  static const std::array<Driver, kNumDrivers> all{{
      {"pocl",
       {"Portable Computing Language"},
       "POCL_CACHE_DIR",
       usual_pocl_folder,
       {""},
       "POCL_KERNEL_CACHE",
       "0"},
      {"nvidia",
       {"NVIDIA"},
       "CUDA_CACHE_PATH",
       usual_nvidia_folder,
       {""},
       "CUDA_CACHE_DISABLE",
       "1"},
      {"mesa",
       {"rusticl", "Clover"},
       "MESA_SHADER_CACHE_DIR",
       usual_mesa_folder,
       {"mesa_shader_cache", "mesa_shader_cache_db", "mesa_shader_cache_sf"},
       "MESA_SHADER_CACHE_DISABLE",
       "true"},
  }};
  return all;
}

/// A driver's folder, and what was found out about it.
struct KernelFolder {
  std::string notice;   ///< which other folder it was given, and why
  std::string trouble;  ///< why it cannot write to its folder
  std::string refusal;  ///< why it must not be used
  bool is_used = false;
};

struct State {
  std::mutex mutex;
  std::array<KernelFolder, kNumDrivers> folders;
};

State &state() {
  static State chosen;
  return chosen;
}

std::optional<std::size_t> driver_of(std::string_view platform) {
  for (std::size_t i = 0; i < kNumDrivers; ++i) {
    if (std::ranges::any_of(drivers()[i].platforms,
                            [&](std::string_view begin) { return platform.starts_with(begin); }))
      return i;
  }
  return {};
}

bool is_off(const Driver &driver) {
  const std::string value = environment(driver.off);
  return value == driver.value_of_off ||
         (driver.value_of_off == std::string_view("true") && (value == "1" || value == "yes"));
}

std::optional<fs::path> wanted_folder(const Driver &driver) {
  if (const std::string folder = environment(driver.variable); !folder.empty()) return folder;
  return driver.usual_folder();
}

platform::FolderCheck check_parts(const Driver &driver, const fs::path &folder) {
  platform::FolderCheck result;
  for (const char *part : driver.parts) {
    const platform::FolderCheck check =
        platform::check_private(*part == 0 ? folder : folder / part);
    if (result.danger.empty()) result = check;
  }
  if (*driver.parts.front() != 0) result.path = result.path.parent_path();
  return result;
}

/// Whether PoCL could fill the folder, or make it first. Makes nothing.
bool is_usable(const fs::path &wanted) {
  std::error_code failure;
  fs::path folder = wanted;
  if (folder.string().size() > kLongestName) return false;
  while (folder.has_relative_path() &&
         fs::status(folder, failure).type() == fs::file_type::not_found)
    folder = folder.parent_path();
  if (!fs::is_directory(folder, failure) || !platform::can_fill(folder, failure)) return false;
  if (folder == wanted) {
    for (const std::string &name :
         platform::names_in(folder)) {  // root may have made some, by sudo
      const fs::path entry = folder / name;
      if (fs::is_directory(entry, failure) && !platform::can_fill(entry, failure)) return false;
    }
  }
  const fs::space_info space = fs::space(folder, failure);
  return failure || space.available >= kNeededBytes;
}

/// Returns an empty path if there is none.
fs::path make_other_folder(const Driver &driver) {
  const std::string name = fmt::format("isowave-kernels-{}", platform::user_id());
  for (const std::string &parent :
       {environment("TMPDIR"), std::string("/tmp"), std::string("/var/tmp")}) {
    if (parent.empty()) continue;
    const fs::path folder = platform::make_private(parent, name);
    if (folder.empty()) continue;
    fs::path own = platform::make_private(folder, driver.name);
    if (!own.empty() && is_usable(own)) return own;
  }
  return {};
}

KernelFolder choose_folder(std::size_t index) {
  const Driver &driver = drivers()[index];
  const bool is_pocl = index == kPocl;
  KernelFolder result;
  if (is_off(driver) && !is_pocl) return result;  // PoCL still writes kernels there, for itself
  const bool is_named = !environment(driver.variable).empty();
  const auto wanted = wanted_folder(driver);
  if (!wanted && !is_pocl) return result;
  std::string reason = "neither HOME nor XDG_CACHE_HOME is set";
  if (wanted) {
    const platform::FolderCheck check = check_parts(driver, *wanted);
    const bool is_safe = check.danger.empty();
    if (is_safe && (!is_pocl || is_usable(check.path))) {
      // The folder that was checked, whatever the working folder will be.
      if (check.path != *wanted)
        platform::set_environment(driver.variable, check.path.string().c_str());
      return result;
    }
    reason = is_safe ? fmt::format("PoCL cannot write to {}", wanted->string())
                     : fmt::format("kernels in {} are not safe to run, since {}", wanted->string(),
                                   check.danger);
    if (is_named && is_safe) {
      result.trouble = fmt::format("; {}: set {} to another folder", reason, driver.variable);
      return result;
    }
  }
  // The driver keeps out of an unsafe folder even if its devices are only listed.
  const fs::path other = make_other_folder(driver);
  if (other.empty())
    platform::set_environment(driver.off, driver.value_of_off);
  else
    platform::set_environment(driver.variable, other.string().c_str());
  if (is_named) {
    result.refusal =
        fmt::format("{}: set {} to a folder that only you can write to", reason, driver.variable);
  } else if (!other.empty()) {
    result.notice = fmt::format("{}: compiled kernels go to {} (set {} for another folder)", reason,
                                other.string(), driver.variable);
  } else if (is_pocl) {
    result.refusal = fmt::format(
        "{}, and /tmp has no place for them: set {} to a folder that only you can write to", reason,
        driver.variable);
    result.trouble = "; " + result.refusal;
  }
  return result;
}

/// PoCL 3.1 runs the linker, and ends the process where PATH, empty for some services, does not
/// lead to it.
void complete_path() {
  const std::string path = environment("PATH");
  for (std::size_t begin = 0; begin < path.size();) {
    const std::size_t end = std::min(path.find(':', begin), path.size());
    if (platform::can_run(path.substr(begin, end - begin) + "/ld")) return;
    begin = end + 1;
  }
  const std::string longer = path + (path.empty() ? "" : ":") + "/usr/local/bin:/usr/bin:/bin";
  platform::set_environment("PATH", longer.c_str());
}

}  // namespace

void prepare_for_drivers() {
  // Drivers of Windows keep kernels in folders of the user's own, and run no linker.
  if constexpr (fs::path::preferred_separator != '/') return;
  static std::once_flag once;
  std::call_once(once, [] {
    complete_path();
    if (environment("POCL_CACHE_DIR").empty())
      platform::unset_environment("POCL_CACHE_DIR");  // PoCL ends the process if it is empty
    for (std::size_t i = 0; i < kNumDrivers; ++i) state().folders[i] = choose_folder(i);
  });
}

void demand_private_kernels(std::string_view platform) {
  const auto driver = driver_of(platform);
  if (!driver) return;
  const std::scoped_lock lock(state().mutex);
  KernelFolder &folder = state().folders[*driver];
  if (!folder.refusal.empty()) throw Error(folder.refusal);
  folder.is_used = true;
}

std::optional<fs::path> kernel_folder(std::string_view platform) {
  const auto driver = driver_of(platform);
  if (!driver || is_off(drivers()[*driver])) return {};
  const auto folder = wanted_folder(drivers()[*driver]);
  const fs::path part = drivers()[*driver].parts.front();
  return !folder || part.empty() ? folder : *folder / part;
}

std::string cache_notice() {
  const std::scoped_lock lock(state().mutex);
  for (const KernelFolder &folder : state().folders) {
    if (folder.is_used && !folder.notice.empty()) return folder.notice;
  }
  return {};
}

std::string cache_trouble() {
  return state().folders[kPocl].trouble;
}

}  // namespace isowave::core::ocl
