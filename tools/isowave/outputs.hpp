#pragma once
// Files that a command reads and writes, looked at before any work: whether the outputs can be
// written, and that none takes the place of an input or of another output.

#include <filesystem>
#include <map>
#include <set>
#include <string>

namespace isowave::core::tools {

class Outputs {
 public:
  /// A file that is read. Ignored if there is none (yet).
  void read(const std::filesystem::path &path);
  /// The volume and, if its header names them, the files of its voxels. generate:... is no file.
  void read_volume(const std::string &path);

  /// A file that will be written, as `option` says; empty: none. Throws Error if it cannot be
  /// written, or is a file that read() or write() was called with: by any name, also through
  /// symbolic and hard links.
  void write(const std::string &option, const std::filesystem::path &path);
  /// Announces a folder that may be missing; make_folder() then makes it. Throws Error if that
  /// cannot be, or the folder cannot be filled. Returns whether it is missing.
  bool write_folder(const std::string &option, const std::filesystem::path &folder);
  /// Announces a folder for files PREFIX*.png whose number is not known yet; make_folder() makes
  /// the folder if it is missing. Call it after all read() and write(): throws Error also if one of
  /// their files has such a name.
  void write_pictures(const std::string &option, const std::filesystem::path &folder,
                      const std::string &prefix);
  /// Has the program's OutputGroup make it.
  void make_folder() const;

 private:
  std::map<std::string, std::string>
      users_;  ///< key of a file -> who uses it: "the input NAME", "--depth"
  std::set<std::filesystem::path>
      probed_;                        ///< folders that were written to, to see whether it works
  std::filesystem::path new_folder_;  ///< to be made
};

}  // namespace isowave::core::tools
