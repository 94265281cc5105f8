#pragma once
// The two pipelines: ways to arrange the stages of a pass of camera rays, with the same finished
// picture bit for bit.
//
//   rays    each ray intersects what it meets, as far as it is cached (core/render/ray_waves.hpp)
//   blocks  the paper's (core/render/blocks_wave.hpp)

#include <cstdint>
#include <string_view>

#include "core/stages/group.hpp"

namespace isowave::core {

enum class PipelineKind {
  kAuto,  ///< kRays, which was faster in nearly all that was measured (bench/README.md)
  kBlocks,
  kRays
};
std::string_view to_string(PipelineKind kind);

/// Packets of eight rays; where they cannot be had (MarchPackets), there are none.
enum class RayPackets { kAuto, kOn, kOff };

/// Blocks that packets decode when they come to them, instead of waiting for the next pass; never
/// where the stream stays on the host.
enum class DecodeOnDemand { kAuto, kOn, kOff };

/// The buffers of a pipeline beside those of BlockStore and Wavefront.
///
/// scanned_pairs: as Wavefront::Limits has it.
ocl::BufferSizes pipeline_sizes(PipelineKind kind, const Group::Limits &limits,
                                bool scanned_pairs = false);

}  // namespace isowave::core
