// core/extract/extractor: meshes of compressed volumes have the bits of the scalar twin, whatever
// the cache, the budget and the place of the volume; they are closed, and lie in the world.

#include "core/extract/extractor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/open_volume.hpp"
#include "core/sources/load_volume.hpp"
#include "reference/mesh_twin.hpp"
#include "tests/mesh_checks.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

CompressedVolume noise_volume(const glm::uvec3 &dims, uint seed) {
  return compress_with_libzfp(random_voxels(dims, -1, 1, seed), dims, 512);
}

/// A sphere around the middle, of several blocks' radius; 0 on its surface.
CompressedVolume sphere_volume(const glm::uvec3 &dims) {
  std::vector<float> voxels;
  const glm::vec3 middle = 0.5f * glm::vec3(dims - 1u);
  for (uint i = 0; i < dims.x * dims.y * dims.z; ++i)
    voxels.push_back(
        0.4f * static_cast<float>(dims.x) -
        glm::distance(middle, glm::vec3(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y)));
  return compress_with_libzfp(voxels, dims, 1024);
}

CompressedVolume real_volume(const char *file) {
  const std::string path = std::string(ISOWAVE_TEST_DATA) + "/" + file;
  Storage storage;
  storage.exact = true;
  return compress_volume([&] { return open_volume(path); }, path, storage);
}

class ExtractorOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  Mesh extract(const CompressedVolume &volume, float isovalue, const ExtractorOptions &options = {},
               ExtractStats *stats = nullptr) {
    Extractor extractor(device_, volume, options);
    Mesh mesh;
    const ExtractStats got = extractor.extract(isovalue, mesh);
    EXPECT_EQ(got.size.num_vertices, mesh.vertices.size());
    EXPECT_EQ(got.size.num_triangles, mesh.triangles.size());
    if (stats != nullptr) *stats = got;
    return mesh;
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, ExtractorOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(ExtractorOnDevice, SmallVolumeEqualsTheTwin) {
  const CompressedVolume volume = noise_volume({9, 6, 7}, 1);
  const Mesh mesh = extract(volume, 0.2f);
  expect_closed(mesh, volume.info.dims);
  expect_same_mesh(mesh, extract_scalar(volume, 0.2f));
}

TEST_P(ExtractorOnDevice, SmallCacheGivesTheSameMesh) {
  const CompressedVolume volume = noise_volume({9, 5, 6}, 2);
  ExtractStats all, few;
  const Mesh expected = extract(volume, 0.1f, {.with_normals = false}, &all);
  const Mesh mesh =
      extract(volume, 0.1f, {.with_normals = false, .cache_slots = 8, .part_vertices = 300}, &few);
  expect_same_mesh(mesh, expected);
  EXPECT_EQ(all.decoded_blocks, all.needed_blocks) << "each once";
  EXPECT_GT(few.decoded_blocks, all.decoded_blocks);
  EXPECT_GT(few.write_batches, all.write_batches);
}

TEST_P(ExtractorOnDevice, RealVolumesEqualTheTwin) {
  for (const auto &[file, isovalue] : {std::pair("head_41x41x41_uint8.raw.gz", 60.0f),
                                       {"head_41x41x41_uint8.raw.gz", 100.5f},
                                       {"fuel_64x33x32_uint8.raw.gz", 10.0f}}) {
    SCOPED_TRACE(fmt::format("{} at {}", file, isovalue));
    const CompressedVolume volume = real_volume(file);
    const Mesh expected = extract_scalar(volume, isovalue), mesh = extract(volume, isovalue);
    EXPECT_GT(mesh.triangles.size(), 1000u);
    expect_closed(mesh, volume.info.dims);
    expect_same_mesh(mesh, expected);
  }
}

TEST_P(ExtractorOnDevice, AnyVolumeCacheAndPart) {
  for (uint seed = 0; seed < (is_llvmpipe(GetParam()) ? 3u : 12u); ++seed) {
    Random random(seed);
    const glm::uvec3 dims(2 + random() % 40, 2 + random() % 40, 2 + random() % 40);
    const bool with_normals = random() % 2 == 0;
    const ExtractorOptions options{
        .with_normals = with_normals,
        .cache_slots = 17 + random() % 200,
        .stream = random() % 2 == 0 ? StreamPlace::kDevice : StreamPlace::kHost,
        .part_vertices = 1 + random() % 3000};
    SCOPED_TRACE(fmt::format("seed {}, {}x{}x{}, {} slots, parts of {}", seed, dims.x, dims.y,
                             dims.z, options.cache_slots, options.part_vertices));
    const CompressedVolume volume = noise_volume(dims, seed);
    const Mesh mesh = extract(volume, 0.3f, options);
    expect_same_mesh(mesh, extract_scalar(volume, 0.3f, with_normals));
    expect_closed(mesh, dims);
  }
}

/// What the sphere's surface is known to be.
TEST_P(ExtractorOnDevice, ASphereIsClosedAndLooksOutwards) {
  const glm::uvec3 dims(33, 33, 33);
  const Mesh mesh = extract(sphere_volume(dims), 0);
  expect_closed(mesh, dims);
  const glm::vec3 middle(16);
  // Euler's formula for a sphere; each triangle has three halves of edges.
  EXPECT_EQ(2 * mesh.vertices.size(), mesh.triangles.size() + 4);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const glm::vec3 outwards = glm::normalize(glm::vec3(mesh.vertices[i]) - middle);
    // Linear interpolation of a distance that bends by 1 / r over a voxel: at most 1 / 8 r off;
    // compression at 16 bits a voxel is finer.
    EXPECT_NEAR(glm::distance(glm::vec3(mesh.vertices[i]), middle), 0.4f * 33, 0.02f);
    EXPECT_GT(glm::dot(mesh.normals[i], outwards), 0.99f);
  }
  for (const Triangle &t : mesh.triangles) {
    const glm::vec3 a = mesh.vertices[t[0]], b = mesh.vertices[t[1]], c = mesh.vertices[t[2]];
    EXPECT_GT(glm::dot(glm::cross(b - a, c - a), a - middle), 0.0f);
  }
}

