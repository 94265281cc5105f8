#pragma once
// The options of RendererOptions on command lines.

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "core/render/renderer.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::tools {

struct RendererFlags {
  std::string pipeline = "auto", speculation = "auto", solver{to_string(kDefaultSolver)};
  std::string grouping{to_string(kDefaultGrouping)}, closest{to_string(kDefaultClosestHit)},
      stream = "auto";
  double voxel_pixels = 0;  ///< FrameRequest::voxel_pixels
  RendererOptions values;
};

void add_renderer_options(CLI::App &app, RendererFlags &flags);

/// Asks for levels of detail of a volume that is compressed now, if they are to be drawn and nobody
/// said how many.
inline void want_levels(const RendererFlags &flags, CompressionOptions &compression) {
  if (flags.voxel_pixels > 0 && !says_levels(compression)) compression.levels = 0;
}

/// Throws Error on names that there are not, numbers out of range, and on options without effect
/// beside others.
void check_renderer_options(const CLI::App &app, const RendererFlags &flags);

/// For frames of at most that size, of flags.voxel_pixels. Throws Error on a solver, grouping or
/// way to the closest hit that there is not.
RendererOptions to_renderer_options(const RendererFlags &flags, ImageSize max_size);

/// pipeline, speculation, max_speculation, cache_slots, solver, grouping, closest, group_size,
/// stream, voxel_pixels.
nlohmann::ordered_json renderer_options_json(const RendererOptions &options, double voxel_pixels);

}  // namespace isowave::tools
