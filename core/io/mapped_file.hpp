#pragma once
// A file as read-only memory: the system reads the pages that are touched, and drops them when memory is short.

#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

namespace isowave {

class MappedFile {
 public:
  /// Maps the first `size` bytes, at least 1. Throws Error in one line when the file cannot be opened or is shorter.
  MappedFile(const std::filesystem::path &path, std::uint64_t size);

  std::span<const std::byte> bytes() const {
    return {static_cast<const std::byte *>(region_.get_address()), region_.get_size()};
  }
  /// To be called before bytes are read: throws Error when the file has become shorter since. Reading past its end would end
  /// the process.
  void check() const { check_size(region_.get_size()); }

 private:
  void check_size(std::uint64_t size) const;

  std::filesystem::path path_;
  boost::interprocess::file_mapping mapping_;
  boost::interprocess::mapped_region region_;
};

}  // namespace isowave
