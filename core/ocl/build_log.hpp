#pragma once
// The message of a device's compiler about a kernel that does not build.

#include <string>
#include <string_view>

namespace isowave::core::ocl {

/// The log, with file and line of kernels_cl in place of `<kernel>:N:` and `input.cl:N:`. NVIDIA's
/// compiler and Oclgrind say these: they ignore #line, and count lines of the text that headers
/// were joined to.
///
/// text  what was compiled (kernel_sources.hpp)
std::string with_file_names(std::string_view log, std::string_view text);

/// The line of the log that says most.
std::string first_error(std::string_view log);

}  // namespace isowave::core::ocl
