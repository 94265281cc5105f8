#pragma once
// The sides that peer_bench compares: one process each, so that the memory of each is its own.

#include <chrono>
#include <cstdint>
#include <ctime>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/frame/normals.hpp"
#include "core/io/png.hpp"
#include "core/render/pipeline.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core::bench {

/// Name -> value: ms; ms of processor time, of all threads, by names that end in _cpu_ms; counts by
/// names that end in _count. A machine that others use as well stretches the one and hardly the
/// other.
using Measured = std::map<std::string, double>;

/// Takes the time of one thing after another.
class Stopwatch {
 public:
  /// Notes NAME_ms and NAME_cpu_ms, and starts again.
  void lap(Measured &measured, const std::string &name) {
    const auto wall = std::chrono::steady_clock::now();
    const double cpu_ms = processor_ms();
    measured[name + "_ms"] = std::chrono::duration<double, std::milli>(wall - wall_).count();
    measured[name + "_cpu_ms"] = cpu_ms - cpu_ms_;
    wall_ = std::chrono::steady_clock::now();
    cpu_ms_ = processor_ms();
  }

 private:
  static double processor_ms() {
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return 1e3 * double(time.tv_sec) + 1e-6 * double(time.tv_nsec);
  }

  std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
  double cpu_ms_ = processor_ms();
};

class PeerSide {
 public:
  virtual ~PeerSide() = default;
  /// Draws a view at an isovalue for which nothing is extracted or decoded, and further frames of
  /// it. new_ms: from the isovalue to the picture in the host's memory; warm_ms: the same view
  /// again; next_ms: then one degree further; hit_count; and the side's own.
  ///
  /// picture  the view's, RGB; null: it is not wanted
  virtual Measured draw(float isovalue, const Camera &camera, Image8 *picture) = 0;
  /// Draws views of an isovalue one after the other. Returns the ms of each: of the first one from
  /// the isovalue, with nothing decoded, to the picture.
  virtual std::vector<double> draw_views(float isovalue, const std::vector<Camera> &cameras) = 0;
};

/// What all sides draw.
struct PeerFrames {
  ImageSize size;
  /// kCell: our frames have the normals of cells; a mesh has those of its triangles, lit from the
  /// eye. kSmooth: all are shaded as our pictures; a mesh interpolates VTK's normals of vertices.
  Normals normals = Normals::kCell;
};

/// Triangles of VTK's Flying Edges, Embree's tree over them, and its rays: threads on all
/// processors. new_ms = extract_ms + build_ms + trace_ms. medium_quality: of Embree's tree, instead
/// of low.
std::unique_ptr<PeerSide> make_mesh_side(CompressedVolume volume, const PeerFrames &frames,
                                         bool medium_quality);

/// Our renderer on the device that is chosen. new_ms: with nothing decoded; new_kept_ms: with the
/// cache as the isovalue before left it.
std::unique_ptr<PeerSide> make_renderer_side(CompressedVolume volume, const PeerFrames &frames,
                                             PipelinePtr pipeline, const std::string &device);

/// Our renderer without OpenCL, on all processors: new_ms and new_kept_ms as above. open_ms: the
/// value ranges of the volume's blocks, once.
std::unique_ptr<PeerSide> make_host_side(CompressedVolume volume, const PeerFrames &frames);

}  // namespace isowave::core::bench
