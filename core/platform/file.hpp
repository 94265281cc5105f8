#pragma once
// Open files, read at any position; files for what is needed for a while.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string_view>
#include <system_error>

namespace isowave::core::platform {

/// An open file; closed when this is destroyed.
class File {
 public:
  /// Opens a file for reading. A pipe does not wait for a program that writes to it.
  static File open(const std::filesystem::path &path, std::error_code &failure);
  /// Makes a file without a name in the folder for temporary files, for reading and writing. The
  /// system removes it when the process ends, whatever ends it.
  static File make_temporary(std::error_code &failure);

  File() = default;
  ~File();
  File(File &&other) noexcept;
  File &operator=(File &&other) noexcept;
  File(const File &) = delete;
  File &operator=(const File &) = delete;

  bool is_regular() const;
  std::uint64_t size() const;
  /// Reads the bytes from `offset` on. Thread-safe.
  ///
  /// Returns  how many there are: fewer than asked for at the file's end, or if it fails
  std::size_t read(std::uint64_t offset, std::span<std::byte> out, std::error_code &failure) const;
  void append(std::span<const std::byte> bytes, std::error_code &failure);

 private:
  explicit File(std::intptr_t handle) : handle_(handle) {}

  std::intptr_t handle_ = -1;  ///< -1: none
};

/// Opens a file for reading as a stream; nullptr if it cannot.
std::FILE *open_stream(const std::filesystem::path &path);

/// Makes a file of a new name in the folder for temporary files, which only this user can read.
///
/// begin    of its name
/// Returns  its path; an empty one if it cannot be made or written
std::filesystem::path keep_in_temporary_folder(std::string_view begin, std::string_view text);

}  // namespace isowave::core::platform
