#include "tools/isowave/bench_pareto.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/accuracy/choose_detail.hpp"
#include "core/accuracy/compare.hpp"
#include "core/accuracy/flip.hpp"
#include "core/accuracy/with_choices.hpp"
#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/io/file_name.hpp"
#include "core/io/open_volume.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/accuracy.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/renderer_options.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;

struct BenchParetoArgs {
  std::string input, size = "640x360", device, json;
  float isovalue = 0;
  VolumeOptions volume;
  std::vector<std::string> storages = {"rate:2", "rate:4", "rate:8", "tolerance-relative:0.01",
                                       "tolerance-relative:0.002"};
  std::vector<std::string> pipelines = {"rays", "blocks"}, solvers = {"linear", "bernstein"};
  std::vector<double> all_voxel_pixels = {0, 0.5, 1, 2};
  std::vector<double> voxel_errors = {0, 0.01, 0.04};     ///< as parts of the range of values
  std::vector<double> max_surface_errors = {0.25, 1, 4};  ///< [pixels]
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
  const std::string_view value =
      colon == std::string::npos ? "" : std::string_view(text).substr(colon + 1);
  const std::optional<std::uint64_t> rate = parse_whole(value);
  const std::optional<double> number = parse_finite(value);
  if (kind == "rate" && rate && *rate >= 1 && *rate <= 32) {
    options.rate = static_cast<std::uint32_t>(*rate);
  } else if (kind == "tolerance" && number && *number > 0) {
    options.tolerance = number;
  } else if (kind == "tolerance-relative" && number && *number > 0) {
    options.relative_tolerance = number;
  } else {
    throw Error("--storage {}: give rate:R, tolerance:E, tolerance-relative:E or exact", text);
  }
  return options;
}

/// The images of a frame.
struct View {
  FloatImage depth;
  Image8 picture;
  std::vector<HitRecord> hits;
};

View view_of(DeviceRenderer &renderer) {
  View view;
  view.hits = renderer.hits();
  view.picture = renderer.shade();
  view.depth = {view.picture.width, view.picture.height, depth_of(view.hits)};
  return view;
}

/// The images that a frame should have.
struct Truth : View {
  explicit Truth(View view) : View(std::move(view)), flip(picture) {}
  Flip flip;
};

/// Angles between the gradients, in index space, of pixels with a hit in both: 99th percentile
/// [degrees].
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

  double wrong_pixels() const { return double(missed + false_hits) / double(pixels); }

  bool no_worse_than(const Errors &other) const {
    return wrong_pixels() <= other.wrong_pixels() && depth_p99 <= other.depth_p99 &&
           normal_p99 <= other.normal_p99 && flip <= other.flip;
  }

  void add(const Errors &other) {
    pixels += other.pixels;
    missed += other.missed;
    false_hits += other.false_hits;
    depth_p99 = std::max(depth_p99, other.depth_p99);
    normal_p99 = std::max(normal_p99, other.normal_p99);
    flip = std::max(flip, other.flip);
    psnr_db = std::min(psnr_db, other.psnr_db);
  }
};

Errors errors_of(const Truth &truth, const View &view, double voxel) {
  Errors errors;
  const DepthComparison depth = compare_depth(truth.depth, view.depth);
  errors.pixels = depth.num_pixels;
  errors.missed = depth.false_negatives;
  errors.false_hits = depth.false_positives;
  if (depth.error) errors.depth_p99 = depth.error->p99 / voxel;
  errors.normal_p99 = normal_error(truth, view);
  const std::optional<double> psnr = compare_colour(truth.picture, view.picture).psnr_db;
  if (!psnr) return errors;
  errors.psnr_db = *psnr;
  errors.flip = truth.flip.error(view.picture);
  return errors;
}

/// One volume, its views, and what they should show.
struct ParetoSubject {
  std::vector<Camera> cameras;
  ImageSize size;
  double voxel = 0;        ///< longest of its spacings [world units]
  double value_range = 0;  ///< largest minus smallest value
  float isovalue = 0;
  std::uint32_t rounds = 0;  ///< times that each view is drawn
  std::vector<Truth> truth;  ///< of each view
};

