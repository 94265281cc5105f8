#include "core/platform/matching_files.hpp"

#include <filesystem>
#include <string_view>
#include <system_error>

#include "core/platform/names_in.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

namespace {

/// The end of the UTF-8 letter that a text begins with.
std::size_t letter_length(std::string_view text) {
  std::size_t length = 1;
  while (length < text.size() && (static_cast<unsigned char>(text[length]) & 0xC0u) == 0x80)
    ++length;
  return length;
}

/// Whether the pattern's [...] has the letter. Takes both from their texts.
bool take_bracket(std::string_view &pattern, std::string_view &name) {
  const std::size_t length = letter_length(name);
  const std::string_view letter = name.substr(0, length);
  name.remove_prefix(length);
  pattern.remove_prefix(1);
  const bool is_negated = pattern.starts_with('!');
  if (is_negated) pattern.remove_prefix(1);
  bool has_letter = false;
  for (bool is_first = true; is_first || !pattern.starts_with(']'); is_first = false) {
    const std::string_view first = pattern.substr(0, letter_length(pattern));
    pattern.remove_prefix(first.size());
    std::string_view last = first;
    if (pattern.starts_with('-') && !pattern.starts_with("-]")) {
      pattern.remove_prefix(1);
      last = pattern.substr(0, letter_length(pattern));
      pattern.remove_prefix(last.size());
    }
    has_letter |= first <= letter && letter <= last;  // UTF-8 is in the order of code points
  }
  pattern.remove_prefix(1);
  return has_letter != is_negated;
}

bool matches(std::string_view pattern, std::string_view name) {
  while (!pattern.empty()) {
    if (pattern.front() == '*') {
      pattern.remove_prefix(1);
      for (std::size_t i = 0; i <= name.size(); ++i) {
        if (matches(pattern, name.substr(i))) return true;
      }
      return false;
    }
    if (name.empty()) return false;
    if (pattern.front() == '?') {
      pattern.remove_prefix(1);
      name.remove_prefix(letter_length(name));
    } else if (pattern.front() == '[' && pattern.find(']', 2) != pattern.npos) {
      if (!take_bracket(pattern, name)) return false;
    } else {
      if (pattern.front() != name.front()) return false;
      pattern.remove_prefix(1);
      name.remove_prefix(1);
    }
  }
  return name.empty();
}

/// parts  the pattern's parts between separators, from this one on
void find_in(const fs::path &folder, fs::path::iterator part, const fs::path::iterator &end,
             std::vector<std::string> &found) {
  std::error_code failure;
  if (part == end) {
    if (fs::exists(folder, failure)) found.push_back(folder.string());
    return;
  }
  const std::string pattern = part->string();
  const auto next = std::next(part);
  if (pattern.find_first_of("*?[") == pattern.npos)
    return find_in(folder / *part, next, end, found);
  for (const std::string &name : names_in(folder.empty() ? "." : folder)) {
    const bool is_hidden = name.starts_with('.') && !pattern.starts_with('.');
    if (!is_hidden && matches(pattern, name)) find_in(folder / name, next, end, found);
  }
}

}  // namespace

std::vector<std::string> matching_files(const std::string &pattern) {
  std::vector<std::string> found;
  const fs::path parts(pattern);
  find_in({}, parts.begin(), parts.end(), found);
  return found;
}

}  // namespace isowave::core::platform
