// `isowave render` on the host: by default if there is no GPU, and as `--device host`.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::quoted;
using test::read_file;
using test::TemporaryFolder;
using testing::HasSubstr;
using testing::StartsWith;

const std::string kRender =
    " render " ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz -i 10 --size 96x72 ";
/// What the program sees of the machine: the machine that runs the tests may have a GPU.
const std::string kOnlyPocl = "OCL_ICD_VENDORS=pocl.icd",
                  kNoDriver = "OCL_ICD_VENDORS=/nonexistent",
                  kGpu = kOnlyPocl + " OPENCL_LAYERS=" ISOWAVE_GPU_LAYER;

/// Runs the program without ISOWAVE_DEVICE, unless the environment given has it.
ProgramResult run_in(const std::string &environment, const std::string &arguments) {
  return test::run_command("env -u ISOWAVE_DEVICE " + environment + " " +
                           quoted(test::program_path()) + arguments);
}

void expect_error_in(const std::string &environment, const std::string &arguments,
                     const std::string &text) {
  const ProgramResult result = run_in(environment, arguments);
  EXPECT_EQ(result.status, 1) << environment << arguments;
  EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << arguments << "\n" << result.err;
  EXPECT_THAT(result.err, HasSubstr(text)) << arguments;
}

class CliHost : public testing::Test {
 protected:
  std::string path(const std::string &name) const { return quoted(folder_ / name); }
  /// The picture that the program draws, and what the program prints.
  std::pair<std::string, std::string> draw_in(const std::string &environment,
                                              const std::string &arguments) const {
    const ProgramResult result = run_in(environment, kRender + arguments + " -o " + path("a.png"));
    EXPECT_EQ(result.status, 0) << environment << arguments << "\n" << result.err;
    return {read_file(folder_ / "a.png"), result.out};
  }

  TemporaryFolder folder_;
};

TEST_F(CliHost, DrawsTheBitsOfADevice) {
  for (const std::string options :
       {"", "--exact --samples 2 --ambient 3", "--tolerance 0.5 --levels all --voxel-pixels 2",
        "--tolerance 0.5 --voxel-error 2 --normals cell --parallel", "--max-surface-error 2",
        "--max-surface-error 2 --by sample", "--max-image-error 0.05", "--time-budget 60000"}) {
    const auto [on_host, text] =
        draw_in(kOnlyPocl, options + " --device host --depth " + path("host.npy"));
    EXPECT_THAT(text, HasSubstr(" threads; choose a device with --device or ISOWAVE_DEVICE\n"));
    EXPECT_THAT(text, HasSubstr("; host memory: "));
    const auto on_device =
        draw_in(kOnlyPocl, options + " --device cpu --depth " + path("device.npy"));
    EXPECT_THAT(on_device.second, HasSubstr("device 0: "));
    EXPECT_EQ(on_host, on_device.first) << options;
    EXPECT_EQ(read_file(folder_ / "host.npy"), read_file(folder_ / "device.npy")) << options;
  }
}

TEST_F(CliHost, DrawsVolumesThatAreTooSmallForLevels) {
  const std::string volume = " render generate:gyroid_5x20x21_uint8 -i 128 --size 40x30 ";
  for (const std::string options :
       {"--voxel-pixels 2", "--time-budget 60000", "--max-surface-error 1 --rate 8",
        "--max-surface-error 1 --by sample --rate 8", "--max-image-error 0.05 --rate 8"}) {
    const auto draw = [&](const std::string &device) {
      const auto result = run_in(kOnlyPocl, volume + options + device + " -o " + path("a.png"));
      EXPECT_EQ(result.status, 0) << options << device << "\n" << result.err;
      return read_file(folder_ / "a.png");
    };
    EXPECT_EQ(draw(" --device host"), draw(" --device cpu")) << options;
  }
}

