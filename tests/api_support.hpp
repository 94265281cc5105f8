#pragma once
// Volumes and requests for tests of what users of the library include, and the errors they get.

#include <gtest/gtest.h>

#include <cmath>
#include <concepts>
#include <isowave/isowave.hpp>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/view/camera.hpp"

namespace isowave::core::test {

/// The one line of the error that a call throws.
template <std::invocable Call>
std::string error_of(const Call &call) {
  try {
    call();
  } catch (const isowave::Error &error) {
    EXPECT_EQ(std::string_view(error.what()).find('\n'), std::string_view::npos);
    return error.what();
  }
  return "no error";
}
inline constexpr std::uint32_t kSphereEdge = 21;  // not a multiple of 4

/// 1 - |p| / sqrt(3) of positions in [-1, 1]^3: spheres.
inline std::vector<float> sphere_voxels() {
  std::vector<float> voxels;
  for (std::uint32_t z = 0; z < kSphereEdge; ++z) {
    for (std::uint32_t y = 0; y < kSphereEdge; ++y) {
      for (std::uint32_t x = 0; x < kSphereEdge; ++x) {
        const auto at = [](std::uint32_t i) { return 2.0 * i / (kSphereEdge - 1) - 1; };
        const double radius = std::sqrt(at(x) * at(x) + at(y) * at(y) + at(z) * at(z));
        voxels.push_back(static_cast<float>(1 - radius / std::sqrt(3.0)));
      }
    }
  }
  return voxels;
}

inline Grid sphere_grid() {
  return {
      .dims = {kSphereEdge, kSphereEdge, kSphereEdge}, .spacing = {1, 2, 1}, .origin = {5, 6, 7}};
}

inline std::shared_ptr<const Volume> sphere(const Compression &compression = {.rate = 16}) {
  return compress(sphere_voxels(), sphere_grid(), compression);
}
inline std::shared_ptr<const Volume> public_volume() {
  return isowave::open_volume(ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz",
                              {.tolerance = 0.5, .levels = 0});
}

inline isowave::FrameRequest public_request(const Camera &camera) {
  return {.camera = {{camera.eye.x, camera.eye.y, camera.eye.z},
                     {camera.at.x, camera.at.y, camera.at.z},
                     {camera.up.x, camera.up.y, camera.up.z},
                     camera.fovy_deg},
          .isovalue = 10,
          .size = {64, 48, 2},
          .want_depth = true,
          .want_normals = true,
          .want_hits = true};
}

}  // namespace isowave::core::test
