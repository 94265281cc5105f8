#pragma once
// The renderer's hits against an oracle's: what is missed, false or in a wrong cell, and how far
// hits are off.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "kernels_cl/portable/grid_dda.h"
#include "reference/hit_oracle.hpp"

namespace isowave::core {

/// A hit closer than this to the oracle's along the ray is the same hit [voxels]. Only what lies
/// beyond counts as missed or false; what lies within shows in the distances.
inline constexpr double kSameHit = 1e-2;

/// Quantiles of a set of distances [voxels]; 0 for an empty one.
struct Quantiles {
  double p50 = 0, p99 = 0, max = 0;
};
Quantiles quantiles(std::vector<double> values);

struct Accuracy {
  std::uint64_t rays = 0;
  std::uint64_t hits = 0;    ///< of the oracle
  std::uint64_t missed = 0;  ///< the oracle hits where the renderer passes through, on a stable ray
  std::uint64_t false_hits = 0;  ///< the renderer hits where the oracle does not, on a stable ray
  std::uint64_t wrong_cells =
      0;  ///< the same hit, but in a cell that does not hold it, on a stable ray
  std::uint64_t at_faces =
      0;  ///< the same hit in two cells, so near their common face that both are right
  std::uint64_t wrong_places =
      0;  ///< hits beside their ray, or whose float32 t is not that of their place
  std::uint64_t unstable = 0;    ///< disagreements without a fault: see judge() and mesh_oracle.hpp
  std::vector<double> distance;  ///< |t - t_oracle| of hits in both, along the ray [voxels]
  std::vector<double> residual;  ///< |field - isovalue| / |gradient| at the renderer's hit
                                 ///< [voxels]; none where the gradient is 0

  std::uint64_t failures() const { return missed + false_hits + wrong_cells + wrong_places; }
};

/// A renderer's hit in double precision, index space.
struct RendererHit {
  bool hit = false;
  std::array<double, 3> point{};
  std::array<int, 3> cell{};  ///< dual cell
  double t = 0;               ///< along the ray [its t]
};
/// From cell and local position, not from the record's t: a float32 t of 3,000 is only good to
/// 2e-4. frame: blocks are used.
RendererHit renderer_hit(const FrameParams &frame, const OracleRay &ray, const HitRecord &record);

/// The renderer's ray, its float32 numbers taken as exact.
OracleRay exact_ray(const Ray &ray);
/// Is the hit on its ray, and the record's t, a depth in world units, that of its place? To within
/// float32: t and a local position of at most 1 voxel have a few roundings each.
bool place_fits(const FrameParams &frame, const OracleRay &ray, const HitRecord &record,
                const RendererHit &hit);
/// Voxels per unit of the ray's t.
double speed_of(const OracleRay &ray);
/// The ray moved sideways by `offset` voxels, in direction 0..7 of eight around it.
OracleRay moved_sideways(const OracleRay &ray, double offset, int direction);

/// Adds one ray of the renderer, its float32 origin and direction taken as exact, and the hit it
/// gave. frame: dims, blocks, isovalue and t_scale are used. Where renderer and oracle disagree,
/// the ray is moved sideways by 1e-5 voxels in eight directions (5e-5 when the eye is 3,000 voxels
/// or more from the volume's centre): if the oracle then does not always give its first answer, or
/// gives the renderer's cell, the ray is unstable. By as much, a hit may be off a face and still
/// count as being on it.
void judge(const HitOracle &oracle, const FrameParams &frame, const Ray &ray, const HitRecord &hit,
           Accuracy &tally);

/// Judges a whole frame with as many threads as there are cores. hits [height * width] of `frame`.
///
/// Throws  std::invalid_argument: another number of hits; what the oracle throws
Accuracy judge_frame(const HitOracle &oracle, const FrameParams &frame,
                     std::span<const HitRecord> hits);

/// Adds the tally of other rays.
void merge(Accuracy &into, const Accuracy &from);

/// Any way of judging one ray, over the rays of a whole frame as judge_frame() does.
using JudgeRay = std::function<void(const Ray &ray, const HitRecord &hit, Accuracy &tally)>;
Accuracy judge_rays(const FrameParams &frame, std::span<const HitRecord> hits,
                    const JudgeRay &judge_ray);

}  // namespace isowave::core
