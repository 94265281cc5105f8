// `mpirun isowave render` and `convert`: what several processes draw or compress together has the
// bytes that one writes, and what goes wrong at one rank is said in one line, and ends all.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/zfp/zfp_stream.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::ProgramResult;
using test::quoted;
using test::read_file;
using test::run_command;
using test::run_isowave;
using test::TemporaryFolder;

/// Several processes on one CPU, by any user, root too; oversubscribed and not bound to cores.
/// -q: mpirun itself says nothing.
const std::string kMpirun =
    ISOWAVE_MPIRUN " -q --oversubscribe --bind-to none --allow-run-as-root ";

const std::string kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz";

std::string on_ranks(int count, const std::string &arguments) {
  return kMpirun + "-n " + std::to_string(count) + " " + test::isowave_program() + " " + arguments;
}

class CliRanks : public testing::Test {
 protected:
  /// Draws with one process, and with so many, of which `bricks` is the option.
  void expect_same(const std::string &volume, const std::string &options, int count,
                   const std::string &bricks = "") {
    const std::string outputs =
        " -o " + quoted(folder_ / "x.png") + " --depth " + quoted(folder_ / "x.npy");
    const std::string arguments = "render " + volume + " " + options + outputs;
    const auto files = [&] {
      std::map<std::string, std::string> texts;
      for (const auto &entry : std::filesystem::directory_iterator(folder_.path())) {
        const std::string name = entry.path().filename().string();
        if (!name.starts_with("x")) continue;
        texts[name] = read_file(entry.path());
        EXPECT_FALSE(texts[name].empty()) << name;
        if (name == "x.json") texts[name] = errors_in(texts[name]);
      }
      for (const auto &[name, text] : texts) std::filesystem::remove(folder_ / name);
      return texts;
    };
    const ProgramResult one = run_isowave(arguments);
    ASSERT_EQ(one.status, 0) << one.err;
    const auto expected = files();
    EXPECT_GE(expected.size(), 2u);
    const ProgramResult several = run_command(on_ranks(count, arguments + bricks));
    ASSERT_EQ(several.status, 0) << several.err;
    EXPECT_TRUE(files() == expected) << arguments << " with " << count << " ranks";
  }

  /// Within an error, also the map of bounds, and what --stats say of them.
  void expect_same_within(const std::string &volume, const std::string &options, int count,
                          const std::string &bricks = "") {
    expect_same(volume,
                options + " --error-map " + quoted(folder_ / "x_map.npy") + " --stats " +
                    quoted(folder_ / "x.json"),
                count, bricks);
  }

  /// Errors in --stats, without what differs from run to run, and from brick to brick.
  static std::string errors_in(const std::string &stats) {
    nlohmann::json errors;
    for (const auto &frame : nlohmann::json::parse(stats)["frames"]) {
      errors.push_back(frame["error"]);
      EXPECT_GT(errors.back()[errors.back()["by"] == "proof" ? "certified" : "within"], 0);
      for (const char *key : {"choice_ms", "bound_ms", "decoded_blocks"}) errors.back().erase(key);
    }
    return errors.dump();
  }

  /// A command line must fail with status 1 and one line.
  static void expect_error(const std::string &command, const std::string &text) {
    const ProgramResult result = run_command(command);
    EXPECT_EQ(result.status, 1) << command << "\n" << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
  }

  /// What the program printed, but for the line that comes when compiling kernels takes long.
  static std::string without_compiling(const std::string &out) {
    return out.starts_with("compiling kernels for ") ? out.substr(out.find('\n') + 1) : out;
  }

