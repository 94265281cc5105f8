#pragma once
// A sample of a frame's rays, and how much of it keeps an error.
//
// Rays are drawn at random places, one in each square of the picture (ImageSize::stride), always at
// the same places for the same size. Each place of the picture has the same chance.

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

/// Share of the rays with a hit that must keep the error, and the confidence of it.
inline constexpr double kSampledShare = 0.99, kConfidence = 0.95;

/// A sample of about 2^13 of the rays of that picture; all of its rays if it has no more.
ImageSize sample_of(ImageSize size);

/// The hits of one frame's rays.
struct SeenFrame {
  std::vector<float> depth;                   ///< [num_rays] see HitRecord::t
  std::vector<std::array<float, 3>> normals;  ///< [num_rays] see world_normal()
  std::vector<glm::dvec3> positions;          ///< [num_rays] world space; without a hit: anything
};

/// The hits of the renderer's last frame; of a team's other ranks than 0: none.
///
/// camera  of that frame
SeenFrame seen_frame(Renderer &renderer, const Camera &camera);

/// The camera, and sixteen more that see what is beside its rays: in eight directions, so many
/// pixels away and half as far.
std::vector<Camera> cameras_beside(const Camera &camera, std::uint32_t height, double pixels);

/// Compares the hits of a sample's rays.
///
/// size           of the sample
/// finest, other  frames of cameras_beside() at full detail, and with another detail
/// limit          the error [pixels]
///
/// A ray with a hit is within the error if each of its hits, at full detail and with the other one,
/// is near what the other detail shows along the ray or beside it: at most `limit` from the tangent
/// plane of a hit that is at most kGrazing times as far away; or no more than `limit` nearer than
/// all of these hits or farther. So silhouettes may move by `limit`, too. Does not set `lowest`.
SampledShare compare_hits(const Camera &camera, ImageSize size, std::span<const SeenFrame> finest,
                          std::span<const SeenFrame> other, double limit);
/// Largest distance from a hit at which its tangent plane stands for the surface [errors]. A
/// judgement, not measured.
inline constexpr double kGrazing = 16;

/// Lower end of the one-sided Clopper-Pearson interval, of confidence kConfidence, for the share of
/// all rays that are within the error.
double lowest_share(std::uint64_t num_within, std::uint64_t num_hits);

/// Whether that lower end is at least kSampledShare. Takes 299 hits or more.
bool suffices(const SampledShare &sample);

}  // namespace isowave::core
