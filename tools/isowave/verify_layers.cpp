#include "tools/isowave/verify_layers.hpp"

#include <fmt/format.h>

#include <chrono>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/io/json_list.hpp"
#include "core/zfp/isovalue.hpp"
#include "reference/twin.hpp"
#include "tools/isowave/accuracy_report.hpp"
#include "tools/isowave/surface_options.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;

ordered_json surfaces_json(const std::vector<SurfaceStyle> &surfaces) {
  ordered_json json = ordered_json::array();
  for (const SurfaceStyle &surface : surfaces)
    json.push_back({{"isovalue", surface.isovalue}, {"opacity", surface.opacity}});
  return json;
}

}  // namespace

std::uint64_t verify_layers(const VerifyFramesOptions &options, ordered_json &document) {
  const std::vector<isowave::Surface> given = read_surfaces(options.surfaces);
  const VolumeAndViews scene = load_volume_and_views(options.input, options.volume, options.frame,
                                                     read_views(options.frame));
  std::vector<SurfaceStyle> surfaces;
  surfaces.reserve(given.size());
  for (const isowave::Surface &surface : given) {
    if (!surface.clipped)
      throw Error(
          "--surface VALUE,COLOR,OPACITY,whole: the oracle clips all surfaces: leave it out");
    surfaces.push_back(
        {.isovalue = drawn_isovalue(scene.volume, surface.isovalue), .opacity = surface.opacity});
  }
  check_surfaces(surfaces);
  const Clip clip = read_clip(options.clip, scene.volume.info);
  const std::vector<float> voxels = decode_with_libzfp(scene.volume, options.frame.voxel_error);
  const bool all_layers = options.device.empty();
  Drawer drawer;
  std::optional<Twin> twin;
  if (all_layers) {
    twin.emplace(scene.volume, 0, options.frame.voxel_error);
  } else {
    drawer = make_drawer(scene, options.device, kDefaultSolver,
                         static_cast<std::uint32_t>(surfaces.size()));
  }
  std::uint64_t failures = 0;
  print_layer_accuracy_header(drawer.name);
  for (std::size_t view = 0; view < scene.cameras.size(); ++view) {
    const Camera &camera = scene.cameras[view];
    std::vector<std::vector<HitRecord>> layers;
    if (all_layers) {
      layers = twin->render_layers({.camera = camera,
                                    .size = scene.size,
                                    .clip = clip,
                                    .surfaces = surfaces,
                                    .normals = Normals::kCell})
                   .layers;
    } else {
      FrameRequest request{.camera = camera, .clip = clip};
      request.surfaces = surfaces;
      request.voxel_error = options.frame.voxel_error;
      request.normals = Normals::kCell;
      drawer.renderer->render(request);
      layers = {drawer.renderer->hits()};
    }
    const auto begin = std::chrono::steady_clock::now();
    const LayerOracle oracle(scene.volume.info, camera, scene.size, clip, surfaces, voxels);
    const LayerAccuracy tally =
        all_layers ? judge_layers(oracle, layers) : judge_first_layer(oracle, layers[0]);
    print_layer_accuracy(fmt::format("{}, view {}", all_layers ? "layers" : "first layer", view),
                         tally);
    ordered_json entry = {{"oracle", "layers"}, {"judged", all_layers ? "all" : "first"}};
    entry.update(layer_accuracy_json(tally));
    entry["seconds"] = ms_since(begin) / 1000;
    entry["volume"] = options.input;
    entry["drawn_by"] = drawer.name;
    entry["surfaces"] = surfaces_json(surfaces);
    entry["view"] = view;
    add_to_list(document, "frames", std::move(entry));
    failures += tally.failures();
  }
  return failures;
}

}  // namespace isowave::core::tools
