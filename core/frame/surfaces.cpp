#include "core/frame/surfaces.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

void check_opacity(float opacity) {
  if (!(opacity > 0 && opacity <= 1))
    throw Error("an opacity of {} is out of range: give more than 0, at most 1", opacity);
}

void check_slices(const Slices &slices) {
  constexpr double kMost = std::numeric_limits<float>::max();
  for (const Slice &slice : slices.planes) {
    check_plane(slice.plane, "a slice");
    check_opacity(slice.opacity);
  }
  for (const double end : {slices.low, slices.high}) {
    if (!(std::abs(end) <= kMost))
      throw Error("colours of slices cannot begin or end at {}: give a finite number", end);
  }
  if (slices.low == slices.high)
    throw Error("colours of slices cannot go from {} to {}: give two numbers that differ",
                slices.low, slices.high);
}

}  // namespace

void check_surfaces(const std::vector<SurfaceStyle> &surfaces, const Slices &slices) {
  if (surfaces.size() > ISO_MAX_SURFACES)
    throw Error("{} surfaces are more than a frame can have: give at most {}", surfaces.size(),
                ISO_MAX_SURFACES);
  if (!slices.planes.empty()) {
    check_slices(slices);
    if (surfaces.empty()) throw Error("slices are drawn beside surfaces: give a surface");
    if (!surfaces.front().labels.empty())
      throw Error("labels are drawn without slices: leave out slices");
    if (surfaces.size() + slices.planes.size() > ISO_MAX_SURFACES)
      throw Error("{} surfaces and {} slices are more than a frame can have: give at most {}",
                  surfaces.size(), slices.planes.size(), ISO_MAX_SURFACES);
  }
  for (const SurfaceStyle &surface : surfaces) {
    if (std::isnan(surface.isovalue)) throw Error("the isovalue is NaN: give a number");
    check_opacity(surface.opacity);
    for (int channel = 0; channel < 3; ++channel) {
      if (!(surface.color[channel] >= 0 && surface.color[channel] <= 1))
        throw Error("a colour of {} is out of range: give 0 to 1", surface.color[channel]);
    }
    if (surface.labels.empty() != surfaces.front().labels.empty())
      throw Error("surfaces of labels are drawn without isosurfaces: give each surface labels");
    if (!surface.labels.empty()) continue;
    const auto same = [&](const SurfaceStyle &other) { return other.isovalue == surface.isovalue; };
    if (std::ranges::count_if(surfaces, same) > 1)
      throw Error("two surfaces have the isovalue {}: give each once", surface.isovalue);
  }
}

std::vector<std::uint32_t> innermost_first(const std::vector<SurfaceStyle> &surfaces) {
  std::vector<std::uint32_t> numbers(surfaces.size());
  std::iota(numbers.begin(), numbers.end(), 0u);
  std::ranges::stable_sort(numbers, std::greater<>(), [&](std::uint32_t number) {
    return surfaces[number].isovalue_of_field();
  });
  return numbers;
}

std::vector<float> isovalues_of_layers(const std::vector<SurfaceStyle> &surfaces) {
  std::vector<float> isovalues;
  isovalues.reserve(surfaces.size());
  for (const std::uint32_t surface : innermost_first(surfaces))
    isovalues.push_back(surfaces[surface].isovalue_of_field());
  return isovalues;
}

std::vector<std::size_t> light_order(const std::vector<SurfaceStyle> &surfaces) {
  const std::vector<std::uint32_t> numbers = innermost_first(surfaces);
  std::vector<std::size_t> order;
  for (const bool clipped : {false, true}) {
    for (std::size_t place = 0; place < numbers.size(); ++place) {
      const SurfaceStyle &surface = surfaces[numbers[place]];
      if (surface.opacity == 1 && surface.clipped == clipped) order.push_back(place);
    }
  }
  return order;
}

bool any_is_whole(const std::vector<SurfaceStyle> &surfaces) {
  return !std::ranges::all_of(surfaces, &SurfaceStyle::clipped);
}

uint mapped_surfaces(const std::vector<SurfaceStyle> &surfaces) {
  uint mapped = surfaces.empty() ? 1 : 0;
  for (std::size_t i = 0; i < surfaces.size(); ++i) mapped |= surfaces[i].mapped ? 1u << i : 0;
  return mapped;
}

LayerParams make_layer_params(const std::vector<SurfaceStyle> &surfaces, const Slices &slices,
                              const VolumeInfo &finest, const View &view, const Camera &camera) {
  LayerParams params{};
  params.num_surfaces = static_cast<uint>(surfaces.size());
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const SurfaceStyle &surface = surfaces[i];
    params.surfaces[i] = {surface.color.r, surface.color.g, surface.color.b, surface.opacity};
    if (!surface.mapped) params.unmapped |= 1u << i;
  }
  Clip planes;
  for (std::size_t i = 0; i < slices.planes.size(); ++i) {
    const Slice &slice = slices.planes[i];
    planes.planes.push_back(slice.plane);
    params.surfaces[surfaces.size() + i].opacity = slice.opacity;
    if (!slice.clipped) params.whole_slices |= 1u << i;
  }
  params.slices = make_clip_params(finest, view, camera, planes);
  params.low = static_cast<float>(slices.low);
  const double scale = 1 / (slices.high - slices.low);
  params.scale = std::isfinite(scale) ? static_cast<float>(scale) : 0.0f;
  std::ranges::copy(slices.colors, params.colors);
  return params;
}

Image8 shade_layers_scalar(const FrameParams &frame, const ShadeParams &params,
                           std::span<const RayColor> colors, std::uint32_t samples) {
  return image_of_pixels(frame, params, samples, [&](uint column, uint row) {
    return layered_pixel(&frame, &params, samples, column, row, colors.data());
  });
}

}  // namespace isowave::core
