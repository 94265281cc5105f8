#pragma once
// Statistics of a frame.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/frame/surfaces.hpp"
#include "core/view/frame.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// Statistics of a pass: the counts of the device, and numbers that follow from them.
struct PassStats {
  PassCounts counts{};
  double n_spec = 0;  ///< blocks that a ray was to look ahead at, mean; 0 if no ray looked ahead
  /// Distinct blocks that rays were intersected in; not counted in pipeline `rays`, which does not
  /// gather rays by block.
  std::optional<std::uint32_t> visible_blocks{};
  /// Distinct blocks whose voxels the pass's rays looked at, or may have looked at if rays request
  /// whole dual grids. Only if the host waits after each pass.
  std::optional<std::uint32_t> touched_blocks{};
  double utilization_percent = 0;  ///< ray-block pairs that were intersected, per ray
  double completed_percent = 0;    ///< rays that have ended, of all rays
  bool begins_anew = false;        ///< the first after another renderer's passes, see SoonRenderer
  std::map<std::string, double>
      stage_ms;  ///< by stage; empty unless the device was opened with profiling
};

/// Statistics of the passes after those that found the hits: normals, behind hits, a field, slices,
/// and ambient and shadow rays.
struct LaterPasses {
  std::uint32_t passes = 0;
  std::uint64_t decoded_blocks = 0;        ///< blocks decoded in these passes
  std::uint64_t recycled_blocks = 0;       ///< see PassCounts::recycled_count
  double ms = 0;                           ///< wall clock, a part of total_ms
  std::map<std::string, double> stage_ms;  ///< as PassStats::stage_ms

  LaterPasses &operator+=(const LaterPasses &other) {
    passes += other.passes;
    decoded_blocks += other.decoded_blocks;
    recycled_blocks += other.recycled_blocks;
    ms += other.ms;
    for (const auto &[stage, time] : other.stage_ms) stage_ms[stage] += time;
    return *this;
  }
};

/// A step of a frame within a time budget. If the step was cancelled because time was over, the
/// picture before shows through its rays without a hit.
struct TimedStep {
  ImageSize size;
  double voxel_pixels = 0;       ///< distance of voxels, in pixels of this step
  double ms = 0;                 ///< wall clock
  double completed_percent = 0;  ///< percentage of finished pixels
  bool cancelled = false;
};

/// How precisely a frame is drawn.
struct Detail {
  double voxel_pixels = 0;  ///< FrameRequest::voxel_pixels
  double voxel_error = 0;   ///< FrameRequest::voxel_error

  friend bool operator==(const Detail &, const Detail &) = default;
};

/// How much of a sample of a frame's rays keeps an error (Evidence::kSample).
struct SampledShare {
  std::uint64_t num_rays = 0;    ///< rays that were drawn
  std::uint64_t num_hits = 0;    ///< those that hit with full detail, or with the other one
  std::uint64_t num_within = 0;  ///< those whose two hits are within the error
  /// Lower end of the confidence interval of num_within / num_hits: see lowest_share().
  double lowest = 0;

  SampledShare &operator+=(const SampledShare &other) {
    num_rays += other.num_rays;
    num_hits += other.num_hits;
    num_within += other.num_within;
    return *this;
  }
  double share() const { return num_hits == 0 ? 1.0 : double(num_within) / double(num_hits); }
};

/// A picture's error, FLIP's mean over all pixels, by tiles of it (core/accuracy/image_error.hpp).
struct ImageError {
  std::uint32_t samples = 1;  ///< rays of a pixel along each axis, as chosen
  std::uint32_t num_tiles = 0;
  double mean = 0;     ///< of the tiles
  double highest = 0;  ///< upper end of the confidence interval of the picture's
  /// Rays and levels that were tried. error: of the tiles, or of those that sufficed to see that it
  /// is too large, with 0 for the others.
  struct Try {
    std::uint32_t samples = 1;
    double voxel_pixels = 0, error = 0;
  };
  std::vector<Try> tries{};
};

/// The detail that was chosen to keep FrameRequest::max_surface_error or max_image_error.
struct DetailChoice {
  Detail detail;
  /// Most pixels keep the error at full detail; true by sample. A candidate keeps an image error.
  bool reachable = true;
  double median = 0;  ///< median bound at full detail [pixels]; 0 by sample
  /// If it is not reachable: a smaller error of the volume's voxels with which the median would be
  /// max_surface_error; none if no such error is known that a volume can be stored with.
  std::optional<double> tolerance{};
  std::string advice{};                  ///< what would help
  std::optional<SampledShare> sample{};  ///< by sample: with the chosen detail
  /// A detail that was tried, and the share of pixels that keep the error with it: of those that
  /// are not certain to miss, or of a sample's hits.
  struct Try {
    Detail detail;
    double kept = 0;
  };
  std::vector<Try> tries;
  std::optional<ImageError> image{};  ///< of an image error: with what was chosen
  double total_ms = 0;                ///< of choosing; 0: a series had been chosen for
};

/// Statistics of a frame.
struct FrameStats {
  std::vector<PassStats> passes;                ///< passes that looked for hits
  LaterPasses normals;                          ///< passes for Normals::kSmooth
  LaterPasses behind;                           ///< passes of rays behind their first hits
  LaterPasses field;                            ///< passes for values of a field
  LaterPasses slices;                           ///< passes for voxels at slices
  LaterPasses ambient;                          ///< passes of ambient and shadow rays
  std::size_t first_level = 0, last_level = 0;  ///< levels of detail that drew; 0: the finest
  double total_ms = 0;  ///< wall clock, from camera to finished hit buffer on the device
  std::uint64_t rays_hit = 0;
  LayerStats layers{};                ///< with FrameRequest::surfaces
  std::uint64_t uploaded_blocks = 0;  ///< from a compressed volume on the host ...
  std::uint64_t uploaded_bytes = 0;   ///< ... and their bytes
  /// Whether on_pass stopped the frame before the picture was finished. The hit buffer then holds
  /// the picture so far. If the last of `passes` has left no rays, the picture has all hits, some
  /// with the gradients of their cells, or with fewer ambient and shadow rays.
  bool cancelled = false;
  bool complete = true;                  ///< false: cancelled, or the time budget was over
  std::vector<TimedStep> steps{};        ///< with a time budget: in the order of drawing
  std::optional<DetailChoice> detail{};  ///< with a largest surface or image error
};

}  // namespace isowave::core