/// No kernel is compiled then.
TEST_F(CliHost, DrawsByDefaultIfThereIsNoGpu) {
  const TemporaryFolder kernels;
  const std::string cache = " POCL_CACHE_DIR=" + quoted(kernels.path());
  const auto [picture, text] = draw_in(kOnlyPocl + cache, "");
  EXPECT_THAT(text, HasSubstr("host: "));
  EXPECT_THAT(text, Not(HasSubstr("device 0")));
  for (const auto &file : std::filesystem::recursive_directory_iterator(kernels.path()))
    EXPECT_NE(file.path().extension(), ".so") << file.path();
  const std::string on_device = draw_in(kOnlyPocl, "--device cpu").first;
  EXPECT_EQ(picture, on_device);
  EXPECT_EQ(draw_in(kOnlyPocl + " ISOWAVE_DEVICE=cpu", "--device host").first, on_device);
  const auto with_gpu = draw_in(kGpu, "");
  EXPECT_THAT(with_gpu.second, HasSubstr("device 0: "));
  EXPECT_EQ(with_gpu.first, on_device);
  EXPECT_THAT(draw_in(kGpu + " ISOWAVE_DEVICE=host", "").second, HasSubstr("host: "));
}

TEST_F(CliHost, NeedsNoOpenCl) {
  const std::string picture = draw_in(kOnlyPocl, "--device cpu").first;
  EXPECT_EQ(draw_in(kNoDriver, "").first, picture);
  EXPECT_EQ(draw_in(kNoDriver, "--device host").first, picture);
  EXPECT_EQ(draw_in(kNoDriver + " ISOWAVE_DEVICE=host", "").first, picture);
  expect_error_in(kNoDriver, kRender + "--device cpu", "pocl-opencl-icd");
  expect_error_in(kNoDriver, kRender + "--pipeline rays",
                  "--pipeline: it needs an OpenCL device, and there is none");
}

TEST_F(CliHost, OptionsOfDevicesAreRefusedOrTakeADevice) {
  for (const std::string option :
       {"--cache-slots 64", "--stream host", "--verbose", "--no-stage-times --stats s.json",
        "--pipeline rays", "--speculation off", "--max-speculation 4", "--solver bernstein",
        "--pipeline blocks --grouping radix", "--pipeline blocks --closest scan",
        "--group-size 64"}) {
    const std::string name = option.substr(0, option.find(' ')),
                      text = name + ": the host has no such option";
    const std::string outputs = option + " -o " + path("b.png");
    const bool takes_two = option.find(" --grouping") != std::string::npos ||
                           option.find(" --closest") != std::string::npos;
    expect_error_in(kOnlyPocl, kRender + "--device host " + outputs,
                    takes_two ? "--pipeline" : text);
    expect_error_in(kOnlyPocl + " ISOWAVE_DEVICE=host", kRender + outputs,
                    takes_two ? "--pipeline" : text);
  }
  EXPECT_EQ(folder_.num_files(), 0u);
  EXPECT_THAT(draw_in(kOnlyPocl, "--speculation off").second, HasSubstr("device 0: "));
}

TEST_F(CliHost, OtherCommandsSayThatTheyNeedADevice) {
  const std::string arguments = " bench solvers generate:gyroid_8x8x8_uint8:128";
  expect_error_in(kOnlyPocl, arguments + " --device host", "'host' is no OpenCL device");
  expect_error_in(kOnlyPocl + " ISOWAVE_DEVICE=host", arguments, "'host' (from ISOWAVE_DEVICE)");
}

