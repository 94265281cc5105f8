#pragma once
// Scene files of `render`: --scene and --save-scene.

#include <CLI/CLI.hpp>
#include <string>

#include "isowave/scene.hpp"

namespace isowave::core::tools {

struct SceneOptions {
  std::string file;  ///< --scene; empty: none
  std::string save;  ///< --save-scene; empty: none
};

void add_scene_options(CLI::App &command, SceneOptions &options);

/// Reads --scene.
///
/// Throws  Error: what the file cannot be, and options that say what the scene says
Scene read_scene_option(const CLI::App &command, const SceneOptions &options);

}  // namespace isowave::core::tools
