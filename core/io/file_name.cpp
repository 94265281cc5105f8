#include "core/io/file_name.hpp"

#include <algorithm>

#include "core/base/error.hpp"
#include "core/base/text.hpp"

namespace isowave::core {

void check_ending(const std::filesystem::path &name, std::string_view content,
                  std::initializer_list<std::string_view> endings) {
  const std::string ending = lower_case(name.extension().string());
  if (ending.empty() || std::ranges::find(endings, ending) != endings.end()) return;
  throw Error("{}: {}: end the name in {}", name.string(), content, *endings.begin());
}

void check_png_name(const std::filesystem::path &name) {
  check_ending(name, "pictures are written as PNG", {".png"});
}

void check_npy_name(const std::filesystem::path &name) {
  check_ending(name, "float32 values are written as a numpy array", {".npy"});
}

void check_json_name(const std::filesystem::path &name) {
  check_ending(name, "results are written as JSON", {".json", ".txt", ".log"});
}

}  // namespace isowave::core
