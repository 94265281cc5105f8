#pragma once
// Rays of a frame in packets of eight, for processors with AVX2, or with SSE4.1 alone, and for
// WebAssembly's relaxed vectors. Without fused multiply-add, both packets and single rays compute
// it by other means, packets for four at a time.

#include "core/host/host_loops.hpp"

#if defined(__x86_64__) || defined(__wasm_relaxed_simd__)
#define ISO_HAS_PACKETS 1

namespace isowave::core {

/// As HostLoops::trace(), with cells' gradients. For processors with avx2, bmi, bmi2, fma and
/// popcnt; in WebAssembly, for engines that fuse multiply-adds.
uint trace_packets(const FrameParams &frame, const HostField &field, const RayTile &tile,
                   HitRecord *hits);

/// The sides of the surface on which eight rays are where they begin and end in a level:
/// find_sides() of kernels_cl/portable/packet_sides.h. Bits count lanes.
struct BandSides {
  uchar at_begin[8], at_end[8];
  uint cut = 0, capped = 0;  ///< rays that begin at a clipping plane; those of a cap
  uint ended = 0;            ///< rays that end at one: no further band has any of them

  /// Where a ray was before it begins in the level.
  uint before(const uchar *at_end_of_last, uint lane) const {
    if ((cut >> lane & 1) == 0) return at_end_of_last[lane];
    return (capped >> lane & 1) != 0 ? ISO_SIDE_OUTSIDE : ISO_SIDE_UNKNOWN;
  }
};

/// Traces eight rays, 4 columns and 2 rows from (x, y) on, in their intervals in a level of detail,
/// and writes the hits of cells into hits [height * width].
///
/// by_lane  hits are [8] instead, by lane
/// lanes    bit column + 4 row: the rays to trace
/// Out      sides: where the rays begin, if that is behind their start; where the band ends, if it
///          does, of those that do not hit
/// Returns  those that hit something
uint trace_band_packet(const HostLevel &level, uint x, uint y, uint lanes, HitRecord *hits,
                       bool by_lane, BandSides *sides);

#ifdef __x86_64__
/// Traces some of eight rays on from their hits on a surface, in the level of detail that has the
/// hits, to their next cell with a crossing.
///
/// lanes, capped  bit column + 4 row: rays whose hits are crossings, and those whose hits are where
///                they begin in the level: on caps, and at borders
/// hits           [8]
/// Out            next [8], of rays that hit something there
void trace_packet_behind(const HostLevel &surface, uint x, uint y, uint lanes, uint capped,
                         const HitRecord *hits, HitRecord *next);

/// The same, for processors with sse4.1 and popcnt.
uint trace_packets_sse4(const FrameParams &frame, const HostField &field, const RayTile &tile,
                        HitRecord *hits);
uint trace_band_packet_sse4(const HostLevel &level, uint x, uint y, uint lanes, HitRecord *hits,
                            bool by_lane, BandSides *sides);
void trace_packet_behind_sse4(const HostLevel &surface, uint x, uint y, uint lanes, uint capped,
                              const HitRecord *hits, HitRecord *next);
#endif

}  // namespace isowave::core
#endif
