#include "core/platform/loaded_code.hpp"

#include "core/platform/windows/system.hpp"

namespace isowave::core::platform {

/// Windows takes pages of code by itself if memory is short.
void give_back_code(bool (*)(std::string_view path)) {}

bool has_opencl() {
  // Among the system's own files alone: the working folder may be a stranger's. It stays loaded.
  static const bool is_there =
      ::LoadLibraryExW(L"OpenCL.dll", nullptr, LOAD_LIBRARY_SEARCH_DEFAULT_DIRS) != nullptr;
  return is_there;
}

}  // namespace isowave::core::platform