/// Integers, of which many equal the isovalue: vertices meet on these voxels, unless they are kept
/// apart.
TEST_P(ExtractorOnDevice, SmallTiesLeaveNoTriangleWithoutArea) {
  if (is_simulator(GetParam()))
    GTEST_SKIP() << "takes half a minute there, by the kernels of SmallVolumeEqualsTheTwin";
  const glm::uvec3 dims(13, 14, 11);
  std::vector<float> voxels = random_voxels(dims, 0, 4, 7);
  for (float &voxel : voxels) voxel = std::floor(voxel);
  const CompressedVolume volume = compress_with_libzfp(voxels, dims, 2048);
  std::size_t num_flat[2] = {0, 0}, num_places[2] = {0, 0};
  Mesh meshes[2];
  for (const VertexPlaces places : {VertexPlaces::kApart, VertexPlaces::kExact}) {
    const std::size_t i = places == VertexPlaces::kApart ? 0 : 1;
    meshes[i] = extract(volume, 2, {.vertices = places});
    expect_same_mesh(meshes[i], extract_scalar(volume, 2, true, places));
    expect_closed(meshes[i], dims);
    std::vector<std::array<double, 3>> vertices;
    for (const glm::dvec3 &v : meshes[i].vertices) vertices.push_back({v.x, v.y, v.z});
    std::ranges::sort(vertices);
    num_places[i] = vertices.size() - std::ranges::unique(vertices).size();
    for (const Triangle &t : meshes[i].triangles) {
      const glm::dvec3 a = meshes[i].vertices[t[0]];
      const glm::dvec3 side = meshes[i].vertices[t[1]] - a, other = meshes[i].vertices[t[2]] - a;
      if (glm::length(glm::cross(side, other)) == 0) ++num_flat[i];
    }
  }
  EXPECT_EQ(num_flat[0], 0u);
  EXPECT_EQ(num_places[0], meshes[0].vertices.size()) << "no two vertices meet";
  EXPECT_GT(num_flat[1], 1000u);
  EXPECT_LT(num_places[1], meshes[1].vertices.size() * 3 / 4);
  for (std::size_t i = 0; i < meshes[0].vertices.size(); ++i)
    EXPECT_LE(glm::distance(meshes[0].vertices[i], meshes[1].vertices[i]), kLeastGap);
}

