// isowave verify: the stability suite and the watertight test for each solver, judged by the root
// oracle; whole frames of real volumes are in verify_frames.cpp.

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/error.hpp"
#include "core/io/file_name.hpp"
#include "core/io/json_list.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/stability_suite.hpp"
#include "reference/watertight.hpp"
#include "reference/watertight_device.hpp"
#include "tools/isowave/accuracy_report.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/compile_report.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/verify_errors.hpp"
#include "tools/isowave/verify_frames.hpp"
#include "tools/isowave/verify_layers.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;

struct VerifyArgs {
  VerifyFramesOptions frames;
  std::vector<std::string> solvers;
  std::uint32_t rays = 20000, seed = 1;
  std::uint64_t watertight = 1000000;
  std::string json;
};

/// Prints and adds the surfaces of one watertight test. Returns its leaks.
std::uint64_t report_watertight(std::string_view by, const std::vector<WatertightResult> &results,
                                ordered_json &surfaces) {
  std::uint64_t leaks = 0;
  for (const WatertightResult &result : results) {
    fmt::print("watertight, {:<16} {:<20} {:>9} rays, {} leaks\n", by, result.surface, result.rays,
               result.leaks);
    leaks += result.leaks;
    surfaces.push_back(
        {{"by", by}, {"surface", result.surface}, {"rays", result.rays}, {"leaks", result.leaks}});
  }
  return leaks;
}

/// Tests the twin and, if there is a device, each of its pipelines. Returns the leaks.
std::uint64_t verify_watertight(const VerifyArgs &options, Solver solver, ocl::Device *device,
                                ordered_json &surfaces) {
  std::uint64_t leaks = 0;
  for (const RayBands bands : {RayBands::kOne, RayBands::kLevels}) {
    leaks += report_watertight(
        "twin", run_watertight(options.watertight, options.seed, solver, bands), surfaces);
    for (const PipelinePtr &pipeline : {rays_pipeline(), blocks_pipeline()}) {
      if (device == nullptr || (bands == RayBands::kLevels && !pipeline->has_levels())) continue;
      CompileReport compiling(*device);
      const auto results =
          run_watertight_on(*device, pipeline, options.watertight, options.seed, solver, bands);
      compiling.finish();
      leaks += report_watertight(fmt::format("pipeline {}", pipeline->name()), results, surfaces);
    }
  }
  return leaks;
}

