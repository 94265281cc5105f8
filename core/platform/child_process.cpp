#include "core/platform/child_process.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "core/platform/channel.hpp"
#include "core/platform/last_failure.hpp"
#include "core/platform/new_file.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

namespace {

int wait_for(std::int64_t id) {
  int status = 0;
  while (::waitpid(static_cast<pid_t>(id), &status, 0) < 0) {
    if (errno != EINTR) return -1;
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

fs::path find_program(const std::string &name) {
  const char *folders = std::getenv("PATH");
  const std::string_view path = folders != nullptr ? folders : "/usr/bin:/bin";
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find(':', begin), path.size());
    const fs::path program = fs::path(path.substr(begin, end - begin)) / name;
    std::error_code failure;
    if (fs::is_regular_file(program, failure) && can_run(program)) return fs::absolute(program);
    begin = end + 1;
  }
  return {};
}

ChildProcess::ChildProcess(const fs::path &program, const std::vector<std::string> &arguments,
                           std::error_code &failure) {
  std::array<int, 2> ends{-1, -1};
  errors_ = make_scratch();
  if (errors_ < 0 || !make_channel(ends)) {
    failure = last_failure();
    return;
  }
  input_ = ends[0];
  ::shutdown(ends[1], SHUT_WR);  // it only reads
  std::string name = program.string();
  std::vector<std::string> texts = arguments;
  std::vector<char *> argv{name.data()};
  for (std::string &text : texts) argv.push_back(text.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t files;
  ::posix_spawn_file_actions_init(&files);
  ::posix_spawn_file_actions_adddup2(&files, ends[1], STDIN_FILENO);
  ::posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_adddup2(&files, errors_, STDERR_FILENO);
  pid_t id = -1;
  const int error = ::posix_spawn(&id, name.c_str(), &files, nullptr, argv.data(), all_variables());
  ::posix_spawn_file_actions_destroy(&files);
  ::close(ends[1]);
  failure = {error, std::generic_category()};
  if (error == 0) id_ = id;
}

ChildProcess::~ChildProcess() {
  close_input();
  if (id_) {
    ::kill(static_cast<pid_t>(*id_), SIGKILL);
    wait_for(*id_);
  }
  if (errors_ >= 0) ::close(errors_);
}

void ChildProcess::write(std::span<const std::byte> bytes, std::error_code &failure) {
  failure.clear();
  while (!bytes.empty()) {
    const std::ptrdiff_t count = write_to_channel(input_, bytes);
    if (count >= 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    } else if (errno != EINTR) {
      failure = last_failure();
      return;
    }
  }
}

int ChildProcess::finish() {
  close_input();
  return id_ ? wait_for(*std::exchange(id_, std::nullopt)) : -1;
}

std::string ChildProcess::errors() const {
  std::string text(std::size_t{64} << 10, '\0');
  const off_t size = ::lseek(errors_, 0, SEEK_END);
  const auto begin = std::max<off_t>(0, size - static_cast<off_t>(text.size()));
  const ssize_t count = ::pread(errors_, text.data(), text.size(), begin);
  text.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
  return text;
}

void ChildProcess::close_input() {
  if (input_ >= 0) ::close(std::exchange(input_, -1));
}

}  // namespace isowave::core::platform
