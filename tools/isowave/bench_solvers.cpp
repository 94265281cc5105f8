#include "tools/isowave/bench_solvers.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/io/file_name.hpp"
#include "core/io/png.hpp"
#include "core/render/device_renderer.hpp"
#include "core/stages/solve_cells.hpp"
#include "reference/accuracy.hpp"
#include "reference/root_oracle.hpp"
#include "reference/scalar_renderer.hpp"
#include "tools/isowave/accuracy_report.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kMaxSegments = 1 << 20;

struct BenchSolversArgs {
  std::vector<std::string> volumes;  ///< FILE:ISOVALUE
  VolumeOptions volume;
  CompressionOptions compression;
  std::uint32_t rounds = 7;
  std::string size = "640x360", device, json, pictures;
};

/// The solvers and their numbers of refinement steps that are compared.
std::vector<Solver> compared_solvers() {
  std::vector<Solver> result;
  for (const int kind : {ISO_SOLVER_LINEAR, ISO_SOLVER_MARMITT, ISO_SOLVER_BERNSTEIN}) {
    for (const int steps : {0, 1, 2, 3, 4, 8, 16, 32}) result.push_back({kind, steps});
  }
  result.push_back({ISO_SOLVER_ANALYTIC, 0});  // closed form: no steps
  return result;
}

/// One volume's frame: what is drawn, and what is true.
struct Subject {
  std::string name;
  float isovalue = 0;
  CompressedVolume volume;
  std::vector<float> voxels;
  Camera camera;
  FrameParams frame{};
};

/// FILE:ISOVALUE
std::pair<std::string, float> parse_subject(const std::string &argument) {
  const std::size_t colon = argument.rfind(':');
  std::string isovalue = colon == std::string::npos ? "" : argument.substr(colon + 1);
  float number = 0;
  if (!fits_float32()(isovalue).empty() || !CLI::detail::lexical_cast(isovalue, number))
    throw Error("{}: give VOLUME:ISOVALUE, such as bonsai.zfp:40", argument);
  return {argument.substr(0, colon), number};
}

/// File for the picture of a solver's failures.
std::filesystem::path picture_path(const BenchSolversArgs &options, const std::string &name,
                                   Solver solver) {
  const auto stem = name.substr(0, name.find('_'));
  return std::filesystem::path(options.pictures) /
         fmt::format("{}_{}.png", stem, to_string(solver));
}

void check_outputs(const BenchSolversArgs &options) {
  Outputs outputs;
  for (const std::string &argument : options.volumes)
    outputs.read_volume(parse_subject(argument).first);
  outputs.write("--json", options.json);
  check_json_name(options.json);
  if (options.pictures.empty()) return;
  if (!std::filesystem::is_directory(options.pictures))
    throw Error("cannot write pictures: {} is no folder", options.pictures);
  for (const std::string &argument : options.volumes) {
    const std::string name =
        std::filesystem::path(parse_subject(argument).first).filename().string();
    for (const std::string_view solver : kSolverNames)
      outputs.write("--pictures", picture_path(options, name, solver_from_string(solver)));
  }
}

Subject load_subject(const std::string &argument, const BenchSolversArgs &options) {
  const auto [path, isovalue] = parse_subject(argument);
  Subject subject;
  subject.isovalue = isovalue;
  subject.name = std::filesystem::path(path).filename().string();
  subject.volume = load_volume(path, to_overrides(options.volume), options.compression);
  subject.voxels = decode_with_libzfp(subject.volume);
  subject.camera = orbit_cameras(subject.volume.info, 1).front();
  subject.frame = make_frame_params(subject.volume.info, subject.camera, parse_size(options.size),
                                    subject.isovalue);
  return subject;
}

/// The oracle's answers to the rays of one frame, found once for all solvers; other rays are asked
/// anew.
class FrameOracle final : public HitOracle {
 public:
  explicit FrameOracle(const Subject &subject)
      : oracle_(subject.voxels,
                {subject.frame.grid.dims_x, subject.frame.grid.dims_y, subject.frame.grid.dims_z},
                subject.isovalue) {
    const std::size_t num_pixels =
        std::size_t{subject.frame.view.width} * subject.frame.view.height;
    std::vector<OracleHit> hits(num_pixels);
    parallel_for(num_pixels, 0, [&](std::uint64_t pixel, std::uint32_t) {
      hits[pixel] =
          oracle_.first_hit(exact_ray(make_ray(&subject.frame, static_cast<std::uint32_t>(pixel))));
    });
    for (std::size_t pixel = 0; pixel < num_pixels; ++pixel) {
      known_.emplace(key(exact_ray(make_ray(&subject.frame, static_cast<std::uint32_t>(pixel)))),
                     hits[pixel]);
    }
  }
  OracleHit first_hit(const OracleRay &ray) const override {
    const auto found = known_.find(key(ray));
    return found != known_.end() ? found->second : oracle_.first_hit(ray);
  }
  double field(const std::array<double, 3> &point) const override { return oracle_.field(point); }
  std::array<double, 3> gradient(const std::array<double, 3> &point) const override {
    return oracle_.gradient(point);
  }

