#pragma once
// Forked processes: threads do not survive a fork, so such a process can do less.

namespace isowave::core {

/// Whether this process was forked from one that had called begin_threads(). Its thread pools and
/// OpenCL drivers wait for threads that are not there.
bool is_forked();

/// To be called before threads are used that live on: those of a pool, or of an OpenCL driver.
void begin_threads();

/// Throws  Error if is_forked()
void check_not_forked();

}  // namespace isowave::core
