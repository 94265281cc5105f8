#pragma once
// Waves of rays that walk from block to block, and intersect the cells of cached blocks:
//
//   start_rays -> march -> request -> [ cache -> decode -> march -> request ]*
//
// On CPUs march_packets does the work of start_rays and march, and of cache and decode if there
// are free slots. In frames of several levels of detail, it does so in the first pass. On GPUs
// start_and_march does the work of both in the first pass, if the last frame drew the same surface.

#include <cstdint>
#include <optional>

#include "core/frame/solvers.hpp"
#include "core/render/block_store.hpp"
#include "core/render/pipeline.hpp"
#include "core/render/wave.hpp"
#include "core/stages/ambient.hpp"
#include "core/stages/field_values.hpp"
#include "core/stages/layers.hpp"
#include "core/stages/march.hpp"
#include "core/stages/march_packets.hpp"
#include "core/stages/request_ahead.hpp"
#include "core/stages/smooth_normals.hpp"
#include "core/stages/start_and_march.hpp"
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
  /// A pass's march, by whatever kernel.
  void march();
  const Macrocells &macrocells() const { return blocks_.levels[0].macrocells; }
  /// Whether rays begin and end in bands of levels of detail, or where they are clipped.
  bool has_bands() const { return draws_levels(rays_) || rays_.is_clipped(); }
  /// Whether the rays of the frame at work go in packets; those with bands in the first pass alone.
  bool in_packets() const { return march_packets_ && (bands_in_packets_ || !has_bands()); }

  BlockStore &blocks_;
  Wavefront &rays_;
  StartRays start_rays_;
  March march_;
  std::optional<StartAndMarch> start_and_march_;  ///< instead of both in the first pass of frames
  bool starts_and_marches_ = false;               ///< in the next pass
  std::optional<MarchPackets> march_packets_;     ///< instead of start_rays_ and march_
  bool bands_in_packets_ =
      false;  ///< also in frames with bands, since blocks are decoded on demand
  RequestAhead request_ahead_;
};

/// Rays that go on behind the hits of a surface, and replace them by the next ones.
class BehindWave : public Wave {
 public:
  /// blocks, rays, layers: must outlive the wave.
  BehindWave(BlockStore &blocks, Wavefront &rays, Layers &layers, std::uint32_t group_size,
             Solver solver);

  /// place  of the surface in innermost_first()
  void set_surface(bool is_first_layer, std::size_t place) {
    is_first_layer_ = is_first_layer;
    place_ = place;
  }
  /// Leaves the surface's hits in rays.hits: see Layers::swap_hits().
  void begin() override;
  void enqueue_pass() override;
  LaterPasses *sum_in(FrameStats &stats) const override { return &stats.behind; }

 private:
  BlockStore &blocks_;
  Wavefront &rays_;
  Layers &layers_;
  March march_;
  RequestAhead request_ahead_;
  bool is_first_layer_ = true;
  std::size_t place_ = 0;
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

 protected:
  BlockStore &blocks_;
  Wavefront &rays_;

 private:
  SmoothNormals &normals_;
  RaySource source_;
  bool begins_ = false;  ///< the next pass is the first
};

/// Gives the hits of a further layer, in rays.hits, smooth gradients.
class LayerNormalsWave : public SmoothNormalsWave {
 public:
  LayerNormalsWave(BlockStore &blocks, Wavefront &rays, SmoothNormals &normals, Layers &layers)
      : SmoothNormalsWave(blocks, rays, normals, RaySource::kCamera), layers_(layers) {}

  void begin() override;

 private:
  Layers &layers_;
};

/// Gives the hits of a layer on slices, in rays.hits, the values of the voxels there, in their
/// levels of detail.
class SliceValuesWave : public Wave {
 public:
  /// blocks, rays, layers: must outlive the wave.
  SliceValuesWave(BlockStore &blocks, Wavefront &rays, Layers &layers, std::uint32_t group_size)
      : blocks_(blocks),
        rays_(rays),
        layers_(layers),
        values_(blocks.device, rays.num_rays, group_size, blocks.cache.slot_type, 0,
                blocks.levels.size()) {}

  /// surfaces  FieldMap::surfaces, of the slices
  void set_layer(bool is_first, uint surfaces);
  void begin() override;
  void enqueue_pass() override;
  LaterPasses *sum_in(FrameStats &stats) const override { return &stats.slices; }

 private:
  BlockStore &blocks_;
  Wavefront &rays_;
  Layers &layers_;
  FieldValues values_;
  bool is_first_layer_ = true;
  bool begins_ = false;  ///< the next pass is the first of all rays
};

/// A round of ambient rays: casts one ray from each hit. In frames of several surfaces, it is run
/// once for each surface that the rays may meet.
class AmbientRound : public Wave {
 public:
  /// given: the wave of RaySource::kGiven.
  AmbientRound(BlockStore &blocks, Wavefront &rays, Ambient &ambient, RaysWave &given)
      : blocks_(blocks), rays_(rays), ambient_(ambient), given_(given) {}

  /// goes_on  the rays of the round have been made already, for another surface
  /// enters   Ambient::enter() follows, with those nearest hits
  void set_round(std::uint32_t round, bool goes_on = false, bool enters = false,
                 ocl::Buffer<HitRecord> *nearest = nullptr) {
    round_ = round;
    goes_on_ = goes_on;
    enters_ = enters;
    nearest_ = nearest;
  }
  void begin() override;
  void enqueue_pass() override { given_.enqueue_pass(); }
  LaterPasses *sum_in(FrameStats &stats) const override { return &stats.ambient; }

 private:
  BlockStore &blocks_;
  Wavefront &rays_;
  Ambient &ambient_;
  RaysWave &given_;
  std::uint32_t round_ = 0;
  bool goes_on_ = false, enters_ = false;
  ocl::Buffer<HitRecord> *nearest_ = nullptr;
};

}  // namespace isowave::core
