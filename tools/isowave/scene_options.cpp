#include "tools/isowave/scene_options.hpp"

#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

void add_scene_options(CLI::App &command, SceneOptions &options) {
  command.add_option(
      "--scene", options.file,
      "scene file (JSON): surfaces, slices, clipping planes, colours, and, unless other "
      "options say them, the volume, the camera and annotations");
  command.add_option("--save-scene", options.save,
                     "writes the scene of the picture as a file for --scene");
}

Scene read_scene_option(const CLI::App &command, const SceneOptions &options) {
  refuse_options(command,
                 {"--isovalue", "--surface", "--labels", "--color", "--color-by", "--color-map",
                  "--background", "--transparent", "--light", "--shadow", "--bounce",
                  "--light-angle", "--clip", "--clip-box", "--no-caps", "--slice",
                  "--slice-opacity", "--slice-map", "--slice-range"},
                 "--scene says what is drawn: leave out either");
  return isowave::read_scene(options.file);
}

}  // namespace isowave::core::tools