 private:
  using Key = std::array<double, 6>;
  static Key key(const OracleRay &ray) {
    return {ray.origin[0],    ray.origin[1],    ray.origin[2],
            ray.direction[0], ray.direction[1], ray.direction[2]};
  }
  RootOracle oracle_;
  std::map<Key, OracleHit> known_;
};

/// Segments of all frames, thinned evenly to at most kMaxSegments.
std::vector<CellSegment> gather_segments(const std::vector<Subject> &subjects) {
  std::vector<CellSegment> all;
  for (const Subject &subject : subjects) {
    for (std::uint32_t pixel = 0; pixel < subject.frame.view.width * subject.frame.view.height;
         ++pixel) {
      append_segments(subject.frame, subject.voxels, make_ray(&subject.frame, pixel), all);
    }
  }
  if (all.size() <= kMaxSegments) return all;
  std::vector<CellSegment> thinned(kMaxSegments);
  for (std::size_t i = 0; i < kMaxSegments; ++i) thinned[i] = all[i * all.size() / kMaxSegments];
  return thinned;
}

ordered_json solver_json(Solver solver) {
  return {{"solver", to_string(solver)}, {"steps", solver.max_steps}};
}

/// Against the exact first change of the same float cubics: what the solver alone does wrong.
ordered_json judge_roots(const std::vector<CellSegment> &segments, const std::vector<double> &truth,
                         const std::vector<float> &roots) {
  std::uint64_t missed = 0, false_hits = 0;
  std::vector<double> errors;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const bool hit = truth[i] >= 0, found = roots[i] >= 0;
    const double ahead = (double(roots[i]) - truth[i]) * double(segments[i].length);
    if (hit && (!found || ahead > kSameHit)) {
      ++missed;
    } else if (found && (!hit || -ahead > kSameHit)) {
      ++false_hits;
    } else if (hit) {
      errors.push_back(std::abs(ahead));
    }
  }
  const Quantiles q = quantiles(std::move(errors));
  return {
      {"missed", missed}, {"false", false_hits}, {"p50", q.p50}, {"p99", q.p99}, {"max", q.max}};
}

ordered_json bench_cells(ocl::Device &device, const std::vector<Subject> &subjects,
                         std::uint32_t rounds) {
  const std::vector<CellSegment> segments = gather_segments(subjects);
  if (segments.empty()) throw Error("no ray meets a cell with the isovalue: nothing to measure");
  std::vector<double> truth(segments.size());
  parallel_for(segments.size(), 0, [&](std::uint64_t i, std::uint32_t) {
    const Cubic &c = segments[i].cubic;
    truth[i] = first_change_of_cubic({c.b0, c.b1, c.b2, c.b3}).value_or(-1);
  });
  std::vector<Cubic> cubics;
  cubics.reserve(segments.size());
  for (const CellSegment &segment : segments) cubics.push_back(segment.cubic);
  const ocl::Buffer<Cubic> on_device(device, "cubics", std::span<const Cubic>(cubics));
  ocl::Buffer<float> roots(device, "roots", cubics.size());
  const std::vector<Solver> solvers = compared_solvers();
  std::vector<SolveCells> kernels;
  std::vector<ordered_json> entries;
  for (const Solver solver : solvers) {
    kernels.emplace_back(device, solver);
    kernels.back()(on_device, roots);
    entries.push_back(solver_json(solver));
    entries.back().update(judge_roots(segments, truth, roots.read()));
  }
  constexpr int kLaunches = 20;  // so that a launch's cost and the clock's do not count
  std::vector<std::vector<double>> ns(solvers.size());
  for (std::uint32_t round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < solvers.size();
         ++i) {  // interleaved: what disturbs one disturbs all
      device.finish();
      const auto begin = Clock::now();
      for (int launch = 0; launch < kLaunches; ++launch) kernels[i](on_device, roots);
      device.finish();
      ns[i].push_back(ms_since(begin) * 1e6 / kLaunches / double(cubics.size()));
    }
  }
  for (std::size_t i = 0; i < solvers.size(); ++i) entries[i]["ns"] = quantiles(ns[i]).p50;
  return {{"segments", segments.size()},
          {"hits", std::count_if(truth.begin(), truth.end(), [](double s) { return s >= 0; })},
          {"entries", entries}};
}

enum class Verdict { kRight, kMissed, kFalse, kUnstable };

