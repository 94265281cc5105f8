#pragma once
// What a frame is asked for, and what comes back.

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "isowave/camera.hpp"

namespace isowave {

/// What is drawn: the volume, or the field that is nowhere above, or nowhere below what its voxels
/// were before compression.
enum class FieldBound { kNone, kLower, kUpper };

/// Which gradient of the field hits have, and so which normals.
enum class Normals {
  kSmooth,  ///< central differences, trilinear between voxels
  kCell     ///< of the trilinear field itself, which jumps from cell to cell
};

/// In world space: origin + t direction, t from 0 on.
struct Ray {
  Vector3 origin, direction;
};

/// Colours are sRGB, 0 to 1.
struct Appearance {
  std::array<float, 3> surface{219 / 255.0f, 189 / 255.0f, 135 / 255.0f};
  std::array<float, 3> background{1, 1, 1};
  float ambient = 0.15f;                  ///< light from all around
  float diffuse = 0.5f, specular = 0.2f;  ///< of a headlight at the eye
  float above = 0.45f;  ///< of a light halfway between the eye and the picture's upper edge
};

/// The picture so far, for FrameRequest::on_pass, and only until that returns. Several threads may
/// look at it: they take turns.
///
/// Throws  Error: another thread asks after on_pass has returned, while the frame is drawn
class Progress {
 public:
  virtual ~Progress() = default;
  virtual std::uint32_t passes() const = 0;
  virtual double completed_percent() const = 0;  ///< rays that have ended, of all
  /// Size of picture(): the frame's, except that the first pictures within a time budget are
  /// smaller.
  virtual ImageSize size() const = 0;
  /// RGB [height][width][3], row 0 at the top. Takes a few milliseconds.
  virtual std::vector<std::uint8_t> picture() const = 0;
};

/// One frame: what to draw, how precisely, and what is wanted of it. Rendering the same request
/// again gives the same bits, whatever was drawn before, unless there is a time budget.
struct FrameRequest {
  Camera camera{};
  /// The surface separates voxels below it from the others. Voxels are float32: of a lossless
  /// volume, each is compared as if in double; of any other, with the nearest float32.
  double isovalue = 0;
  ImageSize size{};
  Appearance appearance{};

  /// Voxels of a coarser level of detail may be so many pixels apart; 0: the finest level draws
  /// all. Needs RendererOptions::with_levels.
  double voxel_pixels = 0;
  /// Decoded voxels may be off by so much from the compressed ones; 0: not at all [voxel values].
  double voxel_error = 0;
  FieldBound bound = FieldBound::kNone;  ///< needs RendererOptions::with_bounds
  Normals normals = Normals::kSmooth;    ///< nothing but the hits' gradients depends on them
  /// Rays of each hit, up to 255, that find out how much of the sky it sees: pictures show depth.
  /// Each takes about as long as the frame without. Needs with_rays.
  std::uint32_t ambient_rays = 0;
  /// Instead: chooses voxel_pixels and voxel_error such that most pixels are within so many pixels
  /// of the true surface, that of the volume before compression. Needs with_bounds.
  std::optional<double> max_surface_error{};
  /// Draws what can be drawn in this time: small pictures first. Needs with_time_budget.
  std::optional<double> time_budget_ms{};

  // What the frame brings to the host.
  bool want_picture = true;
  bool want_depth = false, want_normals = false, want_positions = false, want_hits = false;
  bool want_bounds = false;  ///< of the error of each pixel; needs RendererOptions::with_bounds