/// A volume as it is stored.
struct Stored {
  std::string name;  ///< as parse_storage() reads it
  CompressedVolume volume;
};

/// One way to draw all views, and what it costs.
struct Point {
  const Stored *stored = nullptr;
  std::string pipeline = "rays";
  std::string solver{to_string(kDefaultSolver)};
  std::vector<Detail> details;              ///< of each view
  std::optional<double> max_surface_error;  ///< [pixels], for which they were chosen
  std::vector<bool> reachable;              ///< DetailChoice::reachable, of each view
  double ms = 0;                            ///< median of all cold frames
  std::uint64_t decoded_blocks = 0;         ///< mean of the views
  Errors errors;
  std::optional<double> over_front;  ///< see compare_choices()
};

/// Whether the levels of detail must be there for it.
bool has_levels(const Point &point) {
  return point.max_surface_error || point.details.front().voxel_pixels > 0;
}

DeviceRenderer make_renderer(ocl::Device &device, const ParetoSubject &subject,
                             const Point &point) {
  RendererFlags flags{.pipeline = point.pipeline, .solver = point.solver, .values = {}};
  if (!point.max_surface_error) flags.voxel_pixels = point.details.front().voxel_pixels;
  const RendererOptions options = to_renderer_options(flags, subject.size);
  const CompressedVolume &volume = point.stored->volume;
  return DeviceRenderer(device, volume,
                        point.max_surface_error ? with_choices(options, volume) : options);
}

FrameRequest request_of(const ParetoSubject &subject, const Point &point, std::size_t view) {
  FrameRequest request =
      with_detail({subject.cameras[view], subject.isovalue}, point.details[view]);
  request.normals = Normals::kCell;
  return request;
}

/// Draws one view of the point once: the first frame of an isovalue, or of a precision, does more.
void warm_up(DeviceRenderer &renderer, const ParetoSubject &subject, const Point &point,
             std::size_t view) {
  renderer.render(request_of(subject, point, view));
}

FrameStats draw_cold(DeviceRenderer &renderer, const ParetoSubject &subject, const Point &point,
                     std::size_t view) {
  renderer.clear_cache();
  return renderer.render(request_of(subject, point, view));
}

/// Draws every view `rounds` times from an empty cache.
void measure(DeviceRenderer &renderer, const ParetoSubject &subject, Point &point) {
  std::vector<double> times;
  std::uint64_t decoded = 0;
  std::vector<View> views;
  for (std::size_t view = 0; view < subject.cameras.size(); ++view) {
    warm_up(renderer, subject, point, view);
    for (std::uint32_t round = 0; round < subject.rounds; ++round) {
      const FrameStats stats = draw_cold(renderer, subject, point, view);
      times.push_back(stats.total_ms);
      for (const PassStats &pass : stats.passes)
        decoded += round == 0 ? pass.counts.decoded_count : 0;
    }
    views.push_back(view_of(renderer));
  }
  std::vector<Errors> errors(views.size());
  parallel_for(views.size(), 0, [&](std::uint64_t view, std::uint32_t) {
    errors[view] = errors_of(subject.truth[view], views[view], subject.voxel);
  });
  for (const Errors &of_view : errors) point.errors.add(of_view);
  point.ms = quantiles(std::move(times)).p50;
  point.decoded_blocks = decoded / subject.cameras.size();
}

/// How many times as long as the other one takes: the median of cold frames drawn in turn.
double time_ratio(ocl::Device &device, const ParetoSubject &subject, const Point &point,
                  const Point &other) {
  DeviceRenderer renderer = make_renderer(device, subject, point),
                 others = make_renderer(device, subject, other);
  std::vector<double> ratios;
  for (std::size_t view = 0; view < subject.cameras.size(); ++view) {
    warm_up(renderer, subject, point, view);
    warm_up(others, subject, other, view);
    for (std::uint32_t round = 0; round < subject.rounds; ++round) {
      const double ms = draw_cold(renderer, subject, point, view).total_ms;
      ratios.push_back(ms / draw_cold(others, subject, other, view).total_ms);
    }
  }
  return quantiles(std::move(ratios)).p50;
}

