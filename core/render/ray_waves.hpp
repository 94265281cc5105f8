#pragma once
// Waves of rays that walk from block to block, and intersect the cells of cached blocks:
//
//   start_rays -> march -> request -> [ cache -> decode -> march -> request ]*
//
// On CPUs march_packets does the work of start_rays and march, and of cache and decode if there
// are free slots. In frames of several levels of detail, it does so in the first pass.

#include <cstdint>
#include <optional>

#include "core/frame/solvers.hpp"
#include "core/render/block_store.hpp"
#include "core/render/pipeline.hpp"
#include "core/render/wave.hpp"
#include "core/stages/ambient.hpp"
#include "core/stages/march.hpp"
#include "core/stages/march_packets.hpp"
#include "core/stages/request_ahead.hpp"
#include "core/stages/smooth_normals.hpp"
#include "core/stages/start_rays.hpp"

namespace isowave::core {

/// Pipeline `rays`, for rays of the camera or for Wavefront::given. Hits of given rays are in
/// given_hits; a frame has one given ray for each pixel.
class RaysWave : public Wave {
 public:
  /// blocks, rays: must outlive the wave.
  RaysWave(BlockStore &blocks, Wavefront &rays, std::uint32_t group_size, Solver solver,
           RaySource source, RayPackets packets = RayPackets::kOff,
           DecodeOnDemand on_demand = DecodeOnDemand::kOff);

  void begin() override { start(true); }
  /// begin() for given rays that belong to the frame at work: blocks that the frame has used stay
  /// in the cache as long as other blocks can go.
  void go_on() { start(false); }
  void enqueue_pass() override;
  /// The rays that are left at the end of a pass look ahead.
  void describe(PassStats &stats) const override {
    set_n_spec(stats, stats.counts.next_active_count);
  }

 private:
  void start(bool begins_frame);
  const Macrocells &macrocells() const { return blocks_.levels[0].macrocells; }
  /// Whether rays begin and end in bands of levels of detail, or where they are clipped.
  bool has_bands() const { return draws_levels(rays_) || rays_.is_clipped(); }
  /// Whether the rays of the frame at work go in packets; those with bands in the first pass alone.
  bool in_packets() const { return march_packets_ && (bands_in_packets_ || !has_bands()); }

  BlockStore &blocks_;
  Wavefront &rays_;
  StartRays start_rays_;
  March march_;
  std::optional<MarchPackets> march_packets_;  ///< instead of start_rays_ and march_
  bool bands_in_packets_ =
      false;  ///< also in frames with bands, since blocks are decoded on demand
  RequestAhead request_ahead_;
};

/// Gives hits smooth gradients.
class SmoothNormalsWave : public Wave {
 public:
  /// source: the rays whose hits get gradients.
  SmoothNormalsWave(BlockStore &blocks, Wavefront &rays, SmoothNormals &normals, RaySource source)
      : blocks_(blocks), rays_(rays), normals_(normals), source_(source) {}

  void begin() override { begins_ = true; }
  /// The first pass does nothing if the wave before has rays left.
  void enqueue_pass() override;
  LaterPasses *sum_in(FrameStats &stats) const override { return &stats.normals; }

 private:
  BlockStore &blocks_;
  Wavefront &rays_;
  SmoothNormals &normals_;
  RaySource source_;
  bool begins_ = false;  ///< the next pass is the first
};

/// A round of ambient rays: casts one ray from each hit.
class AmbientRound : public Wave {
 public:
  /// given: the wave of RaySource::kGiven.
  AmbientRound(BlockStore &blocks, Wavefront &rays, Ambient &ambient, RaysWave &given)
      : blocks_(blocks), rays_(rays), ambient_(ambient), given_(given) {}

  void set_round(std::uint32_t round) { round_ = round; }
  void begin() override;
  void enqueue_pass() override { given_.enqueue_pass(); }
  LaterPasses *sum_in(FrameStats &stats) const override { return &stats.ambient; }

 private:
  BlockStore &blocks_;
  Wavefront &rays_;
  Ambient &ambient_;
  RaysWave &given_;
  std::uint32_t round_ = 0;
};

}  // namespace isowave::core
