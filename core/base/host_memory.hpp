#pragma once
// How much memory the host has.

#include <cstdint>

namespace isowave::core {

/// Bytes of the host's memory, used or not; 0 where the system does not say.
std::uint64_t host_memory();

}  // namespace isowave::core
