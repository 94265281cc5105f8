#pragma once
// Round numbers for scales.

#include <string>
#include <vector>

namespace isowave::core {

/// The largest of 1, 2 and 5 times a power of ten that is not above `most`, which it exceeds by a
/// factor of less than 2.5.
///
/// most  finite, above 0
double round_length(double most);

/// Round numbers in a range, and how they are written, in ascending order.
struct Ticks {
  std::vector<double> values;
  std::vector<std::string> labels;  ///< with as many digits as tell them apart
};

/// 3 to 5 multiples of a round number between low and high, both included; one tick if low == high,
/// and both ends if they agree in nearly all digits.
///
/// low, high  finite, in any order
Ticks ticks_between(double low, double high);

}  // namespace isowave::core