  /// Compresses with one process, and with so many.
  void expect_same_file(const std::string &volume, const std::string &options, int count) {
    const std::filesystem::path path = folder_ / "v.zfp";
    const std::string arguments = "convert " + volume + " " + options + " -o " + quoted(path);
    const ProgramResult one = run_isowave(arguments);
    ASSERT_EQ(one.status, 0) << one.err;
    const std::string expected = read_file(path);
    std::filesystem::remove(path);
    const ProgramResult several = run_command(on_ranks(count, arguments));
    ASSERT_EQ(several.status, 0) << several.err;
    EXPECT_TRUE(read_file(path) == expected) << arguments << " with " << count << " ranks";
    EXPECT_EQ(without_compiling(several.out), without_compiling(one.out));
    std::filesystem::remove(path);
    EXPECT_EQ(folder_.num_files(), num_inputs_);
  }

  /// Voxels [z][y][x] of a volume of uneven sides, of which a function gives some.
  template <class Value>
  std::string write_raw(const std::string &type, const std::function<Value(int, int, int)> &voxel) {
    std::string path = (folder_ / ("v_13x9x45_" + type + ".raw")).string();
    if (!std::filesystem::exists(path)) ++num_inputs_;
    std::ofstream file(path, std::ios::binary);
    for (int z = 0; z < 45; ++z) {
      for (int y = 0; y < 9; ++y) {
        for (int x = 0; x < 13; ++x) {
          const Value value = voxel(x, y, z);
          file.write(reinterpret_cast<const char *>(&value), sizeof(value));
        }
      }
    }
    return path;
  }

  /// ids: lines of a rank, or "job", and its process.
  static void send(int signal, const std::string &receiver, const std::filesystem::path &ids) {
    pid_t process = 0;
    std::ifstream stream(ids);
    std::string name;
    for (long id = 0; stream >> name >> id;) {
      if (name == receiver) process = static_cast<pid_t>(id);
    }
    ASSERT_GT(process, 0);
    EXPECT_EQ(::kill(process, signal), 0);
  }

  std::string convert(const std::string &options) {
    std::string path = quoted(folder_ / "volume.zfp");
    const ProgramResult result = run_isowave("convert " + kFuel + " " + options + " -o " + path);
    EXPECT_EQ(result.status, 0) << result.err;
    return path;
  }

  TemporaryFolder folder_;
  std::size_t num_inputs_ = 0;  ///< files that write_raw() has made
};

void skip_unless_long() {
  if (std::getenv("ISOWAVE_LONG_TESTS") == nullptr) GTEST_SKIP() << "among the long tests";
}

TEST_F(CliRanks, DrawWhatOneProcessDraws) {
  expect_same(convert(""), "-i 40 --size 96x64 --fit surface", 2);
  expect_same(kFuel, "-i 40 --size 64x48 --transparent", 2, " --bricks active");
  expect_same(kFuel, "--tolerance 0.3 --orbit 2 -i 40 -i 90 --size 64x48 --pipeline blocks", 3);
}

TEST_F(CliRanks, VoxelsWithoutData) {
  expect_same(convert("--no-data 0"), "-i 40 --size 96x64", 3);
}

/// Also if a rank has none but such voxels.
TEST_F(CliRanks, VoxelsWithoutDataInAllWays) {
  expect_same(kFuel, "--no-data 40 -i 38.5 --size 64x48 --pipeline blocks", 2);
  const std::string half = write_raw<float>("float32", [](int x, int y, int z) {
    const float value = static_cast<float>(x + y) + 0.25f * static_cast<float>(z);
    return z > 20 ? std::numeric_limits<float>::quiet_NaN() : value;
  });
  expect_same(half, "-i 9.5 --size 64x48", 3, " --bricks 1x1x3");
  expect_same(convert("--no-data 0 --levels 3"), "-i 40 --size 64x48 --voxel-pixels 2", 3);
}

TEST_F(CliRanks, SamplesLevelsAndBricksAsAskedFor) {
  expect_same(convert("--exact"), "-i 40 --size 48x32 --samples 2", 3, " --bricks 1x1x3");
  expect_same(convert("--exact --levels 3"), "-i 40 --size 96x64 --voxel-pixels 1.5", 3);
  expect_same("generate:mixing_layer_30x40x24_uint8", "-i 128 --size 64x48 --cache-slots 64", 2);
}

