#include "core/stages/ambient.hpp"

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
                                             ISO_MAX_AMBIENT_RAYS * ISO_AMBIENT_PATTERNS)};
}

Ambient::Ambient(ocl::Device &device, std::uint64_t num_pixels, bool levels, bool placed)
    : range_(ocl::Range::strided(num_pixels, ocl::kGroupSize, device)),
      directions_(device, sizes()["ambient directions"]),
      kernel_(device, defines_of(placed), levels) {}

void Ambient::begin(const VolumeInfo &info, std::size_t level, std::uint32_t num_rays) {
  check_ambient_rays(num_rays);
  level_ = static_cast<uint>(level);
  params_ = make_ambient_params(info);
  if (num_rays == num_rays_) return;
  directions_.write(make_ambient_directions(num_rays));
  num_rays_ = num_rays;
}

void Ambient::operator()(Wavefront &rays, std::uint32_t round) {
  kernel_.of(rays)(range_, rays.frame, rays.level_frames, rays.num_level_frames, rays.clip, level_,
                   params_, directions_, round, num_rays_, rays.hits, rays.given_hits, rays.given,
                   rays.open_counts);
  rays.num_ambient = round;
}

}  // namespace isowave::core
