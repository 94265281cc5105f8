#pragma once
// Volumes, cameras and comparisons for tests of whole frames.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "core/frame/normals.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "reference/scalar_renderer.hpp"
#include "tests/array_reader.hpp"

namespace isowave::core::test {

/// Value of the voxel at integer coordinates.
using VoxelFunction = std::function<double(const glm::dvec3 &voxel)>;

inline VolumeInfo grid_info(const glm::uvec3 &dims, const glm::dvec3 &spacing = glm::dvec3(1.0)) {
  VolumeInfo info;
  info.dims = dims;
  info.spacing = spacing;
  return info;
}

/// [nz][ny][nx], rounded to float32.
inline std::vector<float> sample(const glm::uvec3 &dims, const VoxelFunction &field) {
  std::vector<float> voxels;
  voxels.reserve(std::size_t{dims.x} * dims.y * dims.z);
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x)
        voxels.push_back(static_cast<float>(field({x, y, z})));
    }
  }
  return voxels;
}

/// A compressed volume and what it decodes to.
struct TestVolume {
  explicit TestVolume(VolumeReader &reader, std::uint32_t rate)
      : compressed(compress(reader, CompressOptions{.rate = rate})),
        voxels(decode_with_libzfp(compressed)) {}
  /// Blocks as long as the goal demands. info.type: an integer type, where it is exact.
  TestVolume(const VolumeInfo &info, const std::vector<float> &source, const ErrorGoal &goal) {
    ArrayReader reader(info, source);
    compressed = compress(reader, CompressOptions{.precision = choose_precision(reader, goal, {})});
    voxels = decode_with_libzfp(compressed);
  }
  TestVolume(const VolumeInfo &info, const std::vector<float> &source, std::uint32_t rate)
      : TestVolume(ArrayReader(info, source), rate) {}
  TestVolume(const glm::uvec3 &dims, const VoxelFunction &field, std::uint32_t rate = 8)
      : TestVolume(grid_info(dims), sample(dims, field), rate) {}

  const VolumeInfo &info() const { return compressed.info; }
  float voxel(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return voxels[x + std::size_t{info().dims.x} * (y + std::size_t{info().dims.y} * z)];
  }

  CompressedVolume compressed;
  std::vector<float> voxels;  ///< by libzfp: what every renderer must see

 private:
  TestVolume(ArrayReader &&reader, std::uint32_t rate) : TestVolume(reader, rate) {}
};

/// As a renderer draws them.
inline std::vector<HitRecord> twin_hits(const FrameParams &frame, std::span<const float> voxels,
                                        Normals normals = Normals::kSmooth,
                                        Solver solver = kDefaultSolver) {
  std::vector<HitRecord> hits = render_scalar(frame, voxels, solver);
  if (normals == Normals::kSmooth) smooth_gradients(frame, voxels, hits);
  return hits;
}
inline std::vector<HitRecord> twin_hits(const TestVolume &volume, const Camera &camera,
                                        ImageSize size, float isovalue,
                                        Normals normals = Normals::kSmooth) {
  return twin_hits(make_frame_params(volume.info(), camera, size, isovalue), volume.voxels,
                   normals);
}

/// A camera at `eye` that looks along `direction`.
inline Camera camera_along(const glm::dvec3 &eye, const glm::dvec3 &direction,
                           const glm::dvec3 &up = {0.0, 1.0, 0.0}, double fovy_deg = 60.0) {
  return {eye, eye + direction, up, fovy_deg};
}

inline std::uint64_t num_hits(const std::vector<HitRecord> &hits) {
  return std::uint64_t(std::count_if(hits.begin(), hits.end(),
                                     [](const HitRecord &hit) { return std::isfinite(hit.t); }));
}

/// Every bit of both buffers must be the same.
inline void expect_same_hits(const std::vector<HitRecord> &got,
                             const std::vector<HitRecord> &expected, std::uint32_t width) {
  ASSERT_EQ(got.size(), expected.size());
  if (std::memcmp(got.data(), expected.data(), got.size() * sizeof(HitRecord)) == 0) return;
  std::size_t num_differing = 0, first = 0;
  for (std::size_t i = got.size(); i-- > 0;) {
    if (std::memcmp(&got[i], &expected[i], sizeof(HitRecord)) == 0) continue;
    ++num_differing;
    first = i;
  }
  const auto text = [](const HitRecord &h) {
    return fmt::format("t {} block {} cell {} at ({:a} {:a} {:a}) gradient ({:a} {:a} {:a})", h.t,
                       h.block_id, h.cell, h.x, h.y, h.z, h.grad_x, h.grad_y, h.grad_z);
  };
  ADD_FAILURE() << num_differing << " of " << got.size() << " pixels differ; the first is ("
                << first % width << "," << first / width << "): " << text(got[first])
                << ", expected " << text(expected[first]);
}

// Fields. Values are of the order of 1 unless they say otherwise.

inline VoxelFunction sphere_field(const glm::uvec3 &dims) {
  const glm::dvec3 centre = 0.5 * glm::dvec3(dims - 1u);
  const double scale = 1.0 / glm::length(centre);
  return [=](const glm::dvec3 &p) { return 1.0 - glm::length(p - centre) * scale; };
}

/// Thin sheets everywhere: many blocks per ray.
inline VoxelFunction gyroid_field(double voxels_per_period) {
  const double k = 6.283185307179586 / voxels_per_period;
  return [k](const glm::dvec3 &p) {
    return std::sin(k * p.x) * std::cos(k * p.y) + std::sin(k * p.y) * std::cos(k * p.z) +
           std::sin(k * p.z) * std::cos(k * p.x);
  };
}

/// Independent voxels in [-1, 1): every cell may hold several sheets.
inline VoxelFunction noise_field(std::uint32_t seed) {
  return [random = std::mt19937(seed)](const glm::dvec3 &) mutable {
    return static_cast<double>(random()) * 0x1p-31 - 1.0;
  };
}

/// Integers 0, 51, .. 255 in large flat steps, as in segmented uint8 volumes.
inline VoxelFunction plateau_field() {
  return [](const glm::dvec3 &p) {
    return 51.0 * std::floor(2.5 + 2.5 * std::sin(0.35 * p.x) * std::cos(0.3 * p.y + 0.25 * p.z));
  };
}

}  // namespace isowave::core::test
