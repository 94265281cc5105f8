#include "core/ocl/build_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <system_error>
#include <vector>

namespace isowave::core::ocl {

namespace {

/// Takes a whole number from the front of `text`; none: it begins with something else.
std::optional<std::size_t> take_number(std::string_view &text) {
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{}) return {};
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return number;
}

/// The origin of each line of the joined text: `file:line`.
std::vector<std::string> places_of(std::string_view text) {
  constexpr std::string_view kMarker = "#line ";
  std::vector<std::string> places;
  std::string_view file = "?";
  std::size_t number = 1;
  while (!text.empty()) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    places.push_back(fmt::format("{}:{}", file, number++));
    if (!line.starts_with(kMarker)) continue;
    line.remove_prefix(kMarker.size());  // 12 "portable/window.h"
    number = take_number(line).value_or(number);
    file = line.substr(std::min<std::size_t>(2, line.size()));
    file.remove_suffix(std::min<std::size_t>(1, file.size()));
  }
  return places;
}

}  // namespace

std::string with_file_names(std::string_view log, std::string_view text) {
  const std::vector<std::string> places = places_of(text);
  std::string named(log);
  for (const std::string_view unnamed : {"<kernel>:", "input.cl:"}) {
    for (std::size_t at = 0; (at = named.find(unnamed, at)) != named.npos; ++at) {
      std::string_view rest = std::string_view(named).substr(at + unnamed.size());
      const std::size_t line = take_number(rest).value_or(0);
      if (line == 0 || line > places.size() || !rest.starts_with(':')) continue;
      const std::size_t end = named.size() - rest.size();
      named.replace(at, end - at, places[line - 1]);
    }
  }
  return named;
}

std::string first_error(std::string_view log) {
  std::string first;
  while (!log.empty()) {
    const std::string_view line = log.substr(0, log.find('\n'));
    if (line.find("error") != std::string_view::npos) return std::string(line);
    if (first.empty()) first = line;
    log.remove_prefix(std::min(log.size(), line.size() + 1));
  }
  return first.empty() ? "the compiler left no log" : first;
}

}  // namespace isowave::core::ocl
