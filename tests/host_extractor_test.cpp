// core/mesh/host_extractor: meshes made without OpenCL have the bits of a device's and of the
// scalar twin, whatever the memory, the threads and the parts.

#include "core/mesh/host_extractor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "core/base/error.hpp"
#include "core/extract/extractor.hpp"
#include "core/host/host_blocks.hpp"
#include "core/platform/memory.hpp"
#include "isowave/extract.hpp"
#include "reference/mesh_twin.hpp"
#include "tests/array_reader.hpp"
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

/// As noise_volume(), but about one voxel of `share` has no data.
CompressedVolume volume_with_holes(const glm::uvec3 &dims, uint seed, uint share) {
  std::vector<float> voxels = random_voxels(dims, -1, 1, seed);
  Random random(seed);
  for (float &voxel : voxels) {
    if (random() % share == 0) voxel = std::numeric_limits<float>::quiet_NaN();
  }
  ArrayReader reader(dims, voxels);
  return compress(reader, {.rate = 12});
}

Mesh extract(const CompressedVolume &volume, float isovalue,
             const HostExtractorOptions &options = {}) {
  Mesh mesh;
  extract_on_host(volume, isovalue, options, mesh);
  return mesh;
}

TEST(HostExtractor, AnyVolumeMemoryThreadAndPart) {
  for (uint seed = 0; seed < 24; ++seed) {
    Random random(seed);
    const glm::uvec3 dims(2 + random() % 30, 2 + random() % 30, 2 + random() % 30);
    const CompressedVolume volume =
        seed % 3 == 0 ? volume_with_holes(dims, seed, 20) : noise_volume(dims, seed);
    const std::uint64_t least =
        HostBlocks::bytes(volume.info) + ISO_MESH_NEIGHBOURS * platform::page_bytes();
    const HostExtractorOptions options{.with_normals = random() % 2 == 0,
                                       .memory_limit = random() % 2 == 0 ? 0 : least,
                                       .num_threads = 1 + random() % 4,
                                       .part_vertices = 1 + random() % 3000};
    SCOPED_TRACE(fmt::format("seed {}, {}x{}x{}, {} bytes, {} threads, parts of {}", seed, dims.x,
                             dims.y, dims.z, options.memory_limit, options.num_threads,
                             options.part_vertices));
    const Mesh mesh = extract(volume, 0.3f, options);
    if (seed % 3 != 0) expect_closed(mesh, dims);
    expect_same_mesh(mesh, extract_scalar(volume, 0.3f, options.with_normals));
  }
}

TEST(HostExtractor, SaysWhatIsWrong) {
  const CompressedVolume volume = noise_volume({9, 6, 7}, 1);
  Mesh mesh;
  EXPECT_THAT([&] { extract_on_host(volume, NAN, {}, mesh); },
              ThrowsMessage<Error>(HasSubstr("the isovalue is NaN")));
  EXPECT_THAT([&] { extract_on_host(volume, 0, {.memory_limit = 1000}, mesh); },
              ThrowsMessage<Error>(HasSubstr("and 1000 are allowed: raise the limit")));
  extract_on_host(volume, 7, {}, mesh);
  EXPECT_TRUE(mesh.triangles.empty()) << "no value is as large";
}

TEST(HostExtractor, ReportsProgressToTheEnd) {
  std::uint32_t last = 0;
  Mesh mesh;
  extract_on_host(noise_volume({20, 20, 20}, 1), 0.1f, {.part_vertices = 500}, mesh,
                  [&](std::uint32_t done, std::uint32_t total) {
                    EXPECT_GE(done, last);
                    EXPECT_EQ(total, 1000u);
                    last = done;
                  });
  EXPECT_EQ(last, 1000u);
}

class HostExtractorOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, HostExtractorOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(HostExtractorOnDevice, MeshesOfUsersAreTheDevices) {
  const auto device = open_device(std::to_string(GetParam().index));
  for (const auto &[file, isovalue] :
       {std::pair("head_41x41x41_uint8.raw.gz", 60.0), {"fuel_64x33x32_uint8.raw.gz", 10.0}}) {
    SCOPED_TRACE(file);
    const auto volume = open_volume(std::string(ISOWAVE_TEST_DATA) + "/" + file, {.levels = 2});
    for (const std::uint32_t level : {0u, 1u}) {
      const ExtractOptions options{.level = level, .with_normals = level == 0};
      const isowave::Mesh host = isowave::extract(volume, isovalue, options),
                          expected = isowave::extract(device, volume, isovalue, options);
      EXPECT_GT(host.triangles.size(), 200u);
      EXPECT_TRUE(same_bytes(host.vertices, expected.vertices));
      EXPECT_TRUE(same_bytes(host.normals, expected.normals));
      EXPECT_EQ(host.triangles, expected.triangles);
    }
  }
}

}  // namespace
}  // namespace isowave::core
