#include "core/stages/march_packets.hpp"

#include <utility>

namespace isowave::core {

namespace {

/// A work-item of its own for each packet: its lanes are what a work-group is elsewhere.
ocl::Defines packet_defines(Solver solver) {
  ocl::Defines defines = group_defines(1);
  defines.merge(solver_defines(solver));
  return defines;
}

/// Rays of a chunk, which a work-item takes at a time: march_packets.cl.
constexpr std::uint64_t kChunkRays = 256;

}  // namespace

bool MarchPackets::suits(const ocl::DeviceInfo &device) {
  return device.type == ocl::DeviceType::kCpu && device.capabilities.native_float_width >= 8;
}

MarchPackets::MarchPackets(ocl::Device &device, std::uint64_t num_pixels, Solver solver)
    : range_(ocl::Range::strided((num_pixels + kChunkRays - 1) / kChunkRays, 1, device)),
      begin_(device, "march_packets", "begin_packets", packet_defines(solver)),
      march_(device, "march_packets", "march_packets", packet_defines(solver)) {}

void MarchPackets::begin_frame(Wavefront &rays) {
  begin_({1, 1}, rays.counts, rays.next_counts);
  begins_ = true;
}

void MarchPackets::operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  march_(range_, rays.frame, std::exchange(begins_, false) ? 1u : 0u, macrocells.masks(),
         cache.table, cache.inside, cache.values, rays.previous_counts, rays.counts,
         rays.next_counts, rays.active_ray_ids, rays.next_active_ray_ids, rays.ray_block_ids,
         rays.hits, cache.slot_stamps, cache.state);
}

}  // namespace isowave::core
