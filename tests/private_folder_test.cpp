// core/platform/private_folder: what another user can have written to is found, by every way that
// leads there.

#include "core/platform/private_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

namespace fs = std::filesystem;
using platform::check_private;
using platform::make_private;
using test::TemporaryFolder;
using test::write_file;
using testing::HasSubstr;

constexpr uid_t kAnotherUser = 65534;
constexpr mode_t kSticky = 01777;  ///< as /tmp

fs::path make_folder(const fs::path &path, mode_t mode = 0755) {
  fs::create_directory(path);
  EXPECT_EQ(::chmod(path.c_str(), mode), 0);
  return path;
}

void give_away(const fs::path &path) {
  ASSERT_EQ(::lchown(path.c_str(), kAnotherUser, kAnotherUser), 0);
}

std::string danger_of(const fs::path &path) {
  return check_private(path).danger;
}

TEST(PrivateFolder, OwnFoldersAndMissingOnes) {
  const TemporaryFolder folder;
  const fs::path own = make_folder(folder / "own");
  fs::create_symlink("own", folder / "link");
  for (const char *name : {"own", "own/", "link", "./own/../own", "link/../own"}) {
    EXPECT_EQ(danger_of(folder / name), "") << name;
    EXPECT_EQ(check_private(folder / name).path, own) << name;
  }
  EXPECT_EQ(danger_of(own / "a" / "b"), "");
  EXPECT_EQ(check_private(own / "a" / "b").path, own / "a" / "b");
  EXPECT_FALSE(fs::exists(own / "a")) << "others cannot make it";
  EXPECT_THAT(danger_of(own / "a" / ".." / ".." / "b"), HasSubstr("is missing"));
  write_file(own / "file", std::string_view(""));
  fs::create_symlink("circle", own / "circle");
  EXPECT_EQ(danger_of(own / "file" / "a"), "") << "no user can write there";
  EXPECT_EQ(danger_of(own / "circle"), "");
}

TEST(PrivateFolder, OthersMayWriteNowhereOnTheWay) {
  const TemporaryFolder folder;
  const fs::path open = make_folder(folder / "open", 0777), in_open = make_folder(open / "in");
  fs::create_symlink("open/in", folder / "link");
  for (const mode_t mode : {0777u, 0775u, 0757u, 01777u}) {
    ASSERT_EQ(::chmod(open.c_str(), mode), 0);
    EXPECT_EQ(danger_of(open), "other users can write to " + open.string());
    if (mode == kSticky) continue;
    for (const fs::path &path : {in_open, folder / "link", open / "missing"})
      EXPECT_EQ(danger_of(path), "other users can write to " + open.string()) << path;
  }
  EXPECT_EQ(danger_of(in_open), "") << "of a sticky folder, others can take nothing";
  EXPECT_EQ(danger_of(folder / "link"), "");
  EXPECT_EQ(danger_of(open / "new" / "newer"), "");
  struct stat status {};
  ASSERT_EQ(::stat((open / "new").c_str(), &status), 0) << "else another user makes it";
  EXPECT_EQ(status.st_mode & 0777u, 0700u);
}

TEST(PrivateFolder, NothingOnTheWayIsAnothers) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give files away";
  const TemporaryFolder folder;
  const fs::path open = make_folder(folder / "open", kSticky);
  const fs::path own = make_folder(open / "own"), other = make_folder(open / "other");
  make_folder(other / "own");
  give_away(other);
  fs::create_symlink("own", open / "link");
  fs::create_symlink("own", open / "planted");
  fs::create_symlink("none", open / "dangling");
  fs::create_symlink("other/own", open / "to_other");
  for (const char *name : {"planted", "dangling"}) give_away(open / name);
  EXPECT_EQ(danger_of(open / "link"), "");
  for (const char *name : {"planted", "dangling", "other"})
    EXPECT_EQ(danger_of(open / name), (open / name).string() + " belongs to another user");
  for (const char *name : {"to_other", "other/own", "other/own/..", "other/new"})
    EXPECT_EQ(danger_of(open / name), other.string() + " belongs to another user") << name;
  EXPECT_EQ(danger_of(open / "planted" / "new"),
            (open / "planted").string() + " belongs to another user");
  EXPECT_FALSE(fs::exists(open / "none"));
}

TEST(PrivateFolder, NorIsAnythingInIt) {
  const TemporaryFolder folder;
  const fs::path own = make_folder(folder / "own"),
                 deep = make_folder(make_folder(own / "a") / "b");
  write_file(deep / "f.so", std::string_view("code"));
  EXPECT_EQ(danger_of(own), "");
  for (const fs::path &path : {deep / "f.so", deep, own / "a"}) {
    ASSERT_EQ(::chmod(path.c_str(), 0777), 0);
    EXPECT_EQ(danger_of(own), "other users can write to " + path.string());
    ASSERT_EQ(::chmod(own.c_str(), 0700), 0);
    EXPECT_EQ(danger_of(own), "") << "they cannot come there";
    ASSERT_EQ(::chmod(own.c_str(), 0755), 0);
    ASSERT_EQ(::chmod(path.c_str(), 0755), 0);
    if (::geteuid() != 0) continue;
    give_away(path);
    EXPECT_EQ(danger_of(own), path.string() + " belongs to another user");
    ASSERT_EQ(::chown(path.c_str(), 0, 0), 0);
  }
  fs::create_symlink("f.so", deep / "g.so");
  EXPECT_EQ(danger_of(own), (deep / "g.so").string() + " is a symbolic link");
}

TEST(PrivateFolder, IsMadeUnderAnotherNameIfTheNameIsTaken) {
  const TemporaryFolder folder;
  const fs::path open = make_folder(folder / "open", kSticky), first = make_private(open, "k");
  EXPECT_EQ(first, open / "k");
  EXPECT_EQ(make_private(open, "k"), first);
  ASSERT_EQ(::chmod(first.c_str(), 0777), 0);
  const fs::path second = make_private(open, "k");
  EXPECT_TRUE(second.string().starts_with(first.string() + ".")) << second;
  EXPECT_EQ(danger_of(second), "");
  EXPECT_EQ(make_private(open, "k"), second) << "or each run would leave one";
  ASSERT_EQ(::chmod(open.c_str(), 0777), 0);
  EXPECT_EQ(make_private(open, "l"), "");
  EXPECT_EQ(make_private(folder / "none", "l"), "");
  EXPECT_EQ(std::distance(fs::directory_iterator(open), {}), 2);
}

}  // namespace
}  // namespace isowave::core
