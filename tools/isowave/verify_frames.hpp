#pragma once
// `isowave verify VOLUME`: whole frames, drawn by the scalar reference or a device, judged by up to
// three oracles.

#include <CLI/CLI.hpp>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/isowave/clip_options.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

struct VerifyFramesOptions {
  std::string input;  ///< empty: no frames
  VolumeOptions volume;
  FrameOptions frame;
  ClipOptions clip;
  std::vector<std::string> oracles;  ///< roots, cells, mesh; none: all
  std::string
      device;  ///< empty: the scalar reference draws, or with max_surface_error the default device
  std::optional<double> max_surface_error;  ///< pixels; see verify_errors()
};

/// Adds VOLUME, the options of volumes, frames and clipping planes, --oracle, --max-surface-error
/// and --device.
void add_verify_frames_options(CLI::App &command, VerifyFramesOptions &options);

/// Draws every view and isovalue with every solver, prints a row for each oracle and adds it to
/// document["frames"]. Clipped frames have an oracle of their own. Returns the rays missed, false
/// or in a wrong cell or place. Throws Error, also when every frame had to be left out.
std::uint64_t verify_frames(const VerifyFramesOptions &options,
                            const std::vector<std::string> &solvers,
                            nlohmann::ordered_json &document);

}  // namespace isowave::core::tools
