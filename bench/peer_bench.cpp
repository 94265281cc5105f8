// peer_bench: a new isovalue, and further frames of it, by our renderer and by what one would take
// instead: VTK's Flying Edges and Embree. Each side lives in a process of its own, warm; they draw
// in turns.
//
//   peer_bench [--dims 256 512] [--rounds 5] [--isovalues 126,128,130] --json peer.json
//
// With --pictures, all draw views of one isovalue with smooth normals, and write their pictures.

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bench/peer_pictures.hpp"
#include "bench/peer_sides.hpp"
#include "bench/run_info.hpp"
#include "core/base/error.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::bench {

namespace {

using nlohmann::ordered_json;

struct Options {
  std::vector<std::uint32_t> dims = {256, 512};
  std::string volume, device, json, pictures;
  std::string side;  ///< of a child process
  std::vector<std::string> sides;
  std::optional<std::uint32_t> rate;
  std::uint32_t rounds = 5, views = 100;
  std::vector<float> isovalues = {126, 128, 130};
  float isovalue = 0;  ///< of pictures
  std::vector<std::uint32_t> size = {1280, 720};

  /// Bits per voxel; none: without loss.
  std::optional<std::uint32_t> storage_rate() const {
    return rate || !pictures.empty() ? rate : std::optional(4u);
  }
  ImageSize image_size() const { return {size.at(0), size.at(1)}; }
};

const std::vector<std::string> kSides = {"host", "rays", "blocks", "mesh_low", "mesh_medium"};

/// Their names in charts.
const std::map<std::string, std::string> kNames = {
    {"host", "isowave, host"},
    {"rays", "isowave, rays"},
    {"blocks", "isowave, blocks"},
    {"mesh_low", "Flying Edges + Embree"},
    {"mesh_medium", "Flying Edges + Embree, better tree"}};

/// Pages of files in this process's memory, as code of libraries [bytes]: RssFile of
/// /proc/self/status.
std::uint64_t memory_of_files() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("RssFile:")) return std::strtoull(line.c_str() + 8, nullptr, 10) * 1024;
  }
  return 0;
}

// ---- a child: reads an isovalue a line, and of how many views; answers a line of JSON

std::unique_ptr<PeerSide> make_side(const Options &options, CompressedVolume volume) {
  const PeerFrames frames{options.image_size(),
                          options.pictures.empty() ? Normals::kCell : Normals::kSmooth};
  if (options.side.starts_with("mesh"))
    return make_mesh_side(std::move(volume), frames, options.side == "mesh_medium");
  if (options.side == "host") return make_host_side(std::move(volume), frames);
  return make_renderer_side(std::move(volume), frames,
                            options.side == "rays" ? rays_pipeline() : blocks_pipeline(),
                            options.device);
}

/// Draws a view, and sends what was measured.
void draw_and_answer(PeerSide &side, float isovalue, const Camera &camera, Image8 *picture) {
  Measured measured = side.draw(isovalue, camera, picture);
  measured["peak_byte_count"] = static_cast<double>(peak_memory());
  measured["file_byte_count"] = static_cast<double>(memory_of_files());
  std::cout << ordered_json(measured).dump() << std::endl;
}

/// Views, each by its number, of an isovalue. A view's picture is written when it is drawn first.
void serve_pictures(const Options &options, const VolumeInfo &info, PeerSide &side) {
  const std::vector<Camera> cameras = orbit_cameras(info, options.views);
  std::vector<Image8> pictures(cameras.size());
  float isovalue = 0;
  for (std::uint32_t view = 0; std::cin >> isovalue >> view;) {
    Image8 &picture = pictures.at(view);
    if (!picture.pixels.empty()) {
      draw_and_answer(side, isovalue, cameras[view], nullptr);
      continue;
    }
    draw_and_answer(side, isovalue, cameras[view], &picture);
    write_png(picture, picture_path(options.pictures, options.side, view));
  }
}

void serve(const Options &options) {
  CompressedVolume volume =
      tools::load_volume(options.volume, {}, {.rate = options.storage_rate()});
  const VolumeInfo info = volume.info;
  const auto side = make_side(options, std::move(volume));
  reset_peak_memory();             // loading the volume does not count
  std::cout << "{}" << std::endl;  // ready
  if (!options.pictures.empty()) return serve_pictures(options, info, *side);
  const Camera camera = orbit_cameras(info, 1)[0];
  float isovalue = 0;
  for (std::uint32_t views = 0; std::cin >> isovalue >> views;) {
    if (views == 0) {
      draw_and_answer(*side, isovalue, camera, nullptr);
      continue;
    }
    const auto cameras = orbit_cameras(info, views);
    std::cout << ordered_json(side->draw_views(isovalue, cameras)).dump() << std::endl;
  }
}

