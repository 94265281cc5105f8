#pragma once
// Output files that appear whole or not at all.

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <span>
#include <string_view>

namespace isowave::core {

/// What the name leads to: a file, or the name at which writing through symbolic links would make
/// one.
///
/// Throws  Error: links go in circles
std::filesystem::path follow_links(const std::filesystem::path &path);

/// Gives a new file the mode of the file that it will replace, and its owner, group and access list
/// as far as this user may. Does nothing if there is no such file.
void keep_permissions(const std::filesystem::path &replaced, int file);

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
  void write(std::string_view text) { write(std::as_bytes(std::span(text))); }
  /// For libraries that want a C stream (libpng); errors set on it are found by commit().
  std::FILE *stream() { return file_; }

  /// Hands over all that was written, piece by piece. Nothing may follow.
  void read_back(const std::function<void(std::span<const std::byte>)> &take);

  /// Flushes, closes and renames. Call once, nothing may follow.
  ///
  /// Throws  Error if any write failed
  void commit();

  const std::filesystem::path &target() const { return target_; }

 private:
  void choose_temporary_name();
  /// Returns the descriptor, or -1 and errno.
  int open_temporary();

  std::filesystem::path target_, temporary_;
  std::FILE *file_ = nullptr;
  bool nameless_ =
      false;  ///< the file has no name yet; temporary_ is the one that commit() will give it
};

}  // namespace isowave::core
