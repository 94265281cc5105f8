#include "core/platform/new_file.hpp"

#include <aclapi.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <io.h>

#include <string>

#include "core/platform/last_failure.hpp"
#include "core/platform/windows/system.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

namespace {

constexpr int kMostOpenFiles = 2048;  ///< as many as msvcrt.dll allows

HANDLE handle_of(std::FILE *file) {
  return reinterpret_cast<HANDLE>(::_get_osfhandle(::_fileno(file)));
}

constexpr int kMayWrite = 2;  ///< of _waccess()

}  // namespace

/// Files of Windows have names.
std::FILE *make_nameless(const fs::path &) {
  return nullptr;
}

std::FILE *make_new(const fs::path &path, std::error_code &failure) {
  Handle file(::CreateFileW(path.c_str(), GENERIC_READ | GENERIC_WRITE | WRITE_DAC, kShareAll,
                            nullptr, CREATE_NEW, FILE_ATTRIBUTE_NORMAL, nullptr));
  failure = file.is_open() ? std::error_code() : last_system_failure();
  if (failure) return nullptr;
  const int descriptor =
      ::_open_osfhandle(reinterpret_cast<std::intptr_t>(file.get()), _O_BINARY | _O_NOINHERIT);
  std::FILE *stream = nullptr;
  if (descriptor >= 0) {
    file.release();
    stream = ::_fdopen(descriptor, "w+b");
  }
  if (stream != nullptr) return stream;
  failure = last_failure();
  if (descriptor >= 0) ::_close(descriptor);
  ::DeleteFileW(path.c_str());
  return nullptr;
}

void give_name(std::FILE *, const fs::path &, std::error_code &failure) {
  failure = std::make_error_code(std::errc::function_not_supported);
}

fs::path name_while_open(std::FILE *file) {
  std::wstring name(32768, L'\0');  // no path is longer
  const DWORD length =
      ::GetFinalPathNameByHandleW(handle_of(file), name.data(), static_cast<DWORD>(name.size()), 0);
  name.resize(length < name.size() ? length : 0);
  constexpr std::wstring_view kPlain = L"\\\\?\\";  // begins all that this function returns
  if (name.starts_with(kPlain) && !name.starts_with(L"\\\\?\\UNC\\")) name.erase(0, kPlain.size());
  return name;
}

void keep_permissions(const fs::path &replaced, std::FILE *file) {
  copy_access_list(replaced, file);
}

void copy_access_list(const fs::path &replaced, std::FILE *file) {
  std::wstring name = replaced.wstring();
  PACL list = nullptr;
  PSECURITY_DESCRIPTOR descriptor = nullptr;
  if (::GetNamedSecurityInfoW(name.data(), SE_FILE_OBJECT, DACL_SECURITY_INFORMATION, nullptr,
                              nullptr, &list, nullptr, &descriptor) != ERROR_SUCCESS)
    return;
  ::SetSecurityInfo(handle_of(file), SE_FILE_OBJECT, DACL_SECURITY_INFORMATION, nullptr, nullptr,
                    list, nullptr);
  ::LocalFree(descriptor);
}

std::uint64_t size_of(std::FILE *file) {
  LARGE_INTEGER size{};
  return ::GetFileSizeEx(handle_of(file), &size) != 0 ? static_cast<std::uint64_t>(size.QuadPart)
                                                      : 0;
}

std::string identity_of(const fs::path &path, std::error_code &failure) {
  const Handle file(::CreateFileW(path.c_str(), 0, kShareAll, nullptr, OPEN_EXISTING,
                                  FILE_FLAG_BACKUP_SEMANTICS, nullptr));
  BY_HANDLE_FILE_INFORMATION info{};
  const bool is_there = file.is_open() && ::GetFileInformationByHandle(file.get(), &info) != 0;
  failure = is_there ? std::error_code() : last_system_failure();
  return is_there ? fmt::format("{}:{}:{}", info.dwVolumeSerialNumber, info.nFileIndexHigh,
                                info.nFileIndexLow)
                  : "";
}

bool can_write(const fs::path &file, std::error_code &failure) {
  failure = ::_waccess(file.c_str(), kMayWrite) == 0 ? std::error_code() : last_failure();
  return !failure;
}

bool can_fill(const fs::path &folder, std::error_code &failure) {
  // The access list says so, and not the attribute that _waccess() looks at.
  const Handle opened(::CreateFileW(folder.c_str(), FILE_ADD_FILE, kShareAll, nullptr,
                                    OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, nullptr));
  failure = opened.is_open() ? std::error_code() : last_system_failure();
  return !failure;
}

bool can_run(const fs::path &program) {
  std::error_code failure;
  return fs::is_regular_file(program, failure);
}

void raise_open_file_limit() {
  ::_setmaxstdio(kMostOpenFiles);
}

bool is_near_open_file_limit(std::FILE *file) {
  constexpr int kSpared = 64;
  return ::_fileno(file) + kSpared > ::_getmaxstdio();
}

}  // namespace isowave::core::platform
