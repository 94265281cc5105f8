#pragma once
// Requests of frames, and the frames that come back.

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
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
  /// Colour of the surface, if FrameRequest::surfaces is empty.
  std::array<float, 3> surface{219 / 255.0f, 189 / 255.0f, 135 / 255.0f};
  std::array<float, 3> background{1, 1, 1};
  /// The background goes linearly, by rows of pixels, from `background` at the picture's lower edge
  /// to this one at the upper; none: it is uniform.
  std::optional<std::array<float, 3>> background_top{};
  float ambient = 0.15f;                  ///< light from all around
  float diffuse = 0.5f, specular = 0.2f;  ///< light of a headlight at the eye
  /// Light from halfway between the eye and the picture's upper edge, or that of light_direction.
  float above = 0.45f;
  /// Direction towards a light of the scene, in world space, of any length above 0. It comes
  /// instead of the light above, with its weight, and lights the sides that face it.
  std::optional<Vector3> light_direction{};
  /// Rays from each hit towards that light, up to 255, that find out whether it is seen from there.
  /// 0: nothing casts a shadow; 1: hard shadows; more: soft ones. Each takes about as long as a
  /// frame without any. Needs with_rays, and a surface of opacity 1.
  std::uint32_t shadow_rays = 0;
  /// Least number of ambient rays, up to 255, if that light bounces: each hit then gets light that
  /// comes by way of one other place of a surface, and has that surface's colour. A surface that a
  /// colour map colours counts as one of the hit's own colour. Each takes up to twice the time of
  /// an ambient ray. 0: it does not bounce. Needs with_bounce, and a surface of opacity 1.
  std::uint32_t bounce_rays = 0;
  /// Half of the angle that the light has in soft shadows [degrees], up to 45.
  double light_angle = 3;
  /// Pictures are RGBA with straight alpha: the share of a pixel's rays that hit, and the mean
  /// colour of those alone; 0 0 0 0 if none hits. There is no background. A ray that goes on behind
  /// translucent surfaces counts as far as they are opaque together.
  bool transparent = false;
  /// Name of a colour map (color_map_names()) that surfaces are coloured by instead: by a hit's
  /// distance from the world's origin along color_axis. Empty, without a color_table: their own
  /// colours.
  std::string color_map{};
  std::vector<std::array<float, 3>> color_table{};  ///< 256 colours instead of a map by name
  Vector3 color_axis{0, 0, 1};                      ///< world space, of any length above 0
  bool color_by_depth = false;  ///< along the camera's view instead of color_axis
  /// Colours are by the value of the renderer's field at a hit instead (RendererOptions::field),
  /// trilinear between its voxels. Hits without a value, outside its grid or without data, have
  /// the surface's own colour. Not with time_budget_ms.
  bool color_by_field = false;
  /// With color_by_field: caps have the field's colours, and surfaces their own.
  bool color_caps_alone = false;
  /// With color_by_field: the field's voxels are labels, exact whole numbers from 0 to 65,535, and
  /// label L has colour L % 256 of the map. A hit has the label of the nearest voxel of its cell
  /// with one other than 0, the background. If the field is the volume itself and the surfaces are
  /// those of its labels, it has that of the nearest voxel with one of the surface's labels.
  bool color_by_label = false;
  /// Distances, or values of the field, of the first and the last colour; none: the least and the
  /// largest of the volume's box [world units], or of the field at the frame's hits. In frames of
  /// several or translucent surfaces, a field's are those of its Volume::value_range().
  std::optional<double> color_low{}, color_high{};
  std::string slice_map = "gray";  ///< name of the colour map of FrameRequest::slices
  std::vector<std::array<float, 3>> slice_table{};  ///< 256 colours instead of slice_map
  /// Voxel values of the first and the last of these colours; none: Volume::value_range().
  std::optional<double> slice_low{}, slice_high{};
};

/// The colour maps: viridis, magma, cividis, coolwarm, gray; and labels, for color_by_label.
std::vector<std::string> color_map_names();

/// The colour of a text: "#RRGGBB", or a name such as "bone", "skin" or "orange".
///
/// Throws  Error, which lists the names
std::array<float, 3> parse_color(std::string_view text);
/// A colour for surface `index` of a frame, unlike those of its other surfaces; 0: Appearance's.
std::array<float, 3> surface_color(std::size_t index);

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

