#include "core/io/atomic_file.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

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

mode_t mode_of(const std::filesystem::path &path) {
  struct stat status {};
  EXPECT_EQ(::stat(path.c_str(), &status), 0);
  return status.st_mode & 07777;
}

TEST(AtomicFile, KeepsTheModeOfWhatItReplaces) {
  const TemporaryFolder folder;
  for (const mode_t mode : {0600u, 0640u, 0666u, 0755u, 0200u}) {
    write_file(folder / "a", std::string_view("old"));
    ASSERT_EQ(::chmod((folder / "a").c_str(), mode), 0);
    { AtomicFile dropped(folder / "a"); }
    EXPECT_EQ(mode_of(folder / "a"), mode);
    AtomicFile file(folder / "a");
    file.write("new");
    file.commit();
    EXPECT_EQ(mode_of(folder / "a"), mode);
    std::filesystem::remove(folder / "a");
  }
  const mode_t mask = ::umask(027);
  AtomicFile fresh(folder / "fresh");
  fresh.commit();
  ::umask(mask);
  EXPECT_EQ(mode_of(folder / "fresh"), 0640u) << "a new file has the mode that others have";
}

TEST(AtomicFile, KeepsTheOwnerIfItCan) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give files away";
  const TemporaryFolder folder;
  write_file(folder / "a", std::string_view("old"));
  ASSERT_EQ(::chown((folder / "a").c_str(), 65534, 65534), 0);
  ASSERT_EQ(::chmod((folder / "a").c_str(), 0640), 0);
  AtomicFile file(folder / "a");
  file.commit();
  struct stat status {};
  ASSERT_EQ(::stat((folder / "a").c_str(), &status), 0);
  EXPECT_EQ(status.st_uid, 65534u);
  EXPECT_EQ(status.st_gid, 65534u);
  EXPECT_EQ(mode_of(folder / "a"), 0640u);
}

TEST(AtomicFile, OpensNoFileThatIsThere) {
  const TemporaryFolder folder;
  write_file(folder / "victim", std::string_view("old"));
  const auto planted = [&](int id) {
    return folder.path() / fmt::format(".isowave.{}.{}.tmp", ::getpid(), id);
  };
  constexpr int kNumPlanted = 1000;  // more than the other tests make files
  for (int id = 0; id < kNumPlanted; ++id) std::filesystem::create_symlink("victim", planted(id));
  AtomicFile file(folder / "a");
  file.write("new");
  file.commit();
  EXPECT_EQ(read_file(folder / "victim"), "old");
  EXPECT_EQ(read_file(folder / "a"), "new");
  EXPECT_FALSE(std::filesystem::is_symlink(folder / "a"));
  for (int id = 0; id < kNumPlanted; ++id) EXPECT_TRUE(std::filesystem::is_symlink(planted(id)));
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
