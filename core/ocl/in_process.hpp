#pragma once
// Devices that are this process itself: PoCL's on CPUs. Their memory and their compiler, LLVM and
// Clang, are the process's own.

#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

/// Whether kernels read and write this process's memory where it is.
bool is_in_process(const DeviceInfo &device);

/// Gives the system back what a process that draws does not need any more: the code of the device's
/// compiler, some 60 MiB, and what it has freed. Does nothing on other devices. Code that is used
/// again is read again, from files that the system mostly still has in memory.
///
/// To be called when no kernel is to be compiled for now. A PoCL with LLVM within itself keeps the
/// code.
void give_back_compiler(const DeviceInfo &device);

}  // namespace isowave::core::ocl
