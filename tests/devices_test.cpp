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

TEST(DevicesCommand, JsonListsEveryDeviceAndOneDefault) {
  const auto [status, output] = run(test::isowave_program() + " devices --json");
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
    EXPECT_EQ(entry.at("default"), info.index == ocl::choose_device().index);
  }
}

TEST(DevicesCommand, TableMarksTheDefault) {
  const auto [status, output] = run(test::isowave_program() + " devices");
  ASSERT_EQ(status, 0) << output;
  const ocl::DeviceInfo chosen = ocl::choose_device();
  EXPECT_THAT(output, HasSubstr(fmt::format("\n* {}  {}", chosen.index, to_string(chosen.type))));
  EXPECT_THAT(output, HasSubstr(chosen.name));
}

TEST(DevicesCommand, WrongEnvironmentStillListsTheDevices) {
  const auto [status, output] =
      run("ISOWAVE_DEVICE=no-such-device " + test::isowave_program() + " devices 2>&1");
  EXPECT_EQ(status, 0);
  EXPECT_THAT(output, HasSubstr("'no-such-device' (from ISOWAVE_DEVICE)"));
  EXPECT_THAT(output, HasSubstr(ocl::list_devices().at(0).name));
}

}  // namespace
}  // namespace isowave::core
