#pragma once
// Grids, cameras and random clipping planes for tests of clipped frames.

#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "core/view/camera.hpp"
#include "core/view/clip.hpp"
#include "core/volume/volume.hpp"
#include "reference/random.hpp"
#include "tests/frame_scene.hpp"

namespace isowave::core::test {

struct GridCase {
  std::string name;
  VolumeInfo info;
};

/// Every kind of grid: spacings, origins and directions of volumes, and a brick of one.
inline std::vector<GridCase> clipped_grids() {
  const glm::uvec3 dims(20, 24, 17);
  std::vector<GridCase> grids{{"unit", grid_info(dims)},
                              {"anisotropic", grid_info(dims, {0.3, 2.5, 1.1})},
                              {"tiny", grid_info(dims, glm::dvec3(1e-9, 2e-9, 1.5e-9))},
                              {"huge", grid_info(dims, glm::dvec3(1e9, 2e9, 1.5e9))}};
  GridCase oblique{"oblique", grid_info(dims, {0.7, 1.3, 0.9})};
  oblique.info.origin = {-7, 120, 33};
  oblique.info.direction =
      glm::dmat3(glm::normalize(glm::dvec3(1, 0.2, -0.1)), glm::normalize(glm::dvec3(-0.5, 1, 0.3)),
                 glm::normalize(glm::dvec3(0.2, 0.4, -1)));
  grids.push_back(oblique);
  GridCase brick = oblique;
  brick.name = "brick";
  brick.info.brick = {.first_voxel = {8, 16, 4}, .before = {2, 4, 1}, .behind = {1, 0, 3}};
  grids.push_back(brick);
  return grids;
}

/// A corner of the grid's box, or a place in it, by fractions of its edges.
inline glm::dvec3 place_in(const VolumeInfo &info, const glm::dvec3 &fractions) {
  return info.origin + info.index_to_world() * (fractions * (glm::dvec3(info.dims) - 1.0) +
                                                glm::dvec3(info.brick.first_voxel));
}

/// The length of the grid's longest diagonal, or more.
inline double size_of_grid(const VolumeInfo &info) {
  const glm::dvec3 edges = info.spacing * glm::dvec3(info.dims);
  return edges.x + edges.y + edges.z;
}

/// From outside and from within, in perspective and in parallel projection.
inline std::vector<Camera> clipping_cameras(const VolumeInfo &info) {
  const glm::dvec3 middle = place_in(info, glm::dvec3(0.5));
  const double size = size_of_grid(info);
  std::vector<Camera> cameras{{middle + size * glm::dvec3(0.3, 0.4, 0.7), middle},
                              {place_in(info, {0.3, 0.6, 0.4}), place_in(info, {1, 0.2, 0.1})}};
  for (const std::size_t i : {0u, 1u}) {
    cameras.push_back(cameras[i]);
    cameras.back().parallel_height = 0.7 * size;
  }
  return cameras;
}

/// One to four planes through the grid's box or beside it, with normals of any length.
inline Clip random_clip(const VolumeInfo &info, Random &random) {
  Clip clip;
  for (std::uint32_t i = random.below(4) + 1; i-- > 0;) {
    const auto [x, y, z] = random.direction();
    const glm::dvec3 normal = std::exp(random.in(-5, 5)) * glm::dvec3(x, y, z);
    const auto [u, v, w] = random.in_box({-0.2, -0.2, -0.2}, {1.2, 1.2, 1.2});
    clip.planes.push_back({normal, glm::dot(normal, place_in(info, {u, v, w}))});
  }
  clip.caps = random.below(2) == 0;
  return clip;
}

/// From the camera to a place of its view in the volume or beside it.
inline double random_distance(const VolumeInfo &info, const Camera &camera, Random &random) {
  return random.in(0,
                   glm::length(camera.eye - place_in(info, glm::dvec3(0.5))) + size_of_grid(info));
}

}  // namespace isowave::core::test
