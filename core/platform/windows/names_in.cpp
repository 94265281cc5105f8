#include "core/platform/names_in.hpp"

#include <memory>

#include "core/platform/windows/system.hpp"

namespace isowave::core::platform {

std::vector<std::string> names_in(const std::filesystem::path &folder) {
  WIN32_FIND_DATAW entry{};
  const auto close = [](void *found) { ::FindClose(found); };
  HANDLE const first = ::FindFirstFileW((folder / L"*").c_str(), &entry);
  if (first == INVALID_HANDLE_VALUE) return {};
  const std::unique_ptr<void, decltype(close)> found(first, close);
  std::vector<std::string> names;
  do {
    std::string name = utf8_of(entry.cFileName);
    if (name != "." && name != "..") names.push_back(std::move(name));
  } while (::FindNextFileW(found.get(), &entry) != 0);
  return names;
}

}  // namespace isowave::core::platform
