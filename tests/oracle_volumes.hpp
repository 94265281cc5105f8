#pragma once
// Volumes and clipping planes for tests of frames that oracles judge.

#include <filesystem>
#include <glm/gtc/matrix_transform.hpp>
#include <string>
#include <vector>

#include "core/io/open_volume.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "tests/array_reader.hpp"
#include "tests/clip_scene.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"

namespace isowave::core::test {

struct VolumeCase {
  std::string name;
  CompressedVolume volume;  ///< with all levels of detail
  float isovalue;
};

inline VolumeCase of_field(const char *name, const VolumeInfo &info, std::vector<float> voxels,
                           float isovalue) {
  ArrayReader reader(info, std::move(voxels));
  return {name, compress(reader, CompressOptions{.rate = 14, .levels = 0}), isovalue};
}

/// Without loss.
inline VolumeCase of_whole_numbers(const glm::uvec3 &dims, const VoxelFunction &field) {
  ArrayReader reader(grid_info(dims), sample(dims, field));
  return {
      "whole numbers",
      compress(reader, CompressOptions{.precision = choose_precision(reader, {.exact = true}, {})}),
      0};
}

inline VolumeCase gyroid_volume() {
  VolumeInfo info = grid_info({33, 29, 38}, {1, 1.3, 0.8});
  info.origin = {-20, 35, 7};
  return of_field("gyroid", info, sample(info.dims, gyroid_field(12)), 0.2f);
}

inline VolumeCase noise_volume() {
  const glm::uvec3 dims(22, 25, 19);
  return of_field("noise", grid_info(dims), sample(dims, noise_field(7)), 0.5f);
}

inline VolumeCase holes_volume() {
  const glm::uvec3 dims(31, 26, 29);
  const std::vector<float> voxels = sample(dims, gyroid_field(9));
  return of_field("holes", grid_info(dims),
                  with_hole(dims, voxels,
                            [](const glm::uvec3 &at) {
                              return glm::length(glm::dvec3(at) - glm::dvec3(15)) < 6 ||
                                     (at.x + 3 * at.y + 7 * at.z) % 97 == 0;
                            }),
                  0.1f);
}

inline VolumeCase head_volume() {
  const std::filesystem::path path = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz";
  const BlockPrecision exact = choose_precision(*open_volume(path), {.exact = true}, {});
  return {"head", compress(*open_volume(path), CompressOptions{.precision = exact, .levels = 0}),
          60.5f};
}

struct ClipCase {
  std::string name;
  std::vector<ClipPlane> planes;
};

/// Through the volume: one plane, a slab of two voxels between two planes, and a box whose edges
/// are along no axis.
inline std::vector<ClipCase> clips(const VolumeInfo &info) {
  const glm::dvec3 middle = place_in(info, {0.52, 0.47, 0.55});
  const auto plane = [](const glm::dvec3 &normal, const glm::dvec3 &point) -> ClipPlane {
    return {normal, glm::dot(normal, point)};
  };
  const glm::dvec3 slanted(-2, 0.7, -1.1);
  const glm::dmat3 turn(glm::rotate(glm::dmat4(1), 0.7, glm::dvec3(1, 2, 0.5)));
  const double half_edge = 0.12 * size_of_grid(info);
  std::vector<ClipPlane> box;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const glm::dvec3 normal = sign * turn[axis];
      box.push_back(plane(normal, middle - half_edge * normal));
    }
  }
  return {
      {"plane", {plane(slanted, middle)}},
      {"slab", {plane(slanted, middle), plane(-slanted, middle + glm::normalize(slanted) * 2.0)}},
      {"box", box}};
}

}  // namespace isowave::core::test
