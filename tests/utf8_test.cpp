#include "core/base/utf8.hpp"

#include <gtest/gtest.h>

namespace isowave::core {
namespace {

constexpr const char *kBad = "\xEF\xBF\xBD";

TEST(Utf8, PrintableTextsStayAsTheyAre) {
  for (const char *text :
       {"", "head.nrrd", "Größe \xE2\x82\xAC", "\xF0\x9F\x98\x80", "\xEF\xBF\xBF"})
    EXPECT_EQ(printable_utf8(text), text);
}

TEST(Utf8, WhatIsNoneIsReplaced) {
  for (const char *text : {"\n", "\x1B", "\x7F", "\x80", "\xC3", "\xFF", "\xC2\x85"})
    EXPECT_EQ(printable_utf8(std::string("a") + text + "b"), std::string("a") + kBad + "b") << text;
  // A longer form of '/', half of a surrogate pair, above U+10FFFF, cut: each byte is replaced.
  EXPECT_EQ(printable_utf8("\xC0\xAF"), std::string(kBad) + kBad);
  EXPECT_EQ(printable_utf8("\xED\xA0\x80"), std::string(kBad) + kBad + kBad);
  EXPECT_EQ(printable_utf8("\xF4\x90\x80\x80"), std::string(kBad) + kBad + kBad + kBad);
  EXPECT_EQ(printable_utf8("\xE2\x82"), std::string(kBad) + kBad);
  EXPECT_EQ(printable_utf8(std::string_view("a\0b", 3)), std::string("a") + kBad + "b");
}

TEST(Utf8, LettersAreCodePoints) {
  const std::string text = "aß€\xF0\x9F\x98\x80z";
  EXPECT_EQ(count_letters(text), 5u);
  EXPECT_EQ(letters_of(text, 0, 2), "aß");
  EXPECT_EQ(letters_of(text, 2, 2), "€\xF0\x9F\x98\x80");
  EXPECT_EQ(letters_of(text, 4, 9), "z");
  EXPECT_EQ(letters_of(text, 1, 0), "");
}

}  // namespace
}  // namespace isowave::core
