#include "tools/isowave/bench_topology.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/error.hpp"
#include "core/io/file_name.hpp"
#include "core/mesh/host_extractor.hpp"
#include "reference/mesh_topology.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;

struct BenchTopologyArgs {
  std::string input, json;
  float isovalue = 0;
  VolumeOptions volume;
};

/// A component of fewer triangles is small: specks of noise have a dozen.
constexpr std::uint64_t kFewTriangles = 64;

struct Surface {
  Mesh mesh;
  MeshComponents components;

  Surface(const CompressedVolume &volume, float isovalue) {
    extract_on_host(volume, isovalue, {.with_normals = false}, mesh);
    components = components_of(mesh);
  }
};

/// Components that another surface lacks.
struct Lacking {
  std::uint64_t all = 0, large = 0;
};

Lacking count_lacking(const Surface &surface, const Surface &other, const VolumeInfo &info,
                      double reach) {
  const std::vector<bool> lacks =
      lacking(surface.mesh, surface.components, other.mesh, info, reach);
  Lacking count;
  for (std::size_t component = 0; component < lacks.size(); ++component) {
    count.all += lacks[component];
    count.large += lacks[component] && surface.components.num_triangles[component] >= kFewTriangles;
  }
  return count;
}

constexpr const char *kTopologyRow = "{:<28} {:>10} {:>10} {:>9} {:>11} {:>9} {:>11}\n";

/// Compares a surface with the true one, and prints the row.
///
/// reach  see lacking() [voxels of the finest level]
ordered_json compare_surfaces(const std::string &name, const Surface &truth, const Surface &surface,
                              const VolumeInfo &info, double reach) {
  const Lacking lost = count_lacking(truth, surface, info, reach),
                false_ones = count_lacking(surface, truth, info, reach);
  fmt::print(kTopologyRow, name, with_commas(surface.components.count()), surface.components.euler,
             with_commas(lost.all), with_commas(lost.large), with_commas(false_ones.all),
             with_commas(false_ones.large));
  return {{"stored", name},
          {"components", surface.components.count()},
          {"euler", surface.components.euler},
          {"lost", lost.all},
          {"lost_large", lost.large},
          {"false", false_ones.all},
          {"false_large", false_ones.large}};
}

void run_bench_topology(const BenchTopologyArgs &options) {
  Outputs outputs;
  outputs.read_volume(options.input);
  outputs.write("--json", options.json);
  check_json_name(options.json);
  if (is_zfp_name(options.input))
    throw Error("{}: is compressed already: give the volume that is to be compressed",
                options.input);
  const RawOverrides overrides = to_overrides(options.volume);
  const CompressedVolume finest = load_volume(options.input, overrides, {.levels = 0});
  const Surface truth(finest, options.isovalue);
  const auto large = std::ranges::count_if(
      truth.components.num_triangles, [](std::uint64_t count) { return count >= kFewTriangles; });
  fmt::print("{} components, {} of {} or more triangles; Euler's characteristic {}\n",
             with_commas(truth.components.count()), with_commas(std::uint64_t(large)),
             kFewTriangles, truth.components.euler);
  fmt::print(kTopologyRow, "", "components", "Euler", "lost", "lost, large", "false",
             "false, large");
  ordered_json rows = ordered_json::array();
  for (const std::uint32_t rate : {8u, 4u, 2u, 1u}) {
    const CompressedVolume volume = load_volume(options.input, overrides, {.rate = rate});
    rows.push_back(compare_surfaces(fmt::format("--rate {}", rate), truth,
                                    Surface(volume, options.isovalue), finest.info, 1));
  }
  for (const double part : {0.002, 0.01, 0.05}) {
    const CompressedVolume volume =
        load_volume(options.input, overrides, {.tolerance_relative = part});
    rows.push_back(compare_surfaces(fmt::format("--tolerance-relative {}", part), truth,
                                    Surface(volume, options.isovalue), finest.info, 1));
  }
  for (std::size_t level = 1; level <= std::min<std::size_t>(finest.coarser_levels.size(), 3);
       ++level) {
    rows.push_back(compare_surfaces(fmt::format("level of detail {}", level), truth,
                                    Surface(finest.coarser_levels[level - 1], options.isovalue),
                                    finest.info, double(1u << level)));
  }
  if (options.json.empty()) return;
  write_json({{"schema", kChartsSchema},
              {"benchmark", "topology"},
              {"date", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::chrono::system_clock::now()))},
              {"volume", options.input},
              {"dims", {finest.info.dims.x, finest.info.dims.y, finest.info.dims.z}},
              {"isovalue", options.isovalue},
              {"components", truth.components.count()},
              {"large", large},
              {"euler", truth.components.euler},
              {"rows", rows}},
             options.json);
}

}  // namespace

void add_bench_topology(CLI::App &bench) {
  CLI::App *command = bench.add_subcommand(
      "topology",
      "Components of an isosurface that are lost, or false, with fewer bits and in "
      "coarser levels of detail");
  const auto options = std::make_shared<BenchTopologyArgs>();
  command->add_option("VOLUME", options->input, kVolumeHelp)->required();
  command->add_option("--isovalue,-i", options->isovalue, "isovalue")
      ->check(fits_float32())
      ->required();
  add_volume_options(*command, options->volume);
  command->add_option("--json", options->json, "file for the results, for tools/charts");
  command->callback([options] { run_bench_topology(*options); });
}

}  // namespace isowave::core::tools
