#pragma once
// Pipeline `rays` on CPUs: start_rays and march in one, eight rays at a time
// (kernels_cl/march_packets.cl).

#include <map>
#include <span>

#include "core/frame/solvers.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/wavefront.hpp"
#include "core/stream/device_stream.hpp"
#include "kernels/march_packets.hpp"

namespace isowave::core {

class MarchPackets {
 public:
  /// Whether it is faster there than start_rays and march: on CPUs whose drivers hold eight floats
  /// in a vector. Mesa's llvmpipe makes vectors of work-items instead, and would leave them empty.
  static bool suits(const ocl::DeviceInfo &device);
  /// Whether it has that solver.
  static bool has(Solver solver) { return solver.kind == ISO_SOLVER_BERNSTEIN; }

  /// Whether threads of that device may decode blocks on demand: if it orders memory as
  /// kernels_cl/device/on_demand.h says.
  static bool may_decode(const ocl::DeviceInfo &device);

  /// solver      one that it has
  /// on_demand   the stream that rays decode blocks from when they come to them; null: they wait
  ///             for blocks until the next pass. Whole on the device
  MarchPackets(ocl::Device &device, std::uint64_t num_pixels, Solver solver,
               const DeviceStream *on_demand = nullptr, SlotType slots = SlotType::kFloat32);

  /// Begins a frame of rays of the camera.
  ///
  /// In     rays.counts: next_active_count is 0
  void begin_frame() { begins_ = true; }
  /// Whether the next pass is the first of its frame.
  bool begins() const { return begins_; }

  /// A level of detail: its compressed blocks, and the frame whose part it draws.
  struct Band {
    const DeviceStream &stream;
    const FrameParams &frame;
  };
  /// The first pass of a frame that is clipped or that several levels draw, with blocks decoded on
  /// demand. Rays that wait then go on as March has it.
  ///
  /// bands       of the levels that draw, the finest first; their streams are whole on the device
  /// macrocells  of any level, since levels share what is used of them
  /// Out         as of the first pass below
  /// Waits       no
  void operator()(const Macrocells &macrocells, std::span<const Band> bands, BlockCache &cache,
                  Wavefront &rays);

  /// Takes rays of the finest level further, as far as what was requested in the pass before has
  /// been provided, or can be decoded on demand. In the first pass of a frame, these are the rays
  /// of the picture.
  ///
  /// stream  the volume; it may have got another layout, but must be of the same defines
  /// Out     rays.hits, in the first pass all of them; next_active_ray_ids and ray_block_ids of the
  ///         rays that wait; counts.active_count: rays that had met an active block before;
  ///         hit_count, granted_count (blocks intersected), next_active_count, free_count;
  ///         counts.decoded_count grows by the blocks decoded on demand
  /// Waits   no
  void operator()(const Macrocells &macrocells, const DeviceStream &stream, BlockCache &cache,
                  Wavefront &rays);

 private:
  void open(BlockCache &cache, Wavefront &rays, uint begins);
  /// What a launch begins with (ISO_BEGINS_*), and how many bands follow behind it.
  struct Begin {
    uint of, bands_behind;
  };
  void march(ocl::Kernel<kernels::march_packets> &kernel, const FrameParams &frame, Begin begin,
             const DeviceStream &stream, const Macrocells &macrocells, BlockCache &cache,
             Wavefront &rays);

  ocl::Device &device_;
  ocl::Defines defines_;  ///< of all kernels, besides those for decoding on demand
  bool on_demand_;
  ocl::Range range_;
  bool begins_ = false;  ///< the next pass is the first of its frame
  ocl::Kernel<kernels::open_packets> open_;
  ocl::Kernel<kernels::march_packets> march_;
  /// For bands, by their defines.
  std::map<ocl::Defines, ocl::Kernel<kernels::march_packets>> march_bands_;
};

}  // namespace isowave::core
