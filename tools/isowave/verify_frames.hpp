#pragma once
// `isowave verify VOLUME`: whole frames, drawn by the scalar reference, a device or the host,
// judged by up to three oracles.

#include <CLI/CLI.hpp>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/ocl/device.hpp"
#include "tools/isowave/clip_options.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

struct VerifyFramesOptions {
  std::string input;  ///< empty: no frames
  VolumeOptions volume;
  FrameOptions frame;
  ClipOptions clip;
  std::vector<std::string> surfaces;  ///< VALUE[,COLOR[,OPACITY]] each; some: see verify_layers()
  std::vector<std::string> oracles;   ///< roots, cells, mesh; none: all
  std::string
      device;  ///< empty: the scalar reference draws, or with max_surface_error the default device
  std::optional<double> max_surface_error;  ///< pixels; see verify_errors()
};

/// Adds VOLUME, the options of volumes, frames and clipping planes, --surface, --oracle,
/// --max-surface-error and --device.
void add_verify_frames_options(CLI::App &command, VerifyFramesOptions &options);

/// The scalar reference, a device's renderer, or the host's.
struct Drawer {
  std::string name = "scalar reference";
  std::unique_ptr<ocl::Device> device{};  ///< before the renderer, which it must outlive
  std::unique_ptr<Renderer> renderer{};
};
/// device        as VerifyFramesOptions has it
/// max_surfaces  that a device's frames may have; 0: one opaque one
/// Throws  Error: no such device
Drawer make_drawer(const VolumeAndViews &scene, const std::string &device, Solver solver,
                   std::uint32_t max_surfaces = 0);

/// Draws every view and isovalue with every solver, prints a row for each oracle and adds it to
/// document["frames"]. Clipped frames have an oracle of their own. Returns the rays missed, false
/// or in a wrong cell or place. Throws Error, also when every frame had to be left out.
std::uint64_t verify_frames(const VerifyFramesOptions &options,
                            const std::vector<std::string> &solvers,
                            nlohmann::ordered_json &document);

}  // namespace isowave::core::tools
