// brick_bench: whole frames of a volume in bricks, one for each process that mpirun starts.
//
//   mpirun -n 2 brick_bench generate:mixing_layer_2048x2048x3840_uint8 -i 128 --json bricks.json
//   brick_bench generate:mixing_layer_2048x2048x3840_uint8 -i 128 --brick 1/2    # the second alone

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <optional>

#include "bench/frame_measure.hpp"
#include "bench/run_info.hpp"
#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/text.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/bricks/team_renderer.hpp"
#include "core/volume/range_thresholds.hpp"
#include "tools/isowave/mpi_team.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/renderer_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::bench {

namespace {

using nlohmann::ordered_json;
using std::chrono::steady_clock;

struct Options {
  std::string volume, device, json;
  tools::VolumeOptions volume_options;
  float isovalue = 128;
  tools::CompressionOptions compression{.rate = 4};
  std::uint32_t orbit = 10, rounds = 3;
  double turn = 1;
  std::vector<std::uint32_t> size = {1280, 720};
  tools::RendererFlags renderer;
  std::string brick;     ///< R/N: brick R of N alone; empty: as mpirun has it
  bool profile = false;  ///< times of stages, which makes frames slower
};

/// One of several processes, without the others: they say what this one says.
class AloneOf : public TeamOfOne {
 public:
  /// text: R/N
  explicit AloneOf(const std::string &text) {
    const std::size_t slash = std::min(text.find('/'), text.size());
    const auto rank = parse_all<std::uint32_t>(std::string_view(text).substr(0, slash));
    const auto size =
        parse_all<std::uint32_t>(std::string_view(text).substr(std::min(slash + 1, text.size())));
    if (!rank || !size || *rank >= *size)
      throw Error("--brick {}: give R/N, such as 0/4 to 3/4", text);
    rank_ = *rank;
    size_ = *size;
  }
  std::uint32_t rank() const override { return rank_; }
  std::uint32_t size() const override { return size_; }
  std::vector<std::string> all_gather(const std::string &text) override {
    return std::vector<std::string>(size_, text);
  }
  void reduce(std::size_t count, Reduction, Receiver who, const MakeWords &make,
              const TakeWords &take) override {
    reduce_in_pieces(count, who == Receiver::kAll || rank_ == 0, make, take,
                     [](std::span<std::uint64_t>) {});
  }