/// A plane through the middle of the whole, not of a brick; a cap that belongs to several bricks.
TEST_F(CliRanks, ClippingPlanes) {
  expect_same(convert("--exact"),
              "-i 20 --size 96x64 --clip 1,1,-0.5 --color-by 1,2,0 --background black,skin", 2);
}

TEST_F(CliRanks, ScenesAndTurntables) {
  expect_same(convert("--exact"),
              "--surface 20,skin,0.4 --surface 90 --slice z --light 1,1,0 --shadow 1 --size 48x32",
              2);
  expect_same(kFuel, "-i 40 --clip 0,0,1,12 --color-by volume --size 48x32 --turntable 3", 3);
}

/// WithinAnError has both, too.
TEST_F(CliRanks, AmbientRaysOfLevels) {
  if (skip_unless_long(); IsSkipped()) return;
  expect_same(convert("--exact --levels 3"),
              "-i 40 --size 48x32 --voxel-pixels 1.5 --ambient 3 --samples 2", 3);
}

TEST_F(CliRanks, WithinAnError) {
  expect_same_within(convert("--exact --levels all"),
                     "-i 40 -i 90 --size 48x32 --samples 2 --ambient 2 --max-surface-error 2", 3);
  expect_same(convert("--exact --levels all"),
              "-i 40 --size 320x240 --max-surface-error 4 --by sample --stats " +
                  quoted(folder_ / "x.json"),
              3);
  expect_same_within(kFuel, "--rate 20 --levels 1 -i 40 --size 48x32 --max-surface-error 2", 2,
                     " --bricks active --progress-dir " + quoted(folder_ / "p"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "p" / "pass0001.png"));
  const std::string unreachable =
      "generate:mixing_layer_30x40x24_uint8 --rate 6 --levels 1 -i 128 --size 48x32 "
      "--max-surface-error 0.001 -o " +
      quoted(folder_ / "x.png");
  const ProgramResult one = run_isowave("render " + unreachable),
                      two = run_command(on_ranks(2, "render " + unreachable));
  EXPECT_EQ(two.status, 0);
  const auto warning = [](const ProgramResult &result) {
    return result.err.substr(result.err.find("warning"));
  };
  EXPECT_NE(one.err.find("a volume compressed with a tolerance"), std::string::npos) << one.err;
  EXPECT_EQ(warning(two), warning(one));
}

/// The picture grows from pass to pass, up to what one process draws.
TEST_F(CliRanks, PicturesPassByPass) {
  for (const std::string scene :
       {"-i 40", "--surface 20,skin,0.4 --surface 90 --slice z --ambient 1"}) {
    const std::string render = "render " + kFuel + " " + scene + " --size 64x48 --cache-slots 64 ";
    ASSERT_EQ(run_isowave(render + "-o " + quoted(folder_ / "one.png")).status, 0);
    const ProgramResult result = run_command(
        on_ranks(3, render + "-o " + quoted(folder_ / "x.png") + " --progress-dir " +
                        quoted(folder_ / "p") + " --stats " + quoted(folder_ / "s.json")));
    ASSERT_EQ(result.status, 0) << result.err;
    const std::string one = read_file(folder_ / "one.png");
    EXPECT_TRUE(one == read_file(folder_ / "x.png"));
    std::size_t num_passes = 0;
    const auto stats = nlohmann::json::parse(read_file(folder_ / "s.json"));
    for (const auto &rank : stats["ranks"]) {
      const auto &frame = rank["frames"][0];
      num_passes = std::max(num_passes,
                            std::size_t(frame["passes"]) + std::size_t(frame["normals"]["passes"]));
    }
    std::vector<std::string> pictures;
    for (std::string name = "pass0001.png"; std::filesystem::exists(folder_ / "p" / name);
         name = fmt::format("pass{:04}.png", pictures.size() + 1))
      pictures.push_back(read_file(folder_ / "p" / name));
    if (scene == "-i 40") {
      EXPECT_EQ(pictures.size(), num_passes);
    }
    EXPECT_GE(pictures.size(), num_passes);
    EXPECT_TRUE(one != pictures.front());
    EXPECT_TRUE(one == pictures.back());
    std::filesystem::remove_all(folder_ / "p");
  }
}

