#include "tools/isowave/bench_pareto.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/accuracy/flip.hpp"
#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/io/file_name.hpp"
#include "core/io/input_file.hpp"
#include "core/io/open_volume.hpp"
#include "core/sources/noise_on_device.hpp"
#include "reference/accuracy.hpp"
#include "reference/truth_picture.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/pareto_ways.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct BenchParetoArgs {
  std::string input, size = "640x360", device, json, pictures;
  float isovalue = 0;
  VolumeOptions volume;
  std::vector<std::string> ways, peers;
  std::uint32_t views = 3, rounds = 3;
};

/// Rays of a pixel of the truth along each axis: 81 in all. No way to draw has the same ones.
constexpr std::uint32_t kTruthSamples = 9;
/// A channel of a pixel that is wrong differs from the truth by more than this, of 255.
constexpr int kWrongStep = 16;

/// The picture that a view should have.
struct Truth {
  explicit Truth(Image8 truth) : picture(std::move(truth)), flip(picture) {}
  Image8 picture;
  Flip flip;
};

/// One volume, its views, and what they should show.
struct ParetoSubject {
  VolumeInfo info;
  std::vector<Camera> cameras;
  ImageSize size;
  double value_range = 0;  ///< largest minus smallest value
  float isovalue = 0;
  std::uint32_t rounds = 0;            ///< times that each view is drawn
  std::vector<Truth> truth, with_sky;  ///< of each view; without and with ambient rays
  double truth_ms = 0;
};

/// Means of the views.
struct PictureErrors {
  double flip = 0;
  double wrong_pixels = 0;  ///< as a part of all
};

/// A way to draw, and what came of it.
struct Point {
  std::string name;
  bool is_peer = false;
  std::optional<double> cold_ms;  ///< median of first frames of an isovalue, picture in memory
  double next_ms = 0;             ///< the same of frames one degree further
  std::uint64_t stored_bytes = 0, memory_bytes = 0;
  PictureErrors errors;
};

double share_of_wrong_pixels(const Image8 &truth, const Image8 &picture) {
  std::uint64_t wrong = 0;
  const std::size_t num_pixels = std::size_t{truth.width} * truth.height;
  for (std::size_t pixel = 0; pixel < num_pixels; ++pixel) {
    bool differs = false;
    for (std::size_t i = 3 * pixel; i < 3 * pixel + 3; ++i)
      differs |= std::abs(int{truth.pixels[i]} - int{picture.pixels[i]}) > kWrongStep;
    wrong += differs;
  }
  return double(wrong) / double(num_pixels);
}

/// pictures  of the views, with the size of the truth
PictureErrors errors_of(const std::vector<Truth> &truth, const std::vector<Image8> &pictures) {
  std::vector<PictureErrors> of_views(pictures.size());
  parallel_for(pictures.size(), 0, [&](std::uint64_t view, std::uint32_t) {
    of_views[view] = {truth[view].flip.error(pictures[view]),
                      share_of_wrong_pixels(truth[view].picture, pictures[view])};
  });
  PictureErrors mean;
  for (const PictureErrors &of_view : of_views) {
    mean.flip += of_view.flip / double(of_views.size());
    mean.wrong_pixels += of_view.wrong_pixels / double(of_views.size());
  }
  return mean;
}

/// A picture as a screen shows it larger: linear between the middles of its pixels.
Image8 enlarged(const Image8 &image, ImageSize size) {
  if (image.width == size.width && image.height == size.height) return image;
  Image8 result{size.width, size.height, 3,
                std::vector<std::uint8_t>(std::size_t{3} * size.num_pixels())};
  const auto place = [](std::uint32_t at, std::uint32_t to, std::uint32_t from) {
    return std::clamp((at + 0.5) * from / to - 0.5, 0.0, from - 1.0);
  };
  for (std::uint32_t row = 0; row < size.height; ++row) {
    const double y = place(row, size.height, image.height);
    const auto y0 = static_cast<std::size_t>(y),
               y1 = std::min<std::size_t>(y0 + 1, image.height - 1);
    for (std::uint32_t column = 0; column < size.width; ++column) {
      const double x = place(column, size.width, image.width);
      const auto x0 = static_cast<std::size_t>(x),
                 x1 = std::min<std::size_t>(x0 + 1, image.width - 1);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const auto value = [&](std::size_t i, std::size_t j) {
          return double(image.pixels[3 * (j * image.width + i) + channel]);
        };
        const double above = std::lerp(value(x0, y0), value(x1, y0), x - double(x0)),
                     below = std::lerp(value(x0, y1), value(x1, y1), x - double(x0));
        result.pixels[3 * (std::size_t{row} * size.width + column) + channel] =
            static_cast<std::uint8_t>(std::lround(std::lerp(above, below, y - double(y0))));
      }
    }
  }
  return result;
}

