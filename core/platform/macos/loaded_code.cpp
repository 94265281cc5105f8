#include "core/platform/loaded_code.hpp"

namespace isowave::core::platform {

/// The system takes pages of code by itself if memory is short.
void give_back_code(bool (*)(std::string_view path)) {}

bool has_opencl() {
  return true;
}

}  // namespace isowave::core::platform
