#pragma once
// What ties this process to programs that it starts; for the files of this room.

#include <array>
#include <cstddef>
#include <span>

namespace isowave::core::platform {

/// Makes two ends of a socket: writing to a pipe without a reader would end this process by a
/// signal. No program that this process starts keeps them.
///
/// Returns  false, and errno, if it cannot
bool make_channel(std::array<int, 2> &ends);

/// Writes to one end. That the other is closed is an error, not a signal.
///
/// Returns  how many bytes it took; -1, and errno, if it cannot
std::ptrdiff_t write_to_channel(int end, std::span<const std::byte> bytes);

/// Makes a file without a name, for reading and writing.
///
/// Returns  its descriptor, which no program keeps; -1, and errno, if it cannot
int make_scratch();

/// The variables of this process, for programs that it starts.
char **all_variables();

}  // namespace isowave::core::platform
