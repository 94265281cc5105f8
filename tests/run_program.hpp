#pragma once
// Runs the program isowave as a user would, and folders for what it writes.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace isowave::core::test {

/// A fresh folder, removed with all it holds.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "isowave_test_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr)
      throw std::runtime_error("cannot make a temporary folder");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder &) = delete;
  TemporaryFolder &operator=(const TemporaryFolder &) = delete;

  const std::filesystem::path &path() const { return path_; }
  std::filesystem::path operator/(std::string_view name) const { return path_ / name; }
  std::size_t num_files() const {
    return std::size_t(std::distance(std::filesystem::directory_iterator(path_), {}));
  }

 private:
  std::filesystem::path path_;
};

inline std::string read_file(const std::filesystem::path &path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

inline void write_file(const std::filesystem::path &path, std::string_view text) {
  std::ofstream(path, std::ios::binary).write(text.data(), std::streamsize(text.size()));
}

template <class T>
void write_file(const std::filesystem::path &path, const std::vector<T> &values) {
  write_file(path, std::string_view(reinterpret_cast<const char *>(values.data()),
                                    values.size() * sizeof(T)));
}

struct ProgramResult {
  int status = -1;       ///< exit status; 128 + signal when killed
  std::string out, err;  ///< all of stdout and stderr
};

/// Runs any command line through the shell.
inline ProgramResult run_command(const std::string &command) {
  const TemporaryFolder folder;
  const std::string out = (folder / "out").string(), err = (folder / "err").string();
  const int code = std::system(("( " + command + " ) >" + out + " 2>" + err).c_str());
  ProgramResult result;
  result.status = WIFEXITED(code) ? WEXITSTATUS(code) : 128 + WTERMSIG(code);
  result.out = read_file(out);
  result.err = read_file(err);
  return result;
}

/// For the shell.
inline std::string quoted(const std::filesystem::path &path) {
  return "'" + path.string() + "'";
}

/// The program under test: what the environment says, where ctest has it tested with sanitizers.
inline std::filesystem::path program_path() {
  const char *path = std::getenv("ISOWAVE_PROGRAM");
  return path ? path : ISOWAVE_PROGRAM;
}
/// For the shell. Unless the environment names a device, an OpenCL device for the CPU draws, not
/// the host: most cases look at what devices do.
inline std::string isowave_program() {
  return "/usr/bin/env ISOWAVE_DEVICE=\"${ISOWAVE_DEVICE:-cpu}\" " + quoted(program_path());
}

/// The most memory that `isowave ARGUMENTS` had, whatever came of it [MiB]. Python starts it: the
/// system counts what a process had before its exec, and this one is large.
inline long peak_of_isowave(const std::vector<std::string> &arguments) {
  std::string command =
      "/usr/bin/python3 -c 'import resource, subprocess, sys\n"
      "done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)\n"
      "assert done.returncode != 127\n"
      "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)' " +
      quoted(program_path());
  for (const std::string &argument : arguments)
    command += " " + quoted(std::filesystem::path(argument));
  const ProgramResult result = run_command(command);
  EXPECT_EQ(result.status, 0) << result.err;
  return std::strtol(result.out.c_str(), nullptr, 10) / 1024;
}

/// Runs `isowave ARGUMENTS` through the shell.
inline ProgramResult run_isowave(const std::string &arguments) {
  return run_command(isowave_program() + " " + arguments);
}

/// `isowave ARGUMENTS` must fail with status 1, nothing on stdout and one line on stderr that
/// contains `text`.
inline void expect_one_line_error(const std::string &arguments, std::string_view text) {
  const ProgramResult result = run_isowave(arguments);
  EXPECT_EQ(result.status, 1) << arguments;
  EXPECT_EQ(result.out, "") << arguments;
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << arguments << "\n"
                                                                       << result.err;
  EXPECT_TRUE(result.err.ends_with('\n')) << arguments;
  EXPECT_NE(result.err.find(text), std::string::npos) << arguments << "\n" << result.err;
}

}  // namespace isowave::core::test
