#include "core/platform/private_folder.hpp"

#include <system_error>

namespace isowave::core::platform {

namespace fs = std::filesystem;

/// Access lists of a user's own folders keep other users out.
FolderCheck check_private(const fs::path &folder) {
  std::error_code failure;
  fs::path path = fs::absolute(folder, failure);
  return {failure ? folder : std::move(path), ""};
}

fs::path make_private(const fs::path &parent, const std::string &name) {
  std::error_code failure;
  fs::path path = check_private(parent / name).path;
  fs::create_directory(path, failure);
  return fs::is_directory(path, failure) ? path : fs::path();
}

}  // namespace isowave::core::platform