/// The device that the watertight test is for; none if there is no device.
std::unique_ptr<ocl::Device> open_device(const VerifyArgs &options) {
  if (options.watertight == 0) return nullptr;
  if (options.frames.device.empty() && ocl::list_devices().empty()) {
    fmt::print("no OpenCL device: the watertight test is the twin's alone\n");
    return nullptr;
  }
  const ocl::DeviceInfo info = ocl::choose_device(options.frames.device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  return std::make_unique<ocl::Device>(info);
}

/// Returns the failures of the solver: rays missed, false, wrong or leaked. device: for the
/// watertight test, or none.
std::uint64_t verify_solver(const VerifyArgs &options, std::string_view name, ocl::Device *device,
                            ordered_json &document) {
  const Solver solver = solver_from_string(name);
  fmt::print("solver {}\n", name);
  std::uint64_t failures = 0;
  ordered_json cases = ordered_json::array();
  print_accuracy_header("case");
  for (const StabilityCase &stability_case : stability_cases(options.rays, options.seed)) {
    const CaseResult result = run_case(stability_case, solver);
    print_accuracy(stability_case.name, result.accuracy);
    failures += result.failures();
    ordered_json entry = accuracy_json(result.accuracy);
    entry["resumed_differently"] = result.resumed_differently;
    entry["passes"] = passes(result);
    entry["name"] = stability_case.name;
    entry["description"] = stability_case.description;
    cases.push_back(std::move(entry));
  }
  ordered_json surfaces = ordered_json::array();
  failures += verify_watertight(options, solver, device, surfaces);
  add_to_list(document, "solvers",
              ordered_json{{"solver", name},
                           {"cases", std::move(cases)},
                           {"watertight", std::move(surfaces)},
                           {"failures", failures}});
  return failures;
}

/// Checks that need only the options.
void check_options(const CLI::App &command, const VerifyArgs &options) {
  for (const std::string &name : options.solvers) solver_from_string(name);
  if (options.frames.input.empty()) {
    refuse_options(command,
                   {"--oracle", "--clip", "--clip-box", "--no-caps", "--surface", "--isovalue",
                    "--voxel-error", "--size", "--orbit", "--cameras", "--dims", "--type",
                    "--spacing", "--rate", "--tolerance", "--tolerance-relative", "--exact"},
                   "is for frames: give a VOLUME");
  } else {
    refuse_options(command, {"--rays", "--watertight", "--seed"},
                   "is for the suite: leave out VOLUME");
    if (options.frames.frame.isovalues.empty() && options.frames.surfaces.empty())
      throw Error("{}: give --isovalue or --surface", options.frames.input);
  }
  if (!read_clip(options.frames.clip, {}).planes.empty()) {
    refuse_options(command, {"--oracle"}, "clipped frames have an oracle of their own");
    refuse_options(command, {"--max-surface-error"}, "errors are proven of whole surfaces");
  }
  if (!options.frames.surfaces.empty()) {
    refuse_options(command, {"--isovalue", "--oracle", "--solver", "--max-surface-error"},
                   "frames of --surface have isovalues, an oracle and a solver of their own");
  }
  if (options.frames.device == "host")
    refuse_options(command, {"--solver"}, "the host draws by the default solver");
  refuse_options(command, {"--levels"},
                 options.frames.max_surface_error ? "--max-surface-error has all levels of detail"
                                                  : "the finest level alone is judged");
  Outputs outputs;
  outputs.read_volume(options.frames.input);
  if (!options.frames.frame.cameras.empty()) outputs.read(options.frames.frame.cameras);
  outputs.write("--json", options.json);
  check_json_name(options.json);
}

void run_verify(const CLI::App &command, VerifyArgs options) {
  check_options(command, options);
  const bool all = options.solvers.empty();
  if (all) options.solvers.assign(kSolverNames.begin(), kSolverNames.end());
  ordered_json document = {{"program", program_name()}, {"seed", options.seed}};
  std::uint64_t failures = 0;
  const std::string_view judged = all ? to_string(kDefaultSolver) : std::string_view{};
  if (options.frames.max_surface_error) {
    if (options.frames.input.empty() || !all)
      throw Error("--max-surface-error is for frames by the default solver: give a VOLUME alone");
    failures = verify_errors(options.frames, document);
  } else if (!options.frames.surfaces.empty()) {
    failures = verify_layers(options.frames, document);
  } else if (!options.frames.input.empty()) {
    if (all) options.solvers = {std::string(judged)};
    failures = verify_frames(options.frames, options.solvers, document);
  } else {
    const std::unique_ptr<ocl::Device> device = open_device(options);
    if (device) document["device"] = device_json(device->info());
    for (const std::string &name : options.solvers) {
      // Solvers that are expected to leak are not compiled for that.
      ocl::Device *const tested = judged.empty() || name == judged ? device.get() : nullptr;
      const std::uint64_t found = verify_solver(options, name, tested, document);
      if (judged.empty() || name == judged)
        failures += found;  // the others are expected to fail: that is shown
    }
  }
  if (!options.json.empty()) write_json(document, options.json);
  if (failures != 0 && options.frames.max_surface_error)
    throw Error("{} pixels are farther off than their bounds", failures);
  if (failures != 0)
    throw Error("{} rays were missed, false, in a wrong cell or place, or leaked", failures);
}

}  // namespace

void add_verify(CLI::App &app) {
  CLI::App *command = app.add_subcommand(
      "verify",
      "Judge the intersection by independent oracles: the stability suite, or frames of a volume");
  const auto options = std::make_shared<VerifyArgs>();
  add_verify_frames_options(*command, options->frames);
  command->add_option(
      "--solver", options->solvers,
      "root finder: linear, marmitt, analytic or bernstein; repeat it [suite: all; frames: the "
      "default one]");
  command->add_option("--rays", options->rays, "rays per case of the suite")
      ->check(CLI::Range(1u, 100'000'000u))
      ->capture_default_str();
  command
      ->add_option("--watertight", options->watertight,
                   "rays per surface of the watertight test, for the twin and for each pipeline of "
                   "the device")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000'000}))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "seed of the suite's fields and rays")
      ->capture_default_str();
  command->add_option("--json", options->json, "file for the results, as JSON");
  command->callback([command, options] { run_verify(*command, *options); });
}

}  // namespace isowave::core::tools
