#pragma once
// A renderer turns a request into a picture. A device, the host, a team of processes and the scalar
// twin are renderers: the same request gives the same bits. A time budget or a bound of the error
// can be added to any of them, by a renderer around another (RendererAround).

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/base/team.hpp"
#include "core/frame/frame_arrays.hpp"
#include "core/frame/frame_request.hpp"
#include "core/frame/solvers.hpp"
#include "core/view/given_rays.hpp"

namespace isowave::core {

/// Abilities of a renderer, beside a picture of full detail.
struct Abilities {
  ImageSize largest{};  ///< picture of a request without a size
  std::uint64_t most_rays = std::numeric_limits<std::uint64_t>::max();  ///< most rays of a frame
  bool levels = false;             ///< FrameRequest::voxel_pixels
  bool levels_pay = false;         ///< coarse levels make frames faster on such a device
  bool fewer_planes = false;       ///< FrameRequest::voxel_error
  bool bounds = false;             ///< FrameRequest::bound
  bool given_rays = false;         ///< FrameRequest::ambient_rays and shadow_rays, cast_rays()
  bool bounce = false;             ///< FrameRequest::bounce_rays
  bool cells = true;               ///< hits name their cell: HitRecord::block_id
  bool surface_error = false;      ///< FrameRequest::max_surface_error, by proof
  bool sampled_error = false;      ///< FrameRequest::max_surface_error, by sample
  bool image_error = false;        ///< FrameRequest::max_image_error
  bool time_budget = false;        ///< FrameRequest::time_budget_ms
  bool kept_picture = false;       ///< keep_picture(), fill_from_kept(), enlarge_kept()
  bool parallel = true;            ///< Camera::parallel_height
  bool clipping = false;           ///< FrameRequest::clip
  bool field = false;              ///< FrameRequest::field_values
  bool field_labels = false;       ///< FrameRequest::field_labels
  std::size_t most_surfaces = 0;   ///< of FrameRequest::surfaces
  bool labels = false;             ///< surfaces of labels
  bool isosurfaces = true;         ///< false: surfaces of labels alone
  Solver solver = kDefaultSolver;  ///< the root finder
};

/// Rays of a frame that a renderer must be able to draw for FrameRequest::max_image_error.
inline constexpr std::uint64_t kImageErrorRays = 1 << 16;

/// Why a renderer without Abilities::isosurfaces refuses.
inline constexpr const char *kDrawsLabelsAlone =
    "this renderer draws labels alone: give each surface labels";

/// Throws  Error: the request is out of range, or asks for an ability that the renderer lacks
void check(const FrameRequest &request, const Abilities &abilities);

/// Throws  Error unless the error is finite and above 0
void check_max_surface_error(double max_surface_error);
/// Throws  Error unless the error is above 0 and not above 1
void check_max_image_error(double max_image_error);
/// Throws  Error unless the budget is finite and above 0
void check_time_budget(double budget_ms);

/// The size of the request's picture.
inline ImageSize size_of(const FrameRequest &request, const Abilities &abilities) {
  return request.size.value_or(abilities.largest);
}

/// Turns requests into pictures. Not thread-safe. All processes of a team make the same calls in
/// the same order.
class Renderer {
 public:
  virtual ~Renderer() = default;
  Renderer(const Renderer &) = delete;
  Renderer &operator=(const Renderer &) = delete;

  virtual Abilities abilities() const = 0;
  /// The processes that draw the picture together: by default only this one.
  virtual Team &team() { return alone_; }
  /// Grids of the whole volume's levels of detail that requests may use, the finest first.
  virtual std::vector<VolumeInfo> levels() const = 0;

  /// Draws one frame, and waits for it.
  ///
  /// Throws  Error: what check() refuses; a degenerate camera; a NaN isovalue. The renderer can
  ///         draw further frames afterwards
  virtual FrameStats render(const FrameRequest &request) = 0;

  /// The first hit of each ray, in the finest level of detail. t counts lengths of the ray's
  /// direction. The picture of the last frame stays.
  ///
  /// Throws  Error: no ability for given rays; what make_index_rays() throws; the isovalue is NaN
  virtual std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                           Normals normals) = 0;

