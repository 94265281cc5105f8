#include "tools/isowave/pareto_ways.hpp"

#include <fmt/format.h>

#include "core/accuracy/image_error.hpp"
#include "core/api/choices.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "tools/isowave/renderer_options.hpp"

namespace isowave::core::tools {

namespace {

std::vector<ParetoWay> make_ways() {
  std::vector<ParetoWay> ways = {{.name = "default"}};
  for (const std::uint32_t rate : {8u, 4u, 2u})
    ways.push_back({.name = fmt::format("--rate {}", rate), .rate = rate});
  for (const double part : {0.002, 0.01}) {
    ways.push_back(
        {.name = fmt::format("--tolerance-relative {}", part), .tolerance_relative = part});
  }
  for (const std::uint32_t samples : {2u, 3u, 4u, 8u})
    ways.push_back({.name = fmt::format("--samples {}", samples), .samples = samples});
  for (const std::uint32_t samples : {2u, 4u}) {
    ways.push_back(
        {.name = fmt::format("--rate 4 --samples {}", samples), .rate = 4, .samples = samples});
  }
  for (const std::uint32_t part : {2u, 4u, 8u})
    ways.push_back({.name = fmt::format("1/{} size", part), .shrunk = part});
  for (const double pixels : {1.0, 2.0, 4.0})
    ways.push_back({.name = fmt::format("--voxel-pixels {}", pixels), .voxel_pixels = pixels});
  for (const std::uint32_t samples : {2u, 4u}) {
    ways.push_back({.name = fmt::format("--voxel-pixels 1 --samples {}", samples),
                    .samples = samples,
                    .voxel_pixels = 1});
  }
  ways.push_back({.name = "--voxel-error 4 %", .voxel_error = 0.04});
  for (const double error : {0.5, 1.0, 2.0}) {
    ways.push_back(
        {.name = fmt::format("--max-surface-error {}", error), .max_surface_error = error});
    ways.push_back({.name = fmt::format("--max-surface-error {} --by sample", error),
                    .max_surface_error = error,
                    .by = Evidence::kSample});
  }
  for (const double error : {0.02, 0.005}) {
    ways.push_back({.name = fmt::format("--max-image-error {}", error),
                    .samples = 4,
                    .max_image_error = error});
  }
  for (const double ms : {2.0, 5.0, 10.0, 20.0, 50.0})
    ways.push_back({.name = fmt::format("--time-budget {}", ms), .time_budget_ms = ms});
  for (const char *solver : {"linear", "marmitt", "analytic"})
    ways.push_back({.name = fmt::format("--solver {}", solver), .solver = solver});
  ways.push_back({.name = "--normals cell", .normals = Normals::kCell});
  ways.push_back({.name = "--pipeline blocks", .pipeline = "blocks"});
  for (const std::uint32_t rays : {16u, 64u})
    ways.push_back({.name = fmt::format("--ambient {}", rays), .ambient_rays = rays});
  ways.push_back({.name = "BCMC", .drawn_by = DrawnBy::kTriangles});
  ways.push_back({.name = "--device host", .drawn_by = DrawnBy::kHost});
  for (const std::uint32_t samples : {2u, 4u}) {
    ways.push_back({.name = fmt::format("--device host --samples {}", samples),
                    .drawn_by = DrawnBy::kHost,
                    .samples = samples});
  }
  return ways;
}

}  // namespace

const std::vector<ParetoWay> &pareto_ways() {
  static const std::vector<ParetoWay> ways = make_ways();
  return ways;
}

ImageSize size_of(const ParetoWay &way, ImageSize shown) {
  const auto part = [&](std::uint32_t pixels) { return (pixels - 1) / way.shrunk + 1; };
  return {part(shown.width), part(shown.height), way.samples};
}

std::unique_ptr<Renderer> make_renderer(ocl::Device &device, const CompressedVolume &volume,
                                        const ParetoWay &way, ImageSize shown) {
  const ImageSize own = size_of(way, shown),
                  size = way.max_image_error ? with_room_for_tiles(own) : own;
  if (way.drawn_by == DrawnBy::kHost)
    return std::make_unique<HostRenderer>(volume, HostRendererOptions{.largest = size});
  if (way.drawn_by == DrawnBy::kTriangles)
    return std::make_unique<MeshRenderer>(device, volume, MeshRendererOptions{.size = size});
  RendererFlags flags{.pipeline = way.pipeline, .solver = way.solver, .values = {}};
  flags.values.with_levels = way.needs_levels() && !volume.coarser_levels.empty();
  flags.values.with_bounds = way.needs_bounds();
  flags.values.with_kept_picture = way.time_budget_ms.has_value();
  flags.values.with_given_rays = way.ambient_rays != 0;
  return add_choices(
      std::make_unique<DeviceRenderer>(device, volume, to_renderer_options(flags, size)),
      {.with_time_budget = flags.values.with_kept_picture}, volume, volume.rate());
}

FrameRequest request_of(const ParetoWay &way, ImageSize shown, float isovalue, double value_range) {
  FrameRequest request;
  request.isovalue = isovalue;
  request.size = size_of(way, shown);
  request.voxel_pixels = way.voxel_pixels;
  request.voxel_error = way.voxel_error * value_range;
  request.max_surface_error = way.max_surface_error;
  request.by = way.by;
  request.max_image_error = way.max_image_error;
  request.time_budget_ms = way.time_budget_ms;
  request.normals = way.normals;
  request.ambient_rays = way.ambient_rays;
  return request;
}

}  // namespace isowave::core::tools
