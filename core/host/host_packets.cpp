// Ids of blocks count on through all levels of detail. Before anything is included.
#define ISO_LEVELS 1
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

// Compilers split vectors that are too wide for a function's processor before they inline it. So
// all that has such vectors is compiled for the processor; what both kinds run is included before.
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,bmi,bmi2,fma,popcnt"))), \
                             apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,bmi,bmi2,fma,popcnt")
#endif
#define ISO_PACKET_NAMESPACE packets_avx2
#include "core/host/packet_trace.hpp"
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

namespace isowave::core {

uint trace_packets(const FrameParams &frame, const HostField &field, const RayTile &tile,
                   HitRecord *hits) {
  return packets_avx2::trace_tile(frame, field, tile, hits);
}
uint trace_band_packet(const HostLevel &level, uint x, uint y, uint lanes, HitRecord *hits,
                       bool by_lane, BandSides *sides) {
  return packets_avx2::trace_band(level, x, y, lanes, hits, by_lane, sides);
}
void trace_packet_behind(const HostLevel &surface, uint x, uint y, uint lanes, uint capped,
                         const HitRecord *hits, HitRecord *next) {
  packets_avx2::trace_behind(surface, x, y, lanes, capped, hits, next);
}

}  // namespace isowave::core
#endif
