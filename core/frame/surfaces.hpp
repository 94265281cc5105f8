#pragma once
// Several surfaces of a frame, translucent ones, and slices. Rays go on from hits on translucent
// surfaces, and their hits are blended front to back, in layers (kernels_cl/portable/layers.h).

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/error.hpp"
#include "core/frame/appearance.hpp"
#include "core/view/clip.hpp"
#include "kernels_cl/portable/label_table.h"
#include "kernels_cl/portable/layers.h"

namespace isowave::core {

/// An isosurface of a frame, or the surface of a group of labels.
struct SurfaceStyle {
  float isovalue = 0;
  glm::vec3 color{219 / 255.0f, 189 / 255.0f, 135 / 255.0f};  ///< display values, [0,1]
  float opacity = 1;    ///< of each crossing, (0,1]; 1: nothing behind it is seen
  bool clipped = true;  ///< false: clipping planes leave it whole
  bool mapped = true;   ///< false: colour maps leave it its own colour
  /// The labels of the group, of a renderer of labels: the surface is that of their indicator, and
  /// `isovalue` is not used. Empty: an isosurface.
  std::vector<std::uint16_t> labels{};

  /// The isovalue in the field that is drawn.
  float isovalue_of_field() const { return labels.empty() ? isovalue : ISO_LABEL_ISOVALUE; }
};

/// A plane that shows the voxels, by their values, without light.
struct Slice {
  ClipPlane plane{};    ///< the points p with dot(normal, p) = offset
  float opacity = 1;    ///< (0,1]
  bool clipped = true;  ///< false: clipping planes leave it whole
};

/// The slices of a frame. Voxels without data are not seen.
struct Slices {
  std::vector<Slice> planes{};
  double low = 0, high = 1;  ///< voxel values of the first and the last colour
  ColorTable colors{};
};

/// Throws  Error: more than ISO_MAX_SURFACES with the slices; two at one isovalue; an isovalue that
///         is NaN; labels beside isovalues or slices; colours or opacities out of range; slices
///         without a surface, whose plane is degenerate, or whose range of values is
void check_surfaces(const std::vector<SurfaceStyle> &surfaces, const Slices &slices = {});

/// For frames with ambient or shadow rays.
///
/// surfaces  with members `opacity`
/// Throws    Error: none is opaque, so the rays end nowhere
template <class Surfaces>
void check_some_are_opaque(const Surfaces &surfaces) {
  if (std::ranges::none_of(surfaces, [](const auto &surface) { return surface.opacity == 1; }))
    throw Error(
        "ambient and shadow rays end at surfaces of opacity 1, and there is none: give "
        "one, or leave out these rays");
}

/// The numbers of surfaces, those of larger isovalues first: the order in which layers prefer hits
/// at one place. Surfaces of labels keep the order in which they are given.
std::vector<std::uint32_t> innermost_first(const std::vector<SurfaceStyle> &surfaces);
/// SurfaceStyle::isovalue_of_field() of the surfaces, in that order.
std::vector<float> isovalues_of_layers(const std::vector<SurfaceStyle> &surfaces);

/// The opaque surfaces, by their places in innermost_first(), in the order in which light rays go
/// through them: those that clipping planes leave whole come first.
std::vector<std::size_t> light_order(const std::vector<SurfaceStyle> &surfaces);

/// Whether clipping planes leave one of them whole.
bool any_is_whole(const std::vector<SurfaceStyle> &surfaces);

/// FieldMap::surfaces of a frame's surfaces; of none: of the one opaque surface.
uint mapped_surfaces(const std::vector<SurfaceStyle> &surfaces);

/// finest, view, camera  as make_clip_params()
LayerParams make_layer_params(const std::vector<SurfaceStyle> &surfaces, const Slices &slices,
                              const VolumeInfo &finest, const View &view, const Camera &camera);

/// The picture of rays that have gone through layers, made on the host with the bits of a device's.
///
/// colors   [height * width] of the frame's rays
/// samples  rays per pixel along each axis
/// Returns  RGB, or RGBA if transparent
Image8 shade_layers_scalar(const FrameParams &frame, const ShadeParams &params,
                           std::span<const RayColor> colors, std::uint32_t samples = 1);

/// Statistics of layers.
struct LayerStats {
  std::uint32_t layers = 0;  ///< layers that any ray has; 0: the frame has none
  std::uint64_t hits = 0;    ///< in all of them
  /// Rays that would go on behind their ISO_MAX_LAYERS-th hit. What they would hit there is left
  /// out.
  std::uint64_t rays_cut = 0;

  /// Adds those of other rays.
  void add(const LayerStats &other) {
    layers = other.layers > layers ? other.layers : layers;
    hits += other.hits;
    rays_cut += other.rays_cut;
  }
};

}  // namespace isowave::core
