// `isowave devices`: what draws: OpenCL devices and what they can do, and the host.

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
#include "core/base/parallel_for.hpp"
#include "core/ocl/device.hpp"
#include "core/platform/memory.hpp"
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

Row host_row(bool is_default) {
  return {is_default ? "* -" : "  -",
          "host",
          "isowave itself",
          "-",
          "-",
          std::to_string(thread_count(0)),
          mebibytes(platform::host_memory()),
          "-",
          "-",
          "-",
          "-"};
}

void print_table(const std::vector<ocl::DeviceInfo> &devices,
                 std::optional<std::uint32_t> default_index, bool draws_on_host) {
  std::vector<Row> rows = {{"  #", "type", "name", "platform", "version", "units", "memory",
                            "largest buffer", "local", "group", "features"}};
  for (const ocl::DeviceInfo &info : devices)
    rows.push_back(table_row(info, info.index == default_index));
  rows.push_back(host_row(draws_on_host));
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
  const bool draws_on_host = ocl::choose_drawing() != ocl::DrawsOn::kDevice;
  std::optional<std::uint32_t> default_index;
  try {
    if (!draws_on_host) default_index = ocl::choose_device().index;
  } catch (const Error &error) {
    if (devices.empty()) throw;
    // A wrong ISOWAVE_DEVICE must not hide the list that helps to correct it.
    fmt::print(stderr, "isowave: {}\n", error.what());
  }
  if (!as_json) {
    print_table(devices, default_index, draws_on_host);
  } else if (!devices.empty()) {
    print_json(devices, default_index);
  }
  if (devices.empty()) ocl::pick_device(devices, "", "");  // throws: says what to install
}

}  // namespace

void add_devices(CLI::App &app) {
  CLI::App *command =
      app.add_subcommand("devices",
                         "List what draws: OpenCL devices, and the host, which needs no "
                         "OpenCL; * marks what `render` draws on by default");
  const auto as_json = std::make_shared<bool>(false);
  command->add_flag("--json", *as_json, "Print a JSON array of the devices instead of a table");
  command->callback([as_json] { run_devices(*as_json); });
}

}  // namespace isowave::core::tools
