#pragma once
// Folders that hold code which this process will run: only this user may be able to write there.

#include <filesystem>
#include <string>

namespace isowave::core::platform {

struct FolderCheck {
  std::filesystem::path path;  ///< the folder: absolute, without symbolic links
  std::string danger;  ///< who else can write there, "other users can write to /x"; or empty
};

/// Looks whether other users can have put files into a folder, or can do so from now on. Root is
/// trusted.
///
/// Each folder and each symbolic link on the way must belong to this user or root. Other users must
/// not be able to write to any of these folders, except if it is sticky (/tmp) and what the path
/// takes from it belongs to this user or root. All files in the folder must be this user's or
/// root's, and closed to others. A folder that is missing below such a sticky one is made, with
/// mode 0700: otherwise another user could make it after the check. A missing folder elsewhere is
/// not made.
///
/// A path without danger stays so: only this user and root can change what it leads to.
FolderCheck check_private(const std::filesystem::path &folder);

/// Makes `name` in `parent` with mode 0700, or takes it if it is there. If another user took that
/// name, takes or makes a folder `name.SUFFIX`.
///
/// Returns  its path, or an empty one if `parent` allows no private folder
std::filesystem::path make_private(const std::filesystem::path &parent, const std::string &name);

}  // namespace isowave::core::platform
