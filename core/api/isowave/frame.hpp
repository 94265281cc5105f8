#pragma once
// Requests of frames, and the frames that come back.

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "isowave/array.hpp"
#include "isowave/camera.hpp"

namespace isowave {

/// The field that is drawn: the volume's, or one that is nowhere above (kLower) or nowhere below
/// (kUpper) the voxels before compression.
enum class FieldBound { kNone, kLower, kUpper };

/// The evidence for FrameRequest::max_surface_error.
enum class Evidence {
  kProof,  ///< bounds of most pixels, against the volume before compression
  kSample  ///< a sample of the frame's rays, against full detail
};

/// The gradients that hits have. Normals follow from them.
enum class Normals {
  kSmooth,  ///< central differences, trilinear between voxels
  kCell     ///< gradients of the trilinear field itself, which jump from cell to cell
};

/// A ray in world space: origin + t direction, t from 0 on.
struct Ray {
  Vector3 origin, direction;
};

/// Colours and lights. Colours are sRGB, 0 to 1.
struct Appearance {
  std::array<float, 3> surface{219 / 255.0f, 189 / 255.0f, 135 / 255.0f};
  std::array<float, 3> background{1, 1, 1};
  float ambient = 0.15f;                  ///< light from all around
  float diffuse = 0.5f, specular = 0.2f;  ///< light of a headlight at the eye
  float above = 0.45f;  ///< light from halfway between the eye and the picture's upper edge
  /// Pictures are RGBA with straight alpha: the share of a pixel's rays that hit, and the mean
  /// colour of those alone; 0 0 0 0 if none hits. There is no background.
  bool transparent = false;
};

/// The picture so far, for FrameRequest::on_pass, and only until on_pass returns. Several threads
/// may use it: they take turns.
///
/// Throws  Error: another thread calls after on_pass has returned, while the frame is drawn
class Progress {
 public:
  virtual ~Progress() = default;
  virtual std::uint32_t passes() const = 0;
  virtual double completed_percent() const = 0;  ///< percentage of rays that have ended
  /// Size of picture(): the frame's, except that the first pictures within a time budget are
  /// smaller.
  virtual ImageSize size() const = 0;
  /// RGB [height][width][3], row 0 at the top; RGBA [4] if Appearance::transparent.
  virtual Array<std::uint8_t> picture() const = 0;
};

/// A clipping plane: the half space of the points p with dot(normal, p) >= offset stays.
struct ClipPlane {
  Vector3 normal{1, 0, 0};  ///< world space, of any length above 0, towards what stays
  double offset = 0;        ///< [world units times the normal's length]
};

/// The planes of a box that stays, with edges along the world's axes.
///
/// Throws  Error: the box has no inside
std::array<ClipPlane, 6> box_planes(const Vector3 &begin, const Vector3 &end);

/// One frame: what to draw, how precisely, and which arrays to return. Rendering the same request
/// again gives the same bits, unless there is a time budget.
struct FrameRequest {
  Camera camera{};
  /// The surface separates voxels below the isovalue from the others. Voxels are float32. If the
  /// volume is lossless, they are compared as if in double, otherwise with the nearest float32.
  double isovalue = 0;
  ImageSize size{};
  Appearance appearance{};
  std::vector<ClipPlane> clip{};  ///< up to 14; what is in all half spaces is drawn
  /// Draws flat caps where planes cut what is inside the surface, which are shaded as the surface.
  /// Otherwise cuts are open, and show the surface from within.
  bool caps = true;

  /// Largest distance between voxels of a coarser level of detail [pixels]; 0: the finest level
  /// draws all. Needs RendererOptions::with_levels.
  double voxel_pixels = 0;
  /// Largest difference of decoded voxels from the compressed ones [voxel values].
  double voxel_error = 0;
  FieldBound bound = FieldBound::kNone;  ///< needs RendererOptions::with_bounds
  Normals normals = Normals::kSmooth;    ///< gradients of the hits; nothing else depends on them
  /// Rays from each hit, up to 255, that find out how much of the sky it sees, which shows depth.
  /// Each takes about as long as a frame without any. Needs with_rays.
  std::uint32_t ambient_rays = 0;
  /// Largest distance to the true surface [pixels]. voxel_pixels and voxel_error are then chosen so
  /// that most pixels keep it. By proof, the true surface is that of the volume before compression;
  /// needs with_bounds. By sample, it is that of full detail, and 99 % of the rays that hit keep
  /// the error, along the ray and beside it (DetailChoice::sample); to choose levels of detail,
  /// needs with_levels.
  std::optional<double> max_surface_error{};
  Evidence by = Evidence::kProof;  ///< for max_surface_error; kProof without one
  /// Views that share max_surface_error: most pixels of all of them together keep it. Requests with
  /// the same series and error are drawn with one detail, which is chosen once. Empty: the
  /// request's view alone.
  std::vector<Camera> series{};
  /// Time in which the largest picture possible is drawn: first one that took at most half of it
  /// before, then larger ones. Needs with_time_budget.
  std::optional<double> time_budget_ms{};

  // Arrays that the frame brings to the host.
  bool want_picture = true;
  bool want_depth = false, want_normals = false, want_positions = false, want_hits = false;
  bool want_bounds = false;  ///< bounds of each pixel's error; needs RendererOptions::with_bounds