/// Bytes of the stored volume that frames need.
std::uint64_t stored_bytes(const CompressedVolume &volume, bool with_levels) {
  std::uint64_t bytes =
      (volume.payload_bits() + 7) / 8 + volume.index.size() * sizeof(std::uint32_t);
  for (const CompressedVolume &level : volume.coarser_levels)
    bytes += with_levels ? stored_bytes(level, false) : 0;
  return bytes;
}

/// Draws every view `rounds` times: with nothing decoded, one degree further, and one degree back,
/// which is the picture that is judged.
Point measure(ocl::Device &device, const ParetoSubject &subject, const CompressedVolume &volume,
              const ParetoWay &way, std::vector<Image8> &pictures) {
  const auto renderer = make_renderer(device, volume, way, subject.size);
  const FrameRequest request = request_of(way, subject.size, subject.isovalue, subject.value_range);
  FrameArrays arrays;  // a user has the last frame's until the next is there
  const auto draw = [&](const Camera &camera) {
    const auto begin = std::chrono::steady_clock::now();
    renderer->render(seen_from(camera, request));
    arrays = renderer->fetch({.picture = true}, {});
    return ms_since(begin);
  };
  std::vector<double> cold, next;
  draw(subject.cameras.front());  // makes memory, and compiles what is compiled late
  for (const Camera &camera : subject.cameras) {
    for (std::uint32_t round = 0; round < subject.rounds; ++round) {
      renderer->clear_cache();
      cold.push_back(draw(camera));
      next.push_back(draw(turned(camera, 1)));
      next.push_back(draw(camera));
    }
    pictures.push_back(enlarged(image_of(renderer->size(), arrays.picture), subject.size));
  }
  Point point;
  point.name = way.name;
  point.cold_ms = quantiles(std::move(cold)).p50;
  point.next_ms = quantiles(std::move(next)).p50;
  point.stored_bytes = stored_bytes(volume, way.needs_levels());
  point.memory_bytes = renderer->memory_bytes();
  point.errors = errors_of(way.ambient_rays != 0 ? subject.with_sky : subject.truth, pictures);
  return point;
}

std::vector<const ParetoWay *> chosen_ways(const std::vector<std::string> &names) {
  std::vector<const ParetoWay *> ways;
  for (const ParetoWay &way : pareto_ways()) {
    if (names.empty() || std::ranges::find(names, way.name) != names.end()) ways.push_back(&way);
  }
  for (const std::string &name : names) {
    if (std::ranges::find(pareto_ways(), name, &ParetoWay::name) == pareto_ways().end())
      throw Error("--ways {}: there is no such way to draw; `isowave bench pareto --help` has them",
                  name);
  }
  return ways;
}

/// Draws the truth of all views. info: the device that generators may use
ParetoSubject make_subject(const BenchParetoArgs &options, const ocl::DeviceInfo &info,
                           bool with_sky) {
  ParetoSubject subject;
  subject.size = parse_size(options.size);
  subject.isovalue = options.isovalue;
  subject.rounds = options.rounds;
  check_image_size({subject.size.width, subject.size.height, ImageSize::kMaxSamples});
  const auto reader = open_any_volume(options.input, to_overrides(options.volume), noise_on(info));
  subject.info = reader->info();
  const glm::uvec3 dims = subject.info.dims;
  std::vector<float> voxels(subject.info.num_voxels());
  reader->read_layers(0, dims.z, voxels);
  if (!std::ranges::all_of(voxels, [](float value) { return std::isfinite(value); }))
    throw Error("{}: has voxels without a number, of which there is no true picture",
                options.input);
  const auto [least, most] = std::ranges::minmax(voxels);
  subject.value_range = double{most} - double{least};
  subject.cameras = orbit_cameras(subject.info, options.views);
  const auto begin = std::chrono::steady_clock::now();
  const GridOracle oracle(voxels, {dims.x, dims.y, dims.z}, options.isovalue);
  const ImageSize size{subject.size.width, subject.size.height, kTruthSamples};
  for (const Camera &camera : subject.cameras) {
    subject.truth.emplace_back(truth_picture(oracle, subject.info, camera, size));
    if (with_sky)
      subject.with_sky.emplace_back(truth_picture(oracle, subject.info, camera, size, Sky::kSeen));
  }
  subject.truth_ms = ms_since(begin);
  return subject;
}