/// Bytes of the stored volume that frames need.
std::uint64_t stored_bytes(const CompressedVolume &volume, bool with_levels) {
  std::uint64_t bytes =
      (volume.payload_bits() + 7) / 8 + volume.index.size() * sizeof(std::uint32_t);
  for (const CompressedVolume &level : volume.coarser_levels)
    bytes += with_levels ? stored_bytes(level, false) : 0;
  return bytes;
}

ParetoSubject make_subject(ocl::Device &device, const BenchParetoArgs &options) {
  ParetoSubject subject;
  subject.size = parse_size(options.size);
  subject.isovalue = options.isovalue;
  subject.rounds = options.rounds;
  check_image_size(subject.size);
  const RawOverrides overrides = to_overrides(options.volume);
  const CompressedVolume finest = load_volume(options.input, overrides, {});  // the truth
  const VolumeInfo &info = finest.info;
  subject.cameras = orbit_cameras(info, options.views);
  subject.voxel = std::max({info.spacing.x, info.spacing.y, info.spacing.z});
  subject.value_range = double{finest.value_range[1]} - double{finest.value_range[0]};
  DeviceRenderer renderer(device, finest, {.size = subject.size});
  for (const Camera &camera : subject.cameras) {
    renderer.render({.camera = camera, .isovalue = options.isovalue, .normals = Normals::kCell});
    subject.truth.emplace_back(view_of(renderer));
  }
  return subject;
}

std::uint64_t stored_bytes(const Point &point) {
  return stored_bytes(point.stored->volume, has_levels(point));
}

constexpr const char *kRowFormat =
    "{:<26} {:<6} {:<9} {:>6} {:>6} {:>11} {:>9} {:>9} {:>9} {:>9} {:>7} {:>7} {:>6}\n";

void print_header() {
  fmt::print(kRowFormat, "storage", "", "solver", "px", "value", "bytes", "ms cold", "decoded",
             "wrong", "depth p99", "normal", "FLIP", "PSNR");
}

/// The error as a part of the range of values, which may be 0 if the error is 0.
double part_of(double value_range, double voxel_error) {
  return voxel_error == 0 ? 0 : voxel_error / value_range;
}

void print(const Point &point, double value_range) {
  const auto text = [&](double number) {
    return point.max_surface_error ? "by view" : fmt::format("{:.4g}", number);
  };
  const Errors &errors = point.errors;
  fmt::print(
      kRowFormat, point.stored->name, point.pipeline,
      point.max_surface_error ? fmt::format("error {}", *point.max_surface_error) : point.solver,
      text(point.details.front().voxel_pixels),
      text(part_of(value_range, point.details.front().voxel_error)),
      with_commas(stored_bytes(point)), fmt::format("{:.3f}", point.ms),
      with_commas(point.decoded_blocks), fmt::format("{:.2e}", errors.wrong_pixels()),
      fmt::format("{:.2e}", errors.depth_p99), fmt::format("{:.2f}", errors.normal_p99),
      fmt::format("{:.4f}", errors.flip),
      std::isfinite(errors.psnr_db) ? fmt::format("{:.1f}", errors.psnr_db) : "same");
}

