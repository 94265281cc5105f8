#pragma once
// The options of RendererOptions on command lines.

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "core/renderer.hpp"

namespace isowave::tools {

struct RendererFlags {
  std::string pipeline = "auto", speculation = "auto", solver{to_string(kDefaultSolver)};
  std::string grouping{to_string(kDefaultGrouping)}, stream = "auto";
  RendererOptions values;
};

void add_renderer_options(CLI::App &app, RendererFlags &flags);

/// Throws Error on a solver or grouping that there is not, and on per-ray speculation in pipeline `blocks`.
RendererOptions to_renderer_options(const RendererFlags &flags, ImageSize size);

/// pipeline, speculation, max_speculation, cache_slots, stream, solver, grouping, group_size.
nlohmann::ordered_json renderer_options_json(const RendererOptions &options);

}  // namespace isowave::tools
