#pragma once
// The libraries that are loaded in this process.

#include <string_view>

namespace isowave::core::platform {

/// Gives the system back the memory that holds the code of some libraries. Code that runs again is
/// read again from its file, which the system mostly still has in memory.
///
/// is_meant  says by a library's path whether it is one of them
void give_back_code(bool (*is_meant)(std::string_view path));

}  // namespace isowave::core::platform
