// Arrays of finished frames: picture, depth, normals, positions, from any renderer.

#include "core/frame/frame_arrays.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/host/host_renderer.hpp"
#include "core/volume/world_positions.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;

constexpr WantedArrays kAll{
    .picture = true, .depth = true, .normals = true, .positions = true, .hits = true};

template <class T>
bool same_bits(const HostArray<T> &a, const HostArray<T> &b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.bytes()) == 0;
}

/// Turned, of unequal spacing, so far from the world's origin that float32 does not do, or near.
VolumeInfo turned_info(double distance) {
  VolumeInfo info = test::grid_info({13, 10, 11}, {1, 2, 0.5});
  info.origin = {distance, -distance, 3};
  info.direction = {{0.8, 0.6, 0}, {-0.6, 0.8, 0}, {0, 0, 1}};
  return info;
}

/// What the API says of the hits, computed anew in double precision.
void expect_of_hits(const FrameArrays &arrays, const std::vector<HitRecord> &hits,
                    const VolumeInfo &info) {
  ASSERT_EQ(arrays.depth.size(), hits.size());
  ASSERT_EQ(arrays.normals.size(), hits.size());
  ASSERT_EQ(arrays.positions.size(), hits.size());
  const glm::dmat3 to_normal = glm::transpose(glm::inverse(info.index_to_world()));
  const WorldPositions to_world(info);
  std::size_t num_hits = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const HitRecord &hit = hits[i];
    ASSERT_EQ(arrays.depth[i], hit.t);
    const auto &[nx, ny, nz] = arrays.normals[i];
    if (std::isinf(hit.t)) {
      ASSERT_EQ((std::array{nx, ny, nz}), (std::array{0.0f, 0.0f, 0.0f}));
      for (const double coordinate : arrays.positions[i]) ASSERT_TRUE(std::isnan(coordinate));
      continue;
    }
    ++num_hits;
    const glm::dvec3 normal =
        -glm::normalize(to_normal * glm::dvec3(hit.grad_x, hit.grad_y, hit.grad_z));
    // Three products and sums of float32 for each coordinate, a length, and a quotient.
    ASSERT_LT(glm::distance(normal, glm::dvec3(nx, ny, nz)), 16 * 0x1p-24);
    const std::uint32_t columns = (info.dims.x + 3) / 4, rows = (info.dims.y + 3) / 4;
    const glm::dvec3 cell(4 * (hit.block_id % columns) + hit.cell % 4,
                          4 * (hit.block_id / columns % rows) + hit.cell / 4 % 4,
                          4 * (hit.block_id / columns / rows) + hit.cell / 16);
    const glm::dvec3 at = to_world(cell + glm::dvec3(hit.x, hit.y, hit.z));
    ASSERT_EQ(arrays.positions[i], (std::array{at.x, at.y, at.z}));
  }
  EXPECT_GT(num_hits, hits.size() / 20);
  EXPECT_LT(num_hits, hits.size());
}