TEST_F(CliHost, ExtractsTheMeshOfADevice) {
  const std::string extract = " extract generate:gyroid_8x8x8_uint8 -i 128 ",
                    to_file = extract + "-o " + path("a.ply") + " ";
  const auto mesh_in = [&](const std::string &environment, const std::string &options,
                           const std::string &says) {
    const ProgramResult result =
        run_in(environment, to_file + options + " --stats " + path("s.json"));
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr(says)) << options;
    return read_file(folder_ / "a.ply");
  };
  const std::string mesh = mesh_in(kOnlyPocl, "--device cpu", "device 0: ");
  EXPECT_EQ(mesh_in(kOnlyPocl, "", "host: "), mesh);
  EXPECT_EQ(mesh_in(kNoDriver, "", "host: "), mesh);
  EXPECT_EQ(mesh_in(kGpu + " ISOWAVE_DEVICE=host", "", "host memory: "), mesh);
  const json stats = json::parse(read_file(folder_ / "s.json"));
  EXPECT_GT(stats.at("host").at("threads"), 0);
  EXPECT_GT(stats.at("host").at("memory"), 0);
  EXPECT_GT(stats.at("decoded_blocks"), 0);
  EXPECT_GT(stats.at("total_ms"), 0);
  EXPECT_FALSE(stats.contains("device"));
  EXPECT_EQ(mesh_in(kGpu, "", "device 0: "), mesh);
  EXPECT_EQ(mesh_in(kOnlyPocl, "--cache-slots 20", "device 0: "), mesh) << "devices have slots";
  EXPECT_EQ(mesh_in(kOnlyPocl, "--memory-budget 30KB", "device 0: "), mesh) << "too little";
  for (const std::string option : {"--cache-slots", "--stream"}) {
    const std::string given = to_file + option + (option == "--stream" ? " host" : " 20");
    expect_error_in(kOnlyPocl, given + " --device host", option + ": the host has no such option");
    expect_error_in(kNoDriver, given, option + ": it needs an OpenCL device, and there is none");
  }
  expect_error_in(kOnlyPocl, to_file + "--device host --memory-budget 1KB", "raise the limit");
}

TEST_F(CliHost, StatisticsAreThoseThatTheHostHas) {
  const auto stats_of = [&](const std::string &device) {
    draw_in(kOnlyPocl, "--ambient 2 --device " + device + " --stats " + path("s.json"));
    return json::parse(read_file(folder_ / "s.json"));
  };
  const json on_host = stats_of("host"), on_device = stats_of("cpu");
  EXPECT_GT(on_host.at("host").at("threads"), 0);
  EXPECT_GT(on_host.at("host").at("setup_ms"), 0);
  EXPECT_GT(on_host.at("host").at("memory"), 0);
  EXPECT_FALSE(on_host.contains("device"));
  EXPECT_FALSE(on_host.at("options").contains("pipeline"));
  const json &frame = on_host.at("frames").at(0), &expected = on_device.at("frames").at(0);
  for (const char *key : {"isovalue", "view", "camera", "levels", "rays_hit", "cancelled"})
    EXPECT_EQ(frame.at(key), expected.at(key)) << key;
  EXPECT_GT(frame.at("hits_ms"), frame.at("ambient_ms"));
  EXPECT_GT(frame.at("ambient_ms"), 0);
  for (const char *key : {"passes", "per_pass", "normals"}) EXPECT_FALSE(frame.contains(key));
}

TEST_F(CliHost, ABudgetBoundsItsMemory) {
  expect_error_in(kOnlyPocl, kRender + "--device host --memory-budget 1KB", "raise the limit");
  expect_error_in(kNoDriver, kRender + "--memory-budget 1KB", "raise the limit");
  const std::string picture = draw_in(kOnlyPocl, "--device cpu").first;
  const std::string stats = " --stats " + path("s.json");
  EXPECT_EQ(draw_in(kOnlyPocl, "--device host --memory-budget 100KB" + stats).first, picture);
  EXPECT_LE(json::parse(read_file(folder_ / "s.json")).at("host").at("memory"), 100'000);
  draw_in(kOnlyPocl, "--device host" + stats);
  EXPECT_GT(json::parse(read_file(folder_ / "s.json")).at("host").at("memory"), 100'000);
  // A device for the CPU draws what is too large for the host.
  const ProgramResult on_device = run_in(kOnlyPocl, kRender + "--memory-budget 1KB");
  EXPECT_THAT(on_device.out, HasSubstr("device 0: "));
  EXPECT_THAT(on_device.err, HasSubstr("a memory budget of 1000 bytes is too small"));
}

TEST_F(CliHost, ShowsThePictureSoFar) {
  const std::string folder = path("passes");
  const auto [picture, text] = draw_in(kOnlyPocl, "--device host --progress-dir " + folder);
  std::string last;
  for (const auto &file : std::filesystem::directory_iterator(folder_ / "passes"))
    last = std::max(last, file.path().string());
  EXPECT_EQ(read_file(last), picture);
}

}  // namespace
}  // namespace isowave::core