TEST_F(CliRanks, PicturesWithinATime) {
  const std::string render =
      "render " + convert("--levels all") + " -i 40 --size 64x48 --ambient 2 --samples 2 ";
  const std::string picture = quoted(folder_ / "x.png"), refined = quoted(folder_ / "r.png");
  ASSERT_EQ(run_isowave(render + "-o " + quoted(folder_ / "one.png")).status, 0);
  const std::string one = read_file(folder_ / "one.png");
  for (const bool is_short : {true, false}) {
    const ProgramResult result = run_command(on_ranks(
        2, render + "-o " + picture + " --refined " + refined + " --time-budget " +
               (is_short ? "0.001" : "1000000") + " --stats " + quoted(folder_ / "s.json")));
    ASSERT_EQ(result.status, 0) << result.err;
    const auto stats = nlohmann::json::parse(read_file(folder_ / "s.json"));
    EXPECT_EQ(stats["frames"][0]["time_budget"]["complete"], !is_short);
    EXPECT_EQ(one == read_file(folder_ / "x.png"), !is_short);
    EXPECT_TRUE(one == read_file(folder_ / "r.png"));
  }
}

TEST_F(CliRanks, ManyRanks) {
  skip_unless_long();
  if (IsSkipped()) return;
  const std::string volume = convert("--rate 6");
  for (const int count : {5, 8, 27}) {
    expect_same(volume, "--orbit 2 -i 40 -i 90 --size 320x200", count);
    expect_same(volume, "--orbit 2 -i 40 -i 90 --size 64x48 --pipeline blocks", count);
    expect_same(volume, "-i 40 --size 64x48 --ambient 4 --cache-slots 64", count);
  }
}

TEST_F(CliRanks, CompressWhatOneProcessCompresses) {
  expect_same_file(kFuel, "--rate 5 --no-verify", 2);
  expect_same_file(kFuel, "--exact --levels all", 3);
  expect_same_file(kFuel, "", 2);
  expect_same_file("generate:mixing_layer_30x24x21_float32", "--levels 2", 3);
  expect_same_file("generate:mixing_layer_30x40x47_float32", "--rate 7 --levels all", 5);
  // Nearly all blocks take one bit, so bytes are shared by ranks; and some have no layer.
  const std::string spot = write_raw<std::uint8_t>("uint8", [](int x, int y, int z) {
    return static_cast<std::uint8_t>(x == 4 && y == 3 && z == 17 ? 200 : 0);
  });
  expect_same_file(spot, "--exact --levels all", 3);
  expect_same_file(spot, "--tolerance 0.4", 14);
}

/// Groups of 32 blocks are shared by ranks; some ranks have no layer, some no voxel with data, or
/// none without.
TEST_F(CliRanks, CompressVoxelsWithoutData) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  const auto wave = [](int x, int y, int z) { return static_cast<float>(x * x + y * z) / 7.0f; };
  const std::string half = write_raw<float>(
      "float32", [&](int x, int y, int z) { return z > 20 ? kNone : wave(x, y, z); });
  expect_same_file(half, "--levels all", 3);
  expect_same_file(half, "--rate 8", 14);
  const std::string scattered = write_raw<float>("float32", [&](int x, int y, int z) {
    return (x * 7 + y * 5 + z * 3) % 11 == 0 || z == 43 ? kNone : wave(x, y, z);
  });
  expect_same_file(scattered, "--rate 8 --levels all", 3);
  expect_same_file(scattered, "--tolerance 0.01", 14);
  expect_same_file(write_raw<float>("float32", [](int, int, int) { return kNone; }), "", 3);
  expect_same_file(kFuel, "--no-data 0 --exact --levels all", 3);
}

