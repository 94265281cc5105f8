#include "core/io/input_file.hpp"

#include <system_error>
#include <utility>

#include "core/base/error.hpp"

namespace isowave::core {

InputFile::InputFile(const std::filesystem::path &path, std::string what)
    : path_(path), what_(std::move(what)) {
  std::error_code failure;
  file_ = platform::File::open(path, failure);
  if (failure == std::errc::no_such_file_or_directory) throw Error("{}: no such file", what_);
  if (failure) throw Error("{}: cannot open: {}", what_, failure.message());
  if (!file_.is_regular()) throw Error("{}: not a regular file", what_);
  size_ = file_.size();
}

void InputFile::read(std::uint64_t offset, std::span<std::byte> out) const {
  std::error_code failure;
  const std::size_t count = file_.read(offset, out, failure);
  if (failure) throw Error("{}: cannot read: {}", what_, failure.message());
  if (count < out.size())
    throw Error("{}: truncated while it was in use: {} bytes were there, now {}", what_, size_,
                file_.size());
}

void check_input_file(const std::filesystem::path &path) {
  InputFile{path};
}

}  // namespace isowave::core
