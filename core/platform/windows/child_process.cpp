#include "core/platform/child_process.hpp"

#include <fcntl.h>
#include <io.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "core/platform/last_failure.hpp"
#include "core/platform/new_file.hpp"
#include "core/platform/windows/system.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

namespace {

/// One argument of a command line, as C libraries take it apart again: quoted, and with twice as
/// many backslashes before a quotation mark.
std::wstring quoted(const std::wstring &argument) {
  std::wstring text = L"\"";
  std::size_t num_backslashes = 0;
  for (const wchar_t letter : argument) {
    if (letter == L'"') text.append(num_backslashes + 1, L'\\');
    num_backslashes = letter == L'\\' ? num_backslashes + 1 : 0;
    text += letter;
  }
  return text.append(num_backslashes, L'\\') + L'"';
}

/// A handle for programs that this process starts.
HANDLE inheritable(HANDLE handle) {
  ::SetHandleInformation(handle, HANDLE_FLAG_INHERIT, HANDLE_FLAG_INHERIT);
  return handle;
}

HANDLE process_of(std::int64_t id) {
  return reinterpret_cast<HANDLE>(static_cast<std::intptr_t>(id));
}

/// Returns a descriptor that closes the handle; -1 and why if there is none.
int descriptor_of(HANDLE handle, std::error_code &failure) {
  const int descriptor =
      ::_open_osfhandle(reinterpret_cast<std::intptr_t>(handle), _O_BINARY | _O_NOINHERIT);
  if (descriptor < 0) failure = last_failure();
  return descriptor;
}

}  // namespace

fs::path find_program(const std::string &name) {
  wchar_t found[MAX_PATH];
  const DWORD length =
      ::SearchPathW(nullptr, fs::path(name).c_str(), L".exe", MAX_PATH, found, nullptr);
  return length > 0 && length < MAX_PATH ? fs::path(found) : fs::path();
}

ChildProcess::ChildProcess(const fs::path &program, const std::vector<std::string> &arguments,
                           std::error_code &failure) {
  failure.clear();
  Handle input, our_input;
  if (::CreatePipe(input.out(), our_input.out(), nullptr, 0) == 0) {
    failure = last_system_failure();
    return;
  }
  const fs::path folder = fs::temp_directory_path(failure);
  wchar_t errors_name[MAX_PATH];
  if (failure || ::GetTempFileNameW(folder.c_str(), L"iso", 0, errors_name) == 0) {
    failure = last_system_failure();
    return;
  }
  Handle errors(::CreateFileW(errors_name, GENERIC_READ | GENERIC_WRITE, kShareAll, nullptr,
                              CREATE_ALWAYS, FILE_ATTRIBUTE_TEMPORARY | FILE_FLAG_DELETE_ON_CLOSE,
                              nullptr));
  const Handle nowhere(
      ::CreateFileW(L"NUL", GENERIC_WRITE, kShareAll, nullptr, OPEN_EXISTING, 0, nullptr));
  std::wstring line = quoted(program.wstring());
  for (const std::string &argument : arguments) line += L' ' + quoted(fs::path(argument).wstring());
  STARTUPINFOW start{};
  start.cb = sizeof(start);
  start.dwFlags = STARTF_USESTDHANDLES;
  start.hStdInput = inheritable(input.get());
  start.hStdOutput = inheritable(nowhere.get());
  start.hStdError = inheritable(errors.get());
  PROCESS_INFORMATION made{};
  if (!errors.is_open() ||
      ::CreateProcessW(program.c_str(), line.data(), nullptr, nullptr, TRUE, CREATE_NO_WINDOW,
                       nullptr, nullptr, &start, &made) == 0) {
    failure = last_system_failure();
    return;
  }
  ::CloseHandle(made.hThread);
  id_ = reinterpret_cast<std::intptr_t>(made.hProcess);
  input_ = descriptor_of(our_input.release(), failure);
  errors_ = descriptor_of(errors.release(), failure);
}

ChildProcess::~ChildProcess() {
  close_input();
  if (id_) {
    ::TerminateProcess(process_of(*id_), 1);
    finish();
  }
  if (errors_ >= 0) ::_close(errors_);
}

void ChildProcess::write(std::span<const std::byte> bytes, std::error_code &failure) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 20;
  failure.clear();
  while (!bytes.empty()) {
    const auto count = static_cast<unsigned>(std::min(bytes.size(), kMostBytes));
    const int written = ::_write(input_, bytes.data(), count);
    if (written <= 0) {
      failure = last_failure();
      return;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

int ChildProcess::finish() {
  close_input();
  if (!id_) return -1;
  const Handle process(process_of(*std::exchange(id_, std::nullopt)));
  DWORD status = 1;
  ::WaitForSingleObject(process.get(), INFINITE);
  ::GetExitCodeProcess(process.get(), &status);
  return static_cast<int>(status);
}

std::string ChildProcess::errors() const {
  std::string text(std::size_t{64} << 10, '\0');
  const std::int64_t size = ::_lseeki64(errors_, 0, SEEK_END);
  ::_lseeki64(errors_, std::max<std::int64_t>(0, size - static_cast<std::int64_t>(text.size())),
              SEEK_SET);
  const int count = ::_read(errors_, text.data(), static_cast<unsigned>(text.size()));
  text.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
  return text;
}

void ChildProcess::close_input() {
  if (input_ >= 0) ::_close(std::exchange(input_, -1));
}

}  // namespace isowave::core::platform