TEST_F(CliRanks, KeepTheModeOfTheFileThatTheyReplace) {
  const std::filesystem::path path = folder_ / "v.zfp";
  test::write_file(path, std::string_view("old"));
  constexpr auto kOwners = std::filesystem::perms::owner_read | std::filesystem::perms::owner_write;
  std::filesystem::permissions(path, kOwners);
  const ProgramResult run = run_command(
      on_ranks(2, "convert generate:gyroid_32x32x32_uint8 --rate 4 -o " + quoted(path)));
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(read_file(path), "old");
  EXPECT_EQ(std::filesystem::status(path).permissions(), kOwners);
}

/// What casts to float32 lose, and tiny values, count in the errors of all levels.
TEST_F(CliRanks, CompressWithErrorsOfTheSource) {
  const std::string waves = write_raw<double>("float64", [](int x, int y, int z) {
    const double value = std::sin(0.3 * x) * std::cos(0.2 * z) + 0.1 * y + 1.0 / 3;
    return x % 3 == 0 ? 1e-32 * value : value;
  });
  expect_same_file(waves, "--tolerance-relative 1e-3 --levels all", 5);
  expect_same_file(waves, "", 3);
  expect_same_file(waves, "--rate 9 --levels all", 3);
}

TEST_F(CliRanks, CompressOnEachRanksDevice) {
  expect_same_file("generate:mixing_layer_30x24x21_uint8", "--rate 8 --levels 2 --device 0", 2);
}

TEST_F(CliRanks, RefusedVoxelsAreCountedOnce) {
  const std::string bad = write_raw<float>("float32", [](int x, int y, int z) {
    return x == 5 && y == 2 && z % 11 == 10 ? std::numeric_limits<float>::infinity() : 1.0f;
  });
  const std::string arguments = "convert " + bad + " -o " + quoted(folder_ / "v.zfp") + " ";
  for (const char *options : {"--rate 8 --levels all", "--tolerance 0.1"}) {
    expect_error(on_ranks(3, arguments + options),
                 "isowave: 4 of 5265 voxels are infinite, the first at x=5, y=2, z=10");
  }
  expect_error(on_ranks(3, arguments + "--map-nan 0 --levels 7"), "7 levels of detail");
  EXPECT_EQ(folder_.num_files(), 1u);
}

/// Each of 64 ranks gives half a word for each ray of a picture, even if it has drawn nothing.
TEST_F(CliRanks, ManyRanksGiveHalfAWordForEachRay) {
  skip_unless_long();
  if (IsSkipped()) return;
  expect_same(kFuel, "-i 40 --size 32x24", 64);
  const std::string stats_file = quoted(folder_ / "s.json");
  const ProgramResult result =
      run_command(on_ranks(64, "render " + kFuel + " -i 40 --orbit 3 --size 32x24 -o " +
                                   quoted(folder_ / "x.png") + " --stats " + stats_file));
  ASSERT_EQ(result.status, 0) << result.err;
  const auto stats = nlohmann::json::parse(read_file(folder_ / "s.json"));
  ASSERT_EQ(stats["ranks"].size(), 64u);
  for (const auto &rank : stats["ranks"]) {
    EXPECT_EQ(rank["composition"]["reductions"], 3);
    EXPECT_EQ(rank["composition"]["bytes"], 3 * 32 * 24 * 4);
  }
}

