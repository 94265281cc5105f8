// The JSON, for each volume and method. Summaries have mean, median, min, max, count; null: there
// are no values.
//
//   new_ms         frames of an isovalue that was not drawn before, from the first camera; caches
//                  are as the frames before have left them
//   next_ms        the same isovalue from the other cameras
//   cold_ms        as new_ms, but nothing is decoded beforehand; rays: from all cameras
//   visible_blocks distinct blocks in which a pass intersects rays (pipeline blocks)
//   active_blocks  distinct blocks that are decoded for a cold frame of rays, or for a mesh
//   touched_blocks distinct blocks whose voxels the rays of a pass look at, in cold first views
//   n_spec         blocks that the rays of a pass are to look ahead at, mean
//   utilization    ray-block pairs that a pass intersects, per pixel
//   completed      rays that have ended after each pass, among all pixels, or among those that met
//                  an active block; a finished frame counts as 100
//   progress       ms since the frame's beginning after each pass of cold first views, with a wait
//                  after each pass
//   look_ahead     "global", the paper's; "per-ray"; "off"; "scanned": global, but rays with few
//                  blocks before them leave places to others
//   limits         cold frames of a tenth of the isovalues, from two cameras, by the most blocks
//                  that rays look ahead at
//   cache          "default" slots of rays, or "one frame": as many as the cold frames needed at
//                  most
//   device_bytes   the peak of all buffers; cache_bytes: those of the block cache among them

#include "tools/isowave/bench_paper.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/file_name.hpp"
#include "core/io/input_file.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "core/platform/names_in.hpp"
#include "tools/isowave/bench_paper_runs.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct BenchPaperArgs {
  std::vector<std::string> inputs;
  VolumeOptions volume;
  CompressionOptions compression;
  std::uint32_t isovalues = 100, views = 10, seed = 1;
  std::string size = "1280x720", device, json, pictures;
  std::vector<std::string> scaling = {"640x360", "1920x1080"};
  std::vector<std::uint32_t> limits = {1, 2, 4, 8, 16, 32, 64};
  std::vector<float> range;  ///< [low, high]; none: the middle 80 % of the values
  std::uint64_t bcmc_budget = 0;
  bool quick = false;
};

/// The part of the protocol that --quick leaves.
constexpr std::uint32_t kQuickIsovalues = 4, kQuickViews = 2;
constexpr const char *kQuickSize = "640x360";

/// Volumes of a folder, by their endings.
bool is_volume_name(const fs::path &path) {
  const std::string name = lower_case(path.filename().string());
  return std::ranges::any_of(
      std::initializer_list<std::string_view>{".raw", ".raw.gz", ".nrrd", ".nhdr", ".mha", ".mhd",
                                              ".nii", ".nii.gz", ".zfp"},
      [&](std::string_view ending) { return name.ends_with(ending); });
}

struct FoundVolumes {
  std::vector<std::string> paths;
  std::vector<std::string> skipped;  ///< why, in a line each
};

/// Throws Error if a volume cannot be opened.
void open_once(const std::string &path, const RawOverrides &overrides) {
  if (is_zfp_name(path)) {
    check_input_file(path);
  } else {
    open_any_volume(path, overrides);
  }
}

/// Folders become the volumes in them, sorted, but for what cannot be opened.
FoundVolumes find_volumes(const std::vector<std::string> &inputs, const RawOverrides &overrides) {
  FoundVolumes found;
  for (const std::string &input : inputs) {
    std::error_code error;
    if (!fs::is_directory(input, error)) {
      open_once(input, overrides);
      found.paths.push_back(input);
      continue;
    }
    std::vector<std::string> names;
    for (const std::string &name : platform::names_in(input)) {
      const fs::path file = fs::path(input) / name;
      if (fs::is_regular_file(file, error) && is_volume_name(file)) names.push_back(file.string());
    }
    std::ranges::sort(names);
    const std::size_t before = found.paths.size();
    for (const std::string &name : names) {
      try {
        open_once(name, overrides);
        found.paths.push_back(name);
      } catch (const Error &why) {
        found.skipped.emplace_back(why.what());
      }
    }
    if (found.paths.size() == before) throw Error("{}: a folder without a volume", input);
  }
  return found;
}

std::array<float, 2> range_of(const BenchPaperArgs &options, const CompressedVolume &volume) {
  if (!options.range.empty()) return {options.range[0], options.range[1]};
  const double low = volume.value_range[0], high = volume.value_range[1];
  return {static_cast<float>(low + 0.1 * (high - low)),
          static_cast<float>(low + 0.9 * (high - low))};
}

/// The same for every standard library: the engine's numbers are, distributions are not.
std::vector<float> random_isovalues(std::uint32_t count, std::array<float, 2> range,
                                    std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<float> isovalues(count);
  for (float &isovalue : isovalues) {
    const double part = static_cast<double>(random()) * 0x1p-32;
    isovalue = static_cast<float>(range[0] + part * (double{range[1]} - range[0]));
  }
  return isovalues;
}

constexpr const char *kPaperRow = "{:<18} {:>10} {:>9} {:>9} {:>9} {:>7} {:>11} {:>11} {:>9}\n";

