#pragma once
// Streams for new files; for the files of this room.

#include <unistd.h>

#include <cstdio>
#include <system_error>

#include "core/platform/last_failure.hpp"

namespace isowave::core::platform {

/// A stream for reading and writing an open file.
///
/// descriptor  -1: the file could not be opened, and errno says why
/// Returns     nullptr, and closes the descriptor, if there is no memory for a stream
inline std::FILE *stream_of(int descriptor, std::error_code &failure) {
  std::FILE *const stream = descriptor < 0 ? nullptr : ::fdopen(descriptor, "w+b");
  failure = stream == nullptr ? last_failure() : std::error_code();
  if (stream == nullptr && descriptor >= 0) ::close(descriptor);
  return stream;
}

}  // namespace isowave::core::platform
