#include "core/platform/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <utility>

#include "core/platform/last_failure.hpp"

namespace isowave::core::platform {

namespace {

/// Most bytes that one call of read() takes, with room to spare.
constexpr std::size_t kMostBytes = std::size_t{1} << 30;

int descriptor_of(std::intptr_t handle) {
  return static_cast<int>(handle);
}

struct stat status_of(std::intptr_t handle) {
  struct stat status {};
  if (::fstat(descriptor_of(handle), &status) != 0) status.st_mode = 0;
  return status;
}

}  // namespace

File File::open(const std::filesystem::path &path, std::error_code &failure) {
  File file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  failure = file.handle_ < 0 ? last_failure() : std::error_code();
  return file;
}

File File::make_temporary(std::error_code &failure) {
  const char *folder = std::getenv("TMPDIR");
  std::string name =
      std::string(folder != nullptr && *folder != 0 ? folder : "/tmp") + "/isowave_XXXXXX";
  File file(::mkstemp(name.data()));
  failure = file.handle_ < 0 ? last_failure() : std::error_code();
  if (!failure) ::unlink(name.c_str());
  return file;
}

File::~File() {
  if (handle_ >= 0) ::close(descriptor_of(handle_));
}

File::File(File &&other) noexcept : handle_(std::exchange(other.handle_, -1)) {}

File &File::operator=(File &&other) noexcept {
  std::swap(handle_, other.handle_);
  return *this;
}

bool File::is_regular() const {
  return S_ISREG(status_of(handle_).st_mode);
}

std::uint64_t File::size() const {
  return static_cast<std::uint64_t>(status_of(handle_).st_size);
}

std::size_t File::read(std::uint64_t offset, std::span<std::byte> out,
                       std::error_code &failure) const {
  failure.clear();
  std::size_t done = 0;
  while (done < out.size()) {
    const ssize_t count =
        ::pread(descriptor_of(handle_), &out[done], std::min(out.size() - done, kMostBytes),
                static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) failure = last_failure();
    if (count <= 0) break;
    done += static_cast<std::size_t>(count);
  }
  return done;
}

void File::append(std::span<const std::byte> bytes, std::error_code &failure) {
  failure.clear();
  while (!bytes.empty()) {
    const ssize_t count =
        ::write(descriptor_of(handle_), bytes.data(), std::min(bytes.size(), kMostBytes));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      failure = last_failure();
      return;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

std::FILE *open_stream(const std::filesystem::path &path) {
  return std::fopen(path.c_str(), "rb");
}

std::filesystem::path keep_in_temporary_folder(std::string_view begin, std::string_view text) {
  std::error_code failure;
  std::string name = (std::filesystem::temp_directory_path(failure) / begin).string() + "_XXXXXX";
  const int file = failure ? -1 : ::mkstemp(name.data());
  if (file < 0) return {};
  const bool written = ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  ::close(file);
  if (written) return name;
  ::unlink(name.c_str());
  return {};
}

}  // namespace isowave::core::platform
