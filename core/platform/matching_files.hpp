#pragma once
// Files by a pattern of their names.

#include <string>
#include <vector>

namespace isowave::core::platform {

/// The files and folders whose names match a pattern, as in a shell: * for any characters, ? for
/// one, [a-z] for one of some. In any order.
std::vector<std::string> matching_files(const std::string &pattern);

}  // namespace isowave::core::platform
