#pragma once
// A file that processes write together, each at its place, and what a process knows of its
// sections.

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/zfp/zfp_file.hpp"

namespace isowave::core {

/// A file that all processes of a team write.
class SharedFile {
 public:
  /// Without commit(), nothing is left behind.
  virtual ~SharedFile() = default;
  /// Throws  Error: disk full and such
  virtual void write(std::uint64_t offset, std::span<const std::byte> bytes) = 0;
  /// All processes: gives the file its name.
  ///
  /// Throws  Error at all of them
  virtual void commit() = 0;
};

/// Consecutive bytes of a file, and their checksum.
struct FileSection {
  std::uint64_t bytes = 0;
  std::uint32_t crc = 0;

  void add(std::span<const std::byte> more) {
    crc = update_crc(crc, more);
    bytes += more.size();
  }
  void add(const FileSection &behind) {
    crc = combine_crcs(crc, behind.crc, behind.bytes);
    bytes += behind.bytes;
  }
};

/// Writes one section of a shared file.
class SectionWriter {
 public:
  SectionWriter(SharedFile &file, std::uint64_t begin) : file_(file), begin_(begin) {}
  void write(std::span<const std::byte> bytes) {
    if (bytes.empty()) return;
    file_.write(begin_ + section_.bytes, bytes);
    section_.add(bytes);
  }
  const FileSection &section() const { return section_; }

 private:
  SharedFile &file_;
  std::uint64_t begin_;
  FileSection section_;
};

}  // namespace isowave::core
