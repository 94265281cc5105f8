#pragma once
// The stages of one frame with nothing hidden: for benchmarks that stop between two of them.

#include "bench/harness.hpp"
#include "core/paper/composite.hpp"
#include "core/paper/group.hpp"
#include "core/paper/initial_rays.hpp"
#include "core/paper/intersect.hpp"
#include "core/paper/speculation.hpp"
#include "core/paper/traverse.hpp"
#include "core/render/block_store.hpp"
#include "core/view/frame.hpp"

namespace isowave::core::bench {

/// The scene and the limits of a rig.
struct FrameSetup {
  Camera camera;
  ImageSize size;
  float isovalue = 0;
  std::uint32_t max_speculation = 1;
  bool scanned_pairs = false;
  std::uint32_t cache_slots = 0;  ///< 0: all blocks
  bool with_given = false;        ///< there may be rays of RaySource::kGiven
};

class FrameRig {
 public:
  FrameRig(ocl::Device &device, const CompressedVolume &volume, const FrameSetup &setup);

  /// Makes the rays of the frame.
  void start();
  /// Keeps every n-th ray, n = rays / (pixels / spec_count), so that the next pass has N_Spec =
  /// spec_count (as long as max_speculation allows it).
  ///
  /// Waits  yes
  void thin_wavefront(std::uint32_t spec_count);
  /// The pass's stages from N_Spec on, up to (and without) traverse, intersect, composite.
  void begin_pass() { speculation.begin_pass(rays); }
  void find_blocks();  ///< traverse .. group
  /// A whole pass. Returns what it counted.
  ///
  /// Waits  yes
  PassCounts run_pass();

  PassCounts read_counts() const { return rays.counts.read()[0]; }

  FrameParams params;
  Wavefront rays;
  BlockStore blocks;
  DeviceStream &stream = blocks.levels[0].stream;
  Macrocells &macrocells = blocks.levels[0].macrocells;
  BlockCache &cache = blocks.cache;
  Compaction compaction;
  InitialRays initial_rays;
  Speculation speculation;
  Traverse traverse;
  Group group;
  Intersect intersect;
  Composite composite;
};

/// A frame of mixing_layer(edge) as the default orbit's first camera sees it.
FrameSetup mixing_layer_setup(std::int64_t edge, ImageSize size, std::uint32_t max_speculation);

/// Puts counts and ray states back as they were: stages that change them can run again.
class WavefrontSnapshot {
 public:
  explicit WavefrontSnapshot(Wavefront &rays)
      : rays_(rays), counts_(rays.counts.read()), ray_block_ids_(rays.ray_block_ids.read()) {}
  void restore() const {
    rays_.counts.write(counts_);
    rays_.ray_block_ids.write(ray_block_ids_);
  }

 private:
  Wavefront &rays_;
  std::vector<PassCounts> counts_;
  std::vector<uint> ray_block_ids_;
};

}  // namespace isowave::core::bench
