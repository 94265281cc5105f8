#include "core/io/mapped_file.hpp"

#include <sys/stat.h>

#include <boost/interprocess/exceptions.hpp>

#include "core/error.hpp"

namespace isowave {

namespace ipc = boost::interprocess;

MappedFile::MappedFile(const std::filesystem::path &path, std::uint64_t size) : path_(path) {
  try {
    ipc::file_mapping(path.c_str(), ipc::read_only).swap(mapping_);
    check_size(size);
    ipc::mapped_region(mapping_, ipc::read_only, 0, size).swap(region_);
  } catch (const ipc::interprocess_exception &error) {
    throw Error("{}: cannot map into memory: {}", path.string(), error.what());
  }
}

void MappedFile::check_size(std::uint64_t size) const {
  // Of the file that was opened, not of what has its name now.
  struct stat status {};
  if (::fstat(mapping_.get_mapping_handle().handle, &status) != 0 || std::uint64_t(status.st_size) < size) {
    throw Error("{}: truncated while it was in use: {} bytes were there, now {}", path_.string(), size,
                status.st_size);
  }
}

}  // namespace isowave