/// Volumes of the folder that the environment names, such as one of Open SciVis sets, at three
/// isovalues among the middle 80 % of each volume's voxels.
TEST_F(CliRanks, RealVolumes) {
  const char *folder = std::getenv("ISOWAVE_TEST_VOLUMES");
  if (folder == nullptr) GTEST_SKIP() << "ISOWAVE_TEST_VOLUMES names no folder of volumes";
  std::set<std::filesystem::path> paths;
  for (const auto &entry : std::filesystem::directory_iterator(folder)) paths.insert(entry.path());
  std::size_t num_volumes = 0;
  for (const auto &path : paths) {
    const std::string name = path.filename().string();
    const std::string volume = quoted(folder_ / "volume.zfp");
    if (name.ends_with(".md") ||
        run_isowave("convert " + quoted(path) + " --rate 8 --levels 2 -o " + volume).status != 0)
      continue;  // not a volume, or one that needs options
    SCOPED_TRACE(name);
    ++num_volumes;
    const CompressedVolume info = read_zfp_file_info(folder_ / "volume.zfp");
    const auto [low, high] = info.value_range;
    std::mt19937 random(static_cast<unsigned>(name.size()));
    std::string isovalues;
    for (int i = 0; i < 3; ++i) {
      const float share = std::uniform_real_distribution<float>(0.1f, 0.9f)(random);
      isovalues += fmt::format(" -i {}", low + share * (high - low));
    }
    isovalues += " --orbit 1 --size 320x180";
    for (const int count : {2, 3, 8}) expect_same(volume, isovalues, count);
    for (const char *options : {" --pipeline blocks", " --cache-slots 500", " --voxel-pixels 1"})
      expect_same(volume, isovalues + options, 3);
  }
  EXPECT_GE(num_volumes, 1u);
}

/// Two pieces of words: within a host, between hosts, and both.
TEST_F(CliRanks, MoreWordsThanHostsShare) {
  for (const char *host_ranks : {"9", "1", "2"}) {
    SCOPED_TRACE(host_ranks);
    ::setenv("ISOWAVE_HOST_RANKS", host_ranks, 1);
    expect_same(kFuel, "-i 40 --orbit 1 --size 600x480 --samples 2", 3);
    expect_same(kFuel, "-i 40 --orbit 1 --size 1920x1200", 3);  // half words
  }
  ::unsetenv("ISOWAVE_HOST_RANKS");
}

TEST_F(CliRanks, StatisticsOfEachRank) {
  const ProgramResult result = run_command(
      on_ranks(2, "render " + kFuel + " -i 40 --size 64x48 --stats " + quoted(folder_ / "s.json")));
  ASSERT_EQ(result.status, 0) << result.err;
  const auto stats = nlohmann::json::parse(read_file(folder_ / "s.json"));
  EXPECT_EQ(stats["volume"]["dims"], nlohmann::json({64, 33, 32}));
  ASSERT_EQ(stats["ranks"].size(), 2u);
  for (int rank = 0; rank < 2; ++rank) {
    const auto &of_rank = stats["ranks"][std::size_t(rank)];
    EXPECT_EQ(of_rank["rank"], rank);
    EXPECT_EQ(of_rank["frames"].size(), 1u);
    EXPECT_EQ(of_rank["volume"]["dims"], nlohmann::json({36, 33, 32}));  // a layer of the other's
    // No picture is asked for, and one word a ray says who hits.
    EXPECT_EQ(of_rank["composition"]["reductions"], 1);
    EXPECT_EQ(of_rank["composition"]["bytes"], 64 * 48 * 8);
  }
  EXPECT_GT(stats["frames"][0]["rays_hit"], 200);
}

