#include <fcntl.h>

#include <fstream>

#include "core/platform/process.hpp"
#include "core/platform/provide_memory.hpp"
#include "core/platform/shared_memory.hpp"

namespace isowave::core::platform {

std::filesystem::path own_program() {
  std::error_code failure;
  return std::filesystem::read_symlink("/proc/self/exe", failure);
}

std::string system_identity() {
  std::string identity;
  std::ifstream("/proc/sys/kernel/random/boot_id") >> identity;
  return identity;
}

bool provide_memory(int file, std::size_t bytes) {
  return ::posix_fallocate(file, 0, static_cast<off_t>(bytes)) == 0;
}

}  // namespace isowave::core::platform
