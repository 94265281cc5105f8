#include "core/platform/names_in.hpp"

#include <dirent.h>

#include <memory>

namespace isowave::core::platform {

std::vector<std::string> names_in(const std::filesystem::path &folder) {
  const auto close = [](DIR *open) { ::closedir(open); };
  const std::unique_ptr<DIR, decltype(close)> open(::opendir(folder.c_str()), close);
  std::vector<std::string> names;
  while (const dirent *entry = open ? ::readdir(open.get()) : nullptr) {
    const std::string name = entry->d_name;
    if (name != "." && name != "..") names.push_back(name);
  }
  return names;
}

}  // namespace isowave::core::platform
