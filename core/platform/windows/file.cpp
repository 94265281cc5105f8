#include "core/platform/file.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "core/platform/process.hpp"
#include "core/platform/windows/system.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

namespace {

/// Most bytes that one call reads or writes.
constexpr std::size_t kMostBytes = std::size_t{1} << 30;
constexpr int kMostNames = 1000;  ///< of temporary files that are tried

HANDLE handle_of(std::intptr_t handle) {
  return reinterpret_cast<HANDLE>(handle);
}

DWORD piece_of(std::size_t bytes) {
  return static_cast<DWORD>(std::min(bytes, kMostBytes));
}

OVERLAPPED at(std::uint64_t offset) {
  OVERLAPPED place{};
  place.Offset = static_cast<DWORD>(offset);
  place.OffsetHigh = static_cast<DWORD>(offset >> 32);
  return place;
}

/// Makes a file `begin`.N.M for writing, of a new name in the folder for temporary files.
HANDLE make_in_temporary_folder(std::string_view begin, DWORD attributes, fs::path &path,
                                std::error_code &failure) {
  const fs::path folder = fs::temp_directory_path(failure);
  if (failure) return INVALID_HANDLE_VALUE;
  for (int i = 0; i < kMostNames; ++i) {
    path = folder / (std::string(begin) + "." + std::to_string(process_id()) + "." +
                     std::to_string(::GetTickCount64() % 1000000 + static_cast<unsigned>(i)));
    const HANDLE file = ::CreateFileW(path.c_str(), GENERIC_READ | GENERIC_WRITE, kShareAll,
                                      nullptr, CREATE_NEW, attributes, nullptr);
    failure = file == INVALID_HANDLE_VALUE ? last_system_failure() : std::error_code();
    if (failure != std::errc::file_exists) return file;
  }
  return INVALID_HANDLE_VALUE;
}

}  // namespace

/// Folders are opened, too: is_regular() tells.
File File::open(const fs::path &path, std::error_code &failure) {
  File file(reinterpret_cast<std::intptr_t>(::CreateFileW(path.c_str(), GENERIC_READ, kShareAll,
                                                          nullptr, OPEN_EXISTING,
                                                          FILE_FLAG_BACKUP_SEMANTICS, nullptr)));
  failure = file.handle_ == -1 ? last_system_failure() : std::error_code();
  return file;
}

File File::make_temporary(std::error_code &failure) {
  fs::path path;
  return File(reinterpret_cast<std::intptr_t>(make_in_temporary_folder(
      "isowave", FILE_ATTRIBUTE_TEMPORARY | FILE_FLAG_DELETE_ON_CLOSE, path, failure)));
}

File::~File() {
  if (handle_ != -1) ::CloseHandle(handle_of(handle_));
}

File::File(File &&other) noexcept : handle_(std::exchange(other.handle_, -1)) {}

File &File::operator=(File &&other) noexcept {
  std::swap(handle_, other.handle_);
  return *this;
}

bool File::is_regular() const {
  BY_HANDLE_FILE_INFORMATION info{};
  return ::GetFileType(handle_of(handle_)) == FILE_TYPE_DISK &&
         ::GetFileInformationByHandle(handle_of(handle_), &info) != 0 &&
         (info.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY) == 0;
}

std::uint64_t File::size() const {
  LARGE_INTEGER size{};
  return ::GetFileSizeEx(handle_of(handle_), &size) != 0 ? static_cast<std::uint64_t>(size.QuadPart)
                                                         : 0;
}

std::size_t File::read(std::uint64_t offset, std::span<std::byte> out,
                       std::error_code &failure) const {
  failure.clear();
  std::size_t done = 0;
  while (done < out.size()) {
    OVERLAPPED place = at(offset + done);
    DWORD count = 0;
    if (::ReadFile(handle_of(handle_), &out[done], piece_of(out.size() - done), &count, &place) ==
            0 &&
        ::GetLastError() != ERROR_HANDLE_EOF)
      failure = last_system_failure();
    if (failure || count == 0) break;
    done += count;
  }
  return done;
}

void File::append(std::span<const std::byte> bytes, std::error_code &failure) {
  failure.clear();
  while (!bytes.empty()) {
    OVERLAPPED end = at(~std::uint64_t{0});  // the file's end, wherever it has been read
    DWORD count = 0;
    if (::WriteFile(handle_of(handle_), bytes.data(), piece_of(bytes.size()), &count, &end) == 0) {
      failure = last_system_failure();
      return;
    }
    bytes = bytes.subspan(count);
  }
}

std::FILE *open_stream(const fs::path &path) {
  return ::_wfopen(path.c_str(), L"rb");
}

fs::path keep_in_temporary_folder(std::string_view begin, std::string_view text) {
  fs::path path;
  std::error_code failure;
  const Handle file(make_in_temporary_folder(begin, FILE_ATTRIBUTE_NORMAL, path, failure));
  if (!file.is_open()) return {};
  DWORD count = 0;
  const BOOL done = ::WriteFile(file.get(), text.data(), piece_of(text.size()), &count, nullptr);
  if (done != 0 && count == text.size()) return path;
  ::DeleteFileW(path.c_str());
  return {};
}

}  // namespace isowave::core::platform
