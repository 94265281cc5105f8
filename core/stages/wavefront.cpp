#include "core/stages/wavefront.hpp"

#include <cstring>

namespace isowave::core {

ocl::BufferSizes Wavefront::sizes(const Limits &limits) {
  const std::uint64_t rays = limits.num_rays, pairs = limits.with_pairs ? rays : 0,
                      given = limits.with_given ? rays : 0, bounced = limits.bounced_sums * rays,
                      scanned = limits.scanned_pairs ? rays : 0,
                      walks = limits.with_walks ? rays : 0;
  return {ocl::buffer_size<PassCounts>("pass counts", 1),
          ocl::buffer_size<PassCounts>("pass counts, previous", 1),
          ocl::buffer_size<PassCounts>("pass counts, next", 1),
          ocl::buffer_size<FrameParams>("level frames", limits.num_levels),
          ocl::buffer_size<ClipParams>("clipping planes", 1),
          ocl::buffer_size<HitRecord>("hits", rays),
          ocl::buffer_size<GivenRay>("given rays", given),
          ocl::buffer_size<HitRecord>("hits of given rays", given),
          ocl::buffer_size<uchar>("open ambient rays", 2 * given),
          ocl::buffer_size<float>("bounced light", bounced),
          ocl::buffer_size<float>("bounced light, next", bounced),
          ocl::buffer_size<float>("field values", limits.with_field ? rays : 0),
          ocl::buffer_size<uint>("ray states", walks),
          ocl::buffer_size<uint>("active ray ids", walks),
          ocl::buffer_size<uint>("active ray ids, next", walks),
          ocl::buffer_size<uint>("mask", pairs),
          ocl::buffer_size<uint>("pair block ids", pairs),
          ocl::buffer_size<PairHit>("pair hits", pairs),
          ocl::buffer_size<uint>("pair begins", scanned == 0 ? 0 : scanned + 1),
          ocl::buffer_size<uint>("rays of pairs", scanned),
          ocl::buffer_size<uint>("closest pairs", pairs)};
}

Wavefront::Wavefront(ocl::Device &device, const Limits &limits)
    : Wavefront(device, limits.num_rays, sizes(limits)) {}

Wavefront::Wavefront(ocl::Device &device, std::uint64_t rays, const ocl::BufferSizes &sizes)
    : num_rays(rays),
      level_frames(device, sizes["level frames"]),
      clip(device, sizes["clipping planes"]),
      counts(device, sizes["pass counts"]),
      previous_counts(device, sizes["pass counts, previous"]),
      next_counts(device, sizes["pass counts, next"]),
      hits(device, sizes["hits"]),
      given(device, sizes["given rays"]),
      given_hits(device, sizes["hits of given rays"]),
      open_counts(device, sizes["open ambient rays"]),
      bounced(device, sizes["bounced light"]),
      bounced_next(device, sizes["bounced light, next"]),
      field_values(device, sizes["field values"]),
      ray_block_ids(device, sizes["ray states"]),
      active_ray_ids(device, sizes["active ray ids"]),
      next_active_ray_ids(device, sizes["active ray ids, next"]),
      mask(device, sizes["mask"]),
      pair_block_ids(device, sizes["pair block ids"]),
      pair_hits(device, sizes["pair hits"]),
      pair_begins(device, sizes["pair begins"]),
      pair_rays(device, sizes["rays of pairs"]),
      closest_pairs(device, sizes["closest pairs"]) {
  reset_counts();
  clip.write({&clip_params_, 1});
}

void Wavefront::set_clip(const ClipParams &params) {
  // Whole volumes are all alike.
  const ClipParams next = params.num_planes == 0 ? ClipParams{} : params;
  if (std::memcmp(&next, &clip_params_, sizeof(next)) == 0) return;
  clip_params_ = next;
  clip.write({&clip_params_, 1});
}

}  // namespace isowave::core
