#pragma once
// The coarsest way to draw a frame within an error: how coarse its levels of detail, how few its
// bit planes may be. That saves blocks; on CPUs it costs time (bench/detail.md).

#include <optional>
#include <string>
#include <vector>

#include "core/accuracy/certify.hpp"

namespace isowave::core {

struct Detail {
  double voxel_pixels = 0;  ///< FrameRequest::voxel_pixels
  double voxel_error = 0;   ///< FrameRequest::voxel_error
};

struct DetailChoice {
  Detail detail;
  bool reachable = true;  ///< most pixels keep the error at full detail
  double median = 0;      ///< bound there [pixels]
  /// Where it is not reachable: what would help. tolerance: error of the volume's voxels, smaller
  /// than it is, with which the median would be max_surface_error; none where none is known that
  /// any volume can be stored with.
  std::optional<double> tolerance{};
  std::string advice{};
  /// What was tried, and the share of pixels that are not certain to miss and keep the error with
  /// it.
  struct Try {
    Detail detail;
    double certified = 0;
  };
  std::vector<Try> tries;
  double total_ms = 0;
};

/// Share of the pixels that may lose their certificate, against full detail.
inline constexpr double kLostShare = 0.01;
/// Coarser levels are taken where they leave at most so much of the finest level's blocks: a frame
/// of several levels costs more beside that. A judgement: on the H100, frames with 0.5, 0.64, 0.71
/// of the blocks took 0.89, 0.81, 0.87 of the time, others with 0.58 and 0.63 took 1.19 and 1.04
/// (bench/README.md).
inline constexpr double kMaxBlocksShare = 2.0 / 3;

/// Bit planes are left out only of volumes with more bits a voxel. The others' frames would take
/// about a twentieth less, for a bound that is zfp's promise instead of what was measured block by
/// block (README.md).
inline constexpr double kMinPlaneRate = 16;

/// What a renderer must be made with for choose_detail(): bounds, and all levels of detail that the
/// volume has.
RendererOptions with_choices(RendererOptions options, const CompressedVolume &volume);

/// Chooses the detail of one frame.
///
/// frames             of renderers made with_choices(); the last frame that they draw here is
///                    another
/// request            of the frame; its own voxel_pixels and voxel_error do not matter
/// max_surface_error  that most pixels are to keep [pixels], above 0
///
/// Draws small pictures of the frame, every so many pixels, and their bounds (certify()); so the
/// choice depends on data, camera and size, never on timings. Picks the coarsest levels of detail,
/// then the fewest bit planes, that cost at most kLostShare of the certified pixels. Levels are
/// skipped if they save too few blocks (kMaxBlocksShare); bit planes are kept for volumes below
/// kMinPlaneRate bits a voxel. Full detail if most pixels do not keep max_surface_error even so.
/// All ranks of a team choose alike: what rank 0 finds counts. Throws Error as certify() does.
DetailChoice choose_detail(BoundedFrames &frames, const FrameRequest &request,
                           double max_surface_error);
/// The same with one renderer. volume: what it was made for.
DetailChoice choose_detail(Renderer &renderer, const CompressedVolume &volume,
                           const FrameRequest &request, double max_surface_error);

/// The request with this detail.
FrameRequest with_detail(FrameRequest request, const Detail &detail);

/// Throws  Error unless it is finite and above 0
void check_max_surface_error(double max_surface_error);

}  // namespace isowave::core
