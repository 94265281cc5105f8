// `isowave devices`: what it prints is what list_devices() says.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/ocl/device.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;

/// Exit status and standard output of a shell command.
std::pair<int, std::string> run(const std::string &command) {
  std::FILE *pipe = popen(command.c_str(), "r");
  if (!pipe) return {-1, "popen failed"};
  std::string output;
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) output += static_cast<char>(c);
  return {pclose(pipe), output};
}

/// `isowave devices` in that environment, whatever test::isowave_program() would have it draw on.
std::string devices(const std::string &environment) {
  return environment + test::quoted(test::program_path()) + " devices";
}

bool draws_on_host() {
  return ocl::choose_drawing() != ocl::DrawsOn::kDevice;
}

TEST(DevicesCommand, JsonListsEveryDeviceAndOneDefault) {
  const auto [status, output] = run(devices("") + " --json");
  ASSERT_EQ(status, 0) << output;
  const nlohmann::json list = nlohmann::json::parse(output);
  const std::vector<ocl::DeviceInfo> devices = ocl::list_devices();
  ASSERT_EQ(list.size(), devices.size());
  for (const ocl::DeviceInfo &info : devices) {
    const nlohmann::json &entry = list.at(info.index);
    EXPECT_EQ(entry.at("index"), info.index);
    EXPECT_EQ(entry.at("name"), info.name);
    EXPECT_EQ(entry.at("type"), to_string(info.type));
    EXPECT_EQ(entry.at("fp64"), info.capabilities.fp64);
    EXPECT_EQ(entry.at("default"), !draws_on_host() && info.index == ocl::choose_device().index);
  }
}

TEST(DevicesCommand, TableMarksTheDefault) {
  const ocl::DeviceInfo info = ocl::choose_device();
  const std::string device = fmt::format(" {}  {}", info.index, to_string(info.type));
  const auto expect_default = [&](const std::string &environment, bool is_host) {
    const auto [status, output] = run(devices(environment));
    ASSERT_EQ(status, 0) << output;
    EXPECT_THAT(output, HasSubstr((is_host ? "\n " : "\n*") + device));
    EXPECT_THAT(output, HasSubstr(info.name));
    EXPECT_THAT(output, HasSubstr(is_host ? "\n* -  host " : "\n  -  host "));
  };
  expect_default("", draws_on_host());
  expect_default("ISOWAVE_DEVICE=host ", true);
  expect_default(fmt::format("ISOWAVE_DEVICE={} ", info.index), false);
}

/// The host can draw, and the status tells scripts that no device is there.
TEST(DevicesCommand, WithoutDevicesTheHostIsListedAndTheErrorSaysWhatToInstall) {
  const auto result = test::run_command(devices("OCL_ICD_VENDORS=/nonexistent "));
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.out, HasSubstr("\n* -  host "));
  EXPECT_THAT(result.err, HasSubstr("pocl-opencl-icd"));
  const auto json = test::run_command(devices("OCL_ICD_VENDORS=/nonexistent ") + " --json");
  EXPECT_EQ(json.status, 1);
  EXPECT_EQ(json.out, "");
}

TEST(DevicesCommand, WrongEnvironmentStillListsTheDevices) {
  const auto [status, output] = run(devices("ISOWAVE_DEVICE=no-such-device ") + " 2>&1");
  EXPECT_EQ(status, 0);
  EXPECT_THAT(output, HasSubstr("'no-such-device' (from ISOWAVE_DEVICE)"));
  EXPECT_THAT(output, HasSubstr(ocl::list_devices().at(0).name));
}

}  // namespace
}  // namespace isowave::core
