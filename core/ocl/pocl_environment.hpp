#pragma once
// What PoCL needs of the environment. Without a folder for compiled kernels that it can write to,
// PoCL 3.1 offers no device, fails to build, or ends the process.

#include <string>

namespace isowave::core::ocl {

/// Sees to it that PoCL has such a folder: if the one it would take (POCL_CACHE_DIR,
/// XDG_CACHE_HOME, HOME or /tmp) cannot be written to and POCL_CACHE_DIR is not set, sets
/// POCL_CACHE_DIR to a folder of this user's alone below TMPDIR or /tmp. Adds the usual folders to
/// a PATH without a linker, which PoCL runs. To be called before the first OpenCL call; does its
/// work once.
void prepare_for_pocl();

/// To be called when PoCL is there, for cache_notice().
void note_pocl();
/// One line that says which folder PoCL was given instead of its usual one, or nothing.
std::string cache_notice();
/// "; PoCL needs ..." if there is no such folder, or nothing: the end of a message on what failed.
std::string cache_trouble();

}  // namespace isowave::core::ocl