void print_method(const ordered_json &row) {
  const auto median = [&](const char *name) {
    const auto found = row.find(name);
    return found == row.end() || found->is_null()
               ? std::string()
               : fmt::format("{:.2f}", found->at("median").get<double>());
  };
  const bool is_bcmc = row.at("method") == "bcmc";
  const std::string name = is_bcmc
                               ? row.at("memory_budget") == 0 ? "bcmc growing" : "bcmc bounded"
                               : fmt::format("{} {}", row.at("method").get<std::string>(),
                                             row.at("cache") != "default"        ? "one frame"
                                             : row.at("look_ahead") == "scanned" ? "scanned"
                                             : row.at("speculation").get<bool>() ? ""
                                                                                 : "without spec.");
  if (is_bcmc && !row.at("refused").is_null()) {
    fmt::print("{:<18} {}\n", name, row.at("refused").get<std::string>());
    return;
  }
  const double active = row.at("active_blocks").at("mean").get<double>();
  fmt::print(kPaperRow, name,
             fmt::format("{}x{}", row.at("size")[0].get<int>(), row.at("size")[1].get<int>()),
             median("new_ms"), median("next_ms"), median("cold_ms"), median("passes"),
             with_commas(static_cast<std::uint64_t>(active)),
             with_commas(static_cast<std::uint64_t>(row.at("cache_slots").get<double>())),
             fmt::format("{:.0f}", row.at("device_bytes").get<double>() / (1 << 20)));
}

ordered_json measure_volume(const ocl::DeviceInfo &device, const BenchPaperArgs &options,
                            const std::string &path, const CompressedVolume &volume) {
  const VolumeInfo &info = volume.info;
  const std::array<float, 2> range = range_of(options, volume);
  const PaperRun run{volume, random_isovalues(options.isovalues, range, options.seed),
                     orbit_cameras(info, options.views), parse_size(options.size)};
  PaperRun part = run;  // a tenth of the isovalues, but four, if there are as many
  part.isovalues.resize(
      std::min(run.isovalues.size(), std::max<std::size_t>(4, run.isovalues.size() / 10)));
  PaperRun few = part;  // a frame may take as long as a new mesh
  few.cameras.resize(std::min<std::size_t>(2, run.cameras.size()));
  const PaperParts parts;
  fmt::print("{}: {}x{}x{}, isovalues {:.4g} to {:.4g}\n", one_line(path), info.dims.x, info.dims.y,
             info.dims.z, range[0], range[1]);
  fmt::print(kPaperRow, "method", "size", "ms new", "ms next", "ms cold", "passes", "active blk",
             "cache slots", "MiB");
  ordered_json methods = ordered_json::array();
  const auto add = [&](ordered_json row) {
    print_method(row);
    methods.push_back(std::move(row));
  };
  double most_active = 0;  // blocks of a cold frame
  for (const PipelinePtr &pipeline : {blocks_pipeline(), rays_pipeline()}) {
    for (const LookAhead look_ahead : {LookAhead::kDefault, LookAhead::kOff}) {
      add(measure_rays(device, run, {pipeline, look_ahead}, parts));
      if (blocks_options(*pipeline) != nullptr || look_ahead == LookAhead::kOff) continue;
      most_active = methods.back().at("active_blocks").at("max").get<double>();
    }
  }
  add(measure_rays(
      device, run,
      {.cache_slots = std::max(kMinCacheSlots, static_cast<std::uint32_t>(most_active))}, parts));
  const auto bytes_of_rays = methods.back().at("device_bytes").get<std::uint64_t>();
  add(measure_bcmc(device, run, 0, parts));
  add(measure_bcmc(device, few, options.bcmc_budget != 0 ? options.bcmc_budget : bytes_of_rays,
                   parts));
  for (const std::string &size : options.scaling) {
    part.size = parse_size(size);
    for (const PipelinePtr &pipeline : {blocks_pipeline(), rays_pipeline()})
      add(measure_rays(device, part, {pipeline}, parts));
    add(measure_bcmc(device, part, 0, parts));
  }
  const RayMethod scanned{blocks_pipeline(), LookAhead::kScanned};
  add(measure_rays(device, run, scanned, parts));
  ordered_json limits = ordered_json::array();
  for (const RayMethod &method : {RayMethod{blocks_pipeline()}, scanned, RayMethod{}})
    limits.push_back(measure_limits(device, few, method, options.limits));
  std::string pictures;
  if (!options.pictures.empty())
    pictures = (fs::path(options.pictures) / ("paper_" + volume_stem(path))).string();
  const ordered_json agreement = compare_methods(device, run, pictures);
  if (!agreement.is_null())
    fmt::print("rays and triangles agree on {:.2f} % of the pixels\n",
               agreement.at("percent").get<double>());
  return {{"volume", path},
          {"dims", {info.dims.x, info.dims.y, info.dims.z}},
          {"blocks", volume.block_count()},
          {"rate", volume.rate()},
          {"compressed_bytes", (volume.payload_bits() + 7) / 8},
          {"decoded_bytes", ISO_BLOCK_VOXELS * sizeof(float) * volume.block_count()},
          {"range", {range[0], range[1]}},
          {"isovalues", run.isovalues},
          {"agreement", agreement},
          {"methods", methods},
          {"limits", limits}};
}

