// Files that are read: what may be opened, and what becomes shorter meanwhile.

#include "core/io/input_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "core/base/error.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(InputFile, MissingShortAndTruncatedFilesAreOneLine) {
  const test::TemporaryFolder folder;
  EXPECT_THAT([&] { InputFile{folder / "none"}; },
              ThrowsMessage<Error>(HasSubstr("none: no such file")));
  EXPECT_THAT([&] { InputFile{folder.path()}; },
              ThrowsMessage<Error>(HasSubstr("not a regular file")));
  test::write_file(folder / "a", std::string(10'000, 'a'));
  const InputFile file(folder / "a");
  EXPECT_EQ(file.size(), 10'000u);
  std::vector<std::byte> all(10'000);
  file.read(0, all);
  EXPECT_EQ(std::ranges::count(all, std::byte{'a'}), 10'000);
  EXPECT_THAT([&] { file.read(1, all); }, ThrowsMessage<Error>(HasSubstr("truncated")));
  std::filesystem::resize_file(folder / "a", 9'999);
  EXPECT_NO_THROW(file.read(0, std::span(all).first(9'999)));
  EXPECT_THAT([&] { file.read(0, all); },
              ThrowsMessage<Error>(HasSubstr("10000 bytes were there, now 9999")));
  std::filesystem::resize_file(folder / "a", 100);
  EXPECT_THAT([&] { file.read(5'000, std::span(all).first(1)); },
              ThrowsMessage<Error>(HasSubstr("10000 bytes were there, now 100")));
  std::filesystem::resize_file(folder / "a", 9'999);
  EXPECT_NO_THROW(file.read(0, std::span(all).first(100)));
  test::write_file(folder / "b", std::string(10'000, 'b'));
  std::filesystem::rename(folder / "b", folder / "a");  // the name of another file now
  file.read(0, std::span(all).first(9'999));
  EXPECT_EQ(all[0], std::byte{'a'});
}

}  // namespace
}  // namespace isowave::core
