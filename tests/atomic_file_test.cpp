#include "core/io/atomic_file.hpp"

#include <gtest/gtest.h>

#include "core/base/error.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::read_file;
using test::TemporaryFolder;
using test::write_file;

TEST(AtomicFile, AppearsWithCommit) {
  const TemporaryFolder folder;
  write_file(folder / "a", std::string_view("old"));
  {
    AtomicFile file(folder / "a");
    file.write("ne");
    std::fputs("w", file.stream());
    EXPECT_EQ(read_file(folder / "a"), "old");
    file.commit();
    EXPECT_EQ(read_file(folder / "a"), "new");
  }
  EXPECT_EQ(read_file(folder / "a"), "new");
  EXPECT_EQ(folder.num_files(), 1u);
}

TEST(AtomicFile, LeavesNothingWithoutCommit) {
  const TemporaryFolder folder;
  {
    AtomicFile file(folder / "a");
    file.write("text");
  }
  EXPECT_EQ(folder.num_files(), 0u);
}

TEST(AtomicFile, RelativeNamesAndLinks) {
  const TemporaryFolder folder;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  AtomicFile relative("a");
  relative.write("1");
  relative.commit();
  std::filesystem::current_path(before);
  EXPECT_EQ(read_file(folder / "a"), "1");

  std::filesystem::create_symlink("a", folder / "link");
  AtomicFile through_link(folder / "link");
  through_link.write("2");
  through_link.commit();
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  EXPECT_EQ(read_file(folder / "a"), "2");
}

TEST(AtomicFile, LongNamesAndDanglingLinks) {
  const TemporaryFolder folder;
  const std::string longest(255, 'n');
  AtomicFile file(folder / longest);
  file.write("1");
  file.commit();
  EXPECT_EQ(read_file(folder / longest), "1");
  EXPECT_THROW(AtomicFile(folder / (longest + "n")), Error);

  std::filesystem::create_symlink("b", folder / "link");
  AtomicFile through_link(folder / "link");
  through_link.write("2");
  through_link.commit();
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  EXPECT_EQ(read_file(folder / "b"), "2");
  std::filesystem::create_symlink("circle", folder / "circle");
  EXPECT_THROW(AtomicFile(folder / "circle"), Error);
}

TEST(AtomicFile, RefusesTargetsItCannotReplace) {
  const TemporaryFolder folder;
  EXPECT_THROW(AtomicFile(folder / "missing" / "a"), Error);
  EXPECT_THROW(AtomicFile(folder.path()), Error);
  EXPECT_THROW(AtomicFile(folder.path().string() + "/"), Error);
  EXPECT_THROW(AtomicFile("/dev/null"), Error);
  EXPECT_THROW(AtomicFile(""), Error);
}

}  // namespace
}  // namespace isowave::core
