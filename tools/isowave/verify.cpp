// isowave verify: the stability suite and the watertight test for each solver, and whole frames of real volumes, judged by
// the root oracle.

#include <fmt/format.h>

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/error.hpp"
#include "core/frame.hpp"
#include "reference/accuracy.hpp"
#include "reference/root_oracle.hpp"
#include "reference/scalar_renderer.hpp"
#include "reference/stability_suite.hpp"
#include "reference/watertight.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::tools {

namespace {

using nlohmann::ordered_json;

struct Options {
  std::string input;
  VolumeOptions volume;
  FrameOptions frame;
  std::vector<std::string> solvers;
  std::uint32_t rays = 20000, seed = 1;
  std::uint64_t watertight = 1000000;
  std::string json;
};

ordered_json quantiles_json(const Quantiles &q) {
  return {{"p50", q.p50}, {"p99", q.p99}, {"max", q.max}};
}

ordered_json accuracy_json(const Accuracy &tally) {
  return {{"rays", tally.rays},
          {"hits", tally.hits},
          {"missed", tally.missed},
          {"false", tally.false_hits},
          {"unstable", tally.unstable},
          {"distance_voxels", quantiles_json(quantiles(tally.distance))},
          {"residual_voxels", quantiles_json(quantiles(tally.residual))}};
}

void print_header(const char *what) {
  fmt::print("{:<28} {:>9} {:>9} {:>8} {:>8} {:>8}  {:<26} {}\n", what, "rays", "hits", "missed", "false",
             "unstable", "|dt| p50, p99, max [voxels]", "|f-iso|/|grad f| p99, max");
}

void print_row(std::string_view name, const Accuracy &tally) {
  const Quantiles distance = quantiles(tally.distance), residual = quantiles(tally.residual);
  fmt::print("{:<28} {:>9} {:>9} {:>8} {:>8} {:>8}  {:.1e}, {:.1e}, {:.1e}  {:.1e}, {:.1e}\n", name,
             tally.rays, tally.hits, tally.missed, tally.false_hits, tally.unstable, distance.p50,
             distance.p99, distance.max, residual.p99, residual.max);
}

/// Returns the failures of the solver: rays missed, false or leaked.
std::uint64_t verify_solver(const Options &options, std::string_view name, ordered_json &document) {
  const Solver solver = solver_from_string(name);
  fmt::print("solver {}\n", name);
  std::uint64_t failures = 0;
  ordered_json cases = ordered_json::array();
  print_header("case");
  for (const StabilityCase &stability_case : stability_cases(options.rays, options.seed)) {
    const CaseResult result = run_case(stability_case, solver);
    print_row(stability_case.name, result.accuracy);
    failures += result.failures();
    ordered_json entry = accuracy_json(result.accuracy);
    entry["resumed_differently"] = result.resumed_differently;
    entry["passes"] = passes(result);
    entry["name"] = stability_case.name;
    entry["description"] = stability_case.description;
    cases.push_back(std::move(entry));
  }
  ordered_json surfaces = ordered_json::array();
  for (const WatertightResult &result : run_watertight(options.watertight, options.seed, solver)) {
    fmt::print("watertight {:<17} {:>9} rays, {} leaks\n", result.surface, result.rays, result.leaks);
    failures += result.leaks;
    surfaces.push_back({{"surface", result.surface}, {"rays", result.rays}, {"leaks", result.leaks}});
  }
  document["solvers"].push_back({{"solver", name},
                                 {"cases", std::move(cases)},
                                 {"watertight", std::move(surfaces)},
                                 {"failures", failures}});
  return failures;
}

std::uint64_t verify_frames(const Options &options, ordered_json &document) {
  const Scene scene = load_scene(options.input, options.volume, options.frame);
  const std::vector<float> voxels = decode_with_libzfp(scene.volume);
  const glm::uvec3 dims = scene.volume.info.dims;
  std::uint64_t failures = 0;
  for (const std::string &name : options.solvers) {
    print_header(name.c_str());
    for (const float isovalue : options.frame.isovalues) {
      const RootOracle oracle(voxels, {dims.x, dims.y, dims.z}, isovalue);
      for (std::size_t view = 0; view < scene.cameras.size(); ++view) {
        const FrameParams frame =
            make_frame_params(scene.volume.info, scene.cameras[view], scene.size, isovalue);
        const Accuracy tally =
            judge_frame(oracle, frame, render_scalar(frame, voxels, solver_from_string(name)));
        print_row(fmt::format("isovalue {}, view {}", isovalue, view), tally);
        failures += tally.missed + tally.false_hits;
        ordered_json entry = accuracy_json(tally);
        entry["volume"] = options.input;
        entry["solver"] = name;
        entry["isovalue"] = isovalue;
        entry["view"] = view;
        document["frames"].push_back(std::move(entry));
      }
    }
  }
  return failures;
}

void run_verify(Options options) {
  const bool all = options.solvers.empty();
  if (all) options.solvers.assign(kSolverNames.begin(), kSolverNames.end());
  ordered_json document = {{"program", "isowave 0.1.0"}, {"seed", options.seed}};
  std::uint64_t failures = 0;
  const std::string_view judged = all ? to_string(kDefaultSolver) : std::string_view{};
  if (!options.input.empty()) {
    if (all) options.solvers = {std::string(judged)};
    failures = verify_frames(options, document);
  } else {
    for (const std::string &name : options.solvers) {
      const std::uint64_t found = verify_solver(options, name, document);
      if (judged.empty() || name == judged)
        failures += found;  // the others are expected to fail: that is shown
    }
  }
  if (!options.json.empty()) write_json(document, options.json);
  if (failures != 0) throw Error("{} rays were missed, false or leaked", failures);
}

}  // namespace

void add_verify(CLI::App &app) {
  CLI::App *command = app.add_subcommand(
      "verify", "Judge the intersection by an exact oracle: the stability suite, or frames of a volume");
  const auto options = std::make_shared<Options>();
  command->add_option("VOLUME", options->input,
                      "judge frames of this volume, drawn by the scalar reference, instead of the suite");
  add_volume_options(*command, options->volume);
  add_frame_options(*command, options->frame);
  command->add_option(
      "--solver", options->solvers,
      "linear, marmitt, analytic, bernstein; repeat it [suite: all; frames: the default one]");
  command->add_option("--rays", options->rays, "rays per case of the suite")->capture_default_str();
  command->add_option("--watertight", options->watertight, "rays per surface of the watertight test")
      ->capture_default_str();
  command->add_option("--seed", options->seed, "of the suite's fields and rays")->capture_default_str();
  command->add_option("--json", options->json, "write the results as JSON");
  command->callback([options] { run_verify(*options); });
}

}  // namespace isowave::tools