  /// A view in which isosurfaces fill a picture of that size, see surface_camera(); no size: the
  /// largest. No isovalues, or none that has a surface: the whole volume fills the picture.
  ///
  /// from    of several views, the first is returned, and the surfaces stay in all pictures
  /// Throws  Error: an isovalue is NaN; what camera_of_box() throws
  virtual Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {},
                        const Viewpoint &from = {}) = 0;

  /// The same for the surface of labels.
  ///
  /// Throws  Error: no ability for labels
  virtual Camera label_camera(std::span<const std::uint16_t> labels,
                              std::optional<ImageSize> size = {}, const Viewpoint &from = {});

  // These functions return the last frame, or within on_pass the frame at work. Rank 0 of a team
  // gets the frame, and other ranks get empty ones. All of them wait, and throw Error if no frame
  // was drawn.

  virtual ImageSize size() const = 0;
  /// The wanted arrays, in memory that may serve the next frame's once they are gone. Positions
  /// need Abilities::cells. Shadows are those of the frame's light.
  virtual FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) = 0;
  /// RGB, or RGBA if `appearance.transparent`, [size.height][size.width], row 0 at the top.
  Image8 shade(const Appearance &appearance = {});
  /// Distances from the eye [world units], as hits().
  std::vector<float> depth() { return fetch({.depth = true}, {}).depth.copy(); }
  /// [size.ray_rows()][size.ray_columns()], row 0 at the top.
  virtual std::vector<HitRecord> hits() = 0;
  /// Whether the last frame had FrameRequest::field_values, and no FrameRequest::surfaces.
  virtual bool has_field_values() const { return false; }
  /// The least and the largest value of the field at the hits of the last frame, or in frames of
  /// several or translucent surfaces, of the field. None: they are not known, or no hit has
  /// one.
  virtual std::optional<std::array<float, 2>> field_range() { return {}; }
  /// Number of rays that hit, for the frame with those statistics.
  virtual std::uint64_t num_hits(const FrameStats &stats) { return stats.rays_hit; }

  // Pictures of one frame with more and more pixels (timed_renderer.hpp), for renderers with
  // Abilities::kept_picture. Other renderers throw std::logic_error.

  /// Puts the last frame's picture aside. It has at most half the pixels of the largest picture
  /// along each axis, rounded up (halved()).
  virtual void keep_picture();
  /// Gives rays of the last frame without a hit the kept picture's hits, as after a cancelled
  /// frame. Waits.
  virtual void fill_from_kept();
  /// Makes the kept picture, of the same request, the last frame's, with as many pixels as the
  /// request says. Waits.
  virtual void enlarge_kept(const FrameRequest &request);

  /// Forgets all decoded blocks, so that the next frame is a cold one, for measurements. No picture
  /// depends on it.
  virtual void clear_cache() = 0;
  /// Memory that the renderer holds [bytes]: its device's, if it has one.
  virtual std::uint64_t memory_bytes() const = 0;
  virtual double setup_ms() const { return 0; }  ///< wall clock of making it, without compiling

 protected:
  Renderer() = default;
  /// Throws  Error: colours by a field whose values the last frame does not have
  void check_field_colors(const Appearance &appearance) const;
  /// make_shading(), with field_range() if the appearance gives no range.
  ///
  /// Throws  Error: also as check_field_colors()
  Shading shading_of(const VolumeInfo &info, const Appearance &appearance);

 private:
  TeamOfOne alone_;
};

/// A renderer that hands all calls on to another renderer, except those that a derived class
/// overrides.
class RendererAround : public Renderer {
 public:
  /// inner: must outlive this
  explicit RendererAround(Renderer &inner) : inner_(&inner) {}
  explicit RendererAround(std::unique_ptr<Renderer> inner)
      : owned_(std::move(inner)), inner_(owned_.get()) {}

  Abilities abilities() const override { return inner().abilities(); }
  Team &team() override { return inner().team(); }
  std::vector<VolumeInfo> levels() const override { return inner().levels(); }
  FrameStats render(const FrameRequest &request) override { return inner().render(request); }
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override {
    return inner().cast_rays(rays, isovalue, normals);
  }
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {},
                const Viewpoint &from = {}) override {
    return inner().camera(isovalues, size, from);
  }
  Camera label_camera(std::span<const std::uint16_t> labels, std::optional<ImageSize> size = {},
                      const Viewpoint &from = {}) override {
    return inner().label_camera(labels, size, from);
  }
  ImageSize size() const override { return inner().size(); }
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override {
    return inner().fetch(wanted, appearance);
  }
  std::vector<HitRecord> hits() override { return inner().hits(); }
  bool has_field_values() const override { return inner().has_field_values(); }
  std::optional<std::array<float, 2>> field_range() override { return inner().field_range(); }
  std::uint64_t num_hits(const FrameStats &stats) override { return inner().num_hits(stats); }
  void keep_picture() override { inner().keep_picture(); }
  void fill_from_kept() override { inner().fill_from_kept(); }
  void enlarge_kept(const FrameRequest &request) override { inner().enlarge_kept(request); }
  void clear_cache() override { inner().clear_cache(); }
  std::uint64_t memory_bytes() const override { return inner().memory_bytes(); }
  double setup_ms() const override { return inner().setup_ms(); }

 protected:
  /// For classes that override inner().
  RendererAround() = default;
  virtual Renderer &inner() const { return *inner_; }

 private:
  std::unique_ptr<Renderer> owned_;
  Renderer *inner_ = nullptr;
};

}  // namespace isowave::core