/// An isosurface of a frame of several or translucent ones, or the surface of a group of labels.
struct Surface {
  double isovalue = 0;  ///< as FrameRequest::isovalue; each surface has its own
  std::array<float, 3> color = Appearance{}.surface;  ///< sRGB, 0 to 1
  float opacity = 1;    ///< of each crossing, above 0; 1: nothing behind it is seen
  bool clipped = true;  ///< false: clipping planes leave it whole
  bool mapped = true;   ///< false: color_map and color_table leave it its own colour
  /// Labels of a segmentation, 0 to 65,535, instead of `isovalue`: the surface is that of their
  /// indicator, which is 1 at voxels with one of them and 0 at the others, at 0.5. A
  /// device needs RendererOptions::with_labels. Surfaces may have labels in common.
  std::vector<std::uint32_t> labels{};
};

/// A plane of a frame that shows the voxels: the points p with dot(normal, p) = offset. Voxels are
/// trilinear, and have the colours of Appearance::slice_map, without light. Those without data are
/// not seen.
struct Slice {
  Vector3 normal{0, 0, 1};  ///< world space, of any length above 0
  double offset = 0;        ///< [world units times the normal's length]
  float opacity = 1;        ///< above 0; 1: nothing behind it is seen
  bool clipped = true;      ///< false: clipping planes leave it whole
};

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
  /// Up to 8 surfaces in one picture, drawn instead of that of `isovalue`, and blended front to
  /// back: what lies behind translucent surfaces is seen through them. At most 16 crossings of a
  /// ray are drawn (FrameStatistics::rays_cut). Empty: the surface of `isovalue` alone, opaque, in
  /// appearance.surface. A device needs RendererOptions::with_surfaces. Not with bound,
  /// max_image_error and time_budget_ms. Errors are those of a ray's first hit, whatever its
  /// opacity. That of a slice is rounding alone. Labels have no errors, and one level of detail.
  std::vector<Surface> surfaces{};
  /// Slices beside `surfaces`, or beside that of `isovalue`: up to 8 with the surfaces, blended
  /// with them, with their conditions. A slice counts as a crossing, is in front of a surface at
  /// the same place, and has the plane's normal. It shows the voxels of the level of detail that
  /// is drawn at its distance.
  std::vector<Slice> slices{};

  /// Largest distance between voxels of a coarser level of detail [pixels]; 0: the finest level
  /// draws all. Needs RendererOptions::with_levels.
  double voxel_pixels = 0;
  /// Largest difference of decoded voxels from the compressed ones [voxel values].
  double voxel_error = 0;
  FieldBound bound = FieldBound::kNone;  ///< needs RendererOptions::with_bounds
  Normals normals = Normals::kSmooth;    ///< gradients of the hits; nothing else depends on them
  /// Rays from each hit, up to 255, that find out how much of the sky it sees, which shows depth.
  /// Each takes about as long as a frame without any. Needs with_rays, and a surface of opacity 1.
  std::uint32_t ambient_rays = 0;
  /// Largest distance to the true surface [pixels]. voxel_pixels and voxel_error are then chosen so
  /// that most pixels keep it. By proof, the true surface is that of the volume before compression;
  /// needs with_bounds. By sample, it is that of full detail, and 99 % of the rays that hit keep
  /// the error, along the ray and beside it (DetailChoice::sample); to choose levels of detail,
  /// needs with_levels.
  std::optional<double> max_surface_error{};
  Evidence by = Evidence::kProof;  ///< for max_surface_error; kProof without one
  /// Largest error of the picture, above 0 and up to 1: the mean of FLIP's over all pixels, for a
  /// viewer who sees 67 pixels a degree, against 64 rays a pixel at full detail. The cheapest rays
  /// and voxel_pixels are then chosen that keep it with 95 % confidence, by tiles of the picture
  /// without ambient, shadow and bounce rays. size.samples is the most rays along each axis, and
  /// Frame::size tells how many were taken. Levels of detail need with_levels. A device's
  /// renderer must be made for 65,536 rays or more. Not with max_surface_error.
  std::optional<double> max_image_error{};
  /// Views that share max_surface_error or max_image_error: most pixels of all of them together, or
  /// the mean of their pictures, keep it. Requests with the same series and error are drawn with
  /// one detail, which is chosen once. Empty: the request's view alone.
  std::vector<Camera> series{};
  /// Time in which the largest picture possible is drawn: first one that took at most half of it
  /// before, then larger ones. Needs with_time_budget.
  std::optional<double> time_budget_ms{};

  // Arrays that the frame brings to the host.
  bool want_picture = true;
  bool want_depth = false, want_normals = false, want_positions = false, want_hits = false;
  /// Values of the renderer's field, at hits of one opaque surface; needs RendererOptions::field.
  bool want_field = false;
  bool want_bounds = false;  ///< bounds of each pixel's error; needs RendererOptions::with_bounds

  /// Called after each pass, also those for smooth normals, a field, ambient and shadow rays; on
  /// the host after each band of rows, from the top. If it returns false, the frame stops with the
  /// picture so far. In a team, all processes have an on_pass or none, and all of them ask for the
  /// picture of a pass, or none does. If it returns false in any process, the frame stops in all.
  std::function<bool(const Progress &)> on_pass{};

  /// Called now and then, by the thread that draws, with the percentage of the frame's work that is
  /// done; it never falls. The frame and its statistics are those without it. Not called within a
  /// time budget, nor in frames of several surfaces of a team.
  std::function<void(double percent)> on_progress{};
};

