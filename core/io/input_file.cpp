#include "core/io/input_file.hpp"

#include <system_error>

#include "core/error.hpp"

namespace isowave {

void check_input_file(const std::filesystem::path &path) {
  std::error_code failure;
  const std::filesystem::file_status status = std::filesystem::status(path, failure);
  if (status.type() == std::filesystem::file_type::not_found) throw Error("{}: no such file", path.string());
  if (failure) throw Error("{}: cannot open: {}", path.string(), failure.message());
  if (!std::filesystem::is_regular_file(status)) throw Error("{}: not a regular file", path.string());
}

}  // namespace isowave
