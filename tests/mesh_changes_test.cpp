// core/mesh: closed meshes, their largest parts, fewer triangles.

#include "core/mesh/mesh_changes.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/mesh/host_extractor.hpp"
#include "core/mesh/largest_parts.hpp"
#include "tests/array_reader.hpp"
#include "tests/frame_scene.hpp"
#include "tests/stage_support.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

CompressedVolume volume_of(const VolumeInfo &info, const std::vector<float> &voxels) {
  ArrayReader reader(info, voxels);
  return compress(reader, {.rate = 24});
}

CompressedVolume volume_of(const VolumeInfo &info,
                           const std::function<float(const glm::dvec3 &)> &field) {
  return volume_of(info, test::sample(info.dims, field));
}

Mesh extract(const CompressedVolume &volume, float isovalue, const MeshChanges &changes = {},
             SimplifiedMesh *simplified = nullptr) {
  Mesh mesh;
  const SimplifiedMesh result =
      give_changed(volume, isovalue, VertexPlaces::kApart, changes, mesh,
                   [&](MeshSink &sink) { extract_on_host(volume, isovalue, {}, sink); });
  if (simplified != nullptr) *simplified = result;
  return mesh;
}

/// Each edge belongs to two triangles, which run along it in opposite ways; every vertex has a
/// normal of length 1, and every triangle an area, but for flat parts that were simplified.
void expect_watertight(const Mesh &mesh, bool is_simplified = false) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const Triangle &triangle : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      ASSERT_LT(triangle[i], mesh.vertices.size());
      edges.emplace_back(triangle[i], triangle[(i + 1) % 3]);
    }
    const glm::dvec3 &at = mesh.vertices[triangle[0]];
    const double area =
        glm::length(glm::cross(mesh.vertices[triangle[1]] - at, mesh.vertices[triangle[2]] - at));
    EXPECT_TRUE(area > 0 || is_simplified);
  }
  std::ranges::sort(edges);
  ASSERT_EQ(std::ranges::adjacent_find(edges), edges.end());
  for (const auto &[from, to] : edges)
    ASSERT_TRUE(std::ranges::binary_search(edges, std::pair(to, from))) << from << " " << to;
  ASSERT_EQ(mesh.normals.size(), mesh.vertices.size());
  for (const glm::vec3 &normal : mesh.normals) EXPECT_NEAR(glm::length(normal), 1, 1e-5);
}

/// The volume within a closed mesh; above 0 if triangles are counter-clockwise from outside.
double enclosed(const Mesh &mesh) {
  double sum = 0;
  for (const auto &[a, b, c] : mesh.triangles)
    sum += glm::dot(mesh.vertices[a], glm::cross(mesh.vertices[b], mesh.vertices[c]));
  return sum / 6;
}

VolumeInfo slanted(const glm::uvec3 &dims) {
  VolumeInfo info = test::grid_info(dims);
  info.spacing = {0.5, 2, 1.25};
  info.origin = {-3, 40, 7};
  return info;
}

TEST(ClosedMesh, NoiseOfAnySizeIsWatertight) {
  for (uint seed = 0; seed < 12; ++seed) {
    Random random(seed);
    const glm::uvec3 dims(2 + random() % 13, 2 + random() % 13, 2 + random() % 13);
    SCOPED_TRACE(fmt::format("seed {}, {}x{}x{}", seed, dims.x, dims.y, dims.z));
    const CompressedVolume volume = volume_of(slanted(dims), random_voxels(dims, -1, 1, seed));
    const Mesh mesh = extract(volume, 0.2f, {.closed = true});
    expect_watertight(mesh);
    EXPECT_GT(enclosed(mesh), 0);
    const Mesh open = extract(volume, 0.2f);
    ASSERT_LT(open.triangles.size(), mesh.triangles.size());
    EXPECT_TRUE(
        std::ranges::equal(open.triangles, std::span(mesh.triangles).first(open.triangles.size())));
    EXPECT_EQ(enclosed(extract(volume, -2, {.closed = true})) > 0, true);
  }
}

/// What lies behind a plane, and all of the volume: enclosed volumes that are known. Axes of either
/// hand.
TEST(ClosedMesh, EnclosesWhatIsInside) {
  for (const double side : {1.0, -1.0}) {
    VolumeInfo info = slanted({9, 6, 7});
    info.direction[2] *= side;
    const double box = 8 * 0.5 * 5 * 2 * 6 * 1.25;
    const CompressedVolume volume =
        volume_of(info, [](const glm::dvec3 &at) { return float(at.x + 0.25 * at.y - 3.125); });
    const Mesh all = extract(volume, -100, {.closed = true});
    expect_watertight(all);
    EXPECT_NEAR(enclosed(all), box, 1e-3);
    EXPECT_EQ(all.triangles.size(), 4u * (8 * 5 + 8 * 6 + 5 * 6));
    // x + y/4 > 3.125: x goes from 3.125 to 1.875 as y goes from 0 to 5, of 8.
    const Mesh part = extract(volume, 0, {.closed = true});
    expect_watertight(part);
    EXPECT_NEAR(enclosed(part) / box, 1 - 2.5 / 8, 2e-3);
    EXPECT_EQ(extract(volume, 100, {.closed = true}).triangles.size(), 0u);
  }
}

