#pragma once
// Bounds as people read them.

#include <fmt/format.h>

#include <cstdlib>
#include <string>

namespace isowave::core {

/// A positive number in six digits, never below it: a bound that is printed must hold, too.
inline std::string printed_bound(double bound) {
  std::string text = fmt::format("{:.6g}", bound);
  if (std::strtod(text.c_str(), nullptr) < bound) text = fmt::format("{:.6g}", bound * (1 + 4e-6));
  if (std::strtod(text.c_str(), nullptr) < bound) text = fmt::format("{:.6g}", bound * (1 + 1e-5));
  return text;
}

}  // namespace isowave::core
