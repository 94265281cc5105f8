#pragma once
// What a renderer is asked for, and what it says of it: one frame.

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/stages/device_counts.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/level_bounds.hpp"

namespace isowave {

/// What one pass did: the counts of the device, and what follows from them.
struct PassStats {
  PassCounts counts{};
  double n_spec = 0;  ///< blocks that the pass's rays were to look ahead at, mean over the rays; 0
                      ///< where none looked
  /// Distinct blocks that rays were intersected in; not counted in pipeline `rays`, which does not
  /// gather rays by block.
  std::optional<std::uint32_t> visible_blocks{};
  double utilization_percent = 0;  ///< ray-block pairs that were intersected, of all rays
  double completed_percent = 0;    ///< rays that have ended, of all
  std::map<std::string, double>
      stage_ms;  ///< by stage; empty unless the device was opened with profiling
};

/// Called after each pass, the last included; hits() and shade() show the picture so far. Return
/// false to stop. With a callback, or with profiling, the host waits after each pass; without, it
/// stays a pass ahead.
using OnPass = std::function<bool(const PassStats &)>;

/// One frame: what to draw, and how precisely. A value: to render it changes nothing but caches.
struct FrameRequest {
  Camera camera{};
  float isovalue = 0;
  ImageSize size{};
  /// Distance between voxels of a coarser level of detail, at most [pixels], see
  /// make_level_frames(); 0: the finest level draws all. Needs RendererOptions::with_levels.
  double voxel_pixels = 0;
  /// How far decoded voxels may be from the volume's [voxel values]: fewer bit planes of each block
  /// are decoded (with_fewer_planes()), of coarser levels fewer still (voxel_error_of()); 0: all.
  double voxel_error = 0;
  /// Instead of the volume, the field that is nowhere above, or nowhere below what the volume's
  /// voxels were before compression, trilinear between them: decoded values are lowered or raised
  /// by the bound of their error. Needs RendererOptions::with_bounds.
  FieldBound bound = FieldBound::kNone;
  OnPass on_pass{};
};

struct FrameStats {
  std::vector<PassStats> passes{};
  std::size_t first_level = 0, last_level = 0;  ///< of detail, that drew; 0: the finest
  double total_ms = 0;  ///< wall clock, from camera to finished hit buffer on the device
  std::uint64_t rays_hit = 0;
  std::uint64_t uploaded_blocks = 0;  ///< from a compressed volume on the host ...
  std::uint64_t uploaded_bytes = 0;   ///< ... and their bytes
  bool cancelled =
      false;  ///< on_pass said so while rays were left; the hit buffer holds the picture so far
};

}  // namespace isowave
