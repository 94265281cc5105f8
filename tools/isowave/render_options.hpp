#pragma once
// The options of `render`: what they ask for, what of it cannot be, and the names of its files.

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/team.hpp"
#include "core/sources/series.hpp"
#include "tools/isowave/annotate.hpp"
#include "tools/isowave/clip_options.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/label_options.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/renderer_options.hpp"
#include "tools/isowave/scene_options.hpp"
#include "tools/isowave/slice_options.hpp"
#include "tools/isowave/surface_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

struct RenderArgs {
  std::string input;
  SceneOptions scene;
  std::vector<std::string> surface_texts;  ///< --surface, as typed
  std::vector<std::string> label_texts;    ///< --labels, as typed
  /// What they ask for: one picture of each view. frame.isovalues has the first one's.
  std::vector<isowave::Surface> surfaces;
  VolumeOptions volume;
  FrameOptions frame;
  ClipOptions clip_options;
  Clip clip;  ///< what they ask for
  SliceOptions slice_options;
  std::vector<isowave::Slice> slices;  ///< what they ask for
  std::string device;
  RendererFlags renderer_flags;
  RendererOptions renderer;  ///< what the flags ask for
  bool reference = false, no_stage_times = false, verbose = false, parallel = false,
       transparent = false;
  ColorMapOptions color_map;
  LightOptions light;
  AnnotationOptions annotation_options;
  std::optional<isowave::Annotations> annotations;  ///< what they, or the scene, ask for
  std::string color = "#DBBD87", background = "#FFFFFF";
  std::string image, depth, stats, progress_dir, error_map, refined, movie;
  double fps = 25;                 ///< of the movie
  std::uint32_t turntable = 0;     ///< views; 0: none
  std::string steps_text;          ///< --steps, as typed
  std::vector<SeriesStep> series;  ///< the steps that are drawn; empty: VOLUME is one volume
  std::vector<std::size_t> steps;  ///< their numbers in the series
  std::size_t step_digits = 1;     ///< of numbers in names
  std::optional<double> max_surface_error;  ///< pixels
  std::string by = "proof";                 ///< or "sample": FrameRequest::by
  std::optional<double> max_image_error;    ///< FLIP
  std::optional<double> time_budget;        ///< ms
  double voxel_pixels = 0;                  ///< FrameRequest::voxel_pixels
  std::string normals = "smooth";
  std::uint32_t ambient_rays = 0;
  std::string bricks;          ///< XxYxZ, or "active"
  bool names_picture = false;  ///< no output is asked for: the picture's name is default_image()
  bool isovalue_suggested = false;  ///< none was given: the volume suggests one
};

void add_render_options(CLI::App &command, RenderArgs &options);

/// The isovalues of all surfaces, in one picture or in several. None of surfaces of labels.
std::vector<double> all_isovalues(const RenderArgs &options);
/// Number of frames of a step; as for one isovalue if there is none yet.
std::size_t num_frames(const RenderArgs &options, std::size_t num_views);
/// The name of a frame's file: the name as given for a single frame, else NAME_isoV_viewK.EXT, or
/// NAME_viewK.EXT with --surface. Empty for an empty name. A step of a series adds _stepT.
std::filesystem::path frame_path(const std::filesystem::path &path, std::size_t num_views,
                                 const RenderArgs &options, double isovalue, std::size_t view,
                                 std::optional<std::size_t> step);
/// VOLUME_iso40.png in the current folder, VOLUME_iso40_90.png with --surface, VOLUME_labels.png
/// with
/// --labels, VOLUME.png if there is no isovalue yet; frame_path() says the rest for several frames.
std::string default_image(const RenderArgs &options, std::size_t num_views);

/// Whether frames have layers: several or translucent surfaces, or slices.
bool draws_layers(const RenderArgs &options);
/// If no output was asked for: says which picture was written.
void print_picture_name(const RenderArgs &options, std::size_t num_views);

/// Whether a file was asked for.
bool asks_for_output(const RenderArgs &options);
/// Whether a picture is written.
bool asks_for_picture(const RenderArgs &options);
/// Whether an error is given, for which levels of detail are chosen.
bool chooses_detail(const RenderArgs &options);
/// Whether levels of detail are chosen for it: frames with layers have the finest alone.
bool chooses_levels(const RenderArgs &options);
/// Whether a picture is written that gets annotations.
bool writes_annotated(const RenderArgs &options);
/// Whether bounds of the error are drawn: for --max-surface-error, by proof.
bool draws_bounds(const RenderArgs &options);

/// --turntable: the camera of a file is turned, or as many views are counted.
///
/// Throws  Error: a file with several cameras
void count_turntable(const RenderArgs &options, Views &views);
/// Throws  Error: what can be told from the options alone
void check_options(const CLI::App &command, const RenderArgs &options, const Team &team);
/// The first option on the command line that only devices have; empty: there is none.
std::string find_device_option(const CLI::App &command);
/// Looks at all files before any work. Outputs go to folders that exist, except --progress-dir,
/// which is made when frames are drawn. Throws Error.
Outputs check_outputs(const RenderArgs &options, std::size_t num_views);
/// Throws  Error: bricks would have to make levels of detail. levels: those of the volume
void check_brick_levels(const RenderArgs &options, const std::vector<VolumeInfo> &levels);

}  // namespace isowave::core::tools
