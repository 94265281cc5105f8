#pragma once
// The passes of a frame: two ways to arrange the same stages, with the same finished picture bit
// for bit.
//
//   blocks  [ traverse -> request -> cache -> decode -> group -> intersect -> composite ]*
//           the paper's (Sec. 3.3 to 4.4)
//   rays    start_rays -> march -> request -> [ cache -> decode -> march -> request ]*
//           each ray intersects what it meets, as far as it is cached; on CPUs march_packets does
//           the work of start_rays and march, and of cache and decode where there are free slots

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/stages/block_cache.hpp"
#include "core/stages/group.hpp"
#include "core/stages/macrocells.hpp"
#include "core/frame/solvers.hpp"
#include "core/stages/wavefront.hpp"
#include "core/stages/zfp_decode.hpp"
#include "core/zfp/level_bounds.hpp"

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

/// The volume on the device, or one of its levels of detail.
struct Level {
  VolumeInfo info;
  BlockPrecision precision;  ///< of its blocks
  LevelError error;          ///< of its field against the volume's
  DeviceStream stream;
  Macrocells macrocells;
  ZfpDecode decode;
  FrameParams frame{};     ///< its part of the frame at work
  double range_error = 0;  ///< of voxels of fewer bit planes, at most
};

/// Levels of detail: from `first` to below `end`.
struct LevelRange {
  std::size_t first = 0, end = 1;
};

/// What every pipeline works on.
struct FrameState {
  ocl::Device &device;
  std::vector<Level> levels;  ///< the finest first
  Wavefront rays;
  BlockCache cache;
  LevelRange drawing{};          ///< the frame at work
  bool slots_are_scarce = true;  ///< free slots may not suffice for the next passes
  bool counts_touched = false;   ///< passes count the blocks that they touch, see BlockCache

  /// Cache and decode: the blocks asked for, asked.requested_count, of those levels, get slots and
  /// values. Asynchronous but where the stream stays on the host: see ZfpDecode. Where that throws,
  /// cache and counts are as they were made.
  void provide_blocks(const CountsBuffer &asked, LevelRange of);

  /// As BlockCache::resize(), with what depends on it. No ray and no request of the frame before is
  /// left.
  void resize_cache(const BlockCache::Limits &limits);
};

class Pipeline {
 public:
  virtual ~Pipeline() = default;
  /// Makes the frame's rays from state.rays.frame.
  ///
  /// Waits  no
  virtual void begin_frame() = 0;
  /// Enqueues one pass: a chain of launches whose sizes live on the device.
  ///
  /// Waits  no
  virtual void enqueue_pass() = 0;
  /// Says that no ray is left in the frame. Without it, the next frame knows that passes of this
  /// one were not followed up.
  virtual void end_frame() {}
  /// For a cache of so many slots from now on: as BlockCache::resize(). Between frames.
  virtual void resize_cache(std::uint32_t num_slots) { (void)num_slots; }
};

/// The buffers of a pipeline beside those of FrameState. limits: of its Group, if it has one;
/// scanned_pairs: as Wavefront::Limits has it.
ocl::BufferSizes pipeline_sizes(PipelineKind kind, const Group::Limits &limits,
                                bool scanned_pairs = false);

/// `state` must outlive the pipeline.
std::unique_ptr<Pipeline> make_pipeline(PipelineKind kind, FrameState &state,
                                        const Group::Limits &limits, Solver solver,
                                        ClosestHit closest, RayPackets packets = RayPackets::kAuto,
                                        DecodeOnDemand on_demand = DecodeOnDemand::kAuto);

/// Pipeline `rays` for the rays state.rays.given: what they hit is in given_hits. state.rays.frame
/// has as many as a picture has pixels.
std::unique_ptr<Pipeline> make_given_pipeline(FrameState &state, std::uint32_t group_size,
                                              Solver solver);

}  // namespace isowave::core