TEST_F(CliRanks, RefuseWhatTheyCannotDo) {
  const std::string render = "render " + kFuel + " -i 40 --size 16x16 ";
  const std::string within = render + "--max-surface-error ";
  expect_error(on_ranks(2, within + "1"), "convert --levels all, or do without them: --levels 1");
  expect_error(on_ranks(2, within + "0 --levels 1"), "give more than 0");
  expect_error(on_ranks(2, "render " + convert("--rate 8 --no-verify") +
                               " -i 40 --size 16x16 --max-surface-error 1"),
               "the volume's error is not known");
  expect_error(on_ranks(2, "render " + kFuel + " -o " + quoted(folder_ / "a.png")),
               "with mpirun, no process sees the whole volume: give --isovalue");
  expect_error(on_ranks(2, render + "--bricks 2x2x1"), "2 processes draw a brick each");
  expect_error(on_ranks(2, render + "--voxel-pixels 1"), "convert --levels all");
  expect_error(on_ranks(2, "info " + kFuel), "only render and convert");
  expect_error(on_ranks(2, "render " + quoted(folder_ / "*.zfp") + " -i 40"),
               "with mpirun, all processes draw one volume");
  test::expect_one_line_error(render + "--bricks 1x1x1", "--bricks");
}

TEST_F(CliRanks, DifferentRanksAreFound) {
  const std::string program = test::isowave_program(), render = " render v.zfp -i 40 --size 16x16 ";
  for (const char *rate : {"4", "8"}) {
    std::filesystem::create_directory(folder_ / rate);
    ASSERT_EQ(run_isowave("convert " + kFuel + " --rate " + rate + " -o " +
                          quoted(folder_ / rate / "v.zfp"))
                  .status,
              0);
  }
  const auto in = [&](const char *name) { return " --wdir " + quoted(folder_ / name) + " "; };
  expect_error(kMpirun + "-n 1" + in("4") + program + render + "-o x.png : -n 1" + in("8") +
                   program + render + "-o x.png",
               "rank 1 has another volume");
  expect_error(kMpirun + "-n 1" + in("4") + program + render + "-o x.png : -n 1" + in("4") +
                   program + render + "-o y.png",
               "rank 1 has another command line");
  expect_error(kMpirun + "-n 1" + in("4") + program + render + "-o x.png : -n 1" + in("4") +
                   "env OCL_ICD_VENDORS=/nowhere " + program + render + "-o x.png",
               "rank 1: no OpenCL 1.2 device");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "4" / "x.png"));
}

// As one process does: CliExtract.ValuesThatARateMakes0AreRefused.
TEST_F(CliRanks, ValuesThatARateMakes0AreRefused) {
  std::vector<float> voxels(12 * 12 * 12);
  voxels[500] = 1e-31f;
  test::write_file(folder_ / "a_12x12x12_float32.raw", voxels);
  expect_error(kMpirun + "-n 2 " + test::isowave_program() + " render " +
                   quoted(folder_ / "a_12x12x12_float32.raw") +
                   " -i 5e-32 --rate 32 --size 16x16 -o " + quoted(folder_ / "x.png"),
               "have all become 0 at a rate or by a tolerance");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.png"));
}

TEST_F(CliRanks, FullDisk) {
  // A limit on the length of files stands in for it: with kernels that are compiled already, and
  // without MPI's own files, as over TCP.
  const std::string arguments = "render " + kFuel + " -i 40 --size 1600x1200 --depth ";
  ASSERT_EQ(run_command(on_ranks(2, arguments + quoted(folder_ / "y.npy"))).status, 0);
  std::filesystem::remove(folder_ / "y.npy");
  const std::string command = kMpirun + "--mca btl tcp,self -n 2 sh -c " +
                              "'ulimit -f 8192; exec \"$0\" \"$@\"' " + test::isowave_program() +
                              " " + arguments + quoted(folder_ / "x.npy");
  expect_error(command, "x.npy");
  EXPECT_EQ(folder_.num_files(), 0u);
}

TEST_F(CliRanks, FullDiskWhileCompressing) {
  for (const char *options : {"--rate 16", "--tolerance 1e-6 --levels 2"}) {
    expect_error(kMpirun + "--mca btl tcp,self -n 3 sh -c 'ulimit -f 1024; exec \"$0\" \"$@\"' " +
                     test::isowave_program() + " convert generate:sphere_128x128x128_float32 " +
                     options + " -o " + quoted(folder_ / "x.zfp"),
                 "x.zfp: cannot write: File too large");
  }
  EXPECT_EQ(folder_.num_files(), 0u);
}

