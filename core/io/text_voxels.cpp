#include "core/io/text_voxels.hpp"
#include "core/base/text.hpp"

#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <system_error>
#include <type_traits>

#include "core/base/error.hpp"
#include "core/io/text_header.hpp"

namespace isowave::core {

namespace {

bool is_space(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

/// The nearest float, also of a number that only double holds. Empty if it is too large.
std::optional<float> parse_float(std::string_view text) {
  const std::optional<double> value = parse_number(text);
  if (!value) return std::nullopt;
  if (text.starts_with('+')) text.remove_prefix(1);
  float nearest = 0;
  if (std::from_chars(text.data(), text.data() + text.size(), nearest).ec == std::errc{})
    return nearest;
  if (std::abs(*value) > 1.0) return std::nullopt;
  return static_cast<float>(*value);  // below the least float
}

template <class T>
std::optional<T> parse_voxel(std::string_view text) {
  if constexpr (std::is_same_v<T, float>) {
    return parse_float(text);
  } else if constexpr (std::is_same_v<T, double>) {
    return parse_number(text);
  } else if constexpr (sizeof(T) == 8) {
    return parse_all<T>(text);
  } else {
    std::optional<double> value = parse_number(text);  // double holds all integers of 32 bits
    if (!value ||
        !(*value >= double(std::numeric_limits<T>::min()) &&
          *value <= double(std::numeric_limits<T>::max())) ||
        *value != std::floor(*value)) {
      return std::nullopt;
    }
    return static_cast<T>(*value);
  }
}

/// Returns whether the text is a voxel of the type, which then is at `out`.
bool store(VoxelType type, std::string_view text, std::byte *out) {
  return with_voxel_type(type, [&]<class T>(T) {
    const std::optional<T> value = parse_voxel<T>(text);
    if (value) std::memcpy(out, &*value, sizeof(T));
    return value.has_value();
  });
}

}  // namespace

std::optional<char> CharacterSource::next() {
  constexpr std::size_t kBufferBytes = 1u << 16;
  if (position_ == buffer_.size()) {
    buffer_.resize(kBufferBytes);
    buffer_.resize(source_.read(buffer_));
    position_ = 0;
    if (buffer_.empty()) return std::nullopt;
  }
  return char(buffer_[position_++]);
}

std::optional<unsigned> HexSource::next_digit() {
  std::optional<char> c = characters_.next();
  while (c && is_space(*c)) c = characters_.next();
  if (!c) return std::nullopt;
  if (*c >= '0' && *c <= '9') return unsigned(*c - '0');
  if (*c >= 'a' && *c <= 'f') return unsigned(*c - 'a') + 10u;
  if (*c >= 'A' && *c <= 'F') return unsigned(*c - 'A') + 10u;
  throw Error("{}: broken: {} among its hexadecimal voxels", characters_.what(),
              quote(std::string_view(&*c, 1)));
}

std::size_t HexSource::read(std::span<std::byte> bytes) {
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const std::optional<unsigned> high = next_digit();
    if (!high) return i;
    const std::optional<unsigned> low = next_digit();
    if (!low) throw Error("{}: truncated: an odd number of hexadecimal digits", characters_.what());
    bytes[i] = std::byte(*high << 4 | *low);
  }
  return bytes.size();
}

std::string_view NumberSource::next_word() {
  constexpr std::size_t kLongest = 1024;
  const auto separates = [](char c) { return is_space(c) || c == ','; };
  word_.clear();
  std::optional<char> c = characters_.next();
  while (c && separates(*c)) c = characters_.next();
  for (; c && !separates(*c); c = characters_.next()) {
    word_ += *c;
    if (word_.size() > kLongest)
      throw Error("{}: broken: {} is no voxel", characters_.what(), quote(word_));
  }
  return word_;
}

std::size_t NumberSource::read(std::span<std::byte> bytes) {
  const std::size_t size = size_of(type_);
  for (std::size_t done = 0; done < bytes.size(); done += size) {
    const std::string_view word = next_word();
    if (word.empty()) return done;
    if (!store(type_, word, &bytes[done])) {
      throw Error("{}: broken: {} is no {} voxel", characters_.what(), quote(word),
                  to_string(type_));
    }
  }
  return bytes.size();
}

}  // namespace isowave::core
