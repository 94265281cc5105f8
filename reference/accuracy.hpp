#pragma once
// The renderer's hits against the root oracle's: what is missed, what is false, and how far hits are off.

#include <cstdint>
#include <span>
#include <vector>

#include "kernels_cl/grid_dda.h"
#include "reference/root_oracle.hpp"

namespace isowave {

/// A hit closer than this to the oracle's along the ray is the same hit [voxels]. Only what lies beyond
/// counts as missed or false; what lies within shows in the distances.
inline constexpr double kSameHit = 1e-2;

/// Quantiles of a set of distances [voxels]; 0 for an empty one.
struct Quantiles {
  double p50 = 0, p99 = 0, max = 0;
};
Quantiles quantiles(std::vector<double> values);

struct Accuracy {
  std::uint64_t rays = 0;
  std::uint64_t hits = 0;        ///< of the oracle
  std::uint64_t missed = 0;      ///< the oracle hits where the renderer passes through, on a stable ray
  std::uint64_t false_hits = 0;  ///< the renderer hits where the oracle does not, on a stable ray
  std::uint64_t unstable = 0;    ///< disagreements on rays whose answer changes when they are moved sideways
  std::vector<double> distance;  ///< |t - t_oracle| of hits in both, along the ray [voxels]
  std::vector<double> residual;  ///< |field - isovalue| / |gradient| at the renderer's hit [voxels]; none
                                 ///< where the gradient is 0
};

/// Adds one ray of the renderer, its float32 origin and direction taken as exact, and the hit it gave. frame:
/// dims, blocks and isovalue are used. Where renderer and oracle disagree, the ray is moved sideways by 1e-5
/// voxels in eight directions (5e-5 when the eye is 3,000 voxels or more from the volume's centre): if the
/// oracle then does not always give its first answer, the ray is unstable.
void judge(const RootOracle &oracle, const FrameParams &frame, const Ray &ray, const HitRecord &hit,
           Accuracy &tally);

/// Judges a whole frame with as many threads as there are cores. hits [height * width] of `frame`.
Accuracy judge_frame(const RootOracle &oracle, const FrameParams &frame, std::span<const HitRecord> hits);

/// Adds the tally of other rays.
void merge(Accuracy &into, const Accuracy &from);

}  // namespace isowave
