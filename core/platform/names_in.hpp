#pragma once
// The contents of a folder.

#include <filesystem>
#include <string>
#include <vector>

namespace isowave::core::platform {

/// Names of the files and folders in the folder, in any order; none if it cannot be read. Without
/// memory, this throws std::bad_alloc; libstdc++'s directory iterators would end the process.
std::vector<std::string> names_in(const std::filesystem::path &folder);

}  // namespace isowave::core::platform
