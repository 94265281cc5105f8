#include "core/frame/renderer.hpp"

#include <cmath>
#include <stdexcept>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/view/detail.hpp"

namespace isowave::core {

namespace {

constexpr const char *kDrawsNoLabels =
    "this renderer draws no labels: draw on the host, or on a device by a renderer that was made "
    "with_labels";

/// Checks settings that either the renderer or the user may choose, not both.
void check_choices(const FrameRequest &request) {
  if (!request.clip.planes.empty() && request.bound != FieldBound::kNone)
    throw Error("a bound of the field is drawn whole: leave out clip");
  if (!request.surfaces.empty()) {
    const bool has_slices = !request.slices.planes.empty(),
               has_labels = !request.surfaces.front().labels.empty();
    const auto leave_out = [&](bool is_given, const char *what) {
      if (is_given)
        throw Error("{0} are drawn without {1}: leave out {1}",
                    has_labels   ? "labels"
                    : has_slices ? "slices"
                                 : "several or translucent surfaces",
                    what);
    };
    leave_out(has_labels && request.voxel_error != 0, "voxel_error");
    leave_out(request.bound != FieldBound::kNone, "bound");
    leave_out(has_labels && request.voxel_pixels != 0, "voxel_pixels");
    leave_out(has_labels && request.max_surface_error, "max_surface_error");
    leave_out(request.max_image_error.has_value(), "max_image_error");
    leave_out(request.time_budget_ms.has_value(), "time_budget_ms");
    if (light_rays_of(request).count() != 0) check_some_are_opaque(request.surfaces);
  }
  if (request.field_values && request.time_budget_ms)
    throw Error("colours by a field are drawn without a time budget: leave out one of the two");
  if (!request.max_surface_error) {
    if (request.by == Evidence::kSample)
      throw Error("a sample is evidence for max_surface_error: give max_surface_error");
    if (!request.max_image_error) {
      if (!request.series.empty())
        throw Error("a series of views shares an error: give max_surface_error or max_image_error");
      return;
    }
  } else if (request.max_image_error) {
    throw Error("a frame keeps one error: give max_surface_error or max_image_error");
  }
  if (request.time_budget_ms)
    throw Error("a frame cannot keep both an error and a time: give one of the two");
  if (request.voxel_pixels != 0 || request.voxel_error != 0)
    throw Error("{} chooses the detail: leave out voxel_pixels and voxel_error",
                request.max_surface_error ? "max_surface_error" : "max_image_error");
  if (request.bound != FieldBound::kNone)
    throw Error("the surface of a bound has no error: draw the volume itself");
  if (request.max_surface_error && !request.clip.planes.empty() && request.by == Evidence::kProof)
    throw Error("errors are proven of whole surfaces: leave out clip, or judge by sample");
}

/// Throws  Error with that text: it is asked for, and cannot be had
void need(bool is_asked, bool is_able, const char *text) {
  if (is_asked && !is_able) throw Error("{}", text);
}

/// Throws  Error: the request asks for an error or a time that the renderer does not keep
void need_choices(const FrameRequest &request, const Abilities &abilities) {
  const bool by_sample = request.by == Evidence::kSample;
  need(request.max_surface_error && !by_sample, abilities.surface_error,
       "this renderer knows no bounds of the error: leave out max_surface_error, judge it by "
       "sample, or draw on the host, or on a device by a renderer that was made with_bounds");
  need(by_sample, abilities.sampled_error,
       "this renderer chooses no detail: leave out max_surface_error");
  need(request.max_image_error.has_value(), abilities.image_error,
       "this renderer chooses no detail: leave out max_image_error");
  if (request.max_image_error && abilities.most_rays < kImageErrorRays)
    throw Error(
        "max_image_error looks at parts of the picture with {} rays, and the renderer was made for "
        "{}: make it for larger pictures",
        kImageErrorRays, abilities.most_rays);
  need(request.time_budget_ms.has_value(), abilities.time_budget,
       "this renderer keeps no time: leave out time_budget_ms, or draw on the host, or on a device "
       "by a renderer that was made with_time_budget");
}

}  // namespace

void check_max_surface_error(double max_surface_error) {
  if (!(max_surface_error > 0) || !std::isfinite(max_surface_error))
    throw Error("an error of {} pixels cannot be kept: give more than 0", max_surface_error);
}

void check_max_image_error(double max_image_error) {
  if (!(max_image_error > 0 && max_image_error <= 1))
    throw Error("an error of {} of a picture cannot be kept: give more than 0, up to 1",
                max_image_error);
}

void check_time_budget(double budget_ms) {
  if (!(budget_ms > 0) || !std::isfinite(budget_ms))
    throw Error("no picture can be drawn in {} ms: give more than 0", budget_ms);
}

void check(const FrameRequest &request, const Abilities &abilities) {
  const ImageSize size = size_of(request, abilities);
  check_image_size(size);
  check_voxel_pixels(request.voxel_pixels);
  with_fewer_planes({}, request.voxel_error);  // or throws
  check_ambient_rays(request.ambient_rays);
  check_light(request.light.towards_light);
  check_shadow_rays(request);
  check_clip(request.clip);
  check_surfaces(request.surfaces, request.slices);
  if (request.max_surface_error) check_max_surface_error(*request.max_surface_error);
  if (request.max_image_error) check_max_image_error(*request.max_image_error);
  if (request.time_budget_ms) check_time_budget(*request.time_budget_ms);
  check_choices(request);
  if (size.num_rays() > abilities.most_rays) {
    throw Error("{}x{} pixels have more than the {} rays that the renderer was made for",
                size.width, size.height, abilities.most_rays);
  }
  need(request.camera.parallel_height.has_value(), abilities.parallel,
       "this renderer draws in perspective alone: leave out parallel projection");
  need(!request.clip.planes.empty(), abilities.clipping,
       "this renderer draws whole volumes alone: leave out clip");
  need(request.field_values, abilities.field,
       "this renderer has no field to colour by: make it with one");
  need(
      request.field_values && request.field_labels, abilities.field_labels,
      "the field's voxels are no labels, exact whole numbers from 0 to 65535: leave out colours by "
      "label");
  need(!request.slices.planes.empty(), abilities.most_surfaces != 0,
       "this renderer draws no slices: leave them out, or draw on the host, or on a device by a "
       "renderer that was made with_surfaces");
  if (request.surfaces.size() > abilities.most_surfaces)
    throw Error("{}", abilities.most_surfaces == 0
                          ? std::string("this renderer draws one opaque surface alone: leave out "
                                        "surfaces, or draw on the host, or on a device by a "
                                        "renderer that was made with_surfaces")
                          : fmt::format("this renderer was made for {} {}, and {} are given",
                                        abilities.most_surfaces,
                                        plural(abilities.most_surfaces, "surface", "surfaces"),
                                        request.surfaces.size()));
  const bool has_labels = !request.surfaces.empty() && !request.surfaces.front().labels.empty();
  need(has_labels, abilities.labels, kDrawsNoLabels);
  need(!has_labels, abilities.isosurfaces, kDrawsLabelsAlone);
  need(request.voxel_pixels > 0, abilities.levels,
       "this renderer draws the finest level of detail alone: leave out voxel_pixels, or draw a "
       "volume with levels on the host, or on a device by a renderer that was made with_levels");
  need(request.voxel_error > 0, abilities.fewer_planes,
       "this renderer decodes all bit planes: leave out voxel_error, or draw on a device or the "
       "host");
  need(request.bound != FieldBound::kNone, abilities.bounds,
       "this renderer draws no bounds of the field: leave out bound, or draw on the host, or on a "
       "device by a renderer that was made with_bounds");
  need(request.ambient_rays != 0, abilities.given_rays,
       "ambient rays need a renderer that was made with_rays");
  need(request.shadow_rays != 0, abilities.given_rays,
       "shadow rays need a renderer that was made with_rays");
  need(request.bounce_rays != 0, abilities.bounce,
       "bounced light needs a renderer that was made with_bounce");
  need_choices(request, abilities);
}

Image8 Renderer::shade(const Appearance &appearance) {
  const FrameArrays arrays = fetch({.picture = true}, appearance);
  return arrays.picture.empty() ? Image8{} : image_of(size(), arrays.picture);
}

void Renderer::check_field_colors(const Appearance &appearance) const {
  if (appearance.color_by_field && !has_field_values())
    throw Error("the last frame has no values of a field: ask for field_values");
}

Shading Renderer::shading_of(const VolumeInfo &info, const Appearance &appearance) {
  check_field_colors(appearance);
  const auto &by = appearance.color_by_field;
  const bool needs_range = by && !by->labels && !(by->low && by->high);
  return make_shading(info, appearance, needs_range ? field_range() : std::nullopt);
}

Camera Renderer::label_camera(std::span<const std::uint16_t>, std::optional<ImageSize>,
                              const Viewpoint &) {
  throw Error("{}", kDrawsNoLabels);
}

void Renderer::keep_picture() {
  throw std::logic_error("a renderer without Abilities::kept_picture keeps none");
}

void Renderer::fill_from_kept() {
  throw std::logic_error("a renderer without Abilities::kept_picture keeps none");
}

void Renderer::enlarge_kept(const FrameRequest &) {
  throw std::logic_error("a renderer without Abilities::kept_picture keeps none");
}

}  // namespace isowave::core
