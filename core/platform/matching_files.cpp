#include "core/platform/matching_files.hpp"

#include <glob.h>

namespace isowave::core::platform {

std::vector<std::string> matching_files(const std::string &pattern) {
  glob_t found{};
  std::vector<std::string> names;
  if (::glob(pattern.c_str(), GLOB_NOSORT, nullptr, &found) == 0)
    names.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  ::globfree(&found);
  return names;
}

}  // namespace isowave::core::platform