/// First crossing of a ray with the isosurface, or with the nearest of several: the true crossing
/// of the decoded field, not a sample.
struct Hit {
  float t = std::numeric_limits<float>::infinity();  ///< distance from the eye [world units]
  std::uint32_t level = 0;                           ///< level of detail; 0: the finest
  std::array<std::uint32_t, 3> cell{};               ///< voxel at the cell's lowest corner
  std::array<float, 3> position{};                   ///< place in the cell, 0 to 1
  std::array<float, 3> gradient{};  ///< as FrameRequest::normals [voxel value per voxel]
  /// Index in FrameRequest::surfaces; slices are counted behind them, or from 1 on.
  std::uint32_t surface = 0;
  bool cap = false;  ///< on a clipping plane or slice, not on a surface
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

/// Calls visit(name, field) for each field of a surface.
template <class AnySurface, class Visit>
void for_each_surface_field(AnySurface &surface, const Visit &visit) {
  visit("isovalue", surface.isovalue);
  visit("labels", surface.labels);
  visit("color", surface.color);
  visit("opacity", surface.opacity);
  visit("clipped", surface.clipped);
  visit("mapped", surface.mapped);
}

/// Calls visit(name, field) for each field of a slice.
template <class AnySlice, class Visit>
void for_each_slice_field(AnySlice &slice, const Visit &visit) {
  visit("normal", slice.normal);
  visit("offset", slice.offset);
  visit("opacity", slice.opacity);
  visit("clipped", slice.clipped);
}

/// Calls visit(name, field) for each field of an appearance, except `surface`.
template <class AnyAppearance, class Visit>
void for_each_appearance_field(AnyAppearance &appearance, const Visit &visit) {
  visit("background", appearance.background);
  visit("background_top", appearance.background_top);
  visit("ambient", appearance.ambient);
  visit("diffuse", appearance.diffuse);
  visit("specular", appearance.specular);
  visit("above", appearance.above);
  visit("light_direction", appearance.light_direction);
  visit("shadow_rays", appearance.shadow_rays);
  visit("bounce_rays", appearance.bounce_rays);
  visit("light_angle", appearance.light_angle);
  visit("transparent", appearance.transparent);
  visit("color_map", appearance.color_map);
  visit("color_table", appearance.color_table);
  visit("color_axis", appearance.color_axis);
  visit("color_by_depth", appearance.color_by_depth);
  visit("color_by_field", appearance.color_by_field);
  visit("color_caps_alone", appearance.color_caps_alone);
  visit("color_by_label", appearance.color_by_label);
  visit("color_low", appearance.color_low);
  visit("color_high", appearance.color_high);
  visit("slice_map", appearance.slice_map);
  visit("slice_table", appearance.slice_table);
  visit("slice_low", appearance.slice_low);
  visit("slice_high", appearance.slice_high);
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
  for_each_appearance_field(request.appearance, visit);
  visit("clip", request.clip);
  visit("caps", request.caps);
  visit("surfaces", request.surfaces);
  visit("slices", request.slices);
  visit("voxel_pixels", request.voxel_pixels);
  visit("voxel_error", request.voxel_error);
  visit("bound", request.bound);
  visit("normals", request.normals);
  visit("ambient_rays", request.ambient_rays);
  visit("max_surface_error", request.max_surface_error);
  visit("by", request.by);
  visit("max_image_error", request.max_image_error);
  visit("series", request.series);
  visit("time_budget_ms", request.time_budget_ms);
  visit("want_picture", request.want_picture);
  visit("want_depth", request.want_depth);
  visit("want_normals", request.want_normals);
  visit("want_positions", request.want_positions);
  visit("want_hits", request.want_hits);
  visit("want_field", request.want_field);
  visit("want_bounds", request.want_bounds);
}

struct FrameStatistics {
  std::uint32_t passes = 0;
  std::uint64_t rays = 0, hits = 0;  ///< hits: rays that hit a surface
  // Frames with FrameRequest::surfaces; otherwise 0.
  std::uint32_t layers = 0;      ///< most surface crossings that were drawn of any ray
  std::uint64_t layer_hits = 0;  ///< all crossings that were drawn
  std::uint64_t rays_cut = 0;    ///< rays with a seen crossing behind their 16th, which is left out
  std::uint64_t decoded_blocks = 0;          ///< all decoded blocks of 4^3 voxels
  std::uint32_t normals_passes = 0;          ///< those of `passes` for smooth normals
  std::uint64_t normals_decoded_blocks = 0;  ///< those of decoded_blocks for smooth normals
  double normals_ms = 0;                     ///< part of total_ms
  std::uint32_t ambient_passes = 0;          ///< those of `passes` for ambient and shadow rays
  double ambient_ms = 0;                     ///< part of total_ms
  double field_ms = 0;                       ///< part of total_ms, for values of a field
  /// The least and the largest value of the field at the hits; none: there is no value, or there
  /// are several or translucent surfaces.
  std::optional<std::array<float, 2>> field_range{};
  /// The values of the first and the last colour: distances along Appearance::color_axis, or values
  /// of the field. None: there is no colour map, or no value.
  std::optional<std::array<double, 2>> color_range{};
  /// Voxel values of the first and the last colour of slices; none: there are no slices.
  std::optional<std::array<double, 2>> slice_range{};
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

/// A picture's error by tiles of it, for FrameRequest::max_image_error.
struct ImageError {
  std::uint32_t samples = 1;    ///< rays of a pixel along each axis, as chosen
  std::uint32_t num_tiles = 0;  ///< of the picture, or of all views of a series
  double mean = 0;              ///< of the tiles
  /// Upper end of the one-sided confidence interval of 95 % (Student's t) for the whole picture.
  double highest = 0;
};

/// The detail that was chosen to keep FrameRequest::max_surface_error or max_image_error.
struct DetailChoice {
  double voxel_pixels = 0, voxel_error = 0;
  bool reachable = true;                 ///< false: it cannot be kept; full detail was drawn
  std::string advice{};                  ///< what would help if it is not reachable
  std::optional<SampledShare> sample{};  ///< by sample: with the chosen detail
  std::optional<ImageError> image{};     ///< with max_image_error
};

/// A finished frame. Arrays that were not asked for are empty. Rays are [rows][columns], row 0 at
/// the top: size.samples times as many as pixels along each axis. With FrameRequest::surfaces,
/// depth, normals, positions and hits are those of each ray's first crossing, however translucent
/// that surface is.
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
  Array<float> field{};  ///< [rows][columns] values of the field; NaN: no hit, or no value
  Array<Hit> hits{};     ///< [rows][columns]
  /// [rows][columns] Largest possible distance to the true surface along the ray [pixels];
  /// infinity: nothing is certain. Bounds hold if the volume's errors do: see
  /// FrameStatistics::errors_are_stated.
  Array<float> bounds{};

  std::optional<Camera> camera{};  ///< of the request; save_png() writes it into the file, too
  FrameStatistics statistics{};
  std::optional<DetailChoice> detail{};  ///< if max_surface_error or max_image_error was given
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
