#include "tools/isowave/bench_pareto.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/compare.hpp"
#include "core/error.hpp"
#include "core/renderer.hpp"
#include "reference/accuracy.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/renderer_options.hpp"

namespace isowave::tools {

namespace {

using nlohmann::ordered_json;

struct BenchParetoArgs {
  std::string input, size = "640x360", device, json;
  float isovalue = 0;
  VolumeOptions volume;
  std::vector<std::string> storages = {"rate:2", "rate:4", "rate:8", "tolerance-relative:0.01",
                                       "tolerance-relative:0.002"};
  std::vector<std::string> pipelines = {"rays", "blocks"}, solvers = {"linear", "bernstein"};
  std::vector<double> max_pixel_errors = {0, 0.5, 1, 2};
  std::vector<double> value_errors = {0, 0.01, 0.04};  ///< as parts of the range of values
  std::uint32_t views = 3, rounds = 3;
};

/// "rate:4", "tolerance:0.5", "tolerance-relative:0.01" or "exact".
CompressionOptions parse_storage(const std::string &text) {
  CompressionOptions options;
  const std::size_t colon = text.find(':');
  const std::string kind = text.substr(0, colon);
  if (text == "exact") {
    options.exact = true;
    return options;
  }
  double number = 0;
  if (colon == std::string::npos || !CLI::detail::lexical_cast(text.substr(colon + 1), number))
    throw Error("--storage {}: give rate:R, tolerance:E, tolerance-relative:E or exact", text);
  if (kind == "rate") {
    options.rate = static_cast<std::uint32_t>(number);
  } else if (kind == "tolerance") {
    options.tolerance = number;
  } else if (kind == "tolerance-relative") {
    options.relative_tolerance = number;
  } else {
    throw Error("--storage {}: give rate:R, tolerance:E, tolerance-relative:E or exact", text);
  }
  return options;
}

/// What a frame shows.
struct View {
  FloatImage depth;
  Image8 picture;
  std::vector<HitRecord> hits;
};

View view_of(Renderer &renderer) {
  View view;
  view.hits = renderer.hits();
  view.picture = renderer.shade();
  view.depth = {view.picture.width, view.picture.height, depth_of(view.hits)};
  return view;
}

/// Angles between the gradients, in index space, where both have a hit: 99th percentile [degrees].
double normal_error(const View &truth, const View &view) {
  std::vector<double> angles;
  for (std::size_t i = 0; i < view.hits.size(); ++i) {
    const HitRecord &a = truth.hits[i], &b = view.hits[i];
    const glm::dvec3 m(a.grad_x, a.grad_y, a.grad_z), n(b.grad_x, b.grad_y, b.grad_z);
    const double lengths = glm::length(m) * glm::length(n);
    if (std::isfinite(a.t) && std::isfinite(b.t) && lengths > 0)
      angles.push_back(glm::degrees(std::acos(std::clamp(glm::dot(m, n) / lengths, -1.0, 1.0))));
  }
  return quantiles(std::move(angles)).p99;
}

/// The worst of the views, but the sums of pixels.
struct Errors {
  std::uint64_t pixels = 0, missed = 0, false_hits = 0;
  double depth_p99 = 0;                                      ///< [voxels]
  double normal_p99 = 0;                                     ///< [degrees]
  double psnr_db = std::numeric_limits<double>::infinity();  ///< infinite: the same pictures

