#pragma once
// Output files that appear whole or not at all.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

namespace isowave::core {

/// The place that the name leads to: a file, or the name at which writing through symbolic links
/// would make one.
///
/// Throws  Error: links go in circles
std::filesystem::path follow_links(const std::filesystem::path &path);

/// Writes to a temporary file beside the target; commit() renames it over the target. Destroyed
/// without commit(), it removes what it wrote. A target that exists stays as it was until commit();
/// its mode is kept, and a symbolic link stays one. Where the system has files without a name
/// (Linux, most file systems), not even a killed program leaves anything behind. Every failure
/// throws Error in one line with the target's name and the system's reason.
class AtomicFile {
 public:
  /// Opens the temporary file.
  ///
  /// Throws  Error: folder missing or not writable, target not a regular file or not writable
  explicit AtomicFile(const std::filesystem::path &target);
  ~AtomicFile();
  AtomicFile(const AtomicFile &) = delete;
  AtomicFile &operator=(const AtomicFile &) = delete;

  /// Appends all bytes.
  ///
  /// Throws  Error: disk full and such
  void write(std::span<const std::byte> bytes);
  void write(std::string_view text) { write(std::as_bytes(std::span(text.data(), text.size()))); }
  /// For libraries that want a C stream (libpng); errors set on it are found by commit().
  std::FILE *stream() { return file_; }

  /// Hands over all that was written, piece by piece. Nothing may follow.
  void read_back(const std::function<void(std::span<const std::byte>)> &take);

  /// Flushes, closes and renames. While an OutputGroup lives, the group renames. Call once, nothing
  /// may follow.
  ///
  /// Throws  Error if any write failed
  void commit();

  const std::filesystem::path &target() const { return target_; }

  /// A name by which other processes can open the file before commit(). Processes of this system
  /// alone can use the name of an open file, which ends with this process.
  std::filesystem::path name_on_this_system() const;
  /// A name for processes of any system: the temporary one, which a killed process leaves behind.
  std::filesystem::path name_anywhere();

 private:
  friend class OutputGroup;
  AtomicFile(AtomicFile &&) noexcept;

  void choose_temporary_name();
  void open_temporary();
  /// Gives the file its temporary name, if it has none.
  void give_name();
  /// As give_name(), and closes the file.
  void close();
  /// Renames the file over its target. keep_old: a target that exists stays under another name.
  void replace_target(bool keep_old);
  /// Undoes replace_target(true).
  void put_back() noexcept;
  void remove_old() noexcept;

  std::filesystem::path target_, folder_, temporary_;  ///< folder_: of the temporary file
  std::filesystem::path old_;  ///< other name of the file that the target was before
  std::FILE *file_ = nullptr;
  bool nameless_ =
      false;  ///< the file has no name yet; temporary_ is the one that close() will give it
  bool in_place_ = false;
};

/// The files that a command writes: they appear together, or none does. While a group lives, every
/// AtomicFile::commit() of the process leaves the renaming to the group's commit(). Destroyed
/// without commit(), the group removes its files and folders. There is one group at a time, of one
/// thread. If the process is killed within commit(), some files may have appeared.
class OutputGroup {
 public:
  OutputGroup();
  ~OutputGroup();
  OutputGroup(const OutputGroup &) = delete;
  OutputGroup &operator=(const OutputGroup &) = delete;

  /// None, or the one that lives.
  static OutputGroup *current() { return current_group; }

  /// Bytes of a file that was committed, whether or not the group has renamed it yet.
  std::uint64_t bytes_of(const std::filesystem::path &path) const;
  /// Has commit() make a folder that is missing, and those that it is to lie in. Its files are kept
  /// in the deepest one that exists, until then.
  void make_folder(const std::filesystem::path &folder) { new_folders_.push_back(folder / ""); }
  /// Makes the folders and renames all files. If one cannot be renamed, all targets become again
  /// what they were.
  ///
  /// Throws  Error
  void commit();

 private:
  friend class AtomicFile;
  void take(AtomicFile &&file);
  /// The folder in which the files of `folder` are kept until it is made.
  std::filesystem::path place_of(const std::filesystem::path &folder) const;
  void make_folders(const std::filesystem::path &folder);

  static OutputGroup *current_group;
  std::vector<std::unique_ptr<AtomicFile>> files_;
  std::vector<std::filesystem::path> new_folders_;  ///< to be made
  std::vector<std::filesystem::path> folders_;      ///< made by commit(), outermost first
};

}  // namespace isowave::core
