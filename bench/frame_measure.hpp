#pragma once
// Whole frames of one renderer, and of the floor, against the clock. Without profiling.

#include <optional>
#include <string>
#include <vector>

#include "core/render/device_renderer.hpp"

namespace isowave::core::bench {

/// What a frame has taken. FrameStats::total_ms is the time until its hits are on the device.
struct TimedFrame : FrameStats {
  double arrays_ms = 0;  ///< until the wanted arrays are in the host's memory, with that
};

/// One view, drawn once per round.
struct ViewTimes {
  std::vector<TimedFrame> cold;  ///< nothing decoded before
  std::vector<TimedFrame> warm;  ///< the same view again
  std::vector<TimedFrame> next;  ///< then one degree further around the volume
};
using FramesOfView = std::vector<TimedFrame> ViewTimes::*;

/// The kinds of frames by name.
inline constexpr std::pair<const char *, FramesOfView> kKinds[] = {
    {"cold", &ViewTimes::cold}, {"warm", &ViewTimes::warm}, {"next", &ViewTimes::next}};

double hits_ms(const TimedFrame &frame);
double arrays_ms(const TimedFrame &frame);
/// ms of all frames of one kind.
std::vector<double> all_times(const std::vector<ViewTimes> &views, FramesOfView kind,
                              double (*ms)(const TimedFrame &));

/// The camera one degree further around the vertical through the point it looks at.
Camera turned(const Camera &camera);

/// request: its camera does not matter. The renderer must have drawn a frame of the isovalue
/// before: a driver may compile a kernel when it first runs, and an isovalue's first frame finds
/// its blocks.
std::vector<ViewTimes> measure_views(DeviceRenderer &renderer, const std::vector<Camera> &cameras,
                                     const FrameRequest &request, const WantedArrays &wanted,
                                     std::uint32_t rounds);

double num_passes(const FrameStats &frame);

/// Whole volume decoded, one kernel (core/paper/resident.hpp).
struct FloorTimes {
  std::vector<std::vector<double>> ms;  ///< [views][rounds]; empty if not measured
  std::string why_not;                  ///< one line, if not measured

  std::vector<double> all() const;
};

/// On a device of its own: nothing else should be on it. first_hits: the picture from
/// cameras.front(), which the floor must draw too; throws Error if it differs.
FloorTimes measure_floor(const ocl::DeviceInfo &device_info, const CompressedVolume &volume,
                         const RendererOptions &options, const std::vector<Camera> &cameras,
                         float isovalue, std::uint32_t rounds,
                         const std::vector<HitRecord> &first_hits);

/// Every bit.
bool same_hits(const std::vector<HitRecord> &a, const std::vector<HitRecord> &b);

}  // namespace isowave::core::bench
