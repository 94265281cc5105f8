#pragma once
// The libraries that are loaded in this process.

#include <string_view>

namespace isowave::core::platform {

/// Gives the system back the memory that holds the code of some libraries. Code that runs again is
/// read again from its file, which the system mostly still has in memory.
///
/// is_meant  says by a library's path whether it is one of them
void give_back_code(bool (*is_meant)(std::string_view path));

/// Whether OpenCL's functions can be called. Windows loads them when the first one is called, and
/// ends the process if they are not there. Elsewhere a process does not start without them.
bool has_opencl();

}  // namespace isowave::core::platform
