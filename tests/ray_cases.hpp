#pragma once
// Cameras that are hard on a grid walk.

#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "kernels_cl/portable/grid_dda.h"

namespace isowave::core {

struct CameraCase {
  std::string name;
  Camera camera;
};

/// Spacing 1, origin 0: index space is world space. With an odd image size the middle row and
/// column have direction components that are exactly 0 where the camera looks along an axis.
inline std::vector<CameraCase> camera_cases(const glm::uvec3 &dims) {
  const glm::dvec3 last = glm::dvec3(dims) - 1.0, centre = 0.5 * last;
  const glm::dvec3 middle_voxel = glm::floor(centre), y(0, 1, 0), z(0, 0, 1);
  return {
      {"outside", {{-0.7 * last.x, 1.3 * last.y, 1.9 * last.z}, centre, y, 40}},
      {"inside", {centre + glm::dvec3(0.3, -0.2, 0.6), {last.x + 7, 3.3, -4.1}, y, 100}},
      {"inside, wide", {centre, centre + glm::dvec3(0.1, 0.2, -1), y, 150}},
      {"along +x", {{-20, middle_voxel.y, middle_voxel.z}, middle_voxel, y, 30}},
      {"along -x, between voxels",
       {{last.x + 20, middle_voxel.y + 0.5, middle_voxel.z + 0.5}, middle_voxel + 0.5, z, 30}},
      {"along -y on a voxel", {{middle_voxel.x, last.y + 9, middle_voxel.z}, middle_voxel, z, 50}},
      {"along +z on a block edge", {{4, 4, -15}, {4, 4, 0}, y, 60}},
      {"along +z in the first face", {{0, 0, -15}, {0, 0, 0}, y, 30}},
      {"along -z in the last face", {{last.x, last.y, last.z + 10}, last, y, 30}},
      {"diagonal through voxels", {glm::dvec3(-8), glm::dvec3(8), y, 35}},
      {"back along the diagonal", {last + 4.0, last, y, 45}},
      {"diagonal of a face", {{-6, -6, middle_voxel.z}, {0, 0, middle_voxel.z}, z, 25}},
      {"eye on a voxel", {middle_voxel, middle_voxel + glm::dvec3(1, 0, 0), y, 120}},
      {"eye on a block's corner", {{4, 4, 4}, {4, 4, 9}, y, 110}},
      {"eye on the first voxel", {{0, 0, 0}, last, y, 80}},
      {"eye on the last voxel, looking out", {last, last + glm::dvec3(1, 2, 3), y, 80}},
      {"eye on a plane", {{middle_voxel.x, centre.y + 0.3, -11}, centre, y, 50}},
      {"3000 voxels away", {{1700, 1600, 1900}, centre, y, 1.2}},
      {"3000 voxels away, along an axis",
       {{3000, middle_voxel.y, middle_voxel.z}, middle_voxel, y, 0.9}},
      {"a million voxels away", {{6.1e5, 5.3e5, 7.2e5}, centre, y, 0.002}},
      {"looking away", {{-5, -5, -5}, {-50, -60, -40}, y, 60}},
      {"beside the volume", {{-30, centre.y, -3}, {30, centre.y, -3}, y, 3}},
      {"parallel", {{-0.7 * last.x, 1.3 * last.y, 1.9 * last.z}, centre, y, 60, last.y + 9}},
      {"parallel, from within", {centre, {last.x + 7, 3.3, -4.1}, y, 60, last.y}},
      {"parallel, along +z on a block edge", {{4, 4, -15}, {4, 4, 0}, y, 60, 17}},
      {"parallel, along -x, between voxels",
       {{last.x + 20, middle_voxel.y + 0.5, middle_voxel.z + 0.5}, middle_voxel + 0.5, z, 60, 34}},
      {"parallel, 3000 voxels away", {{1700, 1600, 1900}, centre, y, 60, 2 * last.x}},
  };
}

/// Frame of a camera case. Odd image size; isovalue_index and max_spec_count are the caller's.
inline FrameParams case_frame(const glm::uvec3 &dims, const CameraCase &c,
                              ImageSize size = {23, 17}, float isovalue = 0) {
  VolumeInfo info;
  info.dims = dims;
  return make_frame_params(info, c.camera, size, isovalue);
}

/// The blocks that a pixel's ray enters, found by walking through every cell.
inline std::vector<uint> blocks_of_ray(const FrameParams &frame, uint pixel) {
  const Ray ray = make_ray(&frame, pixel);
  const LastPlanes last = last_planes(&frame);
  std::vector<uint> blocks;
  RayEvent enter;
  if (!domain_entry(&ray, last, &enter)) return blocks;
  GridWalk cell = walk_from(&ray, locate(ray.x, 0, enter, 1, 0, last.x - 1),
                            locate(ray.y, 1, enter, 1, 0, last.y - 1),
                            locate(ray.z, 2, enter, 1, 0, last.z - 1), 1, last);
  while (cell.x >= 0 && cell.x < last.x && cell.y >= 0 && cell.y < last.y && cell.z >= 0 &&
         cell.z < last.z) {
    const uint block =
        uint(cell.x / 4) +
        frame.grid.blocks_x * (uint(cell.y / 4) + frame.grid.blocks_y * uint(cell.z / 4));
    if (blocks.empty() || blocks.back() != block) blocks.push_back(block);
    walk_step(&cell, &ray, walk_exit(&cell, &ray), 1, last);
  }
  return blocks;
}

inline std::vector<Camera> hard_cameras(const glm::uvec3 &dims) {
  std::vector<Camera> cameras;
  for (const CameraCase &c : camera_cases(dims)) cameras.push_back(c.camera);
  return cameras;
}

}  // namespace isowave::core
