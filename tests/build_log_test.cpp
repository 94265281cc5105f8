// Logs of compilers that ignore #line.

#include "core/ocl/build_log.hpp"

#include <gtest/gtest.h>

namespace isowave::core {
namespace {

using ocl::first_error;
using ocl::with_file_names;

constexpr std::string_view kText =
    "#line 1 \"a.cl\"\n"
    "first of a\n"
    "#line 1 \"portable/b.h\"\n"
    "first of b\n"
    "second of b\n"
    "#line 3 \"a.cl\"\n"
    "third of a\n";

TEST(BuildLog, NamesFileAndLineOfTheJoinedText) {
  EXPECT_EQ(
      with_file_names("<kernel>:2:8: error: x\n<kernel>:5:1: error: y\ninput.cl:7:4: z", kText),
      "a.cl:1:8: error: x\nportable/b.h:2:1: error: y\na.cl:3:4: z");
}

TEST(BuildLog, LeavesAloneWhatItDoesNotKnow) {
  for (const char *log : {"", "a.cl:2:8: error", "<kernel>:0:1: x", "<kernel>:8:1: x",
                          "<kernel>:4000000000:1: x", "<kernel>", "<built-in>:1:24: note"})
    EXPECT_EQ(with_file_names(log, kText), log);
}

TEST(BuildLog, FirstErrorIsTheLineThatSaysSo) {
  EXPECT_EQ(first_error("warning: a\nb.h:2: error: c\nerror: d"), "b.h:2: error: c");
  EXPECT_EQ(first_error("it failed\nsomehow"), "it failed");
  EXPECT_EQ(first_error(""), "the compiler left no log");
}

}  // namespace
}  // namespace isowave::core
