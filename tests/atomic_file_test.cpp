#include "core/io/atomic_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

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

void write_and_commit(const std::filesystem::path &path, std::string_view text) {
  AtomicFile file(path);
  file.write(text);
  file.commit();
}

TEST(OutputGroup, FilesAppearTogether) {
  const TemporaryFolder folder;
  write_file(folder / "a", std::string_view("old"));
  {
    OutputGroup group;
    write_and_commit(folder / "a", "new");
    write_and_commit(folder / "b", "2");
    EXPECT_EQ(group.bytes_of(folder / "a"), 3u);
    EXPECT_EQ(group.bytes_of(folder / "b"), 1u);
    EXPECT_EQ(read_file(folder / "a"), "old");
    EXPECT_EQ(folder.num_files(), 1u);
    group.commit();
    EXPECT_EQ(group.bytes_of(folder / "a"), 3u);
  }
  EXPECT_EQ(read_file(folder / "a"), "new");
  EXPECT_EQ(read_file(folder / "b"), "2");
  EXPECT_EQ(folder.num_files(), 2u);
  write_and_commit(folder / "c", "3");
  EXPECT_EQ(folder.num_files(), 3u) << "without a group, at once";
}

TEST(OutputGroup, LeavesNothingWithoutCommit) {
  const TemporaryFolder folder;
  {
    OutputGroup group;
    group.make_folder(folder / "new" / "er");
    write_and_commit(folder / "new" / "er" / "a", "1");
    write_and_commit(folder / "b", "2");
    EXPECT_EQ(folder.num_files(), 0u);
  }
  EXPECT_EQ(folder.num_files(), 0u);
}

TEST(OutputGroup, MakesFoldersLast) {
  const TemporaryFolder folder;
  OutputGroup group;
  group.make_folder(folder / "new" / "er");
  write_and_commit(folder / "new" / "er" / "a", "1");
  write_and_commit(folder / "b", "2");
  EXPECT_EQ(folder.num_files(), 0u);
  group.commit();
  EXPECT_EQ(read_file(folder / "new" / "er" / "a"), "1");
  EXPECT_EQ(folder.num_files(), 2u);
}

/// The third of three cannot take its place, since a folder has come there.
TEST(OutputGroup, PutsBackWhatItHasReplaced) {
  const TemporaryFolder folder;
  write_file(folder / "a", std::string_view("old"));
  {
    OutputGroup group;
    for (const char *name : {"a", "b", "c", "d"}) write_and_commit(folder / name, "new");
    std::filesystem::create_directory(folder / "c");
    EXPECT_THROW(group.commit(), Error);
    EXPECT_EQ(read_file(folder / "a"), "old");
  }
  EXPECT_EQ(read_file(folder / "a"), "old");
  EXPECT_EQ(folder.num_files(), 2u);
}

/// Files keep their descriptors for as long as there are some.
TEST(OutputGroup, FewDescriptorsAreEnough) {
  const TemporaryFolder folder;
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  OutputGroup group;
  rlimit few{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &few), 0);
  few.rlim_cur = 128;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &few), 0);
  for (int i = 0; i < 300; ++i) write_and_commit(folder / std::to_string(i), "1");
  group.commit();
  EXPECT_EQ(folder.num_files(), 300u);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
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
