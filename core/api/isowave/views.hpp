#pragma once
// Views of a volume's box, which depend on nothing but its grid: all steps of a series, and all
// compressions of a volume, have the same.

#include <cstdint>
#include <filesystem>
#include <vector>

#include "isowave/camera.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// The direction of the world that is up: +z, superior, if the grid's world is a patient's
/// (Grid::is_anatomical), else +y. In front are -y, anterior, and +z.
Vector3 up_of(const Grid &grid);

/// A view in which the volume's box fills a picture of that size. `isowave render` takes it by
/// default.
///
/// Throws  Error: `up` has no direction; zoom is out of range
Camera box_camera(const Grid &grid, const Viewpoint &from = {}, ImageSize size = {});
/// Views once around the box, about `up`, from so far that it is in all pictures. Each is turned on
/// by 360 / num_views degrees, anticlockwise from above.
///
/// Throws  Error: as box_camera(); num_views is not 1 to 100,000
std::vector<Camera> box_turntable(const Grid &grid, std::uint32_t num_views,
                                  const Viewpoint &from = {}, ImageSize size = {});

/// The camera, moved without turning, until the volume's box fills a picture of that size.
Camera fitted(const Camera &camera, const Grid &grid, ImageSize size = {});
/// The camera, moved around what it looks at.
///
/// degrees  anticlockwise from above
/// up       the axis; none: the camera's own
Camera turned(const Camera &camera, double degrees, const std::optional<Vector3> &up = {});
/// The camera, whose picture is magnified about its middle.
///
/// Throws  Error: zoom is not 0.01 to 1000
Camera zoomed(const Camera &camera, double zoom);

/// Writes a camera file, for `--cameras` of the program. It names no volume, so it is for all.
///
/// size    of the pictures
/// Throws  Error: no cameras, or with different angles; the file cannot be written
void save_cameras(const std::vector<Camera> &cameras, const std::filesystem::path &path,
                  ImageSize size = {});
/// Reads a camera file.
std::vector<Camera> read_cameras(const std::filesystem::path &path);

}  // namespace isowave
