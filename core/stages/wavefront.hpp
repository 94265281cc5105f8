#pragma once
// The rays of a frame on the device and the arrays of one pass. R = rays; nothing here grows with
// the volume.

#include <utility>

#include "core/stages/device_counts.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

/// The source of the rays of pipeline `rays`.
enum class RaySource {
  kCamera,
  kGiven,      ///< Wavefront::given
  kBehindHits  ///< the camera's, from their hits on (core/stages/layers.hpp)
};

/// The macro for the kernels that make rays.
inline ocl::Defines with_source(ocl::Defines defines, RaySource source) {
  if (source == RaySource::kGiven) defines.insert({"ISO_GIVEN_RAYS", "1"});
  if (source == RaySource::kBehindHits) defines.insert({"ISO_BEHIND_HITS", "1"});
  return defines;
}

struct Wavefront {
  /// Limits that the lengths of its buffers follow from.
  struct Limits {
    std::uint64_t num_rays = 0;
    bool with_pairs = true;          ///< pipeline `blocks` needs the arrays of ray-block pairs
    std::size_t num_levels = 1;      ///< of detail
    bool with_given = false;         ///< there may be rays of RaySource::kGiven
    std::uint32_t bounced_sums = 0;  ///< of each ray, if ambient rays may bring light
    bool with_field = false;         ///< hits may have values of a field
    bool with_walks = true;      ///< rays walk from block to block: false if triangles are drawn
    bool scanned_pairs = false;  ///< there may be frames with Schedule::scanned_pairs
  };
  static ocl::BufferSizes sizes(const Limits &limits);

  Wavefront(ocl::Device &device, const Limits &limits);

  /// Sets all counts as before the first pass of all.
  ///
  /// Waits  yes
  void reset_counts() {
    PassCounts start{};
    start.ray_count = static_cast<uint>(num_rays);
    start.pass = 1;
    counts.write({&start, 1});
    previous_counts.write({&start, 1});
    next_counts.write({&start, 1});
  }

  /// No ray goes on from the last pass.
  ///
  /// Waits  yes
  void forget_rays() {
    PassCounts last = counts.read().front();
    last.next_active_count = 0;
    counts.write({&last, 1});
  }

  /// Hands the counts and the rays that one pass has left to the next (pipeline `rays`, smooth
  /// normals).
  void open_pass() {
    std::swap(previous_counts, counts);
    std::swap(counts, next_counts);
    std::swap(active_ray_ids, next_active_ray_ids);
  }

  /// Takes open_pass() back, for a pass that has touched none of these arrays.
  void unopen_pass() {
    std::swap(active_ray_ids, next_active_ray_ids);
    std::swap(counts, next_counts);
    std::swap(previous_counts, counts);
  }

  /// The part of the volume that the frame at work draws.
  ///
  /// Waits  if it changes
  void set_clip(const ClipParams &params);
  const ClipParams &clip_params() const { return clip_params_; }
  bool is_clipped() const { return clip_params_.num_planes != 0; }

  /// The hits of the rays of a source.
  ocl::Buffer<HitRecord> &hits_of(RaySource source) {
    return source == RaySource::kGiven ? given_hits : hits;
  }

  std::uint64_t num_rays;  ///< R
  FrameParams
      frame{};  ///< of the frame at work; of several levels of detail, the finest that draws
  ocl::Buffer<FrameParams>
      level_frames;  ///< [num_level_frames] of all that draw (pipeline `rays` with several)
  std::uint32_t num_level_frames = 1;
  ocl::Buffer<ClipParams> clip;       ///< [1] clip_params()
  CountsBuffer counts;                ///< [1] of the pass at work
  CountsBuffer previous_counts;       ///< [1] of the pass before, if open_pass() is called
  CountsBuffer next_counts;           ///< [1] of the next such pass, opened by this one
  ocl::Buffer<HitRecord> hits;        ///< [R] by pixel: the picture so far
  ocl::Buffer<GivenRay> given;        ///< [R] of any origin; empty unless there may be some
  ocl::Buffer<HitRecord> given_hits;  ///< [R] hits of given rays
  bool given_at_caps = false;         ///< given rays may begin at caps: see entering()
  ocl::Buffer<uchar> open_counts;     ///< [2][R] by pixel: see LightOfHits
  ocl::Buffer<float> bounced;         ///< [bounced_sums][R] by pixel: see LightOfHits; may be empty
  ocl::Buffer<float> bounced_next;    ///< [bounced_sums][R] scratch
  std::uint32_t num_ambient = 0, num_shadow = 0, num_bounced = 0;  ///< see LightOfHits
  ocl::Buffer<float> field_values;  ///< [R] by pixel: see field_value.h; empty without a field
  ocl::Buffer<uint> ray_block_ids;  ///< [R] by pixel: where a ray goes on from: RayStand (R_BID)
  ocl::Buffer<uint>
      active_ray_ids;  ///< [active_count] rays at work: RayEntry of ray_state.h (R_ID)
  ocl::Buffer<uint> next_active_ray_ids;  ///< [next_active_count]
  ocl::Buffer<uint> mask;                 ///< [R] scratch: rays that the next compaction keeps
  ocl::Buffer<uint> pair_block_ids;       ///< [pair_slot_count] requested blocks, in ray order
  ocl::Buffer<PairHit> pair_hits;         ///< [pair_slot_count] results of intersection
  ocl::Buffer<uint> pair_begins;  ///< [window_count + 1], with scanned pairs: see ray_pairs.h
  ocl::Buffer<uint> pair_rays;    ///< [pair_slot_count], with scanned pairs
  ocl::Buffer<uint>
      closest_pairs;  ///< [window_count] by active ray: its pair that decides (closest_pair.h)

 private:
  Wavefront(ocl::Device &device, std::uint64_t rays, const ocl::BufferSizes &sizes);

  ClipParams clip_params_{};
};

}  // namespace isowave::core