  void add(const View &truth, const View &view, double voxel) {
    const DepthComparison depth = compare_depth(truth.depth, view.depth);
    pixels += depth.num_pixels;
    missed += depth.false_negatives;
    false_hits += depth.false_positives;
    if (depth.error) depth_p99 = std::max(depth_p99, depth.error->p99 / voxel);
    normal_p99 = std::max(normal_p99, normal_error(truth, view));
    psnr_db = std::min(psnr_db, compare_colour(truth.picture, view.picture).psnr_db.value_or(psnr_db));
  }
};

/// One volume, its views, and what they should show.
struct ParetoSubject {
  std::vector<Camera> cameras;
  ImageSize size;
  double voxel = 0;        ///< longest of its spacings [world units]
  double value_range = 0;  ///< largest minus smallest value
  std::vector<View> truth;
};

/// Draws every view `rounds` times from an empty cache.
ordered_json measure(Renderer &renderer, const ParetoSubject &subject, const BenchParetoArgs &options) {
  std::vector<double> times;
  std::uint64_t decoded = 0;
  Errors errors;
  renderer.render(subject.cameras.front(), options.isovalue);  // the first frame of an isovalue does more
  for (std::size_t view = 0; view < subject.cameras.size(); ++view) {
    for (std::uint32_t round = 0; round < options.rounds; ++round) {
      renderer.clear_cache();
      const FrameStats stats = renderer.render(subject.cameras[view], options.isovalue);
      times.push_back(stats.total_ms);
      for (const PassStats &pass : stats.passes) decoded += round == 0 ? pass.counts.decoded_count : 0;
    }
    errors.add(subject.truth[view], view_of(renderer), subject.voxel);
  }
  return {{"ms", quantiles(times).p50},
          {"decoded_blocks", decoded / subject.cameras.size()},
          {"wrong_pixels", double(errors.missed + errors.false_hits) / double(errors.pixels)},
          {"missed", errors.missed},
          {"false", errors.false_hits},
          {"depth_p99", errors.depth_p99},
          {"normal_p99", errors.normal_p99},
          {"psnr_db", std::isfinite(errors.psnr_db) ? ordered_json(errors.psnr_db) : ordered_json()}};
}

/// The source as exactly as it can be stored: the truth.
CompressionOptions finest_storage(VoxelType type) {
  CompressionOptions options;
  options.exact = is_integer(type) && size_of(type) < sizeof(float);
  options.rate = 32;
  return options;
}

/// What frames need of the volume.
std::uint64_t stored_bytes(const CompressedVolume &volume, bool with_levels) {
  std::uint64_t bytes = (volume.payload_bits() + 7) / 8 + volume.index.size() * sizeof(std::uint32_t);
  for (const CompressedVolume &level : volume.coarser) bytes += with_levels ? stored_bytes(level, false) : 0;
  return bytes;
}

ParetoSubject make_subject(ocl::Device &device, const BenchParetoArgs &options) {
  ParetoSubject subject;
  subject.size = parse_size(options.size);
  check_image_size(subject.size);
  const RawOverrides overrides = to_overrides(options.volume);
  const CompressedVolume finest = load_volume(
      options.input, overrides, finest_storage(open_any_volume(options.input, overrides)->info().type));
  const VolumeInfo &info = finest.info;
  subject.cameras = orbit_cameras(info, options.views);
  subject.voxel = std::max({info.spacing.x, info.spacing.y, info.spacing.z});
  subject.value_range = double{finest.value_range[1]} - double{finest.value_range[0]};
  Renderer renderer(device, finest, {.size = subject.size});
  for (const Camera &camera : subject.cameras) {
    renderer.render(camera, options.isovalue);
    subject.truth.push_back(view_of(renderer));
  }
  return subject;
}

/// Every pipeline, solver, level of detail and precision of one stored volume.
void sweep(ocl::Device &device, const ParetoSubject &subject, const BenchParetoArgs &options,
           const std::string &storage, ordered_json &points) {
  CompressionOptions compression = parse_storage(storage);
  const bool has_levels = std::ranges::any_of(options.max_pixel_errors, [](double e) { return e > 0; });
  compression.levels = has_levels ? 0 : 1;
  const CompressedVolume volume = load_volume(options.input, to_overrides(options.volume), compression);
  for (const std::string &pipeline : options.pipelines) {
    for (const std::string &solver : options.solvers) {
      for (const double max_pixel_error : options.max_pixel_errors) {
        if (pipeline == "blocks" && max_pixel_error > 0) continue;
        RendererFlags flags{.pipeline = pipeline, .solver = solver, .values = {}};
        flags.values.max_pixel_error = max_pixel_error;
        Renderer renderer(device, volume, to_renderer_options(flags, subject.size));
        for (const double value_error : options.value_errors) {
          renderer.set_value_error(value_error * subject.value_range);
          ordered_json point = {
              {"storage", storage},        {"bytes", stored_bytes(volume, max_pixel_error > 0)},
              {"rate", volume.rate()},     {"pipeline", pipeline},
              {"solver", solver},          {"max_pixel_error", max_pixel_error},
              {"value_error", value_error}};
          point.update(measure(renderer, subject, options));
          fmt::print(
              "{:<26} {:<6} {:<9} {:>5} {:>6} {:>10} {:>9.3f} {:>9} {:>9.2e} {:>9.2e} {:>7.2f} {:>6}\n",
              storage, pipeline, solver, max_pixel_error, value_error,
              with_commas(point["bytes"].get<std::uint64_t>()), point["ms"].get<double>(),
              with_commas(point["decoded_blocks"].get<std::uint64_t>()), point["wrong_pixels"].get<double>(),
              point["depth_p99"].get<double>(), point["normal_p99"].get<double>(),
              point["psnr_db"].is_null() ? "same" : fmt::format("{:.1f}", point["psnr_db"].get<double>()));
          points.push_back(std::move(point));
        }
      }
    }
  }
}

void run_bench_pareto(const BenchParetoArgs &options) {
  const std::filesystem::path folder = std::filesystem::path(options.json).parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder))
    throw Error("cannot write {}: {} is no folder", options.json, folder.string());
  if (is_zfp_name(options.input))
    throw Error("{}: is compressed already: give the volume that is to be compressed", options.input);
  for (const std::string &storage : options.storages) parse_storage(storage);
  const ocl::DeviceInfo info = ocl::choose_device(options.device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  ocl::Device device(info);
  const ParetoSubject subject = make_subject(device, options);
  ordered_json points = ordered_json::array();
  fmt::print("{:<26} {:<6} {:<9} {:>5} {:>6} {:>10} {:>9} {:>9} {:>9} {:>9} {:>7} {:>6}\n", "storage", "",
             "solver", "px", "value", "bytes", "ms cold", "decoded", "wrong", "depth p99", "normal", "PSNR");
  for (const std::string &storage : options.storages) sweep(device, subject, options, storage, points);
  if (options.json.empty()) return;
  write_json({{"schema", kChartsSchema},
              {"benchmark", "pareto"},
              {"device", device_json(info)},
              {"date", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::chrono::system_clock::now()))},
              {"volume", options.input},
              {"isovalue", options.isovalue},
              {"size", {subject.size.width, subject.size.height}},
              {"views", options.views},
              {"rounds", options.rounds},
              {"points", points}},
             options.json);
}

}  // namespace

