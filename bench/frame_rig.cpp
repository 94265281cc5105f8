#include "bench/frame_rig.hpp"

#include <algorithm>

#include "bench/scenes.hpp"

namespace isowave::core::bench {

namespace {

std::uint32_t slots_of(const CompressedVolume &volume, const FrameSetup &setup) {
  if (setup.cache_slots != 0) return setup.cache_slots;
  return static_cast<std::uint32_t>(std::max<std::uint64_t>(volume.block_count(), kMinCacheSlots));
}

}  // namespace

FrameRig::FrameRig(ocl::Device &device, const CompressedVolume &volume, const FrameSetup &setup)
    : params(make_frame_params(volume.info, setup.camera, setup.size, setup.isovalue)),
      rays(device, {.num_rays = setup.size.num_pixels(),
                    .with_given = setup.with_given,
                    .scanned_pairs = setup.scanned_pairs}),
      blocks(device, volume, DeviceStream(device, volume),
             BlockCache::limits_for(params.grid, slots_of(volume, setup), rays.num_rays),
             kGroupSize),
      compaction(device, rays.num_rays, kGroupSize),
      initial_rays(device, rays.num_rays),
      speculation(device),
      traverse(device, rays.num_rays, kGroupSize, setup.scanned_pairs),
      group(device, {rays.num_rays, cache.num_slots, kGroupSize}),
      intersect(device, rays.num_rays, kGroupSize),
      composite(device, rays.num_rays) {
  blocks.open(rays, {params}, {{stream.layout, 0}}, FieldBound::kNone, RaySource::kCamera);
  rays.frame.schedule.max_spec_count = setup.max_speculation;
  rays.frame.schedule.scanned_pairs = setup.scanned_pairs;
  params = rays.frame;
}

void FrameRig::start() {
  initial_rays(rays, compaction);
}

void FrameRig::thin_wavefront(std::uint32_t spec_count) {
  PassCounts counts = read_counts();
  std::vector<uint> ray_ids(counts.next_active_count);
  rays.next_active_ray_ids.read(ray_ids);
  const std::size_t wanted = rays.num_rays / spec_count;
  const std::size_t stride = std::max<std::size_t>(1, (ray_ids.size() + wanted - 1) / wanted);
  std::vector<uint> kept;
  for (std::size_t i = 0; i < ray_ids.size(); i += stride) kept.push_back(ray_ids[i]);
  counts.next_active_count = static_cast<uint>(kept.size());
  rays.next_active_ray_ids.write(kept);
  rays.counts.write({&counts, 1});
}

void FrameRig::find_blocks() {
  traverse(macrocells, rays);
  cache.request(rays);
  blocks.provide(rays.counts, {}, rays);
  group(cache, rays);
}

PassCounts FrameRig::run_pass() {
  begin_pass();
  find_blocks();
  intersect(cache, group.groups(), rays);
  composite(cache, rays, compaction);
  return read_counts();
}

FrameSetup mixing_layer_setup(std::int64_t edge, ImageSize size, std::uint32_t max_speculation) {
  FrameSetup setup;
  setup.camera = orbit_cameras(mixing_layer(edge).info, 1).front();
  setup.size = size;
  setup.isovalue = kMixingLayerIsovalue;
  setup.max_speculation = max_speculation;
  return setup;
}

}  // namespace isowave::core::bench
