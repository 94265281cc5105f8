#pragma once
// What may be opened to be read.

#include <filesystem>

namespace isowave {

/// Throws Error in one line where no regular file has this name. Reading a pipe would wait for whoever writes to it, and a
/// device may never end.
void check_input_file(const std::filesystem::path &path);

}  // namespace isowave
