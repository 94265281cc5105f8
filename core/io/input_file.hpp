#pragma once
// Files that are read. They are not mapped into memory: touching a page of a file that somebody
// else has made shorter would end the process.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "core/platform/file.hpp"

namespace isowave::core {

/// A regular file, open for reading. Pipes and devices are refused: reading a pipe would wait for
/// its writer, and a device may never end.
class InputFile {
 public:
  /// what    how messages name the file
  /// Throws  Error: there is none, it cannot be opened, or it is not a regular file
  InputFile(const std::filesystem::path &path, std::string what);
  explicit InputFile(const std::filesystem::path &path) : InputFile(path, path.string()) {}

  const std::filesystem::path &path() const { return path_; }
  const std::string &what() const { return what_; }
  /// In bytes, when the file was opened: what is appended to it later is not read.
  std::uint64_t size() const { return size_; }
  /// Reads all of `out` from byte `offset` on. Thread-safe. Who writes into the file meanwhile
  /// changes what is read; who replaces it by another of its name does not.
  ///
  /// Throws  Error: the file has become too short for that, or cannot be read
  void read(std::uint64_t offset, std::span<std::byte> out) const;

 private:
  std::filesystem::path path_;
  std::string what_;
  std::uint64_t size_ = 0;
  platform::File file_;
};

/// Throws  Error where InputFile(path) does
void check_input_file(const std::filesystem::path &path);

}  // namespace isowave::core
