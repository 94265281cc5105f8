#pragma once
// Frames within an error: chooses how coarse a frame may be drawn, and draws it so.

#include "core/accuracy/choose_detail.hpp"
#include "core/frame/renderer.hpp"

namespace isowave::core {

/// Draws frames with a largest surface error (choose_detail()): by proof if the other renderer has
/// bounds, by sample in any case. Other requests are handed on.
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
    return abilities;
  }

  /// Returns  with FrameStats::detail, if the request has a largest error
  FrameStats render(const FrameRequest &request) override {
    if (!request.max_surface_error) return inner().render(request);
    check(request, abilities());
    FrameRequest chosen = without_error(request);
    const DetailChoice choice = choice_for(request, chosen);
    FrameStats stats = inner().render(with_detail(std::move(chosen), choice.detail));
    stats.detail = choice;
    return stats;
  }

 private:
  /// Requests that share a choice.
  struct SeriesKey {
    std::vector<Camera> series;
    float isovalue;
    ImageSize size;
    double error;
    Evidence by;
    friend bool operator==(const SeriesKey &, const SeriesKey &) = default;
  };

  /// chosen: the request without an error
  DetailChoice choice_for(const FrameRequest &request, const FrameRequest &chosen) {
    const double error = *request.max_surface_error;
    const auto choose = [&] {
      return choose_detail(inner(), volume_, rate_, chosen, error, request.by, request.series);
    };
    if (request.series.empty()) return choose();
    const SeriesKey key{request.series, request.isovalue, size_of(request, abilities()), error,
                        request.by};
    if (key == of_series_) {
      choice_.total_ms = 0;
    } else {
      of_series_.reset();
      choice_ = choose();
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