// ---- the parent

/// A process that runs this program as one side.
class Child {
 public:
  Child(const std::string &program, std::vector<std::string> arguments) {
    std::array<int, 2> to_child{}, from_child{};
    // Not for the children that follow: this one would not see the end of its input.
    if (pipe2(to_child.data(), O_CLOEXEC) != 0 || pipe2(from_child.data(), O_CLOEXEC) != 0)
      throw Error("no pipe for a child process");
    arguments.insert(arguments.begin(), program);
    pid_ = fork();
    if (pid_ == 0) {
      dup2(to_child[0], STDIN_FILENO);
      dup2(from_child[1], STDOUT_FILENO);
      std::vector<char *> argv;
      argv.reserve(arguments.size() + 1);
      for (std::string &argument : arguments) argv.push_back(argument.data());
      argv.push_back(nullptr);
      execv("/proc/self/exe", argv.data());
      _exit(127);
    }
    close(to_child[0]);
    close(from_child[1]);
    in_ = fdopen(from_child[0], "r");
    out_ = fdopen(to_child[1], "w");
    if (pid_ < 0 || in_ == nullptr || out_ == nullptr) throw Error("cannot start a child process");
  }
  ~Child() {
    std::fclose(out_);  // the end of its input ends the child
    std::fclose(in_);
    waitpid(pid_, nullptr, 0);
  }
  Child(const Child &) = delete;
  Child &operator=(const Child &) = delete;

  /// Its next line. Throws Error when it has ended.
  nlohmann::json answer() {
    std::string line;
    for (int c = 0; (c = std::fgetc(in_)) != '\n';) {
      if (c == EOF) throw Error("a side ended before its answer");
      line += static_cast<char>(c);
    }
    return nlohmann::json::parse(line);
  }

  /// view: of pictures alone
  Measured draw(float isovalue, std::uint32_t view = 0) {
    return ask(isovalue, view).get<Measured>();
  }
  std::vector<double> draw_views(float isovalue, std::uint32_t views) {
    return ask(isovalue, views).get<std::vector<double>>();
  }

 private:
  nlohmann::json ask(float isovalue, std::uint32_t views_or_view) {
    fmt::print(out_, "{} {}\n", isovalue, views_or_view);
    std::fflush(out_);
    return answer();
  }

  pid_t pid_ = -1;
  std::FILE *in_ = nullptr, *out_ = nullptr;
};

/// Name -> its values in every round.
using Samples = std::map<std::string, std::vector<double>>;

std::array<double, 3> load_average() {
  std::array<double, 3> load{};
  if (getloadavg(load.data(), 3) != 3) load.fill(-1);
  return load;
}

/// After how many views the sums of the times of a side's are above those of a peer's for the first
/// time; nothing: never.
std::optional<std::size_t> overtaken_after(const std::vector<double> &side,
                                           const std::vector<double> &peer) {
  double of_side = 0, of_peer = 0;
  for (std::size_t view = 0; view < side.size(); ++view) {
    of_side += side[view];
    of_peer += peer[view];
    if (of_side > of_peer) return view + 1;
  }
  return {};
}

/// Views on an orbit, of one isovalue that begins with nothing decoded or extracted, side by side.
ordered_json measure_views(const Options &options,
                           const std::vector<std::unique_ptr<Child>> &children) {
  const float isovalue = options.isovalues.at(options.isovalues.size() / 2);
  std::vector<std::vector<double>> times;
  for (const auto &child : children) times.push_back(child->draw_views(isovalue, options.views));
  ordered_json json = {{"isovalue", isovalue}, {"count", options.views}};
  for (std::size_t side = 0; side < children.size(); ++side) {
    ordered_json &of_side = json["sides"][options.sides[side]];
    of_side["view_ms"] = times[side];
    of_side["total_ms"] = std::accumulate(times[side].begin(), times[side].end(), 0.0);
    if (options.sides[side].starts_with("mesh")) continue;
    for (std::size_t peer = 0; peer < children.size(); ++peer) {
      if (!options.sides[peer].starts_with("mesh")) continue;
      const auto views = overtaken_after(times[side], times[peer]);
      of_side["overtaken_after"][options.sides[peer]] = views ? ordered_json(*views) : nullptr;
    }
  }
  return json;
}

