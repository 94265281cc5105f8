#include "core/base/error.hpp"

#include <gtest/gtest.h>

namespace isowave::core {
namespace {

TEST(Error, IsOneLine) {
  EXPECT_STREQ(Error("{}: {}", "a\nb", "c\r").what(), R"(a\nb: c\x0d)");
  EXPECT_STREQ(BuildError("a\n", "b\nc").what(), R"(a\n)");
  EXPECT_EQ(BuildError("a", "b\nc").log(), "b\nc");
}

TEST(Error, OneLineKeepsTextAndEscapesTheRest) {
  EXPECT_EQ(one_line("plain, \\ and 'quoted'"), "plain, \\ and 'quoted'");
  EXPECT_EQ(one_line("\u00e4\u20ac\U0001F600"), "\u00e4\u20ac\U0001F600");
  EXPECT_EQ(one_line("\t\x1b[2J\x7f"), R"(\t\x1b[2J\x7f)");
  EXPECT_EQ(one_line("\u0085\u2028\u2029"), R"(\xc2\x85\xe2\x80\xa8\xe2\x80\xa9)");
  EXPECT_EQ(one_line("\xff\xc3"), R"(\xff\xc3)") << "no UTF-8, or cut short";
  EXPECT_EQ(one_line("\xc0\x8a\xed\xa0\x80\xf4\x90\x80\x80"),
            R"(\xc0\x8a\xed\xa0\x80\xf4\x90\x80\x80)")
      << "too long a form of a newline, half of a pair, beyond the last";
  EXPECT_EQ(one_line(std::string_view("a\0b", 3)), R"(a\x00b)");
}

}  // namespace
}  // namespace isowave::core
