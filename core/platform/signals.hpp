#pragma once
// Signals, by which a system ends a process.

#include <string>

namespace isowave::core::platform {

/// A file that may not grow further (ulimit -f) is from now on an error like any other. By default
/// it ends the process.
void survive_file_size_limit();

/// Has a file removed when the process ends: by itself, or by a signal that leaves it the time. One
/// file; the latest counts.
void remove_at_end(const std::string &name);

}  // namespace isowave::core::platform
