#pragma once
// What `isowave render` draws with: the renderer that a command line asks for, and its volume.

#include <memory>
#include <optional>
#include <vector>

#include "core/api/renderer_implementation.hpp"
#include "core/base/team.hpp"
#include "core/bricks/team_renderer.hpp"
#include "core/io/movie.hpp"
#include "core/ocl/device.hpp"
#include "core/render/device_renderer.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/render_options.hpp"
#include "tools/isowave/render_series.hpp"

namespace isowave::core::tools {

/// The renderer of a command line, and what it needs, in the order in which it is made.
struct Drawing {
  explicit Drawing(Team &of) : team(of) {}

  Team &team;
  Views views{};
  std::vector<Camera> cameras{};
  isowave::Appearance appearance{};
  std::unique_ptr<ocl::Device> device{};  ///< none with --reference, and on the host
  std::optional<TeamVolume> bricks{};     ///< of several processes
  CompressedVolume whole{};               ///< of one process
  CompressedVolume other{};               ///< of --color-by FILE
  std::optional<Movie> movie{};           ///< of rank 0
  std::unique_ptr<Series> series{};       ///< none: one volume
  std::unique_ptr<isowave::Renderer::Implementation> renderer{};
  TeamRenderer *of_team = nullptr;                ///< in the renderer, if several processes draw
  const DeviceRenderer *on_device = nullptr;      ///< this process's, if a device draws
  ocl::DrawsOn draws_on = ocl::DrawsOn::kDevice;  ///< not with --reference

  bool is_team() const { return team.size() > 1; }
  bool on_host() const { return draws_on != ocl::DrawsOn::kDevice; }
  const CompressedVolume &volume() const { return bricks ? bricks->brick : whole; }
  const VolumeInfo &info() const { return bricks ? bricks->whole() : whole.info; }
};

/// Opens the device that the options name, and says so.
std::unique_ptr<ocl::Device> open_device(const RenderArgs &options, bool is_team);

/// The options that the renderer must be made with, for any volume.
void set_wanted(RenderArgs &options);

/// Chooses between the host and devices.
///
/// Throws  Error: an option is of devices, and the host draws
void choose_drawing(const CLI::App &command, const RenderArgs &options, Drawing &drawing);

/// Opens a step of the series, and has the next one prepared while this one is drawn.
void take_step(RenderArgs &options, Drawing &drawing, std::size_t index);

/// Loads the volume of one process, or the first of a series, and its field, if there is one.
void load_alone(RenderArgs &options, Drawing &drawing);
/// Loads the bricks of all processes, and of the field, if there is one.
void load_bricks(RenderArgs &options, Drawing &drawing);

/// Makes drawing.renderer for what is loaded.
void make_renderer(RenderArgs &options, Drawing &drawing);

}  // namespace isowave::core::tools
