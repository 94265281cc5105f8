#include "core/base/utf8.hpp"

#include <algorithm>
#include <cstdint>

namespace isowave::core {

namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";

bool continues(char c) {
  return (static_cast<unsigned char>(c) & 0xC0u) == 0x80;
}

/// The bytes of the code point that the text begins with; 0 if there is none: a shorter form
/// exists, it is half of a surrogate pair, or above U+10FFFF.
std::size_t first_length(std::string_view text) {
  const auto first = static_cast<unsigned char>(text[0]);
  const std::size_t length = first < 0x80   ? 1
                             : first < 0xC0 ? 0
                             : first < 0xE0 ? 2
                             : first < 0xF0 ? 3
                                            : 4;
  if (length < 2) return length;
  if (first >= 0xF8 || text.size() < length ||
      !std::ranges::all_of(text.substr(1, length - 1), continues))
    return 0;
  std::uint32_t point = first & (0x7Fu >> length);
  for (const char c : text.substr(1, length - 1))
    point = point << 6 | (static_cast<unsigned char>(c) & 0x3Fu);
  constexpr std::uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool is_surrogate = point >= 0xD800 && point < 0xE000;
  return point < kLeast[length] || is_surrogate || point > 0x10FFFF ? 0 : length;
}

bool is_control(std::string_view letter) {
  const auto first = static_cast<unsigned char>(letter[0]);
  return first < 0x20 || first == 0x7F ||
         (first == 0xC2 && static_cast<unsigned char>(letter[1]) < 0xA0);  // U+0080 to U+009F
}

}  // namespace

std::string printable_utf8(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t length = first_length(text);
    const std::string_view letter = text.substr(0, std::max<std::size_t>(length, 1));
    result += length == 0 || is_control(letter) ? kReplacement : letter;
    text.remove_prefix(letter.size());
  }
  return result;
}

std::size_t count_letters(std::string_view text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return !continues(c); }));
}

std::string letters_of(std::string_view text, std::size_t begin, std::size_t count) {
  std::string result;
  std::size_t letter = 0;
  for (const char c : text) {
    if (!continues(c)) ++letter;
    if (letter > begin && letter <= begin + count) result += c;
  }
  return result;
}

}  // namespace isowave::core
