#pragma once
// What the steady clock says of a piece of work.

#include <chrono>

namespace isowave::core {

/// Wall clock since then [ms].
inline double ms_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

}  // namespace isowave::core