class FrameArraysOnDevice : public testing::TestWithParam<PipelineOnDevice> {};
INSTANTIATE_TEST_SUITE_P(Devices, FrameArraysOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(FrameArraysOnDevice, SmallFramesOfAllRenderersHaveTheSame) {
  for (const double distance : {2.0, 1e6}) {
    const VolumeInfo info = turned_info(distance);
    EXPECT_EQ(float32_holds_positions(info), distance == 2.0);
    const TestVolume volume(info, test::sample(info.dims, test::gyroid_field(7)), 8);
    const Camera camera = orbit_cameras(info, 1)[0];
    ocl::Device device(GetParam().device);
    const bool is_slow = is_simulator(device.info());  // it draws one frame, small and near
    if (is_slow && distance != 2.0) continue;
    // An odd number of pixels; more bytes of positions than fit at once.
    const ImageSize largest = is_slow ? ImageSize{7, 5, 2} : ImageSize{21, 13, 2};
    DeviceRenderer renderer(device, volume.compressed, GetParam().with({.size = largest}));
    HostRenderer host(volume.compressed);
    TwinRenderer twin(volume.compressed, largest);
    for (const ImageSize size : {largest, ImageSize{7, 5}, ImageSize{1, 1}}) {
      if (is_slow && size.samples != 2) continue;
      SCOPED_TRACE(fmt::format("{} x {}", size.ray_columns(), size.ray_rows()));
      FrameArrays of_device;
      for (Renderer *each : {static_cast<Renderer *>(&renderer), static_cast<Renderer *>(&host),
                             static_cast<Renderer *>(&twin)}) {
        each->render({camera, 0.1f, size});
        const FrameArrays arrays = each->fetch(kAll, {});
        EXPECT_EQ(arrays.picture.size(), 3 * size.num_pixels());
        EXPECT_EQ(each->shade().pixels, arrays.picture.copy());
        EXPECT_EQ(each->depth(), arrays.depth.copy());
        const std::vector<HitRecord> hits = each->hits();
        ASSERT_EQ(arrays.hits.size(), hits.size());
        EXPECT_EQ(std::memcmp(arrays.hits.data(), hits.data(), arrays.hits.bytes()), 0);
        if (each == &renderer) {
          of_device = each->fetch(kAll, {});
          if (size.num_pixels() > 1) expect_of_hits(arrays, each->hits(), info);
        }
        EXPECT_TRUE(same_bits(arrays.picture, of_device.picture));
        EXPECT_TRUE(same_bits(arrays.depth, of_device.depth));
        EXPECT_TRUE(same_bits(arrays.normals, of_device.normals));
        EXPECT_TRUE(same_bits(arrays.positions, of_device.positions));
      }
    }
    const FrameArrays few = renderer.fetch({.normals = true}, {});
    EXPECT_EQ(few.normals.size(), is_slow ? largest.num_rays() : 1u);
    EXPECT_TRUE(few.picture.empty() && few.depth.empty() && few.positions.empty() &&
                few.hits.empty());
  }
}

/// Arrays stay when their renderer draws on, and when it and its device are gone.
TEST_P(FrameArraysOnDevice, SmallArraysOutliveTheRenderer) {
  const TestVolume volume({9, 10, 11}, test::gyroid_field(7));
  const std::vector<Camera> cameras = orbit_cameras(volume.info(), 3);
  std::vector<FrameArrays> kept;
  std::vector<Image8> pictures;
  {
    ocl::Device device(GetParam().device);
    DeviceRenderer renderer(device, volume.compressed, GetParam().with({.size = {12, 8}}));
    for (const Camera &camera : cameras) {
      renderer.render({camera, 0.1f});
      kept.push_back(renderer.fetch({.picture = true, .depth = true}, {}));
      pictures.push_back(renderer.shade());
    }
  }
  for (std::size_t view = 0; view < kept.size(); ++view)
    EXPECT_EQ(kept[view].picture.copy(), pictures[view].pixels);
  EXPECT_NE(pictures[0].pixels, pictures[1].pixels);
}

/// Only the direction of a gradient counts, however large or small it is.
TEST(FrameArrays, NormalsOfTinyAndHugeGradients) {
  const ShadeParams shading = make_shade_params(test::grid_info({9, 9, 9}), {});
  for (const float size : {1e-38f, 1.0f, 1e38f}) {
    HitRecord hit{};
    hit.grad_x = 2 * size;
    hit.grad_z = -1.5f * size;
    const AmbientDirection normal = world_normal(&shading, hit);
    EXPECT_FLOAT_EQ(normal.x, -0.8f);
    EXPECT_EQ(std::bit_cast<std::uint32_t>(normal.y), 0u) << "no -0";
    EXPECT_FLOAT_EQ(normal.z, 0.6f);
  }
  const AmbientDirection none = world_normal(&shading, HitRecord{});
  EXPECT_EQ((std::array{none.x, none.y, none.z}), (std::array{0.0f, 0.0f, 0.0f}));
}

}  // namespace
}  // namespace isowave::core
