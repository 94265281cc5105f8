// Cameras of parallel projection: rays as the camera says, and frames that device, host and twin
// draw with the same bits, of one level of detail and of several, with all that frames can have.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/grid_dda.h"
#include "reference/twin_renderer.hpp"
#include "tests/array_reader.hpp"
#include "tests/frame_scene.hpp"
#include "tests/ray_oracle.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr float kIsovalue = 0.2f;
constexpr ImageSize kSize{41, 29};

/// From outside, and from a plane through the volume.
std::vector<Camera> parallel_cameras(const VolumeInfo &info) {
  std::vector<Camera> cameras;
  for (const Camera &camera : orbit_cameras(info, 2)) cameras.push_back(in_parallel(camera));
  Camera inside = cameras[0];
  inside.eye = 0.5 * (inside.eye + inside.at);
  inside.at = inside.eye + glm::dvec3(0.3, -0.1, -1);
  cameras.push_back(inside);
  Camera along_axis = test::camera_along({8, 9, -20}, {0, 0, 1});
  along_axis.parallel_height = 14;
  cameras.push_back(along_axis);
  return cameras;
}

TEST(ParallelProjection, RaysAreTheCameras) {
  VolumeInfo info = test::grid_info({20, 30, 25}, {0.5, 2, 1.25});
  info.origin = {3, -4, 5};
  const glm::dmat3 to_index = glm::inverse(info.index_to_world());
  for (const Camera &camera : parallel_cameras(info)) {
    const FrameParams frame = make_frame_params(info, camera, kSize, 0);
    for (const std::uint32_t pixel : {0u, 17u, 600u, kSize.width * kSize.height - 1}) {
      const test::OracleRay expected =
          test::oracle_ray(camera, kSize, pixel % kSize.width, pixel / kSize.width);
      const glm::dvec3 start = to_index * (expected.eye - info.origin),
                       direction = to_index * expected.direction;
      const Ray ray = make_ray(&frame, pixel);
      const glm::dvec3 o(ray.x.o, ray.y.o, ray.z.o), d(ray.x.d, ray.y.d, ray.z.d);
      EXPECT_LT(glm::length(o - start), 1e-5 * (1 + glm::length(start)));
      EXPECT_LT(glm::length(d / double{frame.view.t_scale} - direction), 1e-6);
    }
  }
}

TEST(ParallelProjection, KeepsTheSizeOfWhatIsLookedAt) {
  const VolumeInfo info = test::grid_info({20, 20, 20});
  const Camera camera = orbit_cameras(info, 1)[0], parallel = in_parallel(camera);
  const double distance = glm::length(camera.at - camera.eye);
  EXPECT_DOUBLE_EQ(pixel_size_at(parallel, 100, 5), pixel_size_at(camera, 100, distance));
  EXPECT_EQ(pixel_size_at(parallel, 100, 5), pixel_size_at(parallel, 100, 50));
}

TEST(ParallelProjection, RefusesHeightsThatCannotBeDrawn) {
  const VolumeInfo info = test::grid_info({20, 20, 20});
  Camera camera = orbit_cameras(info, 1)[0];
  for (const double bad : {0.0, -1.0, double(NAN), double(INFINITY), 1e300}) {
    camera.parallel_height = bad;
    EXPECT_THAT([&] { make_view(info, camera, kSize); },
                ThrowsMessage<Error>(HasSubstr("parallel projection")));
  }
  camera.parallel_height = 1e9;
  EXPECT_THAT([&] { make_view(info, camera, kSize); },
              ThrowsMessage<Error>(HasSubstr("cannot be drawn in float32")));
}

/// All pixels have voxels of one size: one level draws them all.
TEST(ParallelProjection, OneLevelOfDetailDrawsAll) {
  const std::vector<VolumeInfo> levels{test::grid_info({64, 64, 64}),
                                       test::grid_info({32, 32, 32}, glm::dvec3(2)),
                                       test::grid_info({16, 16, 16}, glm::dvec3(4))};
  Camera camera = orbit_cameras(levels[0], 1)[0];
  camera.parallel_height = 100;
  const ImageSize size{100, 100};  // a pixel is a voxel of the finest level
  for (const auto &[voxel_pixels, expected] :
       {std::pair(0.5, 0u), std::pair(1.0, 0u), std::pair(2.5, 1u), std::pair(4.0, 2u),
        std::pair(100.0, 2u)}) {
    const auto frames = make_level_frames(levels, camera, size, 0.5f, voxel_pixels);
    for (std::uint32_t level = 0; level < frames.size(); ++level)
      EXPECT_EQ(draws(frames[level]), level == expected) << voxel_pixels << " pixels";
  }
}

class ParallelOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  /// Device, host and twin draw the same frames, of at least so many hits each.
  void expect_frames(const TestVolume &volume, const std::vector<Camera> &cameras, ImageSize size,
                     std::size_t least_hits);

  ocl::Device device_{GetParam().device};
};
INSTANTIATE_TEST_SUITE_P(Devices, ParallelOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

void ParallelOnDevice::expect_frames(const TestVolume &volume, const std::vector<Camera> &cameras,
                                     ImageSize size, std::size_t least_hits) {
  DeviceRenderer device(device_, volume.compressed,
                        GetParam().with({.size = size, .with_given_rays = true}));
  TwinRenderer twin(volume.compressed, size);
  HostRenderer host(volume.compressed);
  for (const Camera &camera : cameras) {
    FrameRequest request{.camera = camera, .isovalue = kIsovalue, .size = size};
    request.ambient_rays = 2;
    device.render(request);
    twin.render(request);
    host.render(request);
    EXPECT_GT(test::num_hits(twin.hits()), least_hits);
    expect_same_hits(device.hits(), twin.hits(), size.width);
    expect_same_hits(host.hits(), twin.hits(), size.width);
    EXPECT_EQ(device.shade().pixels, twin.shade().pixels);
    EXPECT_EQ(host.shade().pixels, twin.shade().pixels);
  }
}

TEST_P(ParallelOnDevice, FramesAreTheTwinsAndTheHosts) {
  const TestVolume volume({18, 19, 21}, test::gyroid_field(9));
  expect_frames(volume, parallel_cameras(volume.info()), kSize, 100);
}

TEST_P(ParallelOnDevice, SmallFrame) {
  const TestVolume volume({9, 10, 11}, test::gyroid_field(7));
  expect_frames(volume, {in_parallel(orbit_cameras(volume.info(), 1)[0])}, {8, 6}, 10);
}

TEST_P(ParallelOnDevice, FramesOfCoarserLevels) {
  const glm::uvec3 dims(40, 36, 44);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::sphere_field(dims)));
  const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 0});
  if (GetParam().is_blocks()) GTEST_SKIP() << "pipeline blocks draws the finest level alone";
  DeviceRenderer device(device_, volume, GetParam().with({.size = kSize, .with_levels = true}));
  TwinRenderer twin(volume, kSize);
  for (const double voxel_pixels : {0.0, 2.0, 9.0}) {
    const FrameRequest request{.camera = in_parallel(orbit_cameras(volume.info, 1)[0]),
                               .isovalue = 0.5f,
                               .size = kSize,
                               .voxel_pixels = voxel_pixels};
    const FrameStats stats = device.render(request);
    EXPECT_EQ(stats.first_level, stats.last_level);
    twin.render(request);
    expect_same_hits(device.hits(), twin.hits(), kSize.width);
  }
}

}  // namespace
}  // namespace isowave::core
