// The program on drivers that fail and without memory: whichever call fails, it ends with one line,
// and what it was to write does not appear. By default for some calls, which the seed that is
// printed chooses; with ISOWAVE_LONG_TESTS for all.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "core/base/parallel_for.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::ProgramResult;
using test::quoted;
using test::read_file;
using test::TemporaryFolder;
using test::write_file;

struct Command {
  const char *name;
  const char *arguments;  ///< VOLUME and FOLDER stand for those of the run
};

constexpr std::array kOnDevice = {
    Command{"rays",
            "render VOLUME -i 128 --size 16x12 -o FOLDER/a.png --depth FOLDER/a.npy "
            "--stats FOLDER/a.json --progress-dir FOLDER/new/p"},
    Command{"blocks",
            "render VOLUME -i 128 --size 16x12 --pipeline blocks --stream host -o FOLDER/a.png"},
    Command{"levels",
            "render VOLUME -i 128 --size 16x12 --levels all --voxel-pixels 2 --stream host "
            "--orbit 2 -o FOLDER/a.png --depth FOLDER/a.npy"},
    Command{"bounds",
            "render VOLUME -i 128 --size 16x12 --levels all --max-surface-error 1 "
            "--error-map FOLDER/e.npy -o FOLDER/a.png"},
    Command{"time_budget",
            "render VOLUME -i 128 --size 16x12 --time-budget 1000 --refined FOLDER/r.png "
            "-o FOLDER/a.png"},
    Command{"extract", "extract VOLUME -i 128 -o FOLDER/a.ply --stats FOLDER/a.json"},
    Command{"convert", "convert VOLUME --device cpu --rate 8 --levels 2 -o FOLDER/a.zfp"},
    Command{"verify", "verify VOLUME -i 128 --size 16x12 --device cpu --json FOLDER/a.json"},
};
constexpr std::array kOnHost = {
    Command{"convert_within", "convert VOLUME --tolerance 1 --levels all -o FOLDER/a.zfp"},
    Command{"generate", "generate turbulence --dims 16 -o FOLDER/a.raw"},
    Command{"reference",
            "render VOLUME -i 128 --size 16x12 --reference -o FOLDER/a.png --stats FOLDER/a.json"},
};
constexpr int kTries = 11;  ///< by default, of each command and each kind of failure

void replace(std::string &text, const std::string &name, const std::string &value) {
  for (std::size_t at = 0; (at = text.find(name, at)) != std::string::npos; at += value.size())
    text.replace(at, name.size(), value);
}

/// What fails: a library that a variable of the environment names, and the prefix of its own ones.
struct Failing {
  const char *loaded_by, *library, *prefix;
};
constexpr Failing kOpenCl = {"OPENCL_LAYERS", ISOWAVE_FAILING_OPENCL, "FAILING_OPENCL_"};
constexpr Failing kMemory = {"LD_PRELOAD", ISOWAVE_FAILING_MEMORY, "FAILING_MEMORY_"};

class CliFailures : public testing::TestWithParam<Command> {
 protected:
  /// settings: of the library, without its prefix.
  static ProgramResult run(const Failing &failing, std::string arguments,
                           const TemporaryFolder &folder,
                           const std::vector<std::string> &settings) {
    replace(arguments, "VOLUME", "generate:gyroid_24x24x24_uint8");
    replace(arguments, "FOLDER", folder.path().string());
    std::string environment = fmt::format("OCL_ICD_VENDORS=pocl.icd ISOWAVE_DEVICE=cpu {}={}",
                                          failing.loaded_by, failing.library);
    for (const std::string &setting : settings) environment += " " + (failing.prefix + setting);
    return test::run_command("timeout -k 1 120 env " + environment + " " +
                             test::quoted(test::program_path()) + " " + arguments);
  }

  /// How many calls or requests there are without a failure.
  static long count(const Failing &failing, const std::string &arguments) {
    const TemporaryFolder folder, counted;
    const ProgramResult result =
        run(failing, arguments, folder, {"COUNT=" + (counted / "count").string()});
    EXPECT_EQ(result.err, "") << arguments;
    return std::atol(read_file(counted / "count").c_str());
  }

  static std::string fault_of(const ProgramResult &result, const TemporaryFolder &folder) {
    if (result.status == 0) return {};
    if (result.status != 1) return "is no exit status of the program's";
    if (!result.err.starts_with("isowave: ") || !result.err.ends_with('\n') ||
        std::ranges::count(result.err, '\n') != 1)
      return "should come with one line";
    if (folder.num_files() != 1 || read_file(folder / "a.png") != "old")
      return "should leave the outputs as they were";
    return {};
  }

  static void sweep(const Failing &failing, const Command &command, long first) {
    const long last = count(failing, command.arguments);
    ASSERT_GT(last, first);
    std::vector<std::pair<long, bool>> tries;  // of which call, and whether it is the only one
    if (std::getenv("ISOWAVE_LONG_TESTS") != nullptr) {
      for (long n = first; n <= last; ++n) {
        tries.emplace_back(n, true);
        tries.emplace_back(n, false);
      }
    } else {
      const unsigned seed = std::random_device()();
      std::mt19937 random(seed);
      fmt::print("seed {}, {} calls\n", seed, last);
      for (int i = 0; i < kTries; ++i)
        tries.emplace_back(std::uniform_int_distribution(first, last)(random), i % 2 == 0);
    }
    std::mutex expecting;
    parallel_for(tries.size(), 0, [&](std::uint64_t i, std::uint32_t) {
      const auto [n, once] = tries[i];
      const TemporaryFolder folder;
      write_file(folder / "a.png", std::string_view("old"));
      std::vector<std::string> settings = {fmt::format("AT={}", n)};
      if (once) settings.emplace_back("ONCE=1");
      const ProgramResult result = run(failing, command.arguments, folder, settings);
      const std::string fault = fault_of(result, folder);
      const std::scoped_lock lock(expecting);
      EXPECT_EQ(fault, "") << command.arguments << "\ncall " << n << (once ? " alone" : " and on")
                           << ", status " << result.status << "\n"
                           << result.err;
    });
  }
};

class CliDriverFailures : public CliFailures {};

TEST_P(CliDriverFailures, EndInOneLineAndLeaveNothing) {
  sweep(kOpenCl, GetParam(), 1);
}

/// The description of all options takes most requests, and is the same for all commands.
TEST_P(CliFailures, OfMemoryEndInOneLineAndLeaveNothing) {
  static const long of_options = count(kMemory, "generate gyroid --dims 4 -o FOLDER/a.raw");
  sweep(kMemory, GetParam(), GetParam().name == kOnHost[1].name ? 1 : of_options);
}

std::string name_of(const testing::TestParamInfo<Command> &command) {
  return command.param.name;
}
INSTANTIATE_TEST_SUITE_P(Cli, CliDriverFailures, testing::ValuesIn(kOnDevice), name_of);
INSTANTIATE_TEST_SUITE_P(CliDevice, CliFailures, testing::ValuesIn(kOnDevice), name_of);
INSTANTIATE_TEST_SUITE_P(CliHost, CliFailures, testing::ValuesIn(kOnHost), name_of);

}  // namespace
}  // namespace isowave::core
