#pragma once
// The options of RendererOptions on command lines.

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

struct RendererFlags {
  std::string pipeline = "auto", speculation = "auto", solver{to_string(kDefaultSolver)};
  std::string grouping{to_string(kDefaultGrouping)}, closest{to_string(kDefaultClosestHit)},
      stream = "auto";
  RendererOptions values;
  double voxel_pixels = 0;  ///< FrameRequest::voxel_pixels
};

void add_renderer_options(CLI::App &app, RendererFlags &flags);

/// --normals smooth or cell, for normals_from_string().
void add_normals_option(CLI::App &app, std::string &normals);

/// --ambient N, FrameRequest::ambient_rays.
void add_ambient_option(CLI::App &app, std::uint32_t &num_rays);

/// Asks for levels of detail of a volume that is compressed now, if the user has not said how many.
inline void want_levels(CompressionOptions &compression) {
  if (!says_levels(compression)) compression.levels = 0;
}

/// Throws Error on unknown names, and on options without effect beside others.
void check_renderer_options(const CLI::App &app, const RendererFlags &flags);

/// Options for frames with levels of detail if flags.voxel_pixels is not 0. Throws Error on an
/// unknown solver, grouping or way to the closest hit.
RendererOptions to_renderer_options(const RendererFlags &flags, ImageSize size);

/// pipeline, speculation, max_speculation, cache_slots, solver, grouping, closest, group_size,
/// stream.
nlohmann::ordered_json renderer_options_json(const RendererOptions &options);

}  // namespace isowave::core::tools