ordered_json to_json(const Point &point, double value_range) {
  const auto or_null = [](const std::optional<double> &number) {
    return number ? ordered_json(*number) : ordered_json();
  };
  const auto detail_json = [&](const Detail &detail) -> ordered_json {
    return {{"voxel_pixels", detail.voxel_pixels},
            {"voxel_error", part_of(value_range, detail.voxel_error)}};
  };
  const Errors &errors = point.errors;
  ordered_json json = {
      {"storage", point.stored->name},
      {"bytes", stored_bytes(point)},
      {"rate", point.stored->volume.rate()},
      {"pipeline", point.pipeline},
      {"solver", point.solver},
      {"voxel_pixels", nullptr},
      {"voxel_error", nullptr},
      {"max_surface_error", or_null(point.max_surface_error)},
      {"ms", point.ms},
      {"decoded_blocks", point.decoded_blocks},
      {"wrong_pixels", errors.wrong_pixels()},
      {"missed", errors.missed},
      {"false", errors.false_hits},
      {"depth_p99", errors.depth_p99},
      {"normal_p99", errors.normal_p99},
      {"flip", errors.flip},
      {"psnr_db", std::isfinite(errors.psnr_db) ? ordered_json(errors.psnr_db) : ordered_json()}};
  if (!point.max_surface_error) {
    json.update(detail_json(point.details.front()));
    return json;
  }
  json["chosen"] = ordered_json::array();
  for (std::size_t view = 0; view < point.details.size(); ++view) {
    json["chosen"].push_back(detail_json(point.details[view]));
    json["chosen"].back()["reachable"] = bool{point.reachable[view]};
  }
  json["over_front"] = or_null(point.over_front);
  return json;
}

/// Every pipeline, solver, level of detail and precision of one stored volume.
void sweep(ocl::Device &device, const ParetoSubject &subject, const BenchParetoArgs &options,
           const Stored &stored, std::vector<Point> &points) {
  for (const std::string &pipeline : options.pipelines) {
    for (const std::string &solver : options.solvers) {
      for (const double voxel_pixels : options.all_voxel_pixels) {
        if (pipeline == "blocks" && voxel_pixels > 0) continue;
        Point point;
        point.stored = &stored;
        point.pipeline = pipeline;
        point.solver = solver;
        point.details.resize(subject.cameras.size(), Detail{.voxel_pixels = voxel_pixels});
        DeviceRenderer renderer = make_renderer(device, subject, point);
        for (const double voxel_error : options.voxel_errors) {
          for (Detail &detail : point.details)
            detail.voxel_error = voxel_error * subject.value_range;
          points.push_back(point);
          measure(renderer, subject, points.back());
          print(points.back(), subject.value_range);
        }
      }
    }
  }
}

/// The detail that render --max-surface-error chooses for each view.
void choose(ocl::Device &device, const ParetoSubject &subject, const BenchParetoArgs &options,
            const Stored &stored, std::vector<Point> &points) {
  if (options.max_surface_errors.empty()) return;
  Point any;
  any.stored = &stored;
  any.max_surface_error = options.max_surface_errors.front();
  DeviceRenderer renderer = make_renderer(device, subject, any);
  for (const double max_surface_error : options.max_surface_errors) {
    Point point = any;
    point.max_surface_error = max_surface_error;
    for (const Camera &camera : subject.cameras) {
      const DetailChoice choice =
          choose_detail(renderer, stored.volume, {camera, subject.isovalue}, max_surface_error);
      point.details.push_back(choice.detail);
      point.reachable.push_back(choice.reachable);
    }
    measure(renderer, subject, point);
    print(point, subject.value_range);
    points.push_back(std::move(point));
  }
}

/// Sets Point::over_front of the choices of --max-surface-error: how many times as long they take
/// as the fastest point of the sweep that is no worse in any error; none if all are worse. The
/// two are drawn in turn, once more: of many points that take as long, the one that seemed to be
/// the fastest mostly was lucky.
void compare_choices(ocl::Device &device, const ParetoSubject &subject,
                     std::vector<Point> &points) {
  for (Point &choice : points) {
    if (!choice.max_surface_error) continue;
    const Point *fastest = nullptr;
    for (const Point &point : points) {
      if (!point.max_surface_error && point.errors.no_worse_than(choice.errors) &&
          (!fastest || point.ms < fastest->ms))
        fastest = &point;
    }
    if (!fastest) continue;
    choice.over_front = time_ratio(device, subject, choice, *fastest);
    fmt::print(
        "{}, --max-surface-error {}: {:.2f} times the time of the fastest point that is no worse\n",
        choice.stored->name, *choice.max_surface_error, *choice.over_front);
  }
}

