// Ids of blocks count on through all levels of detail. Before anything is included.
#define ISO_LEVELS 1
// host_packets.cpp for processors with SSE4.1 alone.
#include "core/host/host_packets.hpp"

#ifdef __x86_64__
#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "core/frame/solvers.hpp"
#include "kernels_cl/portable/cell_intersect.h"
#include "kernels_cl/portable/ray_state.h"

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("sse4.1,popcnt"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("sse4.1,popcnt")
#endif
#define ISO_PACKET_NAMESPACE packets_sse4
#define ISO_PACKET_SSE4
#include "core/host/packet_trace.hpp"
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

namespace isowave::core {

uint trace_packets_sse4(const FrameParams &frame, const HostField &field, const RayTile &tile,
                        HitRecord *hits) {
  return packets_sse4::trace_tile(frame, field, tile, hits);
}
uint trace_band_packet_sse4(const HostLevel &level, uint x, uint y, uint lanes, HitRecord *hits,
                            bool by_lane, BandSides *sides) {
  return packets_sse4::trace_band(level, x, y, lanes, hits, by_lane, sides);
}
void trace_packet_behind_sse4(const HostLevel &surface, uint x, uint y, uint lanes, uint capped,
                              const HitRecord *hits, HitRecord *next) {
  packets_sse4::trace_behind(surface, x, y, lanes, capped, hits, next);
}

}  // namespace isowave::core
#endif
