#pragma once
// Rays of a frame in packets of eight, for processors with AVX2, or with SSE4.1 alone. Without
// fused multiply-add, both packets and single rays compute it by other means, packets for four at a
// time.

#include "core/host/host_loops.hpp"

#if defined(__x86_64__)
#define ISO_HAS_PACKETS 1

namespace isowave::core {

/// As HostLoops::trace(), with cells' gradients. For processors with avx2, bmi, bmi2, fma and
/// popcnt.
uint trace_packets(const FrameParams &frame, const HostField &field, const RayTile &tile,
                   HitRecord *hits);
/// The same, for processors with sse4.1 and popcnt.
uint trace_packets_sse4(const FrameParams &frame, const HostField &field, const RayTile &tile,
                        HitRecord *hits);

}  // namespace isowave::core
#endif