constexpr const char *kRowFormat = "{:<30} {:>10} {:>10} {:>8} {:>9} {:>12} {:>12}\n";

void print(const Point &point) {
  fmt::print(kRowFormat, point.name, point.cold_ms ? fmt::format("{:.3f}", *point.cold_ms) : "-",
             fmt::format("{:.3f}", point.next_ms), fmt::format("{:.5f}", point.errors.flip),
             fmt::format("{:.2e}", point.errors.wrong_pixels), with_commas(point.stored_bytes),
             with_commas(point.memory_bytes));
}

ordered_json to_json(const Point &point) {
  return {{"way", point.name},
          {"is_peer", point.is_peer},
          {"cold_ms", point.cold_ms ? ordered_json(*point.cold_ms) : ordered_json()},
          {"next_ms", point.next_ms},
          {"flip", point.errors.flip},
          {"wrong_pixels", point.errors.wrong_pixels},
          {"stored_bytes", point.stored_bytes},
          {"memory_bytes", point.memory_bytes}};
}

/// Points of what other programs drew, from the JSON of bench/peer_bench or bench/gpu_peer.
///
/// Throws  Error: it is no such file, or is of other views
std::vector<Point> read_peers(const std::string &path, const ParetoSubject &subject) {
  std::vector<Point> points;
  try {
    const InputFile file(path);
    std::string text(file.size(), '\0');
    file.read(0, std::as_writable_bytes(std::span(text)));
    const nlohmann::json document = nlohmann::json::parse(text);
    for (const nlohmann::json &peer : document.at("pareto_peers")) {
      if (peer.at("isovalue").get<float>() != subject.isovalue ||
          peer.at("pictures").size() != subject.cameras.size() ||
          peer.at("size") != nlohmann::json{subject.size.width, subject.size.height})
        throw Error("{}: its pictures are of another isovalue, size or number of views", path);
      std::vector<Image8> pictures;
      for (const nlohmann::json &name : peer.at("pictures"))
        pictures.push_back(read_png(fs::path(path).parent_path() / name.get<std::string>()));
      Point point;
      point.name = peer.at("name");
      point.is_peer = true;
      const nlohmann::json &ms = peer.at("ms");
      // A volume that stays on the device has no cold frames; "new" is a new isovalue's.
      for (const char *kind : {"new", "cold"}) {
        if (ms.contains(kind)) point.cold_ms = ms[kind];
      }
      point.next_ms = ms.at("next");
      point.memory_bytes = peer.at("bytes");
      point.errors = errors_of(subject.truth, pictures);
      points.push_back(std::move(point));
    }
  } catch (const nlohmann::json::exception &) {
    throw Error("{}: was not written by peer_bench or gpu_peer with --pictures", path);
  }
  return points;
}

/// The files of a way's pictures.
void write_pictures(const std::string &folder, const std::string &name,
                    const std::vector<Image8> &pictures) {
  if (folder.empty()) return;
  std::string stem = name;
  std::ranges::replace_if(
      stem, [](char c) { return c == ' ' || c == '/' || c == '%'; }, '_');
  for (std::size_t view = 0; view < pictures.size(); ++view)
    write_png(pictures[view], fs::path(folder) / fmt::format("pareto_{}_{}.png", stem, view));
}