void run_bench_pareto(BenchParetoArgs options) {
  Outputs outputs;
  outputs.read_volume(options.input);
  outputs.write("--json", options.json);
  check_json_name(options.json);
  for (const std::string &solver : options.solvers) solver_from_string(solver);
  if (is_zfp_name(options.input))
    throw Error("{}: is compressed already: give the volume that is to be compressed",
                options.input);
  for (const std::string &storage : options.storages) parse_storage(storage);
  std::erase(options.max_surface_errors, 0.0);
  for (const double max_surface_error : options.max_surface_errors)
    check_max_surface_error(max_surface_error);
  const ocl::DeviceInfo info = ocl::choose_device(options.device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  ocl::Device device(info);
  const ParetoSubject subject = make_subject(device, options);
  std::vector<Stored> stored;
  for (const std::string &storage : options.storages) {
    CompressionOptions compression = parse_storage(storage);
    const bool with_levels =
        !options.max_surface_errors.empty() ||
        std::ranges::any_of(options.all_voxel_pixels, [](double e) { return e > 0; });
    compression.levels = with_levels ? 0 : 1;
    compression.measure_error = !options.max_surface_errors.empty();
    stored.push_back(
        {storage, load_volume(options.input, to_overrides(options.volume), compression)});
  }
  std::vector<Point> points;
  print_header();
  for (const Stored &volume : stored) {
    sweep(device, subject, options, volume, points);
    choose(device, subject, options, volume, points);
  }
  compare_choices(device, subject, points);
  if (options.json.empty()) return;
  ordered_json json = ordered_json::array();
  for (const Point &point : points) json.push_back(to_json(point, subject.value_range));
  write_json({{"schema", kChartsSchema},
              {"benchmark", "pareto"},
              {"device", device_json(info)},
              {"date", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::chrono::system_clock::now()))},
              {"volume", options.input},
              {"isovalue", options.isovalue},
              {"size", {subject.size.width, subject.size.height}},
              {"views", options.views},
              {"rounds", options.rounds},
              {"points", json}},
             options.json);
}

}  // namespace

void add_bench_pareto(CLI::App &bench) {
  CLI::App *command = bench.add_subcommand("pareto",
                                           "Bytes and ms of cold frames beside their errors, for "
                                           "storage, pipeline, solver, level and precision");
  const auto options = std::make_shared<BenchParetoArgs>();
  command->add_option("VOLUME", options->input, kVolumeHelp)->required();
  command->add_option("--isovalue,-i", options->isovalue, "isovalue")
      ->check(fits_float32())
      ->required();
  add_volume_options(*command, options->volume);
  command
      ->add_option("--storage", options->storages,
                   "ways to compress the volume: rate:R, tolerance:E, tolerance-relative:E or "
                   "exact; a list")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--pipeline", options->pipelines, "pipelines: rays, blocks; a list")
      ->delimiter(',')
      ->check(CLI::IsMember({"rays", "blocks"}))
      ->capture_default_str();
  command
      ->add_option("--solver", options->solvers,
                   "root finders: linear, marmitt, analytic, bernstein; a list")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--voxel-pixels", options->all_voxel_pixels,
                   "as for render; pipeline blocks takes only 0; a list")
      ->delimiter(',')
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--voxel-error", options->voxel_errors,
                   "as for render, but as parts of the range of values; a list")
      ->delimiter(',')
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--max-surface-error", options->max_surface_errors,
                   "as for render, 0: none; each value is one more point; a list")
      ->delimiter(',')
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--size", options->size, "picture size WxH")->capture_default_str();
  command->add_option("--views", options->views, "views around the volume")
      ->check(CLI::Range(1u, 1000u))
      ->capture_default_str();
  command
      ->add_option("--rounds", options->rounds,
                   "number of times that each view is drawn; the median counts")
      ->check(CLI::Range(1u, 10000u))
      ->capture_default_str();
  command->add_option("--device", options->device,
                      "device: index, cpu, gpu, or a part of its name");
  command->add_option("--json", options->json, "file for the results, for tools/charts");
  command->callback([options] { run_bench_pareto(*options); });
}

}  // namespace isowave::core::tools