/// A process for each side.
std::vector<std::unique_ptr<Child>> start_sides(const Options &options, const std::string &program,
                                                const std::string &volume) {
  std::vector<std::unique_ptr<Child>> children;
  for (const std::string &side : options.sides) {
    std::vector<std::string> arguments = {
        "--side",   side,
        "--volume", volume,
        "--device", options.device,
        "--views",  std::to_string(options.views),
        "--size",   fmt::format("{}x{}", options.size.at(0), options.size.at(1))};
    if (options.rate) arguments.insert(arguments.end(), {"--rate", std::to_string(*options.rate)});
    if (!options.pictures.empty())
      arguments.insert(arguments.end(), {"--pictures", options.pictures, "--isovalue",
                                         fmt::format("{}", options.isovalue)});
    // A process in which PoCL compiles kernels keeps memory for that.
    if (side == "rays" || side == "blocks") {
      Child compiles(program, arguments);
      compiles.answer();
      compiles.draw(options.pictures.empty() ? options.isovalues.at(0) : options.isovalue);
    }
    children.push_back(std::make_unique<Child>(program, arguments));
    children.back()->answer();
  }
  return children;
}

/// One size: rounds x isovalues, in turns that change their order. The first turn of each isovalue
/// is not counted.
ordered_json measure(const Options &options, const std::string &program,
                     const std::string &volume) {
  const std::vector<std::string> &sides = options.sides;
  const auto load_before = load_average();
  const std::vector<std::unique_ptr<Child>> children = start_sides(options, program, volume);
  std::vector<Samples> samples(sides.size());
  std::size_t turn = 0;
  for (std::uint32_t round = 0; round <= options.rounds; ++round) {
    for (const float isovalue : options.isovalues) {
      std::vector<double> hits(sides.size());
      for (std::size_t i = 0; i < sides.size(); ++i) {
        const std::size_t side = (turn + i) % sides.size();
        for (const auto &[name, value] : children[side]->draw(isovalue)) {
          if (round > 0) samples[side][name].push_back(value);
          if (name == "hit_count") hits[side] = value;
        }
      }
      ++turn;
      const auto [least, most] = std::minmax_element(hits.begin(), hits.end());
      if (*most - *least > 0.01 * *most)
        throw Error("isovalue {}: the sides hit {} pixels: not one picture", isovalue,
                    fmt::join(hits, ", "));
    }
  }
  ordered_json json = {{"volume", volume}, {"load_average_before", load_before}};
  for (std::size_t side = 0; side < sides.size(); ++side) {
    for (const auto &[name, values] : samples[side]) {
      json["sides"][sides[side]][name] = spread_json(spread_of(values));
    }
  }
  if (options.views > 0) json["views"] = measure_views(options, children);
  json["load_average_after"] = load_average();
  return json;
}

/// The pictures of all sides, view by view in turns. The first round is not counted.
ordered_json draw_pictures(const Options &options, const std::string &program) {
  const PictureWork work{.folder = options.pictures,
                         .volume = options.volume,
                         .isovalue = options.isovalue,
                         .size = options.image_size(),
                         .views = options.views,
                         .rounds = options.rounds};
  const auto children = start_sides(options, program, options.volume);
  const std::size_t count = children.size();
  std::vector<PeerPictures> results;
  for (const std::string &side : options.sides)
    results.push_back({.side = side, .name = kNames.at(side)});
  for (std::uint32_t round = 0; round <= work.rounds; ++round) {
    for (std::uint32_t view = 0; view < work.views; ++view) {
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t side = (round + view + i) % count;
        const Measured measured = children[side]->draw(work.isovalue, view);
        PeerPictures &result = results[side];
        const bool on_device = measured.contains("device_byte_count");
        result.bytes = static_cast<std::uint64_t>(
            measured.at(on_device ? "device_byte_count" : "peak_byte_count"));
        if (round == 0) continue;
        result.ms["cold"].push_back(measured.at("new_ms"));
        result.ms["next"].push_back(measured.at("next_ms"));
        result.ms["warm"].push_back(measured.at("warm_ms"));
      }
    }
  }
  ordered_json json = ordered_json::array();
  for (const PeerPictures &side : results) json.push_back(to_json(side, work));
  print_pictures(results, work);
  return json;
}

