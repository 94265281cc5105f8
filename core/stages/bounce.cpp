#include "core/stages/bounce.hpp"

#include <span>
#include <utility>
#include <vector>

#include "kernels_cl/portable/bounce.h"

namespace isowave::core {

ocl::BufferSizes Bounce::sizes(std::uint64_t layer_rays) {
  return {ocl::buffer_size<AmbientDirection>("directions to the light",
                                             ISO_MAX_AMBIENT_RAYS * ISO_AMBIENT_PATTERNS),
          ocl::buffer_size<HitRecord>("nearest hits of ambient rays", layer_rays)};
}

Bounce::Bounce(ocl::Device &device, std::uint64_t num_pixels, bool levels, std::uint64_t layer_rays)
    : nearest(device, sizes(layer_rays)["nearest hits of ambient rays"]),
      range_(ocl::Range::strided(num_pixels, ocl::kGroupSize, device)),
      directions_(device, sizes(layer_rays)["directions to the light"]),
      nearest_(device, group_defines(ocl::kGroupSize)),
      rays_(device, group_defines(ocl::kGroupSize), levels),
      add_(device, group_defines(ocl::kGroupSize)),
      add_colored_(device, group_defines(ocl::kGroupSize)),
      place_(device, group_defines(ocl::kGroupSize)),
      filter_(device, group_defines(ocl::kGroupSize)) {}

void Bounce::begin(const VolumeInfo &info, std::size_t level, const LightRays &light_rays,
                   std::uint32_t num_surfaces) {
  level_ = static_cast<uint>(level);
  num_surfaces_ = num_surfaces;
  params_ = make_ambient_params(info, light_rays.num_ambient);
  if (light_rays == light_rays_) return;
  const std::vector<AmbientDirection> all = make_light_directions(light_rays);
  directions_.write(
      std::span(all).subspan(std::size_t{light_rays.num_ambient} * ISO_AMBIENT_PATTERNS));
  light_rays_ = light_rays;
}

void Bounce::take_nearest(const Wavefront &rays, std::uint32_t surface) {
  nearest_(range_, rays.frame, rays.clip, level_, surface, rays.given, rays.given_hits, nearest);
}

void Bounce::go_to_light(Wavefront &rays, std::uint32_t round, const ocl::Buffer<HitRecord> &met) {
  rays_.of(rays)(range_, rays.frame, rays.level_frames, rays.num_level_frames, rays.clip, level_,
                 params_, directions_, light_row(light_rays_.num_shadow, round), met, rays.given,
                 rays.open_counts, rays.bounced_next);
  rays.num_ambient = round + 1;
}

void Bounce::add(Wavefront &rays, std::uint32_t round) {
  add_(range_, rays.frame, rays.clip, level_, round, rays.given_hits, rays.bounced_next, rays.given,
       rays.bounced);
  rays.num_bounced = round + 1;
}

void Bounce::add_colored(Wavefront &rays, std::uint32_t round,
                         const ocl::Buffer<LayerParams> &layers, uint has_map) {
  add_colored_(range_, rays.frame, round, has_map, layers, nearest, rays.bounced_next, rays.given,
               rays.bounced);
  rays.num_bounced = round + 1;
}

void Bounce::filter(Wavefront &rays, std::uint32_t num_sums) {
  place_(range_, rays.frame, params_, num_surfaces_, rays.hits, rays.given);
  for (uint step = 0; step < ISO_BOUNCE_STEPS; ++step) {
    filter_(range_, rays.frame.view.width, rays.frame.view.height, num_sums, 1u << step, rays.given,
            rays.bounced, rays.bounced_next);
    std::swap(rays.bounced, rays.bounced_next);
  }
}

}  // namespace isowave::core
