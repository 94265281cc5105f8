#include "core/io/text_header.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/base/error.hpp"
#include "core/base/text.hpp"

namespace isowave::core {

namespace {

constexpr std::string_view kBlanks = " \t\r";

/// Also with a plus before it.
template <class T>
std::optional<T> parse(std::string_view text) {
  if (text.starts_with("+-")) return std::nullopt;
  if (text.starts_with('+')) text.remove_prefix(1);
  return parse_all<T>(text);
}

}  // namespace

std::string_view trim(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

std::vector<std::string_view> split_words(std::string_view text) {
  std::vector<std::string_view> words;
  for (std::size_t end = 0;;) {
    const std::size_t begin = text.find_first_not_of(kBlanks, end);
    if (begin == std::string_view::npos) return words;
    end = std::min(text.find_first_of(kBlanks, begin), text.size());
    words.push_back(text.substr(begin, end - begin));
  }
}

std::string quote(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  return fmt::format("'{}{}'", text.substr(0, kLongest), text.size() > kLongest ? "..." : "");
}

std::optional<double> parse_number(std::string_view text) {
  return parse<double>(text);
}
std::optional<std::int64_t> parse_integer(std::string_view text) {
  return parse<std::int64_t>(text);
}

bool HeaderLines::refill() {
  constexpr std::size_t kBufferBytes = 1u << 16;
  if (position_ < buffer_.size()) return true;
  buffer_.resize(kBufferBytes);
  buffer_.resize(source_.read(buffer_));
  position_ = 0;
  return !buffer_.empty();
}

bool HeaderLines::add_up_to(std::size_t most) {
  const char *text = reinterpret_cast<const char *>(buffer_.data()) + position_;
  const std::size_t left = std::min(buffer_.size() - position_, most);
  const void *newline = std::memchr(text, '\n', left);
  const std::size_t length =
      newline != nullptr ? std::size_t(static_cast<const char *>(newline) - text) : left;
  line_.append(text, length);
  const std::size_t used = length + (newline != nullptr ? 1 : 0);
  position_ += used;
  end_ += used;
  return newline != nullptr;
}

bool HeaderLines::next() {
  while (is_cut_ && refill()) {  // the rest of a long line
    line_.clear();
    is_cut_ = !add_up_to(buffer_.size());
  }
  line_.clear();
  if (is_cut_ || !refill()) return false;
  ++number_;
  bool has_ended = false;
  while (!has_ended && line_.size() < kMaxLength && refill())
    has_ended = add_up_to(kMaxLength - line_.size());
  is_cut_ = !has_ended && refill();
  if (!is_cut_ && line_.ends_with('\r')) line_.pop_back();
  return true;
}

void HeaderFields::add(std::string_view name, std::string_view value) {
  if (!fields_.emplace(name, value).second)
    throw Error("{}: broken header: '{}' is given twice", what_, name);
}

const std::string &HeaderFields::operator[](std::string_view name) const {
  const auto found = fields_.find(name);
  if (found == fields_.end()) throw Error("{}: broken header: no '{}'", what_, name);
  return found->second;
}

void HeaderFields::fail(std::string_view name, std::string_view reason) const {
  throw Error("{}: broken header: {} {}: {}", what_, name, quote((*this)[name]), reason);
}

std::vector<std::string_view> HeaderFields::words(std::string_view name, std::size_t count) const {
  std::vector<std::string_view> words = split_words((*this)[name]);
  if (words.size() != count)
    fail(name, fmt::format("need {} {}", count, plural(count, "value", "values")));
  return words;
}

std::vector<double> HeaderFields::numbers(std::string_view name, std::size_t count, Nan nan) const {
  std::vector<double> values;
  for (const std::string_view word : words(name, count)) {
    const std::optional<double> value = parse_number(word);
    if (!value) fail(name, fmt::format("{} is not a number in range", quote(word)));
    if (std::isinf(*value) || (std::isnan(*value) && nan == Nan::kRefused))
      fail(name, "must be finite");
    values.push_back(*value);
  }
  return values;
}

std::vector<std::int64_t> HeaderFields::integers(std::string_view name, std::size_t count) const {
  std::vector<std::int64_t> values;
  for (const std::string_view word : words(name, count)) {
    const std::optional<std::int64_t> value = parse_integer(word);
    if (!value) fail(name, fmt::format("{} is not an integer in range", quote(word)));
    values.push_back(*value);
  }
  return values;
}

double HeaderFields::number(std::string_view name) const {
  return numbers(name, 1).front();
}
std::int64_t HeaderFields::integer(std::string_view name) const {
  return integers(name, 1).front();
}

}  // namespace isowave::core
