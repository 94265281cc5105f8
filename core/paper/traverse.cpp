#include "core/paper/traverse.hpp"

namespace isowave::core {

namespace {

ocl::Defines traverse_defines(std::uint32_t group_size, bool scanned_pairs) {
  ocl::Defines defines = group_defines(group_size);
  defines.insert({"ISO_SCANNED_PAIRS", scanned_pairs ? "1" : "0"});
  return defines;
}

}  // namespace

ocl::BufferSizes Traverse::sizes(std::uint64_t num_rays, std::uint32_t group_size,
                                 bool scanned_pairs) {
  if (!scanned_pairs) return {};
  return {
      ocl::buffer_size<uint>("rays by blocks ahead", ISO_MAX_SPECULATION + 1),
      ocl::buffer_size<uint>("pair tile sums", num_tiles(num_rays, group_size, ISO_SCAN_ITEMS))};
}

Traverse::Traverse(ocl::Device &device, std::uint64_t num_rays, std::uint32_t group_size,
                   bool scanned_pairs)
    : range_(ocl::Range::strided(num_rays, group_size, device).in_parts(num_rays, device)),
      kernel_(device, traverse_defines(group_size, false)) {
  if (scanned_pairs)
    scanned_.emplace(device, sizes(num_rays, group_size, scanned_pairs), group_size);
}

void Traverse::operator()(const Macrocells &macrocells, Wavefront &rays) {
  if (scanned_ && rays.frame.schedule.scanned_pairs != 0)
    return (*scanned_)(range_, macrocells, rays);
  kernel_(range_, rays.frame, range_.parts, macrocells.masks(), rays.counts, rays.active_ray_ids,
          rays.ray_block_ids, rays.pair_block_ids, rays.closest_pairs);
}

Traverse::Scanned::Scanned(ocl::Device &device, const ocl::BufferSizes &sizes,
                           std::uint32_t group_size)
    : tile(group_size * ISO_SCAN_ITEMS),
      histogram(device, sizes["rays by blocks ahead"]),
      tile_sums(device, sizes["pair tile sums"]),
      scan(device, group_size),
      count(device, traverse_defines(group_size, true)),
      share(device, traverse_defines(group_size, true)),
      tiles(device, traverse_defines(group_size, true)),
      begins(device, traverse_defines(group_size, true)),
      find(device, traverse_defines(group_size, true)) {}

void Traverse::Scanned::operator()(const ocl::Range &range, const Macrocells &macrocells,
                                   Wavefront &rays) {
  ocl::Buffer<uint> &num_blocks = rays.closest_pairs;  // not in use yet
  count(range, rays.frame, range.parts, macrocells.masks(), rays.counts, rays.active_ray_ids,
        rays.ray_block_ids, rays.pair_block_ids, num_blocks, histogram);
  share({1, 1}, rays.frame, rays.counts, histogram);
  tiles(range, rays.counts, num_blocks, tile_sums);
  scan(tile_sums, rays.counts, ISO_COUNT_FIELD(window_count), tile,
       ISO_COUNT_FIELD(pair_slot_count));
  begins(range, rays.counts, num_blocks, tile_sums, rays.pair_begins);
  find(range, rays.frame, range.parts, macrocells.masks(), rays.counts, rays.active_ray_ids,
       rays.pair_begins, rays.pair_rays, rays.ray_block_ids, rays.pair_block_ids, num_blocks);
}

}  // namespace isowave::core
