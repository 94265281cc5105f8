// Raw volumes, gzipped or not. Input: how to pack what follows ('g': gzip; others: as it is), the
// file's name without its folder, which says dims and type, a newline, and the file's bytes.

#include <algorithm>
#include <string>

#include "tests/fuzz/fuzz_target.hpp"

using namespace isowave::core;

namespace {

constexpr std::size_t kMaxName = 100;

/// A name that a file in our folder can have.
std::string file_name(std::string_view text) {
  std::string name(text.substr(0, kMaxName));
  std::replace_if(
      name.begin(), name.end(),
      [](char c) { return c == '/' || (c >= 0 && c < ' ') || c == '\x7f'; }, '_');
  return name.ends_with(".raw") ? name : name + ".raw.gz";
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  const std::string_view input = fuzz::text_of(data, size);
  const std::size_t end = input.find('\n');
  if (input.empty() || end == input.npos) return -1;
  const std::filesystem::path path = fuzz::put(file_name(input.substr(1, end - 1)),
                                               fuzz::pack_by(input[0], input.substr(end + 1)));
  fuzz::read_volume(path);
  std::filesystem::remove(path);
  return 0;
}
