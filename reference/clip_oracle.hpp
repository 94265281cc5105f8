#pragma once
// The oracle of clipped frames: the part of a ray in front of all clipping planes, what the ray
// meets there first, and a judge of a renderer's hits.
//
// Shares no code with the kernels: planes are the half spaces of core/view/clip.hpp, in double
// precision; surfaces are the root oracle's. The renderer's ray and the borders of levels of detail
// are taken as exact. They are float32, and so is the renderer's t at a plane. So a point's
// distance from a plane is known to within a bound that is linear in t (clip_oracle.cpp). Two
// intervals follow: what surely stays of a ray, and what may stay. If something happens between
// them, the ray is undecided.

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "core/view/camera.hpp"
#include "core/view/clip.hpp"
#include "reference/accuracy.hpp"
#include "reference/root_oracle.hpp"

namespace isowave::core {

/// An interval of a ray; empty: begin > end.
struct RayPart {
  double begin = 0, end = kInfinity;
};

/// What stays of a ray [world units from the eye].
struct KeptPart {
  RayPart surely, possibly;
  std::uint32_t begun_by = 0;  ///< bit i: the ray may begin at plane i; 0: it begins at the eye
};

/// What a clipped ray meets first.
struct ClipTruth {
  enum Kind { kNone, kHit, kCap, kUndecided } kind = kNone;
  double begin = 0, end = 0;   ///< the hit's t is between the two [world units]
  std::size_t level = 0;       ///< level of detail
  std::uint32_t begun_by = 0;  ///< of a cap: KeptPart::begun_by
};

class ClipOracle {
 public:
  /// finest  the volume, or the brick that is drawn of it
  /// frames  [level] of make_level_frames(), or one frame: what is not of the planes
  /// voxels  [level][nz][ny][nx], NaN: without data; both must outlive the oracle
  ClipOracle(const VolumeInfo &finest, const Camera &camera, const Clip &clip,
             std::span<const FrameParams> frames, std::span<const std::vector<float>> voxels);

  /// ray  index space of the finest level, whose t times t_scale is in world units
  KeptPart kept(const OracleRay &ray, double t_scale) const;

  /// rays  [level] a ray of the camera in each level's index space
  ClipTruth first_hit(std::span<const OracleRay> rays) const;

  const std::vector<ClipPlane> &planes() const { return planes_; }
  std::span<const FrameParams> frames() const { return frames_; }
  const RootOracle &surface(std::size_t level) const { return surfaces_[level]; }
  /// Growth of the distance from a plane for each voxel of the finest level along each axis, in
  /// units of its t_scale: the gradient of a cap.
  std::array<double, 3> cap_gradient(std::size_t plane) const;

 private:
  VolumeInfo finest_;
  glm::dvec3 eye_;
  std::vector<ClipPlane> planes_;  ///< normals of length 1
  bool caps_;
  std::span<const FrameParams> frames_;
  std::deque<RootOracle> surfaces_;
};

/// Is the field at a point of the cell the isovalue, as far as float32 can tell?
bool is_on_surface(const RootOracle &surface, const glm::dvec3 &point, const glm::ivec3 &cell,
                   double isovalue);
/// Is a cap's gradient that of a plane at which its ray may begin (KeptPart::begun_by)?
bool is_cap_gradient(const ClipOracle &oracle, const HitRecord &record, std::uint32_t begun_by);

/// A renderer's hits against the oracle. Each ray is counted once.
struct ClipAccuracy {
  std::uint64_t rays = 0, hits = 0, caps = 0;  ///< hits and caps of the oracle
  std::uint64_t missed = 0;                    ///< nothing, or behind the oracle's hit
  std::uint64_t false_hits = 0;                ///< before the oracle's hit, or without one
  std::uint64_t wrong_kinds = 0;               ///< a cap for a hit of the surface, or one for a cap
  /// The same hit, but beside its ray; with a t that is not its place's; off the surface, or off
  /// the plane by more than rounding.
  std::uint64_t wrong_places = 0;
  std::uint64_t wrong_gradients = 0;  ///< caps whose gradient is of no plane there
  /// Not judged: a surface within rounding of a plane, or another answer of the oracle if the ray
  /// moves sideways by 1e-5 voxels (5e-5 from 3,000 voxels).
  std::uint64_t undecided = 0;
  std::vector<std::uint32_t> failed;  ///< rays that count as failures

  std::uint64_t failures() const {
    return missed + false_hits + wrong_kinds + wrong_places + wrong_gradients;
  }
};
/// Adds the tally of other rays.
void merge(ClipAccuracy &into, const ClipAccuracy &from);

/// Judges a whole frame with as many threads as there are cores.
///
/// hits    [height * width] of the oracle's frames
/// Throws  std::invalid_argument: another number of hits
ClipAccuracy judge_clipped(const ClipOracle &oracle, std::span<const HitRecord> hits);

}  // namespace isowave::core
