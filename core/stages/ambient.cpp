#include "core/stages/ambient.hpp"

#include <algorithm>

namespace isowave::core {

namespace {

ocl::Defines defines_of(bool placed) {
  ocl::Defines defines = group_defines(ocl::kGroupSize);
  if (placed) defines.insert({"ISO_PLACED_HITS", "1"});
  return defines;
}

}  // namespace

ocl::BufferSizes Ambient::sizes() {
  return {ocl::buffer_size<AmbientDirection>("ambient directions",
                                             2 * ISO_MAX_AMBIENT_RAYS * ISO_AMBIENT_PATTERNS)};
}

Ambient::Ambient(ocl::Device &device, std::uint64_t num_pixels, bool levels, bool placed)
    : range_(ocl::Range::strided(num_pixels, ocl::kGroupSize, device)),
      directions_(device, sizes()["ambient directions"]),
      kernel_(device, defines_of(placed), levels),
      block_(device, defines_of(placed)),
      enter_(device, defines_of(placed)) {}

void Ambient::begin(const VolumeInfo &info, std::size_t level, const LightRays &light_rays,
                    std::uint32_t num_surfaces) {
  level_ = static_cast<uint>(level);
  num_surfaces_ = num_surfaces;
  params_ = make_ambient_params(info, light_rays.num_ambient);
  if (light_rays == light_rays_) return;
  directions_.write(make_light_directions(light_rays));
  light_rays_ = light_rays;
}

void Ambient::operator()(Wavefront &rays, std::uint32_t round) {
  kernel_.of(rays)(range_, rays.frame, rays.level_frames, rays.num_level_frames, rays.clip, level_,
                   params_, directions_, round, light_rays_.count(), num_surfaces_, rays.hits,
                   rays.given_hits, rays.given, rays.open_counts);
  rays.num_ambient = std::min(round, light_rays_.num_ambient);
  rays.num_shadow = round - rays.num_ambient;
}

void Ambient::block(Wavefront &rays) {
  block_(range_, rays.frame, rays.clip, level_, rays.given, rays.given_hits);
}

void Ambient::enter(Wavefront &rays, ocl::Buffer<HitRecord> *nearest) {
  enter_(range_, rays.frame, rays.clip, level_, nearest != nullptr ? 1 : 0, rays.given,
         nearest != nullptr ? *nearest : rays.given_hits);
}

}  // namespace isowave::core
