// gpu_peer: isowave beside what people have on one NVIDIA GPU: 3D textures of all voxels, and grids
// of NanoVDB. In one process and in turns, all draw the same views of the same surface, the first
// change of inside := f >= isovalue of the trilinear field.
//
//   gpu_peer generate:mixing_layer_512x512x512_uint8 --isovalue 128 --json peers.json
//
// With --pictures, all draw with smooth normals, and their pictures are written instead of
// compared.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "bench/gpu_peer/pictures.hpp"
#include "bench/gpu_peer/turns.hpp"
#include "bench/run_info.hpp"
#include "core/base/error.hpp"
#include "core/sources/load_volume.hpp"
#include "core/sources/noise_on_device.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::bench {

namespace {

using nlohmann::ordered_json;

struct Options {
  std::string volume, device, json, pictures;
  std::vector<std::string> peers;
  tools::VolumeOptions volume_options;
  float isovalue = 0;
  std::vector<std::uint32_t> size = {1280, 720};
  std::uint32_t orbit = 10, rounds = 5, rate = 4;
  std::optional<float> max_error;
  bool on_host = false;
};

const std::vector<std::string> kPeers = {
    "texture_uint8",      "texture_float",       "nanovdb_float_bits", "nanovdb_float_ranges",
    "nanovdb_fpn_bits",   "nanovdb_fpn_ranges",  "nanovdb_fp8_bits",   "nanovdb_fp8_ranges",
    "nanovdb_uint8_bits", "nanovdb_uint8_ranges"};

VoxelsInMemory read_voxels(const Options &options, const ocl::DeviceInfo &device) {
  const auto reader = open_any_volume(options.volume, tools::to_overrides(options.volume_options),
                                      noise_on(device));
  VoxelsInMemory voxels{reader->info(), std::vector<float>(reader->info().num_voxels())};
  reader->read_layers(0, voxels.info.dims.z, voxels.values);
  if (!std::ranges::all_of(voxels.values, [](float value) { return std::isfinite(value); }))
    throw Error("{}: voxels without a finite value cannot be compared", options.volume);
  return voxels;
}

/// A step of 8 bits.
float step_of(const VoxelsInMemory &voxels) {
  const auto [least, most] = std::ranges::minmax_element(voxels.values);
  return (*most - *least) / 255;
}

/// The one asked for, or that of 8 bits.
float max_error_of(const Options &options, const VoxelsInMemory &voxels) {
  return options.max_error ? *options.max_error : step_of(voxels) / 2;
}

std::vector<NamedSide> make_peers(const Options &options, const VoxelsInMemory &voxels) {
  const glm::uvec3 dims = voxels.info.dims;
  const GridVolume volume{
      {dims.x, dims.y, dims.z}, voxels.values, voxels.info.type == VoxelType::kUint8};
  const Place place = options.on_host ? Place::kHost : Place::kDevice;
  const std::uint64_t pixels = std::uint64_t{options.size.at(0)} * options.size.at(1);
  std::vector<NamedSide> peers = make_texture_sides(place, volume, pixels, options.peers);
  for (NamedSide &side :
       make_nanovdb_sides(place, volume, pixels, max_error_of(options, voxels), options.peers))
    peers.push_back(std::move(side));
  for (const std::string &name : options.peers) {
    if (std::ranges::find(peers, name, &NamedSide::name) == peers.end())
      throw Error("--peers {}: only of volumes of uint8, not of {}", name,
                  to_string(voxels.info.type));
  }
  return peers;
}

ordered_json side_json(const SideResult &side) {
  ordered_json json = {{"name", side.name}};
  for (const auto &[kind, values] : side.ms) json["ms"][kind] = spread_json(spread_of(values));
  json["device_bytes"] = side.costs.bytes;
  json["build_ms"] = side.costs.build_ms;
  json["max_voxel_error"] = side.costs.max_voxel_error;
  const HitDifference &difference = side.difference;
  json["hits"] = difference.hits;
  json["missed"] = difference.missed;
  json["false"] = difference.false_hits;
  json["distance_p99"] = difference.p99;
  json["distance_max"] = difference.largest;
  if (!side.is_isowave) json["other_picture_bytes"] = side.picture_difference;
  return json;
}

double median_of(const SideResult &side, const std::string &kind) {
  return side.ms.contains(kind) ? median(side.ms.at(kind)) : 0.0;
}

void print_sides(const std::vector<SideResult> &sides) {
  fmt::print("{:<22}{:>24}{:>24}{:>8}{:>9}{:>8}{:>9}{:>8}{:>8}{:>10}{:>10}\n", "", "hits, ms",
             "picture in host memory", "MiB", "new iso.", "build", "error", "missed", "false",
             "p99", "largest");
  for (const SideResult &side : sides) {
    const auto thrice = [&](const char *behind) {
      const auto ms = [&](const char *kind) { return median_of(side, std::string(kind) + behind); };
      return fmt::format("{:.3f} {:.3f} {:.3f}", ms("cold"), ms("next"), ms("warm"));
    };
    const bool ours = side.is_isowave;
    fmt::print(
        "{:<22}{:>24}{:>24}{:>8.0f}{:>9}{:>8.0f}{:>9.3g}{:>8}{:>8}{:>10.1e}{:>10.1e}\n", side.name,
        ours ? thrice("")
             : fmt::format("{:.3f} ({:.3f})", median_of(side, "kernel"), median_of(side, "hits")),
        ours ? thrice("_picture") : fmt::format("{:.3f}", median_of(side, "picture")),
        double(side.costs.bytes) / (1 << 20), fmt::format("{:.3f}", median_of(side, "new")),
        side.costs.build_ms, side.costs.max_voxel_error, side.difference.missed,
        side.difference.false_hits, side.difference.p99, side.difference.largest);
  }
  fmt::print(
      "Medians over views and rounds. hits: of isowave cold, next and warm, by the wall clock; of "
      "others\nthe kernel by CUDA's events (and the wall clock). MiB: buffers without pictures, of "
      "isowave with\nthem. new iso.: its first hits. build: ms. error: largest of a voxel. "
      "missed, false: pixels\nbeside isowave's without loss; p99, largest: distance of hits, "
      "voxels.\n");
}

/// Compares the sides, or has them write their pictures. Adds to the JSON what was measured.
void draw(const Options &options, std::vector<std::unique_ptr<IsowaveSide>> &isowave,
          std::vector<NamedSide> &peers, const VolumeInfo &info, const Views &views,
          ordered_json &json) {
  if (options.pictures.empty()) {
    const std::vector<SideResult> sides = draw_in_turns(isowave, peers, info, views);
    for (const SideResult &side : sides) json["sides"].push_back(side_json(side));
    print_sides(sides);
    return;
  }
  const PictureWork work{.folder = options.pictures,
                         .volume = options.volume,
                         .isovalue = views.isovalue,
                         .size = views.size,
                         .views = options.orbit,
                         .rounds = views.rounds};
  const std::vector<PeerPictures> sides = draw_pictures(isowave, peers, info, views, work);
  for (const PeerPictures &side : sides) json["pareto_peers"].push_back(to_json(side, work));
  print_pictures(sides, work);
}

void compare(const Options &options, const std::string &command) {
  const ocl::DeviceInfo device_info = ocl::choose_device(options.device);
  const std::optional<GpuInfo> gpu =
      options.on_host ? std::nullopt : std::optional<GpuInfo>(gpu_info());
  const VoxelsInMemory voxels = read_voxels(options, device_info);
  const Views views{.cameras = orbit_cameras(voxels.info, options.orbit),
                    .size = {options.size.at(0), options.size.at(1)},
                    .isovalue = options.isovalue,
                    .other_isovalue = options.isovalue + step_of(voxels),
                    .rounds = options.rounds};
  ordered_json json = {{"program", "gpu_peer"}, {"command", command}, {"date", utc_now()}};
  std::vector<std::unique_ptr<IsowaveSide>> isowave;
  for (const std::optional<std::uint32_t> rate : {std::optional<std::uint32_t>{}, {options.rate}})
    isowave.push_back(std::make_unique<IsowaveSide>(device_info, voxels, views.size, rate));
  for (const auto &[name, value] : run_info(isowave.front()->device()))
    json["context"][name] = value;
  if (gpu) {
    json["context"]["cuda_device"] = gpu->name;
    json["context"]["cuda_driver"] = gpu->driver;
    json["context"]["cuda_runtime"] = gpu->runtime;
  }
  std::vector<NamedSide> peers = make_peers(options, voxels);
  const glm::uvec3 dims = voxels.info.dims;
  json["options"] = {{"volume", options.volume},
                     {"dims", {dims.x, dims.y, dims.z}},
                     {"type", to_string(voxels.info.type)},
                     {"isovalue", options.isovalue},
                     {"width", views.size.width},
                     {"height", views.size.height},
                     {"views", options.orbit},
                     {"rounds", options.rounds},
                     {"rate", options.rate},
                     {"max_error", max_error_of(options, voxels)},
                     {"host", options.on_host}};
  fmt::print("{}\n", command);
  for (const auto &[name, value] : json.at("context").items())
    fmt::print("  {:<16}{}\n", name, value.dump());
  draw(options, isowave, peers, voxels.info, views, json);
  if (!options.json.empty()) tools::write_json(json, options.json);
}

void add_options(CLI::App &app, Options &options) {
  app.add_option("VOLUME", options.volume, tools::kVolumeHelp)->required();
  tools::add_volume_options(app, options.volume_options);
  app.add_option("--isovalue,-i", options.isovalue, "isovalue")
      ->required()
      ->check(tools::fits_float32());
  app.add_option("--rate", options.rate, "bits per voxel of isowave's second side")
      ->check(CLI::Range(1u, 32u))
      ->capture_default_str();
  app.add_option("--max-error", options.max_error,
                 "largest error of a voxel of NanoVDB's FpN [1/510 of the range of values]")
      ->check(tools::fits_float32());
  app.add_option("--size", options.size, "picture size WxH [1280x720]")
      ->delimiter('x')
      ->expected(2);
  app.add_option("--orbit,--views", options.orbit, "views around the volume")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_option("--rounds", options.rounds, "times that every view is drawn")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_option("--peers", options.peers, fmt::format("{} [all]", fmt::join(kPeers, ", ")))
      ->delimiter(',')
      ->check(CLI::IsMember(kPeers));
  app.add_option("--pictures", options.pictures,
                 "write each side's picture of each view, with smooth normals, as SIDE_VIEW.png to "
                 "this folder, and time these pictures alone: pareto_peers of --json");
  app.add_option("--device", options.device,
                 "isowave's OpenCL device: the GPU that CUDA takes [ISOWAVE_DEVICE, or the first "
                 "GPU]");
  app.add_flag("--host-check", options.on_host,
               "draw the peers on the host, without CUDA: only to compare the hits");
  app.add_option("--json", options.json, "also write everything to this file");
}

}  // namespace

}  // namespace isowave::core::bench

int main(int argc, char **argv) {
  using namespace isowave::core;
  CLI::App app("Compares isowave with textures and NanoVDB on one NVIDIA GPU.", "gpu_peer");
  bench::Options options;
  bench::add_options(app, options);
  app.callback([&] {
    check_image_size({options.size.at(0), options.size.at(1)});
    tools::Outputs outputs;
    outputs.read_volume(options.volume);
    outputs.write("--json", options.json);
    bench::check_folder(outputs, options.pictures);
    bench::compare(options, fmt::format("{}", fmt::join(argv, argv + argc, " ")));
  });
  return tools::run_program(app, argc, argv);
}
