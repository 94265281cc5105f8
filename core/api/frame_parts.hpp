#pragma once
// Private to core/api: requests and frames of its users and of core, whichever renderer draws.

#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "isowave/frame.hpp"

namespace isowave {

core::ImageSize core_size(const ImageSize &size);
core::Camera core_camera(const Camera &camera);
Camera public_camera(const core::Camera &camera);
core::Viewpoint core_viewpoint(const Viewpoint &from, std::uint32_t num_views);
/// The views of a turntable.
///
/// first  as core_viewpoint() had it made
std::vector<Camera> public_turntable(const core::Camera &first, const core::VolumeInfo &info,
                                     const core::Viewpoint &from);
core::Clip core_clip(const std::vector<ClipPlane> &planes, bool caps);
/// A surface without its isovalue.
///
/// Throws  core::Error: what is no label
core::SurfaceStyle core_style(const Surface &surface);
/// The labels of a surface as `isowave render --labels` has them: 5+7-9.
std::string text_of_labels(const Surface &surface);
/// The labels of all surfaces.
///
/// Throws  core::Error: what is no label
std::vector<std::uint16_t> labels_of(const std::vector<Surface> &surfaces);
/// value_range  of the volume; infinite: not known
/// Throws       core::Error: the range is needed, and not known; there is no such colour map
core::Slices core_slices(const std::vector<Slice> &slices, const Appearance &appearance,
                         const std::array<float, 2> &value_range);
/// The colours of the map of that name, or of a table [256] instead.
///
/// Throws  core::Error: there is no such map, or the table is none
core::ColorTable color_table_of(const std::string &map,
                                const std::vector<std::array<float, 3>> &colors);
/// whole   of the whole volume
/// Throws  core::Error: a colour map that there is not, or that cannot be shown
core::Appearance core_appearance(const Appearance &appearance, const core::VolumeInfo &whole);
/// That of a request, whose camera says along which axis the depth is.
core::Appearance core_appearance(const FrameRequest &request, const core::VolumeInfo &whole);
/// The request as core has it, without on_pass.
core::FrameRequest core_request(const FrameRequest &request, const core::CompressedVolume &volume);

/// Throws  core::Error: the request wants an array that a renderer of these abilities cannot give
void check_wanted(const FrameRequest &request, const core::Abilities &abilities);
/// Whether a renderer of these abilities draws the request.
bool can_draw(const FrameRequest &request, const core::Abilities &abilities,
              const core::CompressedVolume &volume);
/// A text of the fields in which the processes of a team must agree.
std::string text_of(const FrameRequest &request);

/// A Progress that any number of threads may look at: pictures take turns, and between two calls of
/// on_pass, while the frame is drawn, there are none.
class ProgressInTurns : public Progress {
 public:
  /// Calls on_pass() with this. Waits for other threads' pictures before it returns.
  bool show(const core::PassStats &pass, const std::function<bool(const Progress &)> &on_pass);

  std::uint32_t passes() const final;
  double completed_percent() const final;
  ImageSize size() const final;
  Array<std::uint8_t> picture() const final;

 private:
  virtual ImageSize current_size() const = 0;
  virtual Array<std::uint8_t> draw_picture() const = 0;

  std::unique_lock<std::mutex> turn() const;
  void set_open(bool is_open);

  mutable std::mutex mutex_;
  bool is_open_ = false;
  std::uint32_t passes_ = 0;
  double completed_percent_ = 0;
};

DetailChoice public_choice(const core::DetailChoice &choice);

/// Fills in the frame's size and statistics.
void describe_frame(const FrameRequest &request, const core::FrameStats &stats, Frame &frame);

std::vector<core::WorldRay> world_rays(std::span<const Ray> rays);

/// One row: what rays of any origin hit.
///
/// Throws  core::Error: a hit is too many lengths of its direction away
Frame frame_of_rays(const std::vector<core::HitRecord> &hits, const core::CompressedVolume &volume,
                    bool with_levels);

/// The same values, in the same memory.
template <class T>
Array<T> public_array(core::HostArray<T> &&values) {
  const std::size_t size = values.size();
  T *const data = values.data();
  return {std::shared_ptr<T>(values.release(), data), size};
}
/// Moves arrays that were fetched into the frame.
void move_arrays(core::FrameArrays &&arrays, Frame &frame);

/// memory: of the result
Array<Hit> public_hits(std::span<const core::HitRecord> records,
                       const core::CompressedVolume &volume, bool with_levels,
                       core::HostMemory &memory);

}  // namespace isowave
