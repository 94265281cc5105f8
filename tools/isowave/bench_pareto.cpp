#include "tools/isowave/bench_pareto.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/choose_detail.hpp"
#include "core/compare.hpp"
#include "core/error.hpp"
#include "core/flip.hpp"
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
  std::vector<double> max_errors = {0.25, 1, 4};       ///< [pixels]
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

/// What a frame should show.
struct Truth : View {
  explicit Truth(View view) : View(std::move(view)), flip(picture) {}
  Flip flip;
};

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
  double depth_p99 = 0;   ///< [voxels]
  double normal_p99 = 0;  ///< [degrees]
  double flip = 0;
  double psnr_db = std::numeric_limits<double>::infinity();  ///< infinite: the same pictures

  void add(const Truth &truth, const View &view, double voxel) {
    const DepthComparison depth = compare_depth(truth.depth, view.depth);
    pixels += depth.num_pixels;
    missed += depth.false_negatives;
    false_hits += depth.false_positives;
    if (depth.error) depth_p99 = std::max(depth_p99, depth.error->p99 / voxel);
    normal_p99 = std::max(normal_p99, normal_error(truth, view));
    const std::optional<double> psnr = compare_colour(truth.picture, view.picture).psnr_db;
    if (!psnr) return;
    psnr_db = std::min(psnr_db, *psnr);
    flip = std::max(flip, truth.flip.error(view.picture));
  }
};

/// One volume, its views, and what they should show.
struct ParetoSubject {
  std::vector<Camera> cameras;
  ImageSize size;
  double voxel = 0;        ///< longest of its spacings [world units]
  double value_range = 0;  ///< largest minus smallest value
  std::vector<Truth> truth;
};

/// Draws every view `rounds` times from an empty cache. prepare: called before each view.
ordered_json measure(Renderer &renderer, const ParetoSubject &subject, const BenchParetoArgs &options,
                     const std::function<void(const Camera &)> &prepare = {}) {
  std::vector<double> times;
  std::uint64_t decoded = 0;
  Errors errors;
  renderer.render(subject.cameras.front(), options.isovalue);  // the first frame of an isovalue does more
  for (std::size_t view = 0; view < subject.cameras.size(); ++view) {
    if (prepare) prepare(subject.cameras[view]);
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
          {"flip", errors.flip},
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
    subject.truth.emplace_back(view_of(renderer));
  }
  return subject;
}

constexpr const char *kRowFormat =
    "{:<26} {:<6} {:<9} {:>6} {:>6} {:>11} {:>9} {:>9} {:>9} {:>9} {:>7} {:>7} {:>6}\n";

void print_header() {
  fmt::print(kRowFormat, "storage", "", "solver", "px", "value", "bytes", "ms cold", "decoded", "wrong",
             "depth p99", "normal", "FLIP", "PSNR");
}

void add_point(ordered_json &points, ordered_json point, const ordered_json &measured) {
  point.update(measured);
  const auto text = [&](const char *name) {
    return point[name].is_null() ? std::string("by view") : fmt::format("{}", point[name].get<double>());
  };
  const auto number = [&](const char *name) { return point[name].get<double>(); };
  fmt::print(kRowFormat, point["storage"].get<std::string>(), point["pipeline"].get<std::string>(),
             point["max_error"].is_null() ? point["solver"].get<std::string>()
                                          : fmt::format("error {}", number("max_error")),
             text("max_pixel_error"), text("value_error"), with_commas(point["bytes"].get<std::uint64_t>()),
             fmt::format("{:.3f}", number("ms")), with_commas(point["decoded_blocks"].get<std::uint64_t>()),
             fmt::format("{:.2e}", number("wrong_pixels")), fmt::format("{:.2e}", number("depth_p99")),
             fmt::format("{:.2f}", number("normal_p99")), fmt::format("{:.4f}", number("flip")),
             point["psnr_db"].is_null() ? "same" : fmt::format("{:.1f}", number("psnr_db")));
  points.push_back(std::move(point));
}

