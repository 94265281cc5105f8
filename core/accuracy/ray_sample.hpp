#pragma once
// A sample of a frame's rays, and how much of it keeps an error.
//
// Rays are drawn at random places, one in each square of the picture (ImageSize::stride), always at
// the same places for the same size. Each place of the picture has the same chance.

#include <cstdint>
#include <span>

#include "core/frame/frame_stats.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

/// Share of the rays with a hit that must keep the error, and the confidence of it.
inline constexpr double kSampledShare = 0.99, kConfidence = 0.95;

/// A sample of about 2^13 of the rays of that picture; all of its rays if it has no more.
ImageSize sample_of(ImageSize size);

/// Compares the hits of a sample's rays.
///
/// size    of the sample
/// finest  [num_rays] depth at full detail [world units]; infinity: no hit
/// other   [num_rays] depth with another detail
/// limit   the error [pixels]
///
/// A ray with two hits is within the error if these are at most so far apart along the ray, in
/// pixels at the other detail's hit. A ray with one hit is not within the error, even if a
/// neighbour's hit is near. A ray without any counts for nothing. Does not set `lowest`.
SampledShare compare_hits(const Camera &camera, ImageSize size, std::span<const float> finest,
                          std::span<const float> other, double limit);

/// Lower end of the one-sided Clopper-Pearson interval of confidence kConfidence: the smallest
/// share for which it is not improbable (1 - kConfidence) that so many rays or more are within the
/// error.
double lowest_share(std::uint64_t num_within, std::uint64_t num_hits);

/// Whether that lower end is at least kSampledShare. Takes 299 hits or more.
bool suffices(const SampledShare &sample);

}  // namespace isowave::core