  /// Called after each pass, also those for smooth normals and ambient rays; on the host after each
  /// band of rows, from the top. If it returns false, the frame stops with the picture so far. In a
  /// team, all processes have an on_pass or none; they return the same, and get the same pictures.
  std::function<bool(const Progress &)> on_pass{};
};

/// First crossing of a ray with the isosurface: the true crossing of the decoded field, not a
/// sample.
struct Hit {
  float t = std::numeric_limits<float>::infinity();  ///< distance from the eye [world units]
  std::uint32_t level = 0;                           ///< level of detail; 0: the finest
  std::array<std::uint32_t, 3> cell{};               ///< voxel at the cell's lowest corner
  std::array<float, 3> position{};                   ///< place in the cell, 0 to 1
  std::array<float, 3> gradient{};  ///< as FrameRequest::normals [voxel value per voxel]
};

/// Calls visit(name, field) for each field of a camera.
///
/// camera  a Camera, or a const one
template <class AnyCamera, class Visit>
void for_each_camera_field(AnyCamera &camera, const Visit &visit) {
  visit("eye", camera.eye);
  visit("at", camera.at);
  visit("up", camera.up);
  visit("fovy_degrees", camera.fovy_degrees);
  visit("parallel_height", camera.parallel_height);
}

/// Calls visit(name, field) for each field of a clipping plane.
template <class AnyPlane, class Visit>
void for_each_plane_field(AnyPlane &plane, const Visit &visit) {
  visit("normal", plane.normal);
  visit("offset", plane.offset);
}

/// Calls visit(name, field) for each field of a request, its camera and its appearance, except
/// on_pass. The names are those of isowave's Python package.
///
/// request  a FrameRequest, or a const one
template <class Request, class Visit>
void for_each_field(Request &request, const Visit &visit) {
  for_each_camera_field(request.camera, visit);
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
  visit("transparent", request.appearance.transparent);
  visit("clip", request.clip);
  visit("caps", request.caps);
  visit("voxel_pixels", request.voxel_pixels);
  visit("voxel_error", request.voxel_error);
  visit("bound", request.bound);
  visit("normals", request.normals);
  visit("ambient_rays", request.ambient_rays);
  visit("max_surface_error", request.max_surface_error);
  visit("by", request.by);
  visit("series", request.series);
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
  std::uint64_t decoded_blocks = 0;               ///< all decoded blocks of 4^3 voxels
  std::uint32_t normals_passes = 0;               ///< those of `passes` for smooth normals
  std::uint64_t normals_decoded_blocks = 0;       ///< those of decoded_blocks for smooth normals
  double normals_ms = 0;                          ///< part of total_ms
  std::uint32_t ambient_passes = 0;               ///< those of `passes` for ambient rays
  double ambient_ms = 0;                          ///< part of total_ms
  std::uint64_t uploaded_bytes = 0;               ///< from a compressed volume on the host
  std::uint32_t first_level = 0, last_level = 0;  ///< levels of detail that drew; 0: the finest
  /// Wall clock, from camera to the wanted arrays in the host's memory, without Frame::bounds.
  double total_ms = 0;
  double hits_ms = 0;      ///< part of total_ms: from camera to finished hits, on a device
  bool cancelled = false;  ///< on_pass stopped the frame
  bool complete = true;    ///< false: cancelled, or the time was over
  /// Volume::errors_are_stated() of the volume: Frame::bounds rest on its errors.
  bool errors_are_stated = false;
  std::map<std::string, double> stage_ms{};  ///< by stage, if the device has profiling
};

/// How much of a sample of a frame's rays keeps an error (Evidence::kSample).
struct SampledShare {
  std::uint64_t num_rays = 0;    ///< rays that were drawn
  std::uint64_t num_hits = 0;    ///< those that hit with full detail, or with the chosen one
  std::uint64_t num_within = 0;  ///< those whose two hits are within the error
  /// Lower end of the one-sided Clopper-Pearson interval of 95 % of num_within / num_hits; 1 at
  /// full detail.
  double lowest = 0;
};

/// The detail that was chosen to keep FrameRequest::max_surface_error.
struct DetailChoice {
  double voxel_pixels = 0, voxel_error = 0;
  bool reachable = true;  ///< false: this volume cannot keep it; full detail was drawn
  std::string advice{};   ///< what would help if it is not reachable
  std::optional<SampledShare> sample{};  ///< by sample: with the chosen detail
};

/// A finished frame. Arrays that were not asked for are empty. Rays are [rows][columns], row 0 at
/// the top: size.samples times as many as pixels along each axis.
struct Frame {
  ImageSize size{};
  std::uint32_t rows = 0, columns = 0;  ///< numbers of rays

  /// RGB [height][width][3]; RGBA [height][width][4] if Appearance::transparent
  Array<std::uint8_t> picture{};
  Array<float> depth{};                   ///< [rows][columns] world units; infinity: no hit
  Array<std::array<float, 3>> normals{};  ///< [rows][columns] world space, of length 1, away from
                                          ///< larger values; 0 0 0: no hit
  /// [rows][columns] hits in world space, rounded if Volume::float32_positions(); NaN: no hit
  Array<Vector3> positions{};
  Array<Hit> hits{};  ///< [rows][columns]
  /// [rows][columns] Largest possible distance to the true surface along the ray [pixels];
  /// infinity: nothing is certain. Bounds hold if the volume's errors do: see
  /// FrameStatistics::errors_are_stated.
  Array<float> bounds{};

  FrameStatistics statistics{};
  std::optional<DetailChoice> detail{};  ///< if max_surface_error was given
};

/// Writes frame.picture: RGB, or RGBA if it is transparent.
///
/// Throws  Error: no picture, a name that does not end in .png, a file that cannot be written
void save_png(const Frame &frame, const std::filesystem::path &path);
/// The bytes that save_png() writes.
///
/// Throws  Error: no picture
std::vector<std::uint8_t> encode_png(const Frame &frame);

}  // namespace isowave
