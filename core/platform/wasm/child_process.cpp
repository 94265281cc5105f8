#include "core/platform/child_process.hpp"

namespace isowave::core::platform {

std::filesystem::path find_program(const std::string &) {
  return {};
}

ChildProcess::ChildProcess(const std::filesystem::path &, const std::vector<std::string> &,
                           std::error_code &failure) {
  failure = std::make_error_code(std::errc::function_not_supported);
}

ChildProcess::~ChildProcess() = default;

void ChildProcess::write(std::span<const std::byte>, std::error_code &failure) {
  failure = std::make_error_code(std::errc::function_not_supported);
}

int ChildProcess::finish() {
  return 1;
}

std::string ChildProcess::errors() const {
  return {};
}

}  // namespace isowave::core::platform
