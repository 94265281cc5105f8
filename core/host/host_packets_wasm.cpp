// Ids of blocks count on through all levels of detail. Before anything is included.
#define ISO_LEVELS 1
// host_packets.cpp for WebAssembly's relaxed vectors.
#include "core/host/host_packets.hpp"

#ifdef __wasm_relaxed_simd__
#define ISO_PACKET_NAMESPACE packets_wasm
#include "core/host/packet_trace.hpp"

namespace isowave::core {

uint trace_packets(const FrameParams &frame, const HostField &field, const RayTile &tile,
                   HitRecord *hits) {
  return packets_wasm::trace_tile(frame, field, tile, hits);
}
uint trace_band_packet(const HostLevel &level, uint x, uint y, uint lanes, HitRecord *hits,
                       bool by_lane, BandSides *sides) {
  return packets_wasm::trace_band(level, x, y, lanes, hits, by_lane, sides);
}

}  // namespace isowave::core
#endif
