#pragma once
// Texts in UTF-8 for people: of names that may be any bytes.

#include <cstddef>
#include <string>
#include <string_view>

namespace isowave::core {

/// The text with U+FFFD for each byte that is no UTF-8, and for each control character.
std::string printable_utf8(std::string_view text);

/// The number of code points of valid UTF-8.
std::size_t count_letters(std::string_view text);
/// `count` code points of valid UTF-8, from code point `begin` on.
std::string letters_of(std::string_view text, std::size_t begin, std::size_t count);

}  // namespace isowave::core