Verdict verdict_of(const Accuracy &tally) {
  if (tally.unstable > 0) return Verdict::kUnstable;
  if (tally.missed > 0) return Verdict::kMissed;
  return tally.false_hits > 0 ? Verdict::kFalse : Verdict::kRight;
}

/// The shaded frame in grey, missed pixels red, false ones blue, unstable ones yellow; below, its
/// busiest part of 64 x 36 pixels ten times larger.
Image8 failure_picture(const Image8 &shaded, const std::vector<Verdict> &verdicts) {
  constexpr std::uint32_t kZoom = 10, kPartWidth = 64, kPartHeight = 36;
  const std::uint32_t width = shaded.width, height = shaded.height;
  const auto color = [&](std::uint32_t pixel) -> std::array<std::uint8_t, 3> {
    switch (verdicts[pixel]) {
      case Verdict::kMissed:
        return {213, 34, 30};
      case Verdict::kFalse:
        return {30, 80, 220};
      case Verdict::kUnstable:
        return {240, 200, 0};
      default: {
        const auto grey = static_cast<std::uint8_t>(160 + (shaded.pixels[3 * pixel] +
                                                           shaded.pixels[3 * pixel + 1] +
                                                           shaded.pixels[3 * pixel + 2]) /
                                                              8);
        return {grey, grey, grey};
      }
    }
  };
  std::uint32_t best_x = 0, best_y = 0, most = 0;
  for (std::uint32_t y = 0; y + kPartHeight <= height; y += kPartHeight / 4) {
    for (std::uint32_t x = 0; x + kPartWidth <= width; x += kPartWidth / 4) {
      std::uint32_t count = 0;
      for (std::uint32_t j = 0; j < kPartHeight; ++j) {
        for (std::uint32_t i = 0; i < kPartWidth; ++i) {
          count += verdicts[(y + j) * width + x + i] != Verdict::kRight;
        }
      }
      if (count > most) {
        most = count;
        best_x = x;
        best_y = y;
      }
    }
  }
  Image8 picture;
  picture.width = std::max(width, kZoom * kPartWidth);
  picture.height = height + kZoom * kPartHeight;
  picture.pixels.assign(std::size_t{3} * picture.width * picture.height, 255);
  const auto set = [&](std::uint32_t x, std::uint32_t y, std::array<std::uint8_t, 3> rgb) {
    std::copy(rgb.begin(), rgb.end(),
              picture.pixels.begin() + std::ptrdiff_t{3} * (y * picture.width + x));
  };
  for (std::uint32_t pixel = 0; pixel < width * height; ++pixel)
    set(pixel % width, pixel / width, color(pixel));
  if (width < kPartWidth || height < kPartHeight) return picture;
  for (std::uint32_t y = 0; y < kZoom * kPartHeight; ++y) {
    for (std::uint32_t x = 0; x < kZoom * kPartWidth; ++x) {
      set(x, height + y, color((best_y + y / kZoom) * width + best_x + x / kZoom));
    }
  }
  return picture;
}

void write_failure_picture(const BenchSolversArgs &options, const Subject &subject,
                           const HitOracle &oracle, Solver solver, DeviceRenderer &renderer) {
  const std::vector<HitRecord> hits = renderer.hits();
  std::vector<Verdict> verdicts(hits.size());
  parallel_for(hits.size(), 0, [&](std::uint64_t pixel, std::uint32_t) {
    Accuracy tally;
    judge(oracle, subject.frame, make_ray(&subject.frame, static_cast<std::uint32_t>(pixel)),
          hits[pixel], tally);
    verdicts[pixel] = verdict_of(tally);
  });
  write_png(failure_picture(renderer.shade({}), verdicts),
            picture_path(options, subject.name, solver));
}

ordered_json bench_frames(ocl::Device &device, const Subject &subject,
                          const BenchSolversArgs &options) {
  const FrameOracle oracle(subject);
  struct Run {
    Solver solver;
    std::unique_ptr<DeviceRenderer> renderer;
    std::vector<double> ms;
    ordered_json entry;
  };
  const FrameRequest request{
      .camera = subject.camera, .isovalue = subject.isovalue, .normals = Normals::kCell};
  std::vector<Run> runs;
  for (const Solver solver : compared_solvers()) {
    if (solver.max_steps != solver_from_string(to_string(solver)).max_steps &&
        solver.max_steps != 1)
      continue;
    RendererOptions renderer_options;
    renderer_options.size = {subject.frame.view.width, subject.frame.view.height};
    renderer_options.solver = solver;
    Run run{solver,
            std::make_unique<DeviceRenderer>(device, subject.volume, renderer_options),
            {},
            solver_json(solver)};
    run.renderer->render(request);
    run.entry.update(accuracy_json(judge_frame(oracle, subject.frame, run.renderer->hits())));
    if (!options.pictures.empty() && solver.max_steps != 1) {
      write_failure_picture(options, subject, oracle, solver, *run.renderer);
    }
    runs.push_back(std::move(run));
  }
  for (std::uint32_t round = 0; round < options.rounds; ++round) {
    for (Run &run : runs) run.ms.push_back(run.renderer->render(request).total_ms);
  }
  ordered_json entries = ordered_json::array();
  for (Run &run : runs) {
    run.entry["ms"] = quantiles(run.ms).p50;
    entries.push_back(run.entry);
  }
  return {{"volume", subject.name},
          {"isovalue", subject.isovalue},
          {"size", {subject.frame.view.width, subject.frame.view.height}},
          {"entries", entries}};
}

