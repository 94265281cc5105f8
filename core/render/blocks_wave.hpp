#pragma once
// Pipeline `blocks`, the paper's (Sec. 3.3 to 4.4): rays are gathered by the blocks they meet.
//
//   [ traverse -> request -> cache -> decode -> group -> intersect -> composite ]*

#include "core/frame/solvers.hpp"
#include "core/render/block_store.hpp"
#include "core/render/wave.hpp"
#include "core/stages/composite.hpp"
#include "core/stages/group.hpp"
#include "core/stages/initial_rays.hpp"
#include "core/stages/intersect.hpp"
#include "core/stages/speculation.hpp"
#include "core/stages/traverse.hpp"

namespace isowave::core {

class BlocksWave : public Wave {
 public:
  /// The buffers beside those of BlockStore and Wavefront. scanned_pairs: as Wavefront::Limits has
  /// it.
  static ocl::BufferSizes sizes(const Group::Limits &limits, bool scanned_pairs);
  /// blocks, rays: must outlive the wave.
  BlocksWave(BlockStore &blocks, Wavefront &rays, const Group::Limits &limits, Solver solver,
             ClosestHit closest);

  void begin() override;
  void enqueue_pass() override;
  void resize_cache(std::uint32_t num_slots) override { group_.resize(num_slots); }

 private:
  BlockStore &blocks_;
  Wavefront &rays_;
  Compaction compaction_;
  InitialRays initial_rays_;
  Speculation speculation_;
  Traverse traverse_;
  Group group_;
  Intersect intersect_;
  Composite composite_;
};

}  // namespace isowave::core
