#pragma once
// The stages of pipeline `rays` with nothing hidden: for benchmarks of one of them.

#include "bench/frame_rig.hpp"
#include "core/stages/march.hpp"
#include "core/stages/request_ahead.hpp"
#include "core/stages/start_rays.hpp"

namespace isowave::core::bench {

/// A frame of mixing_layer(256). Its constructor draws it once, so that all blocks are
/// cached.
class RaysRig : public FrameRig {
 public:
  RaysRig(ocl::Device &device, std::int64_t width, bool with_given = false);

  /// Makes the rays of the frame.
  void start_frame();
  /// ... and opens its first pass.
  void start_first_pass();
  /// Nothing cached, nothing asked for, every ray waits.
  void start_waiting();

  StartRays start_rays;
  March march;
  RequestAhead request_ahead;
  uint num_started = 0;   ///< rays that meet an active block
  uint num_requests = 0;  ///< blocks that they ask for in the first pass
  std::uint64_t num_hits = 0;

 private:
  void draw();
};

}  // namespace isowave::core::bench
