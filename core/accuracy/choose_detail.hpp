#pragma once
// The coarsest way to draw a frame within an error: how coarse its levels of detail, how few its
// bit planes may be. That saves blocks; on CPUs it costs time (bench/detail.md).

#include "core/accuracy/certify.hpp"

namespace isowave::core {

/// Share of the pixels that may lose their certificate, against full detail.
inline constexpr double kLostShare = 0.01;
/// Coarser levels are taken if they leave at most this share of the finest level's blocks, since
/// several levels have a cost of their own. A judgement: on the H100, frames with 0.5, 0.64, 0.71
/// of the blocks took 0.89, 0.81, 0.87 of the time; others with 0.58 and 0.63 took 1.19 and 1.04
/// (bench/h100.md).
inline constexpr double kMaxBlocksShare = 2.0 / 3;

/// Bit planes are left out only of volumes with more bits a voxel than this. Frames of other
/// volumes would take about a twentieth less time, and have zfp's promise as their bound instead of
/// errors measured block by block (README.md).
inline constexpr double kMinPlaneRate = 16;

/// Chooses the detail of one frame.
///
/// renderer           with all levels of detail of the volume, by proof with bounds, or a team of
///                    such renderers; its last frame is then another one
/// volume             the volume that this process's renderer was made for
/// rate               rate of the whole volume [bits per voxel]
/// request            the frame's request; its voxel_pixels and voxel_error do not matter
/// max_surface_error  error that most pixels are to keep [pixels], above 0
/// series             see FrameRequest::series; up to four of its views are looked at
///
/// Draws a sample of the frame's rays (ray_sample.hpp). So the choice depends on data, camera and
/// size, never on timings. Picks the coarsest levels of detail, then the fewest bit planes:
///
/// by proof   that cost at most kLostShare of the certified pixels (certify()); full detail if most
///            pixels do not keep max_surface_error even so
/// by sample  with which the hits keep max_surface_error against full detail (suffices()); needs no
///            bounds, and takes any solver
///
/// The first hit of each ray is judged. Levels are skipped beside slices, and if they save too few
/// blocks (kMaxBlocksShare); bit planes are kept for volumes below kMinPlaneRate bits a voxel. All
/// ranks of a team choose what rank 0 finds. Throws Error as certify() does, by proof.
DetailChoice choose_detail(Renderer &renderer, const CompressedVolume &volume, double rate,
                           const FrameRequest &request, double max_surface_error,
                           Evidence by = Evidence::kProof, std::span<const Camera> series = {});
/// The same with a renderer of the whole volume.
inline DetailChoice choose_detail(Renderer &renderer, const CompressedVolume &volume,
                                  const FrameRequest &request, double max_surface_error,
                                  Evidence by = Evidence::kProof) {
  return choose_detail(renderer, volume, volume.rate(), request, max_surface_error, by);
}

}  // namespace isowave::core
