#pragma once
// Options for clipping planes: --clip, --clip-box and --no-caps.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "core/view/clip.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core::tools {

/// Options as typed; read_clip() checks them.
struct ClipOptions {
  std::vector<std::string> planes;  ///< NX,NY,NZ[,D] each
  std::string box;                  ///< X0,X1,Y0,Y1,Z0,Z1
  bool no_caps = false;
};

void add_clip_options(CLI::App &command, ClipOptions &options);

/// The plane of NX,NY,NZ[,D], or of an axis x, y or z and [,D]. Its normal has length 1.
///
/// info    a plane without a distance goes through the middle of this volume
/// Throws  Error in one line, which names the option
ClipPlane parse_plane(const char *option, const std::string &text, const VolumeInfo &info);

/// Normals have length 1.
///
/// info    planes without a distance go through the middle of this volume
/// Throws  Error in one line: what the options cannot mean, for any volume
Clip read_clip(const ClipOptions &options, const VolumeInfo &info);

}  // namespace isowave::core::tools