  /// Called after each pass, those for smooth normals and ambient rays included; on the host after
  /// each band of rows, from the top. Return false to stop; the frame is the picture so far. In a
  /// team, all processes have one or none, which return the same and ask for pictures alike.
  std::function<bool(const Progress &)> on_pass{};
};

/// Where a ray first crosses the isosurface. The true crossing of the decoded field, not a sample.
struct Hit {
  float t = std::numeric_limits<float>::infinity();  ///< distance from the eye [world units]
  std::uint32_t level = 0;                           ///< of detail; 0: the finest
  std::array<std::uint32_t, 3> cell{};  ///< voxel at its lowest corner: it ends one further
  std::array<float, 3> position{};      ///< in the cell, 0 to 1
  std::array<float, 3> gradient{};      ///< FrameRequest::normals [voxel value per voxel]
};

/// Calls visit(name, field) for each field that a request consists of, those of its camera and
/// appearance included, except on_pass. The names are those of isowave's Python package.
///
/// request  a FrameRequest, or a const one
template <class Request, class Visit>
void for_each_field(Request &request, const Visit &visit) {
  visit("eye", request.camera.eye);
  visit("at", request.camera.at);
  visit("up", request.camera.up);
  visit("fovy_degrees", request.camera.fovy_degrees);
  visit("parallel_height", request.camera.parallel_height);
  visit("isovalue", request.isovalue);
  visit("width", request.size.width);
  visit("height", request.size.height);
  visit("samples", request.size.samples);
  visit("surface", request.appearance.surface);
  visit("background", request.appearance.background);
  visit("ambient", request.appearance.ambient);
  visit("diffuse", request.appearance.diffuse);
  visit("specular", request.appearance.specular);
  visit("above", request.appearance.above);
  visit("voxel_pixels", request.voxel_pixels);
  visit("voxel_error", request.voxel_error);
  visit("bound", request.bound);
  visit("normals", request.normals);
  visit("ambient_rays", request.ambient_rays);
  visit("max_surface_error", request.max_surface_error);
  visit("time_budget_ms", request.time_budget_ms);
  visit("want_picture", request.want_picture);
  visit("want_depth", request.want_depth);
  visit("want_normals", request.want_normals);
  visit("want_positions", request.want_positions);
  visit("want_hits", request.want_hits);
  visit("want_bounds", request.want_bounds);
}

struct FrameStatistics {
  std::uint32_t passes = 0;
  std::uint64_t rays = 0, hits = 0;
  std::uint64_t decoded_blocks = 0;               ///< of 4^3 voxels, all
  std::uint32_t normals_passes = 0;               ///< of these, for smooth normals
  std::uint64_t normals_decoded_blocks = 0;       ///< of these, for smooth normals
  double normals_ms = 0;                          ///< of total_ms
  std::uint32_t ambient_passes = 0;               ///< of these, for ambient rays
  double ambient_ms = 0;                          ///< of total_ms
  std::uint64_t uploaded_bytes = 0;               ///< of a compressed volume that stays on the host
  std::uint32_t first_level = 0, last_level = 0;  ///< of detail, that drew; 0: the finest
  double total_ms = 0;     ///< wall clock, from camera to finished hits on the device
  bool cancelled = false;  ///< by on_pass
  bool complete = true;    ///< false: cancelled, or the time was over
  /// Volume::errors_are_stated() of what was drawn: Frame::bounds rest on these errors.
  bool errors_are_stated = false;
  std::map<std::string, double> stage_ms{};  ///< of a device with profiling
};

/// What was chosen to keep FrameRequest::max_surface_error.
struct DetailChoice {
  double voxel_pixels = 0, voxel_error = 0;
  bool reachable = true;  ///< false: not with this volume; full detail was drawn
  std::string advice{};   ///< what would help, where it is not reachable
};

/// A finished frame. Arrays that were not asked for are empty. Rays are [rows][columns], row 0 at
/// the top: size.samples times as many as pixels along each axis.
struct Frame {
  ImageSize size{};
  std::uint32_t rows = 0, columns = 0;  ///< of rays

  std::vector<std::uint8_t> picture{};          ///< RGB [height][width][3]
  std::vector<float> depth{};                   ///< [rows][columns] world units; infinity: no hit
  std::vector<std::array<float, 3>> normals{};  ///< [rows][columns] world space, of length 1, away
                                                ///< from larger values; 0 0 0: no hit
  /// [rows][columns] of the hits, world space, rounded if Volume::float32_positions(); NaN: no hit
  std::vector<Vector3> positions{};
  std::vector<Hit> hits{};  ///< [rows][columns]
  /// [rows][columns] how far the surface may be from the true one along the ray, at most [pixels];
  /// infinity: nothing is certain. They hold if the volume's errors do: see
  /// FrameStatistics::errors_are_stated.
  std::vector<float> bounds{};

  FrameStatistics statistics{};
  std::optional<DetailChoice> detail{};  ///< where max_surface_error was given
};

/// Writes frame.picture: RGB, or RGBA if a caller has added an alpha to its pixels.
///
/// Throws  Error: no picture, a name that ends in something else than .png, or it cannot be written
void save_png(const Frame &frame, const std::filesystem::path &path);
/// The bytes of such a file.
///
/// Throws  Error: no picture
std::vector<std::uint8_t> encode_png(const Frame &frame);

}  // namespace isowave
