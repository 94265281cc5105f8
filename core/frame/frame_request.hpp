#pragma once
// What a frame is asked for, and what drawing it has done.

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/frame/normals.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/level_bounds.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// What one pass did: the counts of the device, and what follows from them.
struct PassStats {
  PassCounts counts{};
  double n_spec = 0;  ///< blocks that the pass's rays were to look ahead at, mean over the rays; 0
                      ///< where none looked
  /// Distinct blocks that rays were intersected in; not counted in pipeline `rays`, which does not
  /// gather rays by block.
  std::optional<std::uint32_t> visible_blocks{};
  /// Distinct blocks whose voxels the pass's rays looked at, or, where a whole dual grid is asked
  /// for, may have; only where the host waits after each pass.
  std::optional<std::uint32_t> touched_blocks{};
  double utilization_percent = 0;  ///< ray-block pairs that were intersected, of all rays
  double completed_percent = 0;    ///< rays that have ended, of all
  std::map<std::string, double>
      stage_ms;  ///< by stage; empty unless the device was opened with profiling
};

/// What a part of a frame took that comes after the passes that found the hits.
struct LaterPasses {
  std::uint32_t passes = 0;
  std::uint64_t decoded_blocks = 0;        ///< for it alone
  std::uint64_t recycled_blocks = 0;       ///< see PassCounts::recycled_count
  double ms = 0;                           ///< wall clock, of total_ms
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

struct FrameStats {
  std::vector<PassStats> passes;                ///< that looked for hits
  LaterPasses normals;                          ///< Normals::kSmooth
  LaterPasses ambient;                          ///< of ambient rays
  std::size_t first_level = 0, last_level = 0;  ///< of detail, that drew; 0: the finest
  double total_ms = 0;  ///< wall clock, from camera to finished hit buffer on the device
  std::uint64_t rays_hit = 0;
  std::uint64_t uploaded_blocks = 0;  ///< from a compressed volume on the host ...
  std::uint64_t uploaded_bytes = 0;   ///< ... and their bytes
  /// on_pass said so before the picture was finished; the hit buffer holds the picture so far.
  /// Where the last of `passes` has left no rays, that has all hits, some with the gradients of
  /// their cells, or of fewer ambient rays.
  bool cancelled = false;
};

/// Called after each pass, the last included, and those for smooth normals and ambient rays, of
/// which 100 % of the rays are completed; Renderer::hits() and shade() show the picture so far.
/// Return false to stop. With a callback, or with profiling, the host waits after each pass;
/// without, it stays a pass ahead.
using OnPass = std::function<bool(const PassStats &)>;

/// One frame: what to draw, and how precisely. The same request gives the same picture, bit for
/// bit, whatever was drawn before.
struct FrameRequest {
  Camera camera{};
  float isovalue = 0;
  std::optional<ImageSize> size{};  ///< none: the renderer's largest
  /// Voxels of a coarser level of detail may be so many pixels apart, see make_level_frames(); 0:
  /// the finest level draws all.
  double voxel_pixels = 0;
  /// How far the voxels may be from the volume's: 0, not at all; more, and fewer bit planes of each
  /// block are decoded (with_fewer_planes()), of coarser levels of detail fewer still
  /// (voxel_error_of()).
  double voxel_error = 0;
  /// What is drawn: the volume, or the field that is nowhere above, or nowhere below what the
  /// volume's voxels were before compression, trilinear between them: decoded values are lowered or
  /// raised by the bound of their error.
  FieldBound bound = FieldBound::kNone;
  Normals normals = Normals::kSmooth;  ///< gradients of the hits; nothing else depends on them
  /// Rays of each hit that find out how much of the sky it sees, which shading shows
  /// (kernels_cl/portable/ambient.h); 0: all see all of it.
  std::uint32_t ambient_rays = 0;
  OnPass on_pass{};
};

/// The same request from another place.
inline FrameRequest seen_from(const Camera &camera, FrameRequest request) {
  request.camera = camera;
  return request;
}

}  // namespace isowave::core
