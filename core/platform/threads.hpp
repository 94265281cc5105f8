#pragma once
// Threads, which not every system has.

#include <future>

namespace isowave::core::platform {

/// How std::async() begins work that may go on beside its caller. A system without threads does it
/// when its result is asked for: a browser gives a page alone none.
#if defined(__EMSCRIPTEN__) && !defined(__EMSCRIPTEN_PTHREADS__)
inline constexpr std::launch kBeside = std::launch::deferred;
#else
inline constexpr std::launch kBeside = std::launch::async;
#endif

}  // namespace isowave::core::platform
