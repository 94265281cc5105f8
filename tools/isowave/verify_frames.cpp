#include "tools/isowave/verify_frames.hpp"

#include <fmt/format.h>

#include <chrono>
#include <functional>
#include <memory>
#include <span>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/io/json_list.hpp"
#include "core/render/device_renderer.hpp"
#include "core/zfp/isovalue.hpp"
#include "reference/cell_oracle.hpp"
#include "reference/clip_oracle.hpp"
#include "reference/embree_reach.hpp"
#include "reference/mesh_oracle.hpp"
#include "reference/ray_rounding.hpp"
#include "reference/root_oracle.hpp"
#include "reference/scalar_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tools/isowave/accuracy_report.hpp"
#include "tools/isowave/compile_report.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;
using Dims = std::array<std::uint32_t, 3>;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// One of the oracles, for one isovalue.
struct FrameJudge {
  std::string oracle;
  std::string contents;  ///< what it is made of, for the reader
  bool uses_embree = true;
  std::function<Accuracy(const FrameParams &frame, std::span<const HitRecord> hits)> judge;
};

template <class Oracle>
FrameJudge judge_by(std::string name, const std::shared_ptr<const Oracle> &oracle,
                    std::string contents) {
  return {std::move(name), std::move(contents), true,
          [oracle](const FrameParams &frame, std::span<const HitRecord> hits) {
            return judge_frame(*oracle, frame, hits);
          }};
}

FrameJudge make_judge(const std::string &name, std::span<const float> voxels, const Dims &dims,
                      float isovalue) {
  if (name == "cells") {
    const auto oracle = std::make_shared<const CellOracle>(voxels, dims, isovalue);
    return judge_by(name, oracle, with_commas(oracle->num_cells()) + " dual cells in Embree");
  }
  if (name == "mesh") {
    const auto oracle = std::make_shared<const MeshOracle>(voxels, dims, isovalue);
    return judge_by(name, oracle,
                    with_commas(oracle->num_triangles()) +
                        " triangles in Embree; unstable: finer ones agree with the frame");
  }
  FrameJudge judge = judge_by(name, std::make_shared<const RootOracle>(voxels, dims, isovalue),
                              "every cell, certified");
  judge.uses_embree = false;
  return judge;
}

/// Sums of the rows and the JSON entries of a run.
struct Totals {
  std::uint64_t failures = 0, judged = 0;
};

/// One frame before all judges: a row and an entry each.
void judge_all(const std::vector<FrameJudge> &judges, const FrameParams &frame, std::size_t view,
               std::span<const HitRecord> hits, const ordered_json &labels, ordered_json &document,
               Totals &totals) {
  const std::array<double, 3> eye{frame.view.eye_x, frame.view.eye_y, frame.view.eye_z};
  const Dims dims{frame.grid.dims_x, frame.grid.dims_y, frame.grid.dims_z};
  for (const FrameJudge &judge : judges) {
    const std::string row =
        fmt::format("{}, isovalue {}, view {}", judge.oracle, frame.surface.isovalue, view);
    ordered_json entry = {{"oracle", judge.oracle}};
    if (judge.uses_embree && !within_embree_reach(eye, dims)) {
      const std::string why = out_of_reach(eye, dims);
      fmt::print("{:<28} left out: {}\n", row, why);
      entry["left_out"] = why;
    } else {
      const auto begin = Clock::now();
      const Accuracy tally = judge.judge(frame, hits);
      print_accuracy(row, tally);
      entry.update(accuracy_json(tally));
      entry["seconds"] = seconds_since(begin);
      totals.failures += tally.failures();
      ++totals.judged;
    }
    entry.update(labels);
    add_to_list(document, "frames", std::move(entry));
  }
}

/// A clipped frame before its oracle: a row and an entry.
void judge_clipped_frame(const ClipOracle &oracle, const FrameParams &frame, std::size_t view,
                         std::span<const HitRecord> hits, const ordered_json &labels,
                         ordered_json &document, Totals &totals) {
  const auto begin = Clock::now();
  const ClipAccuracy tally = judge_clipped(oracle, hits);
  print_clip_accuracy(fmt::format("clip, isovalue {}, view {}", frame.surface.isovalue, view),
                      tally);
  ordered_json entry = {{"oracle", "clip"}};
  entry.update(clip_accuracy_json(tally));
  entry["seconds"] = seconds_since(begin);
  entry.update(labels);
  add_to_list(document, "frames", std::move(entry));
  totals.failures += tally.failures();
  ++totals.judged;
}

std::vector<FrameJudge> make_judges(const std::vector<std::string> &names,
                                    std::span<const float> voxels, const Dims &dims,
                                    float isovalue) {
  std::vector<FrameJudge> judges;
  for (const std::string &name : names) {
    const auto begin = Clock::now();
    judges.push_back(make_judge(name, voxels, dims, isovalue));
    fmt::print("oracle {}, isovalue {}: {} ({:.1f} s)\n", name, isovalue, judges.back().contents,
               seconds_since(begin));
  }
  return judges;
}

}  // namespace