/// One rank's file has become shorter.
TEST_F(CliRanks, ARankThatFailsLeavesNoFile) {
  const auto raw = [&](const char *name) { return folder_ / name / "v_64x64x64_uint8.raw"; };
  for (const char *name : {"a", "b"}) {
    std::filesystem::create_directory(folder_ / name);
    std::ofstream(raw(name)) << std::string(64 * 64 * 64, 'x');
  }
  std::filesystem::resize_file(raw("b"), 1000);
  const auto in = [&](const char *name) {
    return "-n 1 --wdir " + quoted(folder_ / name) + " " + test::isowave_program() +
           " convert v_64x64x64_uint8.raw -o " + quoted(folder_ / "x.zfp");
  };
  expect_error(kMpirun + in("a") + " : " + in("b"), "rank 1: v_64x64x64_uint8.raw: truncated");
  EXPECT_EQ(folder_.num_files(), 2u);
}

/// However the processes end: of one host's, and as if each were on a host of its own, where the
/// file needs a name.
TEST_F(CliRanks, AnEndedJobLeavesNoFile) {
  const auto is_written = [&] {
    const std::string open = fmt::format(
        "find /proc/[0-9]*/fd -lname '{}/*' 2> /dev/null | grep -q .", folder_.path().string());
    return run_command(open).status == 0;
  };
  for (const char *hosts : {"", "ISOWAVE_HOST_RANKS=1 "}) {
    for (const int ended : {SIGKILL, SIGTERM, SIGINT}) {
      const std::string ids = (folder_ / "ids").string();
      const std::string command = fmt::format(
          "exec sh -c 'echo job $$ >> {}; exec \"$0\" \"$@\"' env {} {} -n 2 sh -c 'echo "
          "$OMPI_COMM_WORLD_RANK $$ >> {}; exec \"$0\" \"$@\"' {} convert "
          "generate:turbulence_2048x2048x1024_uint8 --rate 8 -o {}",
          ids, hosts, kMpirun, ids, test::isowave_program(), quoted(folder_ / "x.zfp"));
      ProgramResult result;
      std::thread job([&] { result = run_command(command); });
      for (int tries = 0; tries < 600 && !is_written(); ++tries)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      EXPECT_TRUE(is_written());
      send(ended, ended == SIGKILL ? "1" : "job", ids);
      job.join();
      EXPECT_NE(result.status, 0);
      for (int tries = 0; tries < 200 && is_written(); ++tries)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));  // mpirun may end before ranks
      std::filesystem::remove(ids);
      EXPECT_EQ(folder_.num_files(), 0u) << hosts << "signal " << ended;
    }
  }
}

/// Without rank 1, rank 0 must not wait for ever, and leaves nothing half-written.
TEST_F(CliRanks, ARankThatDiesEndsTheJob) {
  const std::string ids = (folder_ / "ids").string();
  const std::string command = kMpirun + "-n 2 sh -c 'echo $OMPI_COMM_WORLD_RANK $$ >> " + ids +
                              "; exec \"$0\" \"$@\"' " + test::isowave_program() + " render " +
                              kFuel + " -i 40 --size 64x48 --orbit 3000 --depth " +
                              quoted(folder_ / "x.npy") + " > " + quoted(folder_ / "out");
  ProgramResult result;
  std::thread job([&] { result = run_command(command); });
  const auto draws = [&] {
    return read_file(folder_ / "out").find("view 3:") != std::string::npos;
  };
  for (int tries = 0; tries < 600 && !draws(); ++tries)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  const auto begin = std::chrono::steady_clock::now();
  send(SIGKILL, "1", ids);
  job.join();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
  EXPECT_NE(result.status, 0);
  EXPECT_EQ(folder_.num_files(), 2u) << "ids and out alone";
}

}  // namespace
}  // namespace isowave::core
