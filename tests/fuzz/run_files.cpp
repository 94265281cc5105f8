// Gives a target each file of the named folders once: the seeds, and what was found before (there
// may be none). For compilers without libFuzzer.
//   fuzz_NAME FOLDER|FILE...

#include <cstdio>
#include <filesystem>
#include <string>

#include "tests/fuzz/fuzz_target.hpp"

std::size_t LLVMFuzzerMutate(std::uint8_t *, std::size_t size, std::size_t) {
  return size;
}

int main(int argc, char **argv) {
  namespace fs = std::filesystem;
  std::size_t num_files = 0;
  const auto run = [&num_files](const fs::path &path) {
    std::fprintf(stderr, "%s\n", path.c_str());  // the last line before a crash
    const std::string bytes = isowave::core::fuzz::bytes_of(path);
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t *>(bytes.data()), bytes.size());
    ++num_files;
  };
  for (int i = 1; i < argc; ++i) {
    if (fs::is_regular_file(argv[i])) run(argv[i]);
    if (!fs::is_directory(argv[i])) continue;
    for (const fs::directory_entry &entry : fs::directory_iterator(argv[i])) run(entry.path());
  }
  std::printf("%zu files\n", num_files);
  return num_files == 0 ? 1 : 0;
}