/// At the coordinates of maps, float32 would have a few distinct places.
TEST_P(ExtractorOnDevice, SmallMeshFarFromTheOriginLosesNothing) {
  CompressedVolume volume = noise_volume({7, 6, 8}, 4);
  volume.info.spacing = glm::dvec3(0.125);
  const Mesh near_mesh = extract(volume, 0.1f);
  volume.info.origin = {4500000, 6700000, 120};
  const Mesh far_mesh = extract(volume, 0.1f);
  ASSERT_EQ(far_mesh.vertices.size(), near_mesh.vertices.size());
  for (std::size_t i = 0; i < near_mesh.vertices.size(); ++i) {
    const glm::dvec3 v = near_mesh.vertices[i];
    EXPECT_EQ(v, rounded_to_float32(v)) << "near the origin, float32 holds positions";
    EXPECT_LT(glm::distance(far_mesh.vertices[i] - volume.info.origin, v), 1e-7);
  }
  EXPECT_EQ(far_mesh.triangles, near_mesh.triangles);
}

/// Spacing, origin, and axes that are turned and mirrored.
TEST_P(ExtractorOnDevice, AMeshLiesInTheWorld) {
  CompressedVolume volume = noise_volume({7, 6, 8}, 4);
  const Mesh plain = extract(volume, 0.1f);
  volume.info.spacing = {2, 0.5, 3};
  volume.info.origin = {100, -20, 7};
  volume.info.direction = glm::dmat3(0, 1, 0, 1, 0, 0, 0, 0, 1);  // x and y swapped: left-handed
  const Mesh placed = extract(volume, 0.1f);
  ASSERT_EQ(placed.vertices.size(), plain.vertices.size());
  for (std::size_t i = 0; i < plain.vertices.size(); ++i) {
    const glm::vec3 p = plain.vertices[i];
    const glm::vec3 expected(100 + 0.5f * p.y, -20 + 2 * p.x, 7 + 3 * p.z);
    EXPECT_LT(glm::distance(glm::vec3(placed.vertices[i]), expected), 2e-5f);  // an ulp of 128
    const glm::vec3 n = plain.normals[i];
    const glm::vec3 normal = glm::normalize(glm::vec3(n.y / 0.5f, n.x / 2, n.z / 3));
    EXPECT_LT(glm::distance(placed.normals[i], normal), 1e-6f);
  }
  for (std::size_t i = 0; i < plain.triangles.size(); ++i) {
    const Triangle t = plain.triangles[i];
    EXPECT_EQ(placed.triangles[i], (Triangle{t[0], t[2], t[1]}));
  }
}

TEST_P(ExtractorOnDevice, OneExtractorServesManyIsovalues) {
  const CompressedVolume volume = sphere_volume({30, 28, 29});
  Extractor extractor(device_, volume, {});
  for (const float isovalue : {0.0f, 0.0f, -2.5f, 3.0f, 1000.0f, 0.0f}) {
    Mesh mesh;
    const ExtractStats stats = extractor.extract(isovalue, mesh);
    SCOPED_TRACE(isovalue);
    expect_same_mesh(mesh, extract_scalar(volume, isovalue));
    EXPECT_EQ(mesh.triangles.empty(), isovalue == 1000.0f);
    EXPECT_LE(stats.decoded_blocks, stats.needed_blocks);
  }
  Mesh mesh;
  EXPECT_EQ(extractor.extract(0, mesh).decoded_blocks, 0u) << "all are cached";
  extractor.clear_cache();
  const ExtractStats cold = extractor.extract(0, mesh);
  EXPECT_EQ(cold.decoded_blocks, cold.needed_blocks);
}

/// What the message of a budget that is too small says would do.
std::uint64_t budget_named(const std::string &text) {
  return std::stoull(text.substr(text.rfind(": ") + 2));
}