/// Measures the ways, each kind of storage in one go.
std::vector<Point> measure_ways(ocl::Device &device, const ParetoSubject &subject,
                                const BenchParetoArgs &options,
                                const std::vector<const ParetoWay *> &ways) {
  std::map<std::pair<std::optional<std::uint32_t>, std::optional<double>>,
           std::vector<const ParetoWay *>>
      by_storage;
  for (const ParetoWay *way : ways) by_storage[{way->rate, way->tolerance_relative}].push_back(way);
  std::vector<Point> points;
  for (const auto &[storage, of_storage] : by_storage) {
    CompressionOptions compression{.rate = storage.first, .tolerance_relative = storage.second};
    if (std::ranges::any_of(of_storage, &ParetoWay::needs_levels)) compression.levels = 0;
    compression.measure_error = std::ranges::any_of(of_storage, &ParetoWay::needs_bounds);
    const CompressedVolume volume =
        load_volume(options.input, to_overrides(options.volume), compression, &device);
    for (const ParetoWay *way : of_storage) {
      std::vector<Image8> pictures;
      points.push_back(measure(device, subject, volume, *way, pictures));
      print(points.back());
      write_pictures(options.pictures, way->name, pictures);
    }
  }
  return points;
}

void run_bench_pareto(const BenchParetoArgs &options) {
  Outputs outputs;
  outputs.read_volume(options.input);
  for (const std::string &peers : options.peers) outputs.read(peers);
  outputs.write("--json", options.json);
  check_json_name(options.json);
  if (!options.pictures.empty()) outputs.write_pictures("--pictures", options.pictures, "pareto_");
  if (is_zfp_name(options.input))
    throw Error("{}: is compressed already: give the volume that is to be compressed",
                options.input);
  const std::vector<const ParetoWay *> ways = chosen_ways(options.ways);
  const ocl::DeviceInfo info = ocl::choose_device(options.device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  ocl::Device device(info);
  const bool with_sky =
      std::ranges::any_of(ways, [](const ParetoWay *way) { return way->ambient_rays != 0; });
  const ParetoSubject subject = make_subject(options, info, with_sky);
  outputs.make_folder();
  fmt::print("truth: {} rays a pixel, {:.0f} ms\n", kTruthSamples * kTruthSamples,
             subject.truth_ms);
  for (std::size_t view = 0; view < subject.truth.size(); ++view)
    write_pictures(options.pictures, fmt::format("truth_{}", view), {subject.truth[view].picture});
  fmt::print(kRowFormat, "", "ms, new", "ms, next", "FLIP", "wrong", "bytes stored",
             "bytes to draw");
  std::vector<Point> points = measure_ways(device, subject, options, ways);
  for (const std::string &path : options.peers) {
    for (Point &point : read_peers(path, subject)) {
      print(point);
      points.push_back(std::move(point));
    }
  }
  if (options.json.empty()) return;
  ordered_json json = ordered_json::array();
  for (const Point &point : points) json.push_back(to_json(point));
  write_json({{"schema", kChartsSchema},
              {"benchmark", "pareto"},
              {"device", device_json(info)},
              {"date", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::chrono::system_clock::now()))},
              {"volume", options.input},
              {"dims", {subject.info.dims.x, subject.info.dims.y, subject.info.dims.z}},
              {"isovalue", options.isovalue},
              {"size", {subject.size.width, subject.size.height}},
              {"views", options.views},
              {"rounds", options.rounds},
              {"truth_rays", kTruthSamples * kTruthSamples},
              {"points", json}},
             options.json);
}

std::string names_of_ways() {
  std::string names;
  for (const ParetoWay &way : pareto_ways()) names += (names.empty() ? "" : "; ") + way.name;
  return names;
}

}  // namespace

void add_bench_pareto(CLI::App &bench) {
  CLI::App *command = bench.add_subcommand(
      "pareto",
      "Speed against accuracy: ms until the picture is in memory, and its error against "
      "81 rays a pixel of the uncompressed voxels, for each way to draw");
  const auto options = std::make_shared<BenchParetoArgs>();
  command->add_option("VOLUME", options->input, kVolumeHelp)->required();
  command->add_option("--isovalue,-i", options->isovalue, "isovalue")
      ->check(fits_float32())
      ->required();
  add_volume_options(*command, options->volume);
  command
      ->add_option("--ways", options->ways,
                   fmt::format("ways to draw, a list, of: {} [all]", names_of_ways()))
      ->delimiter(',');
  command
      ->add_option("--peers", options->peers,
                   "what peer_bench or gpu_peer drew: JSON with --pictures; a list")
      ->delimiter(',');
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
  command->add_option("--pictures", options->pictures, "folder for all pictures and the truth");
  command->add_option("--json", options->json, "file for the results, for tools/charts");
  command->callback([options] { run_bench_pareto(*options); });
}

}  // namespace isowave::core::tools
