#pragma once
// Pixel by pixel: what a side hits, beside what isowave hits.

#include <cstdint>
#include <span>

#include "bench/gpu_peer/sides.hpp"

namespace isowave::core::bench {

/// How far one picture's hits are from another's.
struct HitDifference {
  std::uint64_t hits = 0;        ///< of both
  std::uint64_t missed = 0;      ///< isowave alone
  std::uint64_t false_hits = 0;  ///< the side alone
  double p99 = 0, largest = 0;   ///< distance along the ray where both hit [voxels]
};

/// Gathers the pixels of several pictures.
class HitComparison {
 public:
  /// voxel: the shortest edge [world units]
  explicit HitComparison(double voxel) : voxel_(voxel) {}

  /// side, isowave: distances from the eye, INFINITY where nothing is hit; as many of both.
  void add(std::span<const float> side, std::span<const float> isowave);
  HitDifference difference() const;

 private:
  double voxel_;
  HitDifference counts_;
  std::vector<float> distances_;
};

/// Share of the bytes of two pictures that differ by more than two steps of 255.
double share_of_other_bytes(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b);

}  // namespace isowave::core::bench