/// Every pipeline, solver, level of detail and precision of one stored volume.
void sweep(ocl::Device &device, const ParetoSubject &subject, const BenchParetoArgs &options,
           const std::string &storage, const CompressedVolume &volume, ordered_json &points) {
  for (const std::string &pipeline : options.pipelines) {
    for (const std::string &solver : options.solvers) {
      for (const double max_pixel_error : options.max_pixel_errors) {
        if (pipeline == "blocks" && max_pixel_error > 0) continue;
        RendererFlags flags{.pipeline = pipeline, .solver = solver, .values = {}};
        flags.values.max_pixel_error = max_pixel_error;
        Renderer renderer(device, volume, to_renderer_options(flags, subject.size));
        for (const double value_error : options.value_errors) {
          renderer.set_value_error(value_error * subject.value_range);
          add_point(points,
                    {{"storage", storage},
                     {"bytes", stored_bytes(volume, max_pixel_error > 0)},
                     {"rate", volume.rate()},
                     {"pipeline", pipeline},
                     {"solver", solver},
                     {"max_pixel_error", max_pixel_error},
                     {"value_error", value_error},
                     {"max_error", nullptr}},
                    measure(renderer, subject, options));
        }
      }
    }
  }
}

/// What render --max-error chooses for each view.
void choose(ocl::Device &device, const ParetoSubject &subject, const BenchParetoArgs &options,
            const std::string &storage, const CompressedVolume &volume, ordered_json &points) {
  if (options.max_errors.empty()) return;
  Renderer renderer(device, volume, with_choices({.size = subject.size}, volume));
  for (const double max_error : options.max_errors) {
    ordered_json chosen = ordered_json::array();
    const auto prepare = [&](const Camera &camera) {
      const DetailChoice choice = choose_detail(renderer, volume, camera, options.isovalue, max_error);
      chosen.push_back({{"max_pixel_error", choice.detail.max_pixel_error},
                        {"value_error", choice.detail.value_error / subject.value_range},
                        {"reachable", choice.reachable}});
    };
    const ordered_json measured = measure(renderer, subject, options, prepare);
    add_point(points,
              {{"storage", storage},
               {"bytes", stored_bytes(volume, true)},
               {"rate", volume.rate()},
               {"pipeline", "rays"},
               {"solver", to_string(renderer.options().solver)},
               {"max_pixel_error", nullptr},
               {"value_error", nullptr},
               {"max_error", max_error},
               {"chosen", chosen}},
              measured);
  }
}

/// For each choice of --max-error: its time over that of the fastest point of the sweep that is no worse in any error; null where there
/// is none.
void compare_choices(ordered_json &points) {
  for (ordered_json &choice : points) {
    if (choice["max_error"].is_null()) continue;
    const auto is_as_good = [&](const ordered_json &point) {
      return point["max_error"].is_null() &&
             std::ranges::all_of(std::array{"wrong_pixels", "depth_p99", "normal_p99", "flip"},
                                 [&](const char *error) { return point[error] <= choice[error]; });
    };
    choice["over_front"] = nullptr;
    double fastest = std::numeric_limits<double>::infinity();
    for (const ordered_json &point : points) {
      if (is_as_good(point)) fastest = std::min(fastest, point["ms"].get<double>());
    }
    if (!std::isfinite(fastest)) continue;
    choice["over_front"] = choice["ms"].get<double>() / fastest;
    fmt::print("{}, --max-error {}: {:.2f} times the time of the fastest point that is no worse\n",
               choice["storage"].get<std::string>(), choice["max_error"].get<double>(),
               choice["over_front"].get<double>());
  }
}

void run_bench_pareto(BenchParetoArgs options) {
  const std::filesystem::path folder = std::filesystem::path(options.json).parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder))
    throw Error("cannot write {}: {} is no folder", options.json, folder.string());
  if (is_zfp_name(options.input))
    throw Error("{}: is compressed already: give the volume that is to be compressed", options.input);
  for (const std::string &storage : options.storages) parse_storage(storage);
  std::erase(options.max_errors, 0.0);
  for (const double max_error : options.max_errors) check_max_error(max_error);
  const ocl::DeviceInfo info = ocl::choose_device(options.device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  ocl::Device device(info);
  const ParetoSubject subject = make_subject(device, options);
  ordered_json points = ordered_json::array();
  print_header();
  for (const std::string &storage : options.storages) {
    CompressionOptions compression = parse_storage(storage);
    const bool has_levels = !options.max_errors.empty() ||
                            std::ranges::any_of(options.max_pixel_errors, [](double e) { return e > 0; });
    compression.levels = has_levels ? 0 : 1;
    compression.measure_error = !options.max_errors.empty();
    const CompressedVolume volume = load_volume(options.input, to_overrides(options.volume), compression);
    sweep(device, subject, options, storage, volume, points);
    choose(device, subject, options, storage, volume, points);
  }
  compare_choices(points);
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
  command
      ->add_option("--max-error", options->max_errors,
                   "what render chooses for these, as points of their own; a list, 0: none")
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
