#include "core/stages/march_packets.hpp"

#include <utility>

#include "core/stages/levelled_kernel.hpp"
#include "core/stages/solver_defines.hpp"
#include "kernels_cl/portable/ray_state.h"

namespace isowave::core {

namespace {

/// A work-item of its own for each packet: its lanes are what a work-group is elsewhere.
ocl::Defines packet_defines(Solver solver) {
  ocl::Defines defines = group_defines(1);
  defines.merge(solver_defines(solver));
  return defines;
}

/// With the stream that rays decode blocks from, or none.
ocl::Defines with_stream(ocl::Defines defines, const DeviceStream *on_demand) {
  if (on_demand != nullptr) {
    defines.merge(on_demand->defines());
    defines.emplace("ISO_ON_DEMAND", "1");
  }
  return defines;
}

/// Rays of a chunk, which a work-item takes at a time: march_packets.cl.
constexpr std::uint64_t kChunkRays = 256;

/// Oclgrind would report what work-items do for each other.
ocl::Range range_of(const ocl::Device &device, std::uint64_t num_pixels, bool on_demand) {
  if (on_demand && device.info().platform == "Oclgrind") return {1, 1};
  return ocl::Range::strided((num_pixels + kChunkRays - 1) / kChunkRays, 1, device);
}

}  // namespace

bool MarchPackets::suits(const ocl::DeviceInfo &device) {
  return device.type == ocl::DeviceType::kCpu && device.capabilities.native_float_width >= 8;
}

bool MarchPackets::may_decode(const ocl::DeviceInfo &device) {
  return device.type == ocl::DeviceType::kCpu && device.platform == "Portable Computing Language";
}

MarchPackets::MarchPackets(ocl::Device &device, std::uint64_t num_pixels, Solver solver,
                           const DeviceStream *on_demand, SlotType slots)
    : device_(device),
      defines_(with_slots(packet_defines(solver), slots)),
      on_demand_(on_demand != nullptr),
      range_(range_of(device, num_pixels, on_demand_)),
      open_(device, with_stream(defines_, on_demand)),
      march_(device, with_stream(defines_, on_demand)) {}

void MarchPackets::open(BlockCache &cache, Wavefront &rays, uint begins) {
  open_({1, 1}, rays.frame, begins, rays.previous_counts, rays.counts, rays.next_counts,
        cache.state);
}

void MarchPackets::march(ocl::Kernel<kernels::march_packets> &kernel, const FrameParams &frame,
                         Begin begin, const DeviceStream &stream, const Macrocells &macrocells,
                         BlockCache &cache, Wavefront &rays) {
  const ocl::Buffer<uint> &none = macrocells.masks();  // stands in for what is not read
  const auto part = [&](std::size_t i) -> const ocl::Buffer<uint> & {
    return on_demand_ ? stream.part(i) : none;
  };
  kernel(range_, frame, rays.clip, begin.of, begin.bands_behind, part(0), part(1), part(2), part(3),
         on_demand_ ? stream.index() : none, stream.layout, macrocells.masks(), macrocells.ranges(),
         macrocells.no_data().words_or(none), macrocells.no_data().begin, cache.table, cache.inside,
         cache.changing, cache.values, rays.previous_counts, rays.counts, rays.active_ray_ids,
         rays.next_active_ray_ids, rays.ray_block_ids, rays.hits, cache.slot_block_ids,
         cache.slot_stamps, cache.requested_bits, cache.free_slots, cache.state);
}

void MarchPackets::operator()(const Macrocells &macrocells, const DeviceStream &stream,
                              BlockCache &cache, Wavefront &rays) {
  const uint begins = std::exchange(begins_, false) ? ISO_BEGINS_FRAME : 0;
  open(cache, rays, begins);
  march(march_, rays.frame, {begins, 0}, stream, macrocells, cache, rays);
}

void MarchPackets::operator()(const Macrocells &macrocells, std::span<const Band> bands,
                              BlockCache &cache, Wavefront &rays) {
  begins_ = false;
  uint begins = ISO_BEGINS_FRAME;
  open(cache, rays, begins);
  for (const Band &band : bands) {
    ocl::Defines defines = with_levels(with_stream(defines_, &band.stream), true);
    if (rays.is_clipped()) defines = with_clip(std::move(defines));
    auto found = march_bands_.find(defines);
    if (found == march_bands_.end())
      found = march_bands_.try_emplace(defines, device_, defines).first;
    ocl::Kernel<kernels::march_packets> &kernel = found->second;
    FrameParams frame = band.frame;
    frame.screen = bands.front().frame.screen;  // packets beside it have drawn nothing
    const auto behind = static_cast<uint>(&bands.back() - &band);
    march(kernel, frame, {std::exchange(begins, ISO_BEGINS_BAND), behind}, band.stream, macrocells,
          cache, rays);
  }
}

}  // namespace isowave::core
