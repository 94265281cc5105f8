#pragma once
// The oracle of frames with several and translucent surfaces: all crossings of each ray with each
// surface, and a judge of a renderer's layers.
//
// Shares no code, constant or formula with the kernels: crossings are the root oracle's, caps and
// the part of a ray that stays are the clip oracle's. The renderer's ray is taken as exact.
//
// Float32 may see two crossings, or none, where the ray nearly touches a surface. Such a pair is
// shallow: between its crossings the field is the isovalue as far as float32 can tell. A shallow
// pair may be in the frame or not; so may be a crossing where the ray's data begin or end. The
// ray's other hits are judged all the same.

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "core/frame/surfaces.hpp"
#include "core/view/frame.hpp"
#include "reference/clip_oracle.hpp"

namespace isowave::core {

/// Where a ray crosses a surface, or meets its cap.
struct LayerCrossing {
  double begin = 0, end = 0;  ///< t is between the two, which differ for a cap [the ray's t]
  bool enters = true;         ///< inside is behind it
  bool behind_gap = false;    ///< see OracleChange
  bool is_cap = false;
  bool may_be_cut = false;  ///< a clipping plane is so near that rounding decides
};

/// All that a ray crosses of one surface, in order.
struct LayerTruth {
  /// A clipping plane begins the ray so near to the surface that rounding decides; no crossings.
  bool undecided = false;
  std::vector<LayerCrossing> crossings;
  std::uint32_t begun_by = 0;  ///< of a cap: KeptPart::begun_by
};

class LayerOracle {
 public:
  /// surfaces  as in FrameRequest
  /// voxels    [nz][ny][nx], NaN: without data; they must outlive the oracle
  LayerOracle(const VolumeInfo &info, const Camera &camera, ImageSize size, const Clip &clip,
              std::span<const SurfaceStyle> surfaces, const std::vector<float> &voxels);
  LayerOracle(const LayerOracle &) = delete;
  LayerOracle &operator=(const LayerOracle &) = delete;

  /// ray  in index space
  LayerTruth crossings(std::size_t surface, const OracleRay &ray) const;

  std::size_t num_surfaces() const { return frames_.size(); }
  const FrameParams &frame(std::size_t surface) const { return frames_[surface]; }
  const ClipOracle &clip(std::size_t surface) const { return clips_[surface]; }
  const RootOracle &surface(std::size_t surface) const { return clips_[surface].surface(0); }
  double isovalue(std::size_t surface) const { return frames_[surface].surface.isovalue; }
  double opacity(std::size_t surface) const { return opacities_[surface]; }

 private:
  std::vector<FrameParams> frames_;  ///< of each surface
  std::vector<double> opacities_;
  std::deque<ClipOracle> clips_;
  bool is_clipped_;
};

/// A renderer's layers against the oracle. Each ray is counted once, under its first fault.
struct LayerAccuracy {
  std::uint64_t rays = 0;
  std::uint64_t hits = 0, caps = 0;  ///< of the renderer, in all layers: on surfaces, and caps
  std::uint64_t most_hits = 0;       ///< of a ray
  std::uint64_t missed = 0;          ///< a crossing is left out, in between or behind the last hit
  std::uint64_t false_hits = 0;      ///< a hit without a crossing, or behind the ray's end
  std::uint64_t wrong_order = 0;     ///< not by depth; at one depth, not the innermost first
  std::uint64_t wrong_surfaces = 0;  ///< no surface of the frame, or another one is there
  std::uint64_t wrong_sides = 0;     ///< two hits of a surface in a row enter it, or leave it
  /// As in ClipAccuracy.
  std::uint64_t wrong_kinds = 0, wrong_places = 0, wrong_gradients = 0;
  /// A shallow pair is missing, or is there without two crossings; or a border of the data, or a
  /// clipping plane, is within rounding of a crossing. The rest of the ray is judged.
  std::uint64_t undecided = 0;
  /// Rays that have as many hits as can be drawn, and would go on to one more crossing.
  std::uint64_t cut = 0;
  std::vector<std::uint32_t> failed;  ///< rays that count as failures

  std::uint64_t failures() const {
    return missed + false_hits + wrong_order + wrong_surfaces + wrong_sides + wrong_kinds +
           wrong_places + wrong_gradients;
  }
};
/// Adds the tally of other rays.
void merge(LayerAccuracy &into, const LayerAccuracy &from);

/// Judges all layers of a frame with as many threads as there are cores. A ray may end where no
/// crossing is left, where less than 1/512 of what lies behind would be seen, or after 16 hits.
///
/// layers  [layer][height * width], as LayeredFrame has them
/// Throws  std::invalid_argument: layers of another size
LayerAccuracy judge_layers(const LayerOracle &oracle,
                           std::span<const std::vector<HitRecord>> layers);
/// Judges the hits of a frame's first layer, which is all that renderers return.
LayerAccuracy judge_first_layer(const LayerOracle &oracle, const std::vector<HitRecord> &hits);

}  // namespace isowave::core