void print_results(const ordered_json &document) {
  const ordered_json &cells = document["cells"];
  fmt::print("{} ray-cell tests, {} with a hit\n{:<11} {:>5} {:>9} {:>8} {:>8} {:>9} {:>9}\n",
             cells["segments"].dump(), cells["hits"].dump(), "solver", "steps", "ns/test", "missed",
             "false", "p99", "max");
  for (const ordered_json &e : cells["entries"]) {
    fmt::print("{:<11} {:>5} {:>9.3f} {:>8} {:>8} {:>9.1e} {:>9.1e}\n",
               e["solver"].get<std::string>(), e["steps"].get<int>(), e["ns"].get<double>(),
               e["missed"].dump(), e["false"].dump(), e["p99"].get<double>(),
               e["max"].get<double>());
  }
  for (const ordered_json &frame : document["frames"]) {
    fmt::print("{} at {}\n{:<11} {:>5} {:>9} {:>8} {:>8} {:>8}\n",
               frame["volume"].get<std::string>(), frame["isovalue"].dump(), "solver", "steps",
               "ms", "missed", "false", "unstable");
    for (const ordered_json &e : frame["entries"]) {
      fmt::print("{:<11} {:>5} {:>9.2f} {:>8} {:>8} {:>8}\n", e["solver"].get<std::string>(),
                 e["steps"].get<int>(), e["ms"].get<double>(), e["missed"].dump(),
                 e["false"].dump(), e["unstable"].dump());
    }
  }
}

void run_bench_solvers(const CLI::App &command, const BenchSolversArgs &options) {
  check_image_size(parse_size(options.size));
  if (std::ranges::all_of(options.volumes, [](const auto &volume) {
        return is_zfp_name(parse_subject(volume).first);
      }))
    refuse_options(command, {"--rate"}, "all volumes are compressed already");
  check_outputs(options);
  const ocl::DeviceInfo info = ocl::choose_device(options.device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  std::vector<Subject> subjects;
  for (const std::string &argument : options.volumes)
    subjects.push_back(load_subject(argument, options));
  ocl::Device device(info);
  ordered_json document = {
      {"schema", kChartsSchema},
      {"benchmark", "solvers"},
      {"device", device_json(info)},
      {"date", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::chrono::system_clock::now()))},
      {"rounds", options.rounds}};
  document["cells"] = bench_cells(device, subjects, options.rounds);
  document["frames"] = ordered_json::array();
  for (const Subject &subject : subjects)
    document["frames"].push_back(bench_frames(device, subject, options));
  print_results(document);
  if (!options.json.empty()) write_json(document, options.json);
}

}  // namespace

void add_bench_solvers(CLI::App &bench) {
  CLI::App *command = bench.add_subcommand("solvers",
                                           "Root finders: ns per ray-cell test and ms per frame "
                                           "beside their errors, by the exact oracle");
  const auto options = std::make_shared<BenchSolversArgs>();
  command->add_option("VOLUME:ISOVALUE", options->volumes, "volumes and the isovalue of each")
      ->required();
  add_volume_options(*command, options->volume);
  command->add_option("--rate", options->compression.rate,
                      "bits per voxel for volumes that are not compressed yet [as many as float32 "
                      "needs]");
  command->add_option("--size", options->size, "picture size WxH")->capture_default_str();
  command
      ->add_option("--rounds", options->rounds,
                   "number of times that everything is measured; the median counts")
      ->check(CLI::Range(1u, 10000u))
      ->capture_default_str();
  command->add_option("--device", options->device,
                      "device: index, cpu, gpu, or a part of its name");
  command->add_option("--json", options->json, "file for the results, for tools/charts");
  command->add_option(
      "--pictures", options->pictures,
      "folder for VOLUME_SOLVER.png: missed pixels red, false blue, unstable yellow");
  command->callback([command, options] { run_bench_solvers(*command, *options); });
}

}  // namespace isowave::core::tools