 private:
  std::uint32_t rank_ = 0, size_ = 1;
};

/// The frames of one kind: ms, and this process's counts.
struct Frames {
  std::vector<double> frame;        ///< wall clock: until the slowest process is through
  std::vector<double> own;          ///< until this one is
  std::vector<double> composition;  ///< of the picture, with the wait for others
  std::vector<double> picture;      ///< until the picture is in rank 0's memory
  std::vector<double> given;        ///< bytes for it that this process gave to others
  std::vector<double> passes, decoded, recycled, free;  ///< free: slots after the last pass
  std::map<std::string, std::vector<double>> stages;    ///< ms of each stage, if they are timed
};

void draw(TeamRenderer &renderer, Team &team, const FrameRequest &request, Frames &frames) {
  team.all_gather("");
  const auto begin = std::chrono::steady_clock::now();
  const FrameStats stats = renderer.render(request);
  frames.frame.push_back(ms_since(begin));
  frames.own.push_back(stats.total_ms);
  std::uint64_t decoded = stats.normals.decoded_blocks, recycled = stats.normals.recycled_blocks;
  std::map<std::string, double> stages = stats.normals.stage_ms;
  for (const PassStats &pass : stats.passes) {
    decoded += pass.counts.decoded_count;
    recycled += pass.counts.recycled_count;
    for (const auto &[stage, ms] : pass.stage_ms) stages[stage] += ms;
  }
  frames.passes.push_back(static_cast<double>(stats.passes.size()));
  frames.decoded.push_back(static_cast<double>(decoded));
  frames.recycled.push_back(static_cast<double>(recycled));
  frames.free.push_back(stats.passes.back().counts.free_count);
  for (const auto &[stage, ms] : stages) frames.stages[stage].push_back(ms);
  const double before = renderer.composition().ms;
  const std::uint64_t given_before = team.given_bytes();
  static_cast<void>(renderer.fetch({.picture = true}, {}));
  frames.picture.push_back(ms_since(begin));
  frames.composition.push_back(renderer.composition().ms - before);
  frames.given.push_back(static_cast<double>(team.given_bytes() - given_before));
}

std::map<std::string, Frames> measure_frames(TeamRenderer &renderer, Team &team,
                                             const VolumeInfo &whole, const Options &options) {
  const std::vector<Camera> cameras = orbit_cameras(whole, options.orbit);
  const auto request_of = [&](std::uint32_t view, bool is_next) {
    FrameRequest request;
    request.camera = is_next ? core::turned(cameras[view], options.turn) : cameras[view];
    request.isovalue = options.isovalue;
    return request;
  };
  std::map<std::string, Frames> kinds;
  Frames unused;
  for (int i = 0; i < 2; ++i) draw(renderer, team, request_of(0, false), unused);
  for (std::uint32_t round = 0; round < options.rounds; ++round) {
    for (std::uint32_t view = 0; view < options.orbit; ++view) {
      renderer.clear_cache();
      draw(renderer, team, request_of(view, false), kinds["cold"]);
      draw(renderer, team, request_of(view, false), kinds["warm"]);
      draw(renderer, team, request_of(view, true), kinds["next"]);
    }
  }
  return kinds;
}

/// One row of numbers for each process, of all of which rank 0 makes the report.
void report(const Options &options, const std::string &command, ocl::Device &device,
            const std::map<std::string, Frames> &kinds, const ordered_json &of_rank, Team &team) {
  ordered_json own = of_rank;
  for (const auto &[kind, frames] : kinds) {
    own["frames"][kind] = {{"own_ms", spread_json(spread_of(frames.own))},
                           {"given_bytes", median(frames.given)},
                           {"passes", median(frames.passes)},
                           {"decoded_blocks", median(frames.decoded)},
                           {"recycled_blocks", median(frames.recycled)},
                           {"free_slots", median(frames.free)}};
    for (const auto &[stage, ms] : frames.stages)
      own["frames"][kind]["stage_ms"][stage] = median(ms);
  }
  own["memory"] = tools::memory_json(device.ledger());
  own["host_peak"] = peak_memory();
  std::vector<std::string> all = team.all_gather(own.dump());
  if (!options.brick.empty()) {
    all.resize(1);
  } else if (team.rank() != 0) {
    return;
  }
  ordered_json json = {
      {"program", "brick_bench"}, {"command", command}, {"date", utc_now()}, {"context", {}}};
  for (const auto &[name, value] : run_info(device)) json["context"][name] = value;
  json["volume"] = options.volume;
  json["isovalue"] = options.isovalue;
  json["size"] = options.size;
  if (!options.brick.empty()) json["brick"] = options.brick;
  fmt::print("{}, {} bricks, ms: median (range)\n", options.volume, team.size());
  for (const auto &[kind, frames] : kinds) {
    const Spread frame = spread_of(frames.frame), composition = spread_of(frames.composition);
    json["frames"][kind] = {{"frame_ms", spread_json(frame)},
                            {"composition_ms", spread_json(composition)},
                            {"picture_ms", spread_json(spread_of(frames.picture))}};
    fmt::print("{:<6} {:8.2f} ({:.2f} to {:.2f}), composition {:.2f} ({:.2f} to {:.2f})\n", kind,
               frame.median, frame.min, frame.max, composition.median, composition.min,
               composition.max);
  }
  for (const std::string &text : all) json["ranks"].push_back(ordered_json::parse(text));
  if (!options.json.empty()) tools::write_json(json, options.json);
}

void measure(const Options &options, const std::string &command, Team &team) {
  TeamVolumeSource source;
  source.path = options.volume;
  source.overrides = tools::to_overrides(options.volume_options);
  std::optional<ocl::Device> device;
  together(team, [&] {
    tools::Outputs outputs;
    outputs.read_volume(options.volume);
    if (team.rank() == 0 || !options.brick.empty()) outputs.write("--json", options.json);
    device.emplace(choose_local_device(options.device, tools::MpiJob::local_rank()),
                   options.profile);
    source.storage = tools::storage_for(options.volume, options.compression, &*device);
  });
  const TeamVolume volume =
      open_together(team, source, [](std::vector<VolumeInfo> &levels) { levels.resize(1); });
  const BlockBox own = volume.cuts.bricks()[team.rank()];
  std::optional<TeamRenderer> renderer;
  together(team, [&] {
    renderer.emplace(
        *device, volume,
        tools::to_renderer_options(options.renderer, {options.size.at(0), options.size.at(1)}),
        team);
  });
  const auto kinds = measure_frames(*renderer, team, volume.whole(), options);
  const ordered_json of_rank = {{"brick",
                                 {{"begin", {own.begin.x, own.begin.y, own.begin.z}},
                                  {"end", {own.end.x, own.end.y, own.end.z}}}},
                                {"load_ms", volume.load_ms},
                                {"setup_ms", renderer->renderer().setup_ms()},
                                {"cache_slots", renderer->renderer().options().cache_slots},
                                {"stream_bytes", 4 * volume.brick.words.size()}};
  report(options, command, *device, kinds, of_rank, team);
}

void add_options(CLI::App &app, Options &options) {
  app.add_option("VOLUME", options.volume, "a .zfp file, or " + std::string(tools::kVolumeHelp))
      ->required();
  tools::add_volume_options(app, options.volume_options);
  app.add_option("--isovalue,-i", options.isovalue)->capture_default_str();
  tools::add_compression_options(app, options.compression);
  app.add_option("--size", options.size, "picture size WxH [1280x720]")
      ->delimiter('x')
      ->expected(2);
  app.add_option("--orbit", options.orbit, "views around the volume")
      ->check(CLI::Range(1u, 360u))
      ->capture_default_str();
  app.add_option("--rounds", options.rounds, "times that every view is drawn")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_option("--turn", options.turn, "angle from a view to its next frame [degrees]")
      ->capture_default_str();
  app.add_option("--device", options.device, "of the first process of a host: see isowave render");
  tools::add_renderer_options(app, options.renderer);
  app.add_option("--brick", options.brick,
                 "R/N: draws brick R of N alone, without mpirun; each brick by itself shows what N "
                 "devices would take, but for waiting and for putting the picture together")
      ->type_name("R/N");
  app.add_flag("--profile", options.profile, "also times stages, which makes frames slower");
  app.add_option("--json", options.json, "also write everything to this file");
}

}  // namespace

}  // namespace isowave::core::bench

int main(int argc, char **argv) {
  using namespace isowave::core;
  tools::MpiJob job(&argc, &argv);
  CLI::App app("Times whole frames of a volume in bricks, one for each process of mpirun.",
               "brick_bench");
  bench::Options options;
  bench::add_options(app, options);
  app.callback([&] {
    TeamOfOne alone;
    Team *team = tools::MpiJob::team();
    std::optional<bench::AloneOf> one_of_several;
    if (!options.brick.empty()) {
      if (team != nullptr)
        throw Error("--brick {}: one process draws it, without mpirun", options.brick);
      team = &one_of_several.emplace(options.brick);
    }
    bench::measure(options, fmt::format("{}", fmt::join(argv, argv + argc, " ")),
                   team != nullptr ? *team : alone);
  });
  return job.finish(tools::run_program(app, argc, argv));
}
