#pragma once
// A file whose parts are read when they are asked for. It is not mapped into memory: touching a page of a file that somebody else has
// made shorter would end the process.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

namespace isowave {

class FileBytes {
 public:
  /// Throws Error in one line: it cannot be opened, or is no regular file.
  explicit FileBytes(const std::filesystem::path &path);
  ~FileBytes();
  FileBytes(const FileBytes &) = delete;
  FileBytes &operator=(const FileBytes &) = delete;

  /// When it was opened [bytes].
  std::uint64_t size() const { return size_; }
  /// Reads all of `out` from byte `offset` on. Thread-safe. Throws Error: it ends too early, since it has become shorter, or cannot be
  /// read. Who writes to the file meanwhile changes what is read; who replaces it by another of its name does not.
  void read(std::uint64_t offset, std::span<std::byte> out) const;

 private:
  std::filesystem::path path_;
  int descriptor_;
  std::uint64_t size_ = 0;
};

}  // namespace isowave