/// Throws Error on what no volume is needed to refuse.
void check_args(const BenchPaperArgs &options) {
  check_image_size(parse_size(options.size));
  for (const std::string &size : options.scaling) check_image_size(parse_size(size));
  if (!options.range.empty() && !(options.range[0] < options.range[1]))
    throw Error("--range {} {}: give the lower isovalue first", options.range[0], options.range[1]);
}

void run_bench_paper(const BenchPaperArgs &options) {
  check_args(options);
  const auto [volumes, skipped] = find_volumes(options.inputs, to_overrides(options.volume));
  Outputs outputs;
  for (const std::string &volume : volumes) outputs.read_volume(volume);
  outputs.write("--json", options.json);
  check_json_name(options.json);
  if (!options.pictures.empty()) outputs.write_pictures("--pictures", options.pictures, "paper");
  const ocl::DeviceInfo info = ocl::choose_device(options.device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  for (const std::string &why : skipped) fmt::print("skipped: {}\n", one_line(why));
  if (!options.pictures.empty()) outputs.make_folder();
  ordered_json measured = ordered_json::array();
  for (const std::string &path : volumes) {
    CompressionOptions compression = options.compression;
    if (is_zfp_name(path) && volumes.size() > 1) compression = {};  // of the others
    std::optional<ocl::Device> device;
    if (!is_zfp_name(path)) device.emplace(info);
    const CompressedVolume volume =
        load_volume(path, to_overrides(options.volume), compression, device ? &*device : nullptr);
    device.reset();  // what it had is no part of the frames'
    measured.push_back(measure_volume(info, options, path, volume));
  }
  if (options.json.empty()) return;
  write_json({{"schema", kChartsSchema},
              {"benchmark", "paper"},
              {"program", program_name()},
              {"device", device_json(info)},
              {"date", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::chrono::system_clock::now()))},
              {"seed", options.seed},
              {"volumes", measured}},
             options.json);
}

}  // namespace

void add_bench_paper(CLI::App &bench) {
  CLI::App *command = bench.add_subcommand(
      "paper", "The paper's evaluation: both pipelines beside Block-Compressed Marching Cubes");
  const auto options = std::make_shared<BenchPaperArgs>();
  command
      ->add_option("VOLUME", options->inputs,
                   "a .zfp file, " + std::string(kVolumeHelp) + ", or a folder: all volumes in it")
      ->required();
  CLI::Option *isovalues =
      command->add_option("--isovalues", options->isovalues, "number of random isovalues")
          ->check(CLI::Range(1u, 10000u))
          ->capture_default_str();
  CLI::Option *views =
      command->add_option("--views", options->views, "views on an orbit, for each isovalue")
          ->check(CLI::Range(1u, 1000u))
          ->capture_default_str();
  CLI::Option *size =
      command->add_option("--size", options->size, "picture size WxH")->capture_default_str();
  CLI::Option *scaling =
      command
          ->add_option("--scaling", options->scaling,
                       "further sizes, for a tenth of the isovalues, at least four; a list")
          ->delimiter(',')
          ->capture_default_str();
  command
      ->add_option("--limits", options->limits,
                   "most blocks that a ray may look ahead at, 1 to 64, to compare passes and "
                   "decoded blocks; a list")
      ->check(CLI::Range(1u, 64u))
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  command
      ->add_option("--range", options->range,
                   "isovalues of interest, LOW HIGH [the middle 80 % of the values]")
      ->expected(2)
      ->check(fits_float32());
  command->add_option("--seed", options->seed, "seed of the isovalues")->capture_default_str();
  command
      ->add_option("--bcmc-budget", options->bcmc_budget,
                   "memory budget of bounded Block-Compressed Marching Cubes [memory of pipeline "
                   "rays with slots for a frame]")
      ->transform(byte_count())
      ->type_name("BYTES");
  command->add_flag(
      "--quick", options->quick,
      fmt::format("{} isovalues, {} views, {}, no further sizes, unless other options "
                  "say otherwise: shows that all works",
                  kQuickIsovalues, kQuickViews, kQuickSize));
  add_volume_options(*command, options->volume);
  add_compression_options(*command, options->compression);
  command->add_option("--device", options->device,
                      "device: index, cpu, gpu, or a part of its name");
  command->add_option("--pictures", options->pictures,
                      "folder for two pictures of each volume: its first view by rays, and by "
                      "triangles");
  command->add_option("--json", options->json, "file for all results, as JSON");
  command->callback([=] {
    if (options->quick) {
      if (isovalues->count() == 0) options->isovalues = kQuickIsovalues;
      if (views->count() == 0) options->views = kQuickViews;
      if (size->count() == 0) options->size = kQuickSize;
      if (scaling->count() == 0) options->scaling.clear();
    }
    run_bench_paper(*options);
  });
}

}  // namespace isowave::core::tools