void add_bench_pareto(CLI::App &bench) {
  CLI::App *command = bench.add_subcommand(
      "pareto",
      "Bytes and ms of cold frames beside their errors, for storage, pipeline, solver, level and precision");
  const auto options = std::make_shared<BenchParetoArgs>();
  command->add_option("VOLUME", options->input, kVolumeHelp)->required();
  command->add_option("--isovalue,-i", options->isovalue, "isovalue")->required();
  add_volume_options(*command, options->volume);
  command
      ->add_option("--storage", options->storages,
                   "how the volume is compressed: rate:R, tolerance:E, tolerance-relative:E or exact; a list")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--pipeline", options->pipelines, "rays, blocks; a list")
      ->delimiter(',')
      ->check(CLI::IsMember({"rays", "blocks"}))
      ->capture_default_str();
  command->add_option("--solver", options->solvers, "linear, marmitt, analytic, bernstein; a list")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--max-pixel-error", options->max_pixel_errors,
                   "see render; a list; pipeline blocks takes 0 only")
      ->delimiter(',')
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--value-error", options->value_errors,
                   "see render, but as parts of the range of values; a list")
      ->delimiter(',')
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--size", options->size, "picture size WxH")->capture_default_str();
  command->add_option("--views", options->views, "views around the volume")
      ->check(CLI::Range(1u, 1000u))
      ->capture_default_str();
  command->add_option("--rounds", options->rounds, "times that each view is drawn; the median of all counts")
      ->check(CLI::Range(1u, 10000u))
      ->capture_default_str();
  command->add_option("--device", options->device, "device: index, cpu, gpu, or a part of its name");
  command->add_option("--json", options->json, "write the results for tools/charts");
  command->callback([options] { run_bench_pareto(*options); });
}

}  // namespace isowave::tools
