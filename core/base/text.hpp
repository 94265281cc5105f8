#pragma once
// Functions for short texts of files and options.

#include <algorithm>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

namespace isowave::core {

/// ASCII letters in lower case; other bytes as they are.
inline std::string lower_case(std::string_view text) {
  std::string result(text);
  std::ranges::transform(result, result.begin(),
                         [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  return result;
}

/// The word for that many of something: plural(1, "ray", "rays").
template <class Count>
std::string_view plural(Count count, std::string_view one, std::string_view many) {
  return count == Count{1} ? one : many;
}

/// The whole text as a number in decimal, of any type that std::from_chars() knows: no blanks, no
/// plus; NaN and infinities by name. Nothing if it is none, or does not fit the type.
template <class Number>
std::optional<Number> parse_all(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return number;
}

}  // namespace isowave::core
