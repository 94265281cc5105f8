// `isowave devices`: which OpenCL devices there are and what they can do.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/ocl/device.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/render_stats.hpp"

namespace isowave::core::tools {

namespace {

constexpr std::size_t kNumColumns = 11;
using Row = std::array<std::string, kNumColumns>;

std::string mebibytes(std::uint64_t bytes) {
  return fmt::format("{} MiB", bytes >> 20);
}

/// The optional features that a device has, in words.
std::string features(const ocl::Capabilities &can) {
  std::string text;
  const auto add = [&text](bool has, const char *name) {
    if (has) text += (text.empty() ? "" : ",") + std::string(name);
  };
  add(can.int64_atomics, "int64-atomics");
  add(can.fp64, "fp64");
  add(can.sub_groups, "sub-groups");
  add(can.correctly_rounded_divide, "exact-divide");
  add(can.denormals, "denormals");
  return text.empty() ? "-" : text;
}

/// "OpenCL 3.0" of "OpenCL 3.0 PoCL HSTR: ...": --json has the rest.
std::string short_version(const std::string &version) {
  return version.substr(0, version.find(' ', version.find(' ') + 1));
}

Row table_row(const ocl::DeviceInfo &info, bool is_default) {
  const ocl::Capabilities &can = info.capabilities;
  return {fmt::format("{} {}", is_default ? '*' : ' ', info.index),
          std::string(to_string(info.type)),
          info.name,
          info.platform,
          short_version(info.device_version),
          std::to_string(can.compute_units),
          mebibytes(can.global_memory),
          mebibytes(can.largest_allocation),
          fmt::format("{} KiB", can.local_memory >> 10),
          std::to_string(can.max_work_group_size),
          features(can)};
}

void print_table(const std::vector<ocl::DeviceInfo> &devices,
                 std::optional<std::uint32_t> default_index) {
  std::vector<Row> rows = {{"  #", "type", "name", "platform", "version", "units", "memory",
                            "largest buffer", "local", "group", "features"}};
  for (const ocl::DeviceInfo &info : devices)
    rows.push_back(table_row(info, info.index == default_index));
  std::array<std::size_t, kNumColumns> widths{};
  for (const Row &row : rows) {
    for (std::size_t i = 0; i < kNumColumns; ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  for (const Row &row : rows) {
    std::string line;
    for (std::size_t i = 0; i < kNumColumns; ++i) line += fmt::format("{:{}}  ", row[i], widths[i]);
    line.erase(line.find_last_not_of(' ') + 1);
    fmt::print("{}\n", line);
  }
}

void print_json(const std::vector<ocl::DeviceInfo> &devices,
                std::optional<std::uint32_t> default_index) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ocl::DeviceInfo &info : devices) {
    nlohmann::ordered_json entry = device_json(info);
    entry["default"] = info.index == default_index;
    list.push_back(std::move(entry));
  }
  fmt::print("{}", json_text(list));
}

void run_devices(bool as_json) {
  const std::vector<ocl::DeviceInfo> devices = ocl::list_devices();
  std::optional<std::uint32_t> default_index;
  try {
    default_index = ocl::choose_device().index;
  } catch (const Error &error) {
    if (devices.empty()) throw;
    // A wrong ISOWAVE_DEVICE must not hide the list that helps to correct it.
    fmt::print(stderr, "isowave: {}\n", error.what());
  }
  if (as_json) {
    print_json(devices, default_index);
  } else {
    print_table(devices, default_index);
  }
}

}  // namespace

void add_devices(CLI::App &app) {
  CLI::App *command =
      app.add_subcommand("devices", "List the OpenCL devices; * marks the one taken by default");
  const auto as_json = std::make_shared<bool>(false);
  command->add_flag("--json", *as_json, "Print a JSON array instead of a table");
  command->callback([as_json] { run_devices(*as_json); });
}

}  // namespace isowave::core::tools