Drawer make_drawer(const VolumeAndViews &scene, const std::string &device, Solver solver,
                   std::uint32_t max_surfaces) {
  Drawer drawer;
  if (device.empty()) {
    drawer.renderer = std::make_unique<TwinRenderer>(scene.volume, scene.size, solver);
    return drawer;
  }
  if (device == "host") {
    drawer.name = device;
    drawer.renderer =
        std::make_unique<HostRenderer>(scene.volume, HostRendererOptions{.largest = scene.size});
    return drawer;
  }
  const ocl::DeviceInfo info = ocl::choose_device(device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  drawer.name = info.name;
  drawer.device = std::make_unique<ocl::Device>(info);
  CompileReport compiling(*drawer.device);
  RendererOptions options;
  options.size = scene.size;
  options.solver = solver;
  options.max_surfaces = max_surfaces;
  options.with_shading = false;
  drawer.renderer = std::make_unique<DeviceRenderer>(*drawer.device, scene.volume, options);
  compiling.finish();
  return drawer;
}

std::uint64_t verify_frames(const VerifyFramesOptions &options,
                            const std::vector<std::string> &solvers, ordered_json &document) {
  const VolumeAndViews scene = load_volume_and_views(options.input, options.volume, options.frame,
                                                     read_views(options.frame));
  const std::vector<std::vector<float>> voxels{
      decode_with_libzfp(scene.volume, options.frame.voxel_error)};
  const Clip clip = read_clip(options.clip, scene.volume.info);
  const glm::uvec3 dims = scene.volume.info.dims;
  std::vector<std::string> names = options.oracles;
  if (names.empty() && clip.planes.empty()) names = {"roots", "cells", "mesh"};
  Totals totals;
  for (const double given : options.frame.isovalues) {
    const float isovalue = drawn_isovalue(scene.volume, given);
    const auto judges = make_judges(names, voxels[0], {dims.x, dims.y, dims.z}, isovalue);
    for (const std::string &solver : solvers) {
      const Drawer drawer = make_drawer(scene, options.device, solver_from_string(solver));
      (clip.planes.empty() ? print_accuracy_header : print_clip_accuracy_header)(solver);
      for (std::size_t view = 0; view < scene.cameras.size(); ++view) {
        const FrameParams frame =
            make_frame_params(scene.volume.info, scene.cameras[view], scene.size, isovalue);
        const ordered_json labels = {{"volume", options.input},
                                     {"drawn_by", drawer.name},
                                     {"solver", solver},
                                     {"isovalue", isovalue},
                                     {"view", view}};
        drawer.renderer->render({.camera = scene.cameras[view],
                                 .isovalue = frame.surface.isovalue,
                                 .clip = clip,
                                 .voxel_error = options.frame.voxel_error,
                                 .normals = Normals::kCell});
        const std::vector<HitRecord> hits = drawer.renderer->hits();
        if (clip.planes.empty()) {
          judge_all(judges, frame, view, hits, labels, document, totals);
        } else {
          const ClipOracle oracle(scene.volume.info, scene.cameras[view], clip, {&frame, 1},
                                  voxels);
          judge_clipped_frame(oracle, frame, view, hits, labels, document, totals);
        }
        const Quantiles rounding =
            quantiles(ray_rounding(scene.volume.info, scene.cameras[view], scene.size, hits));
        fmt::print(
            "{:<28} float32 rays are off the camera's by p50 {:.1e}, p99 {:.1e}, max {:.1e} "
            "voxels\n",
            "", rounding.p50, rounding.p99, rounding.max);
        add_to_list(document, "ray_rounding_voxels", quantiles_json(rounding));
      }
    }
  }
  if (totals.judged == 0)
    throw Error("no frame of {} was judged: give --isovalue, or a nearer eye", options.input);
  return totals.failures;
}

void add_verify_frames_options(CLI::App &command, VerifyFramesOptions &options) {
  command.add_option("VOLUME", options.input,
                     "volume whose frames are judged, instead of the suite");
  add_volume_options(command, options.volume);
  add_frame_options(command, options.frame);
  add_clip_options(command, options.clip);
  command
      .add_option(
          "--surface", options.surfaces,
          "a surface as for `isowave render`, whose colour is not judged; repeat it for up "
          "to 8 surfaces in one frame. All layers of the scalar reference are judged, or the "
          "first one of what --device names [opacity 1]")
      ->type_name("VALUE[,COLOR[,OPACITY]]")
      ->allow_extra_args(false);
  command
      .add_option(
          "--oracle", options.oracles,
          "judge of frames: roots (every root on the ray, certified), cells (Embree through the "
          "dual cells) or mesh (Embree and triangles); repeat it [all]")
      ->check(CLI::IsMember({"roots", "cells", "mesh"}))
      ->allow_extra_args(false);  // one name each time: VOLUME may follow
  command.add_option(
      "--max-surface-error", options.max_surface_error,
      "judge each pixel's bound of render --max-surface-error instead, against the volume before "
      "compression [pixels]");
  command.add_option(
      "--device", options.device,
      "what draws frames, or is tested for leaks, beside the scalar reference: index, cpu, gpu, or "
      "a part of a device's name; for frames also host [frames: the scalar reference; leaks: as "
      "render]");
}

}  // namespace isowave::core::tools
