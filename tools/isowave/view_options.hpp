#pragma once
// Options that say from where volumes are seen: --view, --up, --zoom, --fit and --save-camera.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "core/view/camera.hpp"

namespace isowave::core::tools {

/// As typed.
struct ViewOptions {
  std::string side, up;
  double zoom = 1;
  std::string fit = "box", save;
};

/// --view, --up and --zoom.
void add_side_options(CLI::App &command, ViewOptions &options);
/// These, --fit and --save-camera.
void add_view_options(CLI::App &command, ViewOptions &options);

/// --view, --up, and the views that a turntable has. --zoom comes later: it is for all cameras.
///
/// Throws  Error: what --up cannot be
Viewpoint viewpoint_of(const ViewOptions &options, std::uint32_t num_views);
/// --up; none: not given. Throws Error.
std::optional<glm::dvec3> up_of(const ViewOptions &options);

/// Whether options ask for another view than that of a scene file.
bool chooses_view(const CLI::App &command);

/// Throws  Error: an option that others exclude, or that cannot be
///
/// from_file  a camera file says where the cameras are
void check_view_options(const CLI::App &command, const ViewOptions &options, bool from_file);

}  // namespace isowave::core::tools
