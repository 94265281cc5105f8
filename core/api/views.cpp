#include "isowave/views.hpp"

#include <algorithm>
#include <iterator>

#include "core/api/convert.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/base/error.hpp"
#include "core/frame/surface_camera.hpp"
#include "core/io/atomic_file.hpp"
#include "core/view/camera.hpp"

namespace isowave {

using core::guarded;

namespace {

/// Throws  core::Error: a grid without a box; a size without pixels
void check_view(const core::VolumeInfo &info, ImageSize size) {
  core::check_volume_info(info, "the grid");
  core::check_image_size(core_size(size));
}

}  // namespace

Vector3 up_of(const Grid &grid) {
  return from_glm(core::orientation_of(core_grid(grid)).up);
}

Camera box_camera(const Grid &grid, const Viewpoint &from, ImageSize size) {
  return box_turntable(grid, 1, from, size).front();
}

std::vector<Camera> box_turntable(const Grid &grid, std::uint32_t num_views, const Viewpoint &from,
                                  ImageSize size) {
  return guarded("looking at a volume", [&] {
    const core::VolumeInfo info = core_grid(grid);
    check_view(info, size);
    const core::Viewpoint viewpoint = core_viewpoint(from, num_views);
    return public_turntable(core::surface_camera(info, {}, core_size(size), viewpoint), info,
                            viewpoint);
  });
}

Camera fitted(const Camera &camera, const Grid &grid, ImageSize size) {
  return guarded("looking at a volume", [&] {
    const core::VolumeInfo info = core_grid(grid);
    check_view(info, size);
    return public_camera(core::fitted(core_camera(camera), info, double(size.width) / size.height));
  });
}

Camera turned(const Camera &camera, double degrees, const std::optional<Vector3> &up) {
  return guarded("turning a camera", [&] {
    core::check_camera(core_camera(camera), "the camera");
    const glm::dvec3 axis = up ? core::orientation_of({}, to_glm(*up)).up : to_glm(camera.up);
    return public_camera(core::turned(core_camera(camera), degrees, axis));
  });
}

Camera zoomed(const Camera &camera, double zoom) {
  return guarded("zooming", [&] { return public_camera(core::zoomed(core_camera(camera), zoom)); });
}

void save_cameras(const std::vector<Camera> &cameras, const std::filesystem::path &path,
                  ImageSize size) {
  guarded("saving cameras", [&] {
    if (cameras.empty()) throw core::Error("{}: no cameras", path.string());
    std::vector<core::Camera> of_core;
    std::ranges::transform(cameras, std::back_inserter(of_core), core_camera);
    for (const core::Camera &camera : of_core) core::check_camera(camera, path.string());
    core::AtomicFile file(path);
    file.write(core::camera_file_text(of_core, size.width, size.height));
    file.commit();
  });
}

std::vector<Camera> read_cameras(const std::filesystem::path &path) {
  return guarded("reading cameras", [&] {
    std::vector<Camera> cameras;
    std::ranges::transform(core::read_camera_file(path).cameras, std::back_inserter(cameras),
                           public_camera);
    return cameras;
  });
}

}  // namespace isowave
