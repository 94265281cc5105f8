#pragma once
// The options of RendererOptions on command lines.

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "core/renderer.hpp"

namespace isowave::tools {

struct RendererFlags {
  std::string pipeline = "auto", speculation = "auto", solver{to_string(kDefaultSolver)};
  std::string grouping{to_string(kDefaultGrouping)}, closest{to_string(kDefaultClosestHit)}, stream = "auto";
  RendererOptions values;
};

void add_renderer_options(CLI::App &app, RendererFlags &flags);

/// Throws Error on a solver, grouping or way to the closest hit that there is not.
RendererOptions to_renderer_options(const RendererFlags &flags, ImageSize size);

/// pipeline, speculation, max_speculation, cache_slots, solver, grouping, closest, group_size, stream.
nlohmann::ordered_json renderer_options_json(const RendererOptions &options);

}  // namespace isowave::tools