std::string cell(const ordered_json &side, const std::string &name) {
  if (!side.contains(name)) return "";
  const ordered_json &spread = side.at(name);
  return fmt::format("{:.0f} ({:.0f}..{:.0f})", spread.at("median").get<double>(),
                     spread.at("min").get<double>(), spread.at("max").get<double>());
}

void print_rows(const ordered_json &sides, const char *title, const std::string &unit) {
  fmt::print("{:<20}{:>22}{:>22}{:>22}{:>22}\n", title, "new isovalue", "new, cache kept", "warm",
             "next");
  for (const auto &[name, side] : sides.items()) {
    fmt::print("{:<20}{:>22}{:>22}{:>22}{:>22}\n", name, cell(side, "new" + unit),
               cell(side, "new_kept" + unit), cell(side, "warm" + unit), cell(side, "next" + unit));
  }
}

void print_size(const ordered_json &size) {
  constexpr double kMiB = 1 << 20;
  fmt::print("\n{}; load average {:.1f} before, {:.1f} after\n",
             size.at("volume").get<std::string>(),
             size.at("load_average_before").at(0).get<double>(),
             size.at("load_average_after").at(0).get<double>());
  const ordered_json &sides = size.at("sides");
  print_rows(sides, "ms", "_ms");
  print_rows(sides, "ms of processors", "_cpu_ms");
  for (const auto &[name, side] : sides.items()) {
    fmt::print("{}: peak {:.0f} MiB, of it {:.0f} MiB of files", name,
               side.at("peak_byte_count").at("max").get<double>() / kMiB,
               side.at("file_byte_count").at("max").get<double>() / kMiB);
    if (side.contains("device_byte_count")) {
      fmt::print("; device memory, peak {:.0f} MiB\n",
                 side.at("device_byte_count").at("max").get<double>() / kMiB);
      continue;
    }
    if (!side.contains("triangle_count")) {
      fmt::print(", of it ranges and decoded blocks {:.0f} MiB; the ranges once took {} ms\n",
                 side.at("renderer_byte_count").at("max").get<double>() / kMiB,
                 cell(side, "open_ms"));
      continue;
    }
    fmt::print("; {:.0f} triangles, packets of {:.0f}\n",
               side.at("triangle_count").at("median").get<double>(),
               side.at("packet_count").at("median").get<double>());
    for (const std::string part : {"extract", "build", "trace"}) {
      fmt::print("  {:<8} {} ms, of processors {}\n", part, cell(side, part + "_ms"),
                 cell(side, part + "_cpu_ms"));
    }
  }
}

void print_views(const ordered_json &views) {
  fmt::print("{} views of isovalue {}:\n", views.at("count").get<std::uint32_t>(),
             views.at("isovalue").get<float>());
  for (const auto &[name, side] : views.at("sides").items()) {
    fmt::print("  {:<12} {:>8.0f} ms", name, side.at("total_ms").get<double>());
    if (side.contains("overtaken_after")) {
      for (const auto &[peer, count] : side.at("overtaken_after").items()) {
        fmt::print("; {} {}", peer,
                   count.is_null() ? std::string("never ahead")
                                   : fmt::format("ahead after {}", count.get<std::size_t>()));
      }
    }
    fmt::print("\n");
  }
}

/// Volumes of all sizes.
void compare(const Options &options, const std::string &program, ordered_json &json) {
  std::vector<std::string> volumes;
  if (!options.volume.empty()) volumes.push_back(options.volume);
  for (const std::uint32_t n :
       options.volume.empty() ? options.dims : std::vector<std::uint32_t>{}) {
    volumes.push_back(fmt::format("generate:mixing_layer_{0}x{0}x{0}_uint8", n));
  }
  for (const std::string &volume : volumes) {
    json["sizes"].push_back(measure(options, program, volume));
    print_size(json["sizes"].back());
    if (options.views > 0) print_views(json["sizes"].back().at("views"));
  }
  fmt::print(
      "\nmesh_low, mesh_medium: Flying Edges of VTK, tree (build quality low, medium) and rays of\n"
      "Embree on all processors; rays, blocks: our pipelines; host: ours without OpenCL. Median\n"
      "(min..max) over rounds and isovalues. new isovalue: from there to the picture, "
      "nothing\n"
      "decoded before; cache kept: with what the isovalue before left decoded; warm: the same "
      "view\n"
      "again; next: one degree further; of processors: their time, of all threads, which the load "
      "of\n"
      "others hardly changes; peak: memory of the side's process, without what loading the volume\n"
      "took; views: the first one from the new isovalue on.\n");
}