/// Two balls, and a small one.
CompressedVolume three_balls() {
  return volume_of(slanted({40, 20, 20}), [](const glm::dvec3 &at) {
    const auto ball = [&](double x, double radius) {
      return radius - glm::length(at - glm::dvec3(x, 9, 9));
    };
    return float(std::max({ball(9, 5), ball(24, 6.5), ball(36, 1.5)}));
  });
}

TEST(LargestParts, StayAsTheyWere) {
  const CompressedVolume volume = three_balls();
  const Mesh all = extract(volume, 0);
  const double three = enclosed(all), two = enclosed(extract(volume, 0, {.largest = 2})),
               one = enclosed(extract(volume, 0, {.largest = 1}));
  EXPECT_LT(two, 0.995 * three);
  EXPECT_NEAR(one / (two - one), std::pow(6.5 / 5, 3), 0.05) << "the larger ball stays";
  const Mesh largest = extract(volume, 0, {.closed = true, .largest = 2});
  expect_watertight(largest);
  for (const MeshChanges &more : {MeshChanges{.largest = 3}, MeshChanges{.largest = 99}}) {
    const Mesh same = extract(volume, 0, more);
    EXPECT_EQ(same.triangles, all.triangles);
    EXPECT_EQ(same.vertices.size(), all.vertices.size());
  }
  // No other vertices than before, in their order.
  const Mesh first = extract(volume, 0, {.largest = 1});
  std::set<std::array<double, 3>> places;
  for (const glm::dvec3 &v : all.vertices) places.insert({v.x, v.y, v.z});
  for (const glm::dvec3 &v : first.vertices) EXPECT_TRUE(places.contains({v.x, v.y, v.z}));
}

TEST(SimplifiedMesh, StaysClosedAndNear) {
  if (!can_simplify()) GTEST_SKIP() << "built without meshoptimizer";
  const CompressedVolume volume = volume_of(test::grid_info({40, 40, 20}), [](const auto &at) {
    return float(12.0 - glm::length(at - glm::dvec3(19.5, 19.5, 12)));  // cut by the upper face
  });
  const Mesh all = extract(volume, 0, {.closed = true});
  for (const double share : {0.5, 0.1}) {
    SimplifiedMesh simplified;
    const Mesh mesh = extract(volume, 0, {.closed = true, .simplify = share}, &simplified);
    expect_watertight(mesh, true);
    EXPECT_EQ(simplified.before, all.triangles.size());
    EXPECT_EQ(simplified.after, mesh.triangles.size());
    EXPECT_NEAR(double(simplified.after) / double(simplified.before), share, 0.02);
    EXPECT_GT(simplified.error, 0);
    EXPECT_LT(simplified.error, 1);
    EXPECT_NEAR(enclosed(mesh) / enclosed(all), 1, 0.03);
  }
  // Where a surface is rough, no edge gets four triangles.
  for (uint seed = 0; seed < 4; ++seed) {
    const CompressedVolume rough =
        volume_of(test::grid_info({19, 17, 18}), random_voxels({19, 17, 18}, -1, 1, seed));
    expect_watertight(extract(rough, 0, {.closed = true, .simplify = 0.05 * (1 + seed)}), true);
  }
  // Without caps, the rim stays.
  const auto rim = [](const Mesh &mesh) {
    return std::ranges::count_if(mesh.vertices, [](const auto &v) { return v.z == 19; });
  };
  EXPECT_EQ(rim(extract(volume, 0, {.simplify = 0.2})), rim(extract(volume, 0)));
}

TEST(MeshChanges, WhatCannotBeDoneIsRefused) {
  const auto refuse = [](const CompressedVolume &volume, const MeshChanges &changes,
                         VertexPlaces places, const char *why) {
    Mesh mesh;
    EXPECT_THAT([&] { give_changed(volume, 0, places, changes, mesh, [](MeshSink &) { FAIL(); }); },
                ThrowsMessage<Error>(HasSubstr(why)));
  };
  const CompressedVolume volume = three_balls();
  refuse(volume, {.closed = true}, VertexPlaces::kExact, "leave out exact vertices");
  for (const double share : {0.0, -1.0, 1.5, std::nan("")})
    refuse(volume, {.simplify = share}, VertexPlaces::kApart, "give a share above 0, up to 1");
  std::vector<float> voxels = random_voxels({9, 8, 7}, -1, 1, 3);
  voxels[100] = std::numeric_limits<float>::quiet_NaN();
  refuse(volume_of(test::grid_info({9, 8, 7}), voxels), {.closed = true}, VertexPlaces::kApart,
         "voxels without data");
}

}  // namespace
}  // namespace isowave::core
