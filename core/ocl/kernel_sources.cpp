#include "core/ocl/kernel_sources.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace isowave::core::ocl {

namespace {

/// "portable/" of "portable/cubic.h"; empty for a file at the top.
std::string_view folder_of(std::string_view name) {
  return name.substr(0, name.find_last_of('/') + 1);
}

/// The file that a line `#include "x.h"` names; empty for any other line.
std::string_view included_by(std::string_view line) {
  constexpr std::string_view kBegin = "#include \"";
  if (!line.starts_with(kBegin)) return {};
  line.remove_prefix(kBegin.size());
  return line.substr(0, std::min(line.find('"'), line.size()));
}

class Joiner {
 public:
  explicit Joiner(std::span<const KernelFile> files) : files_(files), is_joined_(files.size()) {}

  void add(std::size_t i) {
    is_joined_[i] = true;
    const auto [name, text] = files_[i];
    result_ += fmt::format("#line 1 \"{}\"\n", name);
    std::size_t line_number = 0;
    for (std::size_t begin = 0; begin <= text.size();) {
      const std::size_t end = std::min(text.find('\n', begin), text.size());
      const std::string_view line = text.substr(begin, end - begin);
      begin = end + 1;
      ++line_number;
      const std::string_view header = included_by(line);
      if (header.empty()) {
        result_ += line;
        result_ += '\n';
        continue;
      }
      const std::size_t of_header = find(header, name);
      if (!is_joined_[of_header]) add(of_header);
      result_ += fmt::format("#line {} \"{}\"\n", line_number + 1, name);
    }
  }

  std::string take() { return std::move(result_); }

 private:
  std::size_t find(std::string_view header, std::string_view includer) const {
    const std::string beside = std::string(folder_of(includer)) + std::string(header);
    for (const std::string_view name : {std::string_view(beside), header}) {
      const auto found = std::ranges::find(files_, name, &KernelFile::name);
      if (found != files_.end()) return static_cast<std::size_t>(found - files_.begin());
    }
    throw std::invalid_argument(fmt::format("{}: there is no header '{}'", includer, header));
  }

  std::span<const KernelFile> files_;
  std::vector<bool> is_joined_;
  std::string result_;
};

}  // namespace

std::string join_kernel_file(std::span<const KernelFile> files, std::size_t i) {
  Joiner joiner(files);
  joiner.add(i);
  return joiner.take();
}

std::string kernel_text(std::string_view stem) {
  const std::span<const KernelFile> files = kernel_files();
  const std::string wanted = std::string(stem) + ".cl";
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (files[i].name.substr(folder_of(files[i].name).size()) == wanted)
      return join_kernel_file(files, i);
  }
  throw std::invalid_argument(fmt::format("no kernel file '{}' is part of this program", wanted));
}

}  // namespace isowave::core::ocl