TEST_P(ExtractorOnDevice, TheBudgetIsKept) {
  const CompressedVolume volume = noise_volume({40, 41, 39}, 5);
  ExtractStats ample;
  const Mesh expected = extract(volume, 0, {}, &ample);
  EXPECT_EQ(device_.ledger().current(), 0u);
  std::uint64_t least = 0;
  try {
    extract(volume, 0, {.memory_budget = 60'000});
  } catch (const Error &error) {
    EXPECT_THAT(error.what(), HasSubstr("a memory budget of 60000 bytes is too small: "));
    least = budget_named(error.what());
  }
  ASSERT_GT(least, 60'000u);
  for (const std::uint64_t bytes : {least, least + 100'000, ample.device_bytes}) {
    SCOPED_TRACE(bytes);
    ocl::Device device(GetParam());
    Extractor extractor(device, volume, {.memory_budget = bytes});
    Mesh mesh;
    const ExtractStats stats = extractor.extract(0, mesh);
    expect_same_mesh(mesh, expected);
    EXPECT_LE(device.ledger().peak(), bytes);
    EXPECT_LE(stats.device_bytes, bytes);
    extractor.extract(0.5f, mesh);
    EXPECT_LE(device.ledger().peak(), bytes);
  }
  EXPECT_THROW(extract(volume, 0, {.memory_budget = least - 1}), Error);
}

/// A surface in so many blocks that their list takes more than what the volume's ranges are made
/// in.
TEST_P(ExtractorOnDevice, ASurfaceThatExceedsTheBudgetIsNamed) {
  if (is_llvmpipe(GetParam())) GTEST_SKIP() << "takes a minute there, and is the host's work";
  const glm::uvec3 dims(124, 128, 160);
  std::vector<float> voxels(std::size_t{dims.x} * dims.y * dims.z);
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    const glm::uvec3 at(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y);
    voxels[i] = at % 4u == glm::uvec3(1) ? 1.0f : 0.0f;
  }
  const CompressedVolume volume = compress_with_libzfp(voxels, dims, 256);
  std::uint64_t least = 0;
  for (std::uint64_t budget = 1u << 20; least == 0; budget += 1u << 17) {
    ASSERT_LT(budget, 8u << 20) << "no budget was too small for the surface alone";
    try {
      Mesh mesh;
      extract(volume, 0.5f, {.memory_budget = budget});
    } catch (const Error &error) {
      const std::string text = error.what();
      if (text.find("blocks of the surface at 0.5: ") == std::string::npos) continue;
      least = budget_named(text);
      EXPECT_GT(least, budget);
    }
  }
  ocl::Device device(GetParam());
  Extractor extractor(device, volume, {.memory_budget = least + (2u << 20)});
  Mesh mesh;
  extractor.extract(0.5f, mesh);
  EXPECT_LE(device.ledger().peak(), least + (2u << 20));
  expect_closed(mesh, dims);
}

TEST_P(ExtractorOnDevice, SmallRefusals) {
  const CompressedVolume volume = noise_volume({5, 5, 5}, 6);
  Extractor extractor(device_, volume, {});
  Mesh mesh;
  EXPECT_THAT([&] { extractor.extract(std::nanf(""), mesh); },
              ThrowsMessage<Error>(HasSubstr("NaN")));
  EXPECT_THAT([&] { Extractor(device_, volume, {.cache_slots = 16}); },
              ThrowsMessage<Error>(HasSubstr("a block of the surface needs 17")));
  EXPECT_THAT([&] { Extractor(device_, volume, {.memory_budget = 1000}); },
              ThrowsMessage<Error>(HasSubstr("a memory budget of 1000 bytes is too small")));
}

/// A sink that fails leaves the extractor as it was.
TEST_P(ExtractorOnDevice, SmallFailingSinkHarmsNobody) {
  struct Failing : MeshSink {
    void begin(const MeshSize &) override {}
    void add(const MeshPart &) override { throw Error("full"); }
  } failing;
  const CompressedVolume volume = noise_volume({6, 6, 6}, 7);
  Extractor extractor(device_, volume, {});
  EXPECT_THROW(extractor.extract(0, failing), Error);
  Mesh mesh;
  extractor.extract(0, mesh);
  expect_same_mesh(mesh, extract_scalar(volume, 0));
}

}  // namespace
}  // namespace isowave::core
