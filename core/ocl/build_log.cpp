#include "core/ocl/build_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <regex>
#include <vector>

namespace isowave::core::ocl {

namespace {

/// Of each line of the joined text, where it comes from: `file:line`.
std::vector<std::string> places_of(std::string_view text) {
  static const std::regex marker(R"re(#line (\d+) "([^"]+)")re");
  std::vector<std::string> places;
  std::string file = "?";
  std::size_t number = 1;
  while (!text.empty()) {
    const std::string line(text.substr(0, text.find('\n')));
    places.push_back(fmt::format("{}:{}", file, number++));
    if (std::smatch match; std::regex_match(line, match, marker)) {
      number = std::stoul(match[1]);
      file = match[2];
    }
    text.remove_prefix(std::min(text.size(), line.size() + 1));
  }
  return places;
}

}  // namespace

std::string with_file_names(std::string_view log, std::string_view text) {
  static const std::regex unnamed(R"((<kernel>|input\.cl):(\d{1,9}):)");
  const std::vector<std::string> places = places_of(text);
  const std::string all(log);
  std::string named;
  auto rest = all.cbegin();
  for (std::sregex_iterator match(all.begin(), all.end(), unnamed), end; match != end; ++match) {
    const std::size_t line = std::stoul((*match)[2]);
    if (line == 0 || line > places.size()) continue;
    named.append(rest, (*match)[0].first).append(places[line - 1]).append(":");
    rest = (*match)[0].second;
  }
  return named.append(rest, all.cend());
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