void run(const Options &options, const std::string &command, const std::string &program) {
  ocl::Device device(ocl::choose_device(options.device));
  ordered_json json = {{"program", "peer_bench"}, {"command", command}, {"date", utc_now()}};
  for (const auto &[name, value] : run_info(device)) json["context"][name] = value;
  json["context"]["processors"] = std::thread::hardware_concurrency();
  const auto rate = options.storage_rate();
  json["options"] = {{"rate", rate ? ordered_json(*rate) : nullptr},
                     {"rounds", options.rounds},
                     {"views", options.views},
                     {"width", options.size.at(0)},
                     {"height", options.size.at(1)}};
  const bool draws = !options.pictures.empty();
  json["options"]["isovalues"] = draws ? std::vector{options.isovalue} : options.isovalues;
  fmt::print("{}\n", command);
  for (const auto &[name, value] : json.at("context").items())
    fmt::print("  {:<16}{}\n", name, value.dump());
  if (draws) {
    json["pareto_peers"] = draw_pictures(options, program);
  } else {
    compare(options, program, json);
  }
  if (!options.json.empty()) tools::write_json(json, options.json);
}

/// Checks that need only the options.
void check_options(const CLI::App &app, const Options &options) {
  if (!options.volume.empty()) tools::refuse_options(app, {"--dims"}, "leave it out, or --volume");
  if (is_zfp_name(options.volume))
    tools::refuse_options(app, {"--rate"}, "the volume is compressed already");
  tools::Outputs outputs;
  outputs.read_volume(options.volume);
  outputs.write("--json", options.json);
  check_folder(outputs, options.pictures);
  if (!options.pictures.empty() && options.views == 0)
    throw Error("--views 0: --pictures needs at least one view");
}

void add_options(CLI::App &app, Options &options) {
  app.add_option("--dims", options.dims, "edges of the mixing layers [256 512]");
  CLI::Option *volume =
      app.add_option("--volume", options.volume,
                     "this volume instead: a .zfp file, or " + std::string(tools::kVolumeHelp));
  CLI::Option *isovalues = app.add_option("--isovalues", options.isovalues,
                                          "isovalues drawn in turn, at least two [126 128 130]")
                               ->delimiter(',')
                               ->expected(2, 1000);
  CLI::Option *isovalue = app.add_option("--isovalue", options.isovalue, "isovalue of --pictures")
                              ->check(tools::fits_float32())
                              ->excludes(isovalues);
  CLI::Option *pictures = app.add_option(
      "--pictures", options.pictures,
      "write each side's picture of each view of --isovalue, with smooth normals, as SIDE_VIEW.png "
      "to this folder, and time these pictures alone: pareto_peers of --json");
  pictures->needs(volume)->needs(isovalue);
  isovalue->needs(pictures);
  app.add_option("--rate", options.rate, "bits per voxel [4; with --pictures, without loss]")
      ->check(CLI::Range(1u, 32u));
  app.add_option("--rounds", options.rounds,
                 "times that every isovalue is drawn, after one that is not counted")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_option("--views", options.views,
                 "views on an orbit that each side then draws of one isovalue; 0: none")
      ->check(CLI::Range(0u, 100000u))
      ->capture_default_str();
  app.add_option("--sides", options.sides, fmt::format("{} [all]", fmt::join(kSides, ", ")))
      ->delimiter(',')
      ->check(CLI::IsMember(kSides));
  app.add_option("--size", options.size, "picture size WxH [1280x720]")
      ->delimiter('x')
      ->expected(2);
  app.add_option("--device", options.device, "our device")->capture_default_str();
  app.add_option("--json", options.json, "also write everything to this file");
  app.add_option("--side", options.side)->group("");  // of a child
}

}  // namespace

}  // namespace isowave::core::bench

int main(int argc, char **argv) {
  CLI::App app("Times a new isovalue, and further frames, beside VTK's Flying Edges and Embree.",
               "peer_bench");
  isowave::core::bench::Options options;
  options.device = "cpu";
  isowave::core::bench::add_options(app, options);
  app.callback([&] {
    if (options.sides.empty()) options.sides = isowave::core::bench::kSides;
    if (options.side.empty()) {
      isowave::core::bench::check_options(app, options);
      isowave::core::bench::run(options, fmt::format("{}", fmt::join(argv, argv + argc, " ")),
                                argv[0]);
    } else {
      isowave::core::bench::serve(options);
    }
  });
  return isowave::core::tools::run_program(app, argc, argv);
}
