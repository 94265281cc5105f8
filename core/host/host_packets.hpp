#pragma once
// Rays of a frame in packets of eight, for processors with AVX2. Others trace ray by ray: with
// vectors of four and fused multiply-add in software, packets take three times as long as that.

#include "core/host/host_loops.hpp"

#if defined(__x86_64__)
#define ISO_HAS_PACKETS 1

namespace isowave::core {

/// As HostLoops::trace(), with cells' gradients. For processors with avx2, bmi, bmi2, fma and
/// popcnt.
uint trace_packets(const FrameParams &frame, const HostField &field, const RayTile &tile,
                   HitRecord *hits);

}  // namespace isowave::core
#endif
