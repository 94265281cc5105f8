// Rays -> hits, or the blocks that they wait at: march.cl. The first pass of a frame, all blocks
// cached, where every ray hits or leaves; and none cached, where all wait. march/given: the
// camera's rays as a list of rays of any origin. march/levels: a frame that two levels of detail
// draw, all blocks cached.

#include <algorithm>

#include "bench/rays_rig.hpp"
#include "bench/scenes.hpp"
#include "core/view/detail.hpp"

namespace isowave::core::bench {
namespace {

struct MarchInput : RaysRig {
  MarchInput(ocl::Device &device, std::int64_t width, bool cached) : RaysRig(device, width) {
    if (!cached) cache.clear();
    start_first_pass();
    march(macrocells, cache, rays);
    const PassCounts counts = read_counts();
    check(counts.hit_count == (cached ? num_hits : 0), "hits of the frame drawn again");
    check(counts.next_active_count == (cached ? 0 : num_started), "rays that wait");
  }
};

void march_rays(benchmark::State &state) {
  auto &in = input<MarchInput>(state.range(0), state.range(1) != 0);
  const double written = state.range(1) != 0 ? double(in.num_hits) * sizeof(HitRecord)
                                             : 2.0 * sizeof(uint) * in.num_started;
  measure(
      state, {double(in.num_started), written + 2.0 * sizeof(uint) * in.num_started},
      [&] { in.start_first_pass(); }, [&] { in.march(in.macrocells, in.cache, in.rays); });
  state.counters["hits"] = state.range(1) != 0 ? double(in.num_hits) : 0;
}

struct MarchGivenInput : RaysRig {
  MarchGivenInput(ocl::Device &device, std::int64_t width)
      : RaysRig(device, width, true),
        start_given(device, rays.num_rays, kGroupSize, false, RaySource::kGiven),
        march_given(device, rays.num_rays, kGroupSize, kDefaultSolver, false, RaySource::kGiven) {
    std::vector<GivenRay> given(rays.num_rays);
    for (uint pixel = 0; pixel < given.size(); ++pixel) {
      const Ray ray = make_ray(&params, pixel);
      given[pixel] = {ray.x.o, ray.y.o, ray.z.o, ray.x.d, ray.y.d, ray.z.d, 0};
    }
    rays.given.write(given);
    start();
    num_given = previous_active();
    march_given(macrocells, cache, rays);
    const PassCounts counts = read_counts();
    check(counts.hit_count > num_hits / 100 * 99, "hits of the camera's rays");
    check(counts.next_active_count == 0, "rays that wait");
  }

  void start() {
    rays.forget_rays();
    start_given(macrocells, rays);
    rays.open_pass();
  }
  uint previous_active() const { return rays.previous_counts.read()[0].next_active_count; }

  StartRays start_given;
  March march_given;
  uint num_given = 0;
};

void march_given(benchmark::State &state) {
  auto &in = input<MarchGivenInput>(state.range(0));
  const auto hits = static_cast<double>(in.num_hits), given = static_cast<double>(in.num_given);
  const double bytes = hits * sizeof(HitRecord) + given * (sizeof(GivenRay) + 2 * sizeof(uint));
  measure(
      state, {given, bytes}, [&] { in.start(); },
      [&] { in.march_given(in.macrocells, in.cache, in.rays); });
}

const CompressedVolume &layer_of_two_levels() {
  return mixing_layer(256, 4, 2);
}

RendererOptions options_of_levels(std::int64_t width, ocl::Device &device) {
  return checked({.size = image_of_width(width),
                  .cache_slots = static_cast<std::uint32_t>(layer_of_two_levels().block_count()),
                  .with_levels = true},
                 layer_of_two_levels(), device);
}

/// Levels of detail that begin before the point that the camera looks at.
std::ptrdiff_t num_levels_before(const std::vector<FrameParams> &frames, const Camera &camera) {
  return std::ranges::count_if(frames, [&](const FrameParams &frame) {
    return draws(frame) && double{frame.band.begin_t} * double{frame.view.t_scale} <
                               glm::distance(camera.eye, camera.at);
  });
}

struct MarchLevelsInput {
  MarchLevelsInput(ocl::Device &device, std::int64_t width)
      : blocks(device, layer_of_two_levels(), options_of_levels(width, device),
               make_plan(device, layer_of_two_levels(), options_of_levels(width, device))),
        rays(device, blocks.plan.limits.rays),
        start_rays(device, rays.num_rays, kGroupSize, true),
        march(device, rays.num_rays, kGroupSize, kDefaultSolver, true, RaySource::kCamera,
              blocks.cache.slot_type),
        request_ahead(device, rays.num_rays, kGroupSize, true) {
    std::vector<VolumeInfo> infos;
    std::vector<DecodedValues> values;
    for (const Level &level : blocks.levels) {
      infos.push_back(level.info);
      values.push_back({level.stream.layout, 0});
    }
    // The coarser level takes over in the middle of the volume.
    const Camera camera = orbit_cameras(infos[0], 1).front();
    std::vector<FrameParams> frames;
    for (double voxel_pixels = 0.5; num_levels_before(frames, camera) < 2; voxel_pixels *= 1.1)
      frames = make_level_frames(infos, camera, image_of_width(width), kMixingLayerIsovalue,
                                 voxel_pixels);
    blocks.open(rays, frames, values, FieldBound::kNone, RaySource::kCamera);
    start_frame();
    num_started = read_counts().next_active_count;
    while (read_counts().next_active_count != 0) {
      rays.open_pass();
      blocks.provide(rays);
      march(macrocells(), blocks.cache, rays);
      request_ahead(macrocells(), blocks.cache, rays);
      blocks.expect_requests();
      num_hits += read_counts().hit_count;
    }
    start_first_pass();
    march(macrocells(), blocks.cache, rays);
    check(num_hits > 0 && read_counts().hit_count + read_counts().next_active_count >= num_hits,
          "hits of the frame drawn again");
  }

  void start_frame() {
    rays.forget_rays();
    start_rays(macrocells(), rays, true);
  }
  void start_first_pass() {
    start_frame();
    rays.open_pass();
  }
  const Macrocells &macrocells() const { return blocks.levels[0].macrocells; }
  PassCounts read_counts() const { return rays.counts.read()[0]; }

  BlockStore blocks;
  Wavefront rays;
  StartRays start_rays;
  March march;
  RequestAhead request_ahead;
  uint num_started = 0;
  std::uint64_t num_hits = 0;
};

/// A ray that crosses the border waits there for the next pass, so the pass hits less than the
/// frame.
void march_levels(benchmark::State &state) {
  auto &in = input<MarchLevelsInput>(state.range(0));
  const PassCounts pass = in.read_counts();
  const double bytes = double(pass.hit_count) * sizeof(HitRecord) +
                       2.0 * sizeof(uint) * (pass.next_active_count + double(in.num_started));
  measure(
      state, {double(in.num_started), bytes}, [&] { in.start_first_pass(); },
      [&] { in.march(in.macrocells(), in.blocks.cache, in.rays); });
  state.counters["hits"] = double(pass.hit_count);
}

const bool kRegistered = [] {
  stage_benchmark("march", march_rays)
      ->ArgNames({"width", "cached"})
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {0, 1}});
  stage_benchmark("march/levels", march_levels)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  stage_benchmark("march/given", march_given)
      ->ArgName("width")
      ->ArgsProduct({{kWidths.begin(), kWidths.end()}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
