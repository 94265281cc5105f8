#include "bench/frame_measure.hpp"

#include <chrono>
#include <cstring>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/paper/resident.hpp"

namespace isowave::core::bench {

double hits_ms(const TimedFrame &frame) {
  return frame.total_ms;
}

double arrays_ms(const TimedFrame &frame) {
  return frame.arrays_ms;
}

std::vector<double> all_times(const std::vector<ViewTimes> &views, FramesOfView kind,
                              double (*ms)(const TimedFrame &)) {
  std::vector<double> times;
  for (const ViewTimes &view : views) {
    for (const TimedFrame &frame : view.*kind) times.push_back(ms(frame));
  }
  return times;
}

Camera turned(const Camera &camera) {
  return core::turned(camera, 1);
}

std::vector<ViewTimes> measure_views(DeviceRenderer &renderer, const std::vector<Camera> &cameras,
                                     const FrameRequest &request, const WantedArrays &wanted,
                                     std::uint32_t rounds) {
  FrameArrays arrays;  // a user has the last frame's until the next is there
  const auto draw = [&](const Camera &camera) {
    const auto begin = std::chrono::steady_clock::now();
    TimedFrame frame{renderer.render(seen_from(camera, request))};
    Appearance shown = request.light;
    if (!request.surfaces.empty()) shown.color_by_field.reset();  // their colours are blended
    arrays = renderer.fetch(wanted, shown);
    frame.arrays_ms = ms_since(begin);
    return frame;
  };
  for (int frame = 0; frame < 3; ++frame) draw(cameras.front());  // makes the arrays' memory
  std::vector<ViewTimes> views(cameras.size());
  for (std::uint32_t round = 0; round < rounds; ++round) {
    for (std::size_t view = 0; view < cameras.size(); ++view) {
      renderer.clear_cache();
      views[view].cold.push_back(draw(cameras[view]));
      views[view].warm.push_back(draw(cameras[view]));
      views[view].next.push_back(draw(turned(cameras[view])));
    }
  }
  return views;
}

double num_passes(const FrameStats &frame) {
  return static_cast<double>(frame.passes.size());
}

std::vector<double> FloorTimes::all() const {
  std::vector<double> times;
  for (const std::vector<double> &view : ms) times.insert(times.end(), view.begin(), view.end());
  return times;
}

FloorTimes measure_floor(const ocl::DeviceInfo &device_info, const CompressedVolume &volume,
                         const RendererOptions &options, const std::vector<Camera> &cameras,
                         float isovalue, std::uint32_t rounds,
                         const std::vector<HitRecord> &first_hits) {
  ocl::Device device(device_info);
  FloorTimes times;
  if (const auto obstacle = Resident::obstacle(device, volume, options.size)) {
    times.why_not = *obstacle;
    return times;
  }
  Resident resident(device, volume, options.size, options.solver);
  resident.render(cameras.front(), isovalue);
  if (!same_hits(resident.hits(), first_hits)) {
    throw Error(
        "the resident floor draws another picture than the renderer: its time means nothing");
  }
  times.ms.resize(cameras.size());
  for (std::uint32_t round = 0; round < rounds; ++round) {
    for (std::size_t view = 0; view < cameras.size(); ++view) {
      times.ms[view].push_back(resident.render(cameras[view], isovalue));
    }
  }
  return times;
}

bool same_hits(const std::vector<HitRecord> &a, const std::vector<HitRecord> &b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(HitRecord)) == 0;
}

}  // namespace isowave::core::bench
