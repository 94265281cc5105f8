#pragma once
// Room for shared memory; for the files of this room.

#include <cstddef>

namespace isowave::core::platform {

/// Makes new shared memory as long, and has the system provide it, as far as it can now.
///
/// file     its descriptor
/// Returns  false if there is not as much
bool provide_memory(int file, std::size_t bytes);

}  // namespace isowave::core::platform
