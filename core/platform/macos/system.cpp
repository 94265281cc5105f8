#include <mach-o/dyld.h>
#include <sys/sysctl.h>
#include <unistd.h>

#include <array>
#include <cstdint>

#include "core/platform/process.hpp"
#include "core/platform/provide_memory.hpp"
#include "core/platform/shared_memory.hpp"

namespace isowave::core::platform {

std::filesystem::path own_program() {
  std::array<char, 4096> name{};
  std::uint32_t size = name.size();
  if (::_NSGetExecutablePath(name.data(), &size) != 0) return {};
  std::error_code failure;
  return std::filesystem::canonical(name.data(), failure);
}

std::string system_identity() {
  std::array<char, 64> identity{};
  std::size_t size = identity.size() - 1;
  if (::sysctlbyname("kern.bootsessionuuid", identity.data(), &size, nullptr, 0) != 0) return {};
  return identity.data();
}

/// The system promises nothing.
bool provide_memory(int file, std::size_t bytes) {
  return ::ftruncate(file, static_cast<off_t>(bytes)) == 0;
}

}  // namespace isowave::core::platform
