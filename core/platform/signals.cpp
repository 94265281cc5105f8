#include "core/platform/signals.hpp"

#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <cstring>

namespace isowave::core::platform {

namespace {

std::array<char, 4096> unfinished_file;
constexpr int kEndingSignals[] = {SIGTERM, SIGINT, SIGHUP, SIGABRT};

extern "C" void remove_unfinished() {
  if (unfinished_file.front() != '\0') ::unlink(unfinished_file.data());
}

extern "C" void remove_unfinished_by_signal(int number) {
  remove_unfinished();
  std::signal(number, SIG_DFL);
  ::raise(number);
}

}  // namespace

void survive_file_size_limit() {
  std::signal(SIGXFSZ, SIG_IGN);
}

void remove_at_end(const std::string &name) {
  static const int registered = std::atexit(remove_unfinished);
  static_cast<void>(registered);
  if (name.size() >= unfinished_file.size()) return;
  std::strcpy(unfinished_file.data(), name.c_str());
  for (const int number : kEndingSignals) std::signal(number, remove_unfinished_by_signal);
}

}  // namespace isowave::core::platform
