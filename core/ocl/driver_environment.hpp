#pragma once
// The environment that OpenCL drivers need. Drivers keep compiled kernels in a folder, and run
// what they find there: no other user of the machine may be able to write to it.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace isowave::core::ocl {

/// Sees to it that each driver keeps its kernels in a folder of this user's alone
/// (core/platform/private_folder.hpp) and that PoCL can write to its folder: without one, PoCL 3.1
/// offers no device, fails to build, or ends the process. If the driver's usual folder will not do,
/// it is given one below TMPDIR, /tmp or /var/tmp, by its environment variable; if there is none,
/// its kernels are not kept. Adds the usual folders to a PATH without a linker, which PoCL runs.
/// To be called before the first OpenCL call; does its work once.
void prepare_for_drivers();

/// To be called before a device of that platform is used.
///
/// Throws  Error: its driver would run what other users can have put into its folder
void demand_private_kernels(std::string_view platform);

/// The folder that the driver keeps its kernels in; nothing if it keeps none, or that is unknown.
std::optional<std::filesystem::path> kernel_folder(std::string_view platform);

/// One line that says which folder the driver of a device in use was given instead of its usual
/// one, or nothing.
std::string cache_notice();
/// "; PoCL cannot ..." if PoCL has no folder that it can write to, or nothing: the end of a message
/// on what failed.
std::string cache_trouble();

}  // namespace isowave::core::ocl
