#pragma once
// Frames within an error: chooses how coarse a frame may be drawn, and draws it so.

#include <optional>
#include <utility>
#include <vector>

#include "core/accuracy/choose_detail.hpp"
#include "core/accuracy/image_error.hpp"
#include "core/frame/renderer.hpp"

namespace isowave::core {

/// Draws frames with a largest surface error (choose_detail()): by proof if the other renderer has
/// bounds, by sample in any case; and with a largest image error (choose_for_image()). Other
/// requests are handed on.
class BoundedRenderer : public RendererAround {
 public:
  /// volume  that this process's renderer was made for; must outlive this
  /// rate    of the whole volume [bits per voxel]
  BoundedRenderer(Renderer &inner, const CompressedVolume &volume, double rate)
      : RendererAround(inner), volume_(volume), rate_(rate) {}
  BoundedRenderer(std::unique_ptr<Renderer> inner, const CompressedVolume &volume, double rate)
      : RendererAround(std::move(inner)), volume_(volume), rate_(rate) {}

  Abilities abilities() const override {
    Abilities abilities = inner().abilities();
    abilities.surface_error = abilities.bounds;
    abilities.sampled_error = true;
    abilities.image_error = true;
    return abilities;
  }

  /// Returns  with FrameStats::detail, if the request has a largest error
  FrameStats render(const FrameRequest &request) override {
    if (!request.max_surface_error && !request.max_image_error) return inner().render(request);
    check(request, abilities());
    const DetailChoice choice = choice_for(request);
    FrameStats stats = inner().render(as_chosen(request, choice, abilities().largest));
    stats.detail = choice;
    return stats;
  }

 private:
  /// Requests that share a choice.
  struct SeriesKey {
    std::vector<Camera> series;
    float isovalue;
    std::vector<std::pair<float, bool>> surfaces;  ///< isovalue, clipped
    std::vector<std::pair<ClipPlane, bool>> slices;
    Clip clip;
    ImageSize size;
    std::optional<double> surface_error, image_error;
    Evidence by;
    std::optional<std::pair<Appearance, Normals>> look;  ///< with an image error
    friend bool operator==(const SeriesKey &, const SeriesKey &) = default;
  };

  static std::optional<std::pair<Appearance, Normals>> look_of(const FrameRequest &request) {
    if (!request.max_image_error) return {};
    return std::pair(request.light, request.normals);
  }

  DetailChoice choose(const FrameRequest &request) {
    const FrameRequest plain = without_error(request);
    if (request.max_image_error)
      return choose_for_image(inner(), plain, *request.max_image_error, request.series);
    return choose_detail(inner(), volume_, rate_, plain, *request.max_surface_error, request.by,
                         request.series);
  }

  DetailChoice choice_for(const FrameRequest &request) {
    if (request.series.empty()) return choose(request);
    SeriesKey key{request.series,
                  request.isovalue,
                  {},
                  {},
                  request.clip,
                  size_of(request, abilities()),
                  request.max_surface_error,
                  request.max_image_error,
                  request.by,
                  look_of(request)};
    for (const SurfaceStyle &surface : request.surfaces)
      key.surfaces.emplace_back(surface.isovalue, surface.clipped);
    for (const Slice &slice : request.slices.planes)
      key.slices.emplace_back(slice.plane, slice.clipped);
    if (key == of_series_) {
      choice_.total_ms = 0;
    } else {
      of_series_.reset();
      choice_ = choose(request);
      of_series_ = key;
    }
    return choice_;
  }

  const CompressedVolume &volume_;
  double rate_;
  std::optional<SeriesKey> of_series_{};  ///< that choice_ was made for
  DetailChoice choice_{};
};

}  // namespace isowave::core
