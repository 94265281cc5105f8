#pragma once
// A frame is a row of waves. A wave is rays, or hits, that go through passes until none of them is
// left: camera rays, hits that get smooth normals, rounds of ambient rays.

#include <cstdint>

#include "core/frame/frame_request.hpp"
#include "kernels_cl/portable/window.h"

namespace isowave::core {

class BlockStore;

/// Sets the mean number of blocks that so many rays of a pass were to look ahead at.
inline void set_n_spec(PassStats &stats, uint rays_looking) {
  const uint rays = rays_in_window(stats.counts.window_count, rays_looking);
  if (rays != 0) stats.n_spec = static_cast<double>(stats.counts.ahead_count) / rays;
}

class Wave {
 public:
  virtual ~Wave() = default;

  /// Makes the wave's rays for the frame that the block store has opened.
  ///
  /// Waits  if an earlier frame was stopped
  virtual void begin() = 0;
  /// Enqueues one pass: a chain of launches whose sizes live on the device.
  ///
  /// Throws  Error: as BlockStore::provide()
  /// Waits   only if the stream stays on the host
  virtual void enqueue_pass() = 0;
  /// Sum of the wave's passes in the statistics; none: FrameStats::passes lists each.
  virtual LaterPasses *sum_in(FrameStats & /*stats*/) const { return nullptr; }
  /// The store of the blocks that it asks for; null: the renderer's.
  virtual BlockStore *own_blocks() { return nullptr; }
  /// Adds to a pass's statistics the counts that depend on the way in which camera rays are traced.
  virtual void describe(PassStats & /*stats*/) const {}
};

}  // namespace isowave::core
