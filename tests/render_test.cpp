// Whole frames on every device: the hit buffer must equal the twin's bit for bit, whatever is
// drawn.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>

#include "core/base/error.hpp"
#include "core/io/open_volume.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::camera_along;
using test::expect_same_hits;
using test::TestVolume;
using test::twin_hits;

constexpr ImageSize kTiny{6, 5}, kSmall{12, 8}, kMedium{96, 64};

class RenderOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Draws all isovalues from all cameras with one renderer, with normals of both kinds. Returns
  /// the number of hits.
  std::uint64_t check(const TestVolume &volume, const std::vector<Camera> &cameras,
                      const std::vector<float> &isovalues, ImageSize size,
                      RendererOptions options = {}) {
    std::uint64_t hits = 0;
    options.size = size;
    DeviceRenderer renderer(*device_, volume.compressed, options);
    for (const float isovalue : isovalues) {
      for (std::size_t view = 0; view < cameras.size(); ++view) {
        SCOPED_TRACE(fmt::format("isovalue {}, view {}", isovalue, view));
        const FrameStats stats = renderer.render({cameras[view], isovalue});
        const auto expected = twin_hits(volume, cameras[view], size, isovalue);
        expect_same_hits(renderer.hits(), expected, size.width);
        EXPECT_EQ(stats.rays_hit, test::num_hits(expected));
        hits += stats.rays_hit;
        renderer.render({.camera = cameras[view], .isovalue = isovalue, .normals = Normals::kCell});
        expect_same_hits(renderer.hits(),
                         twin_hits(volume, cameras[view], size, isovalue, Normals::kCell),
                         size.width);
      }
    }
    return hits;
  }
  std::uint64_t check(const TestVolume &volume, const std::vector<float> &isovalues,
                      ImageSize size) {
    return check(volume, orbit_cameras(volume.info(), 2), isovalues, size);
  }

  /// Becomes the same device with other abilities.
  void pretend(const std::function<void(ocl::Capabilities &)> &change) {
    ocl::DeviceInfo info = GetParam();
    change(info.capabilities);
    device_ = std::make_unique<ocl::Device>(info);
  }

  /// What the simulator can afford where a case draws many frames.
  ImageSize small_size() const { return is_simulator(device_->info()) ? kTiny : kSmall; }

  std::unique_ptr<ocl::Device> device_ = std::make_unique<ocl::Device>(GetParam());
};
INSTANTIATE_TEST_SUITE_P(Devices, RenderOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TestVolume read_volume(const char *name, std::uint32_t rate) {
  const auto reader = open_volume(std::string(ISOWAVE_TEST_DATA "/") + name);
  return TestVolume(*reader, rate);
}

// ---- small enough for Oclgrind

TEST_P(RenderOnDevice, SmallSphere) {
  const glm::uvec3 dims(9, 10, 11);
  EXPECT_GT(check(TestVolume(dims, test::sphere_field(dims)), {0.5f}, kSmall), 20u);
}

TEST_P(RenderOnDevice, SmallNoiseManyCandidates) {
  EXPECT_GT(check(TestVolume({9, 10, 11}, test::noise_field(3), 4), {0.6f}, kSmall), 20u);
}

TEST_P(RenderOnDevice, SmallOneCellOneBlockAndThinVolumes) {
  for (const glm::uvec3 dims : {glm::uvec3(2, 2, 2), {4, 4, 4}, {5, 2, 9}, {2, 13, 6}}) {
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    const TestVolume volume(dims, test::noise_field(4), 16);
    EXPECT_GT(check(volume, {orbit_cameras(volume.info(), 1)[0]}, {0.1f}, kSmall), 5u);
  }
}

TEST_P(RenderOnDevice, SmallEyeInside) {
  const TestVolume volume({9, 10, 11}, test::gyroid_field(7));
  EXPECT_GT(check(volume, {camera_along({4, 4.5, 5}, {1, 0.25, -0.5})}, {0.1f}, kSmall), 20u);
}

/// Rays, and blocks of rays, in many launches of a stage.
TEST_P(RenderOnDevice, SmallLaunchesOfFewRays) {
  pretend([](ocl::Capabilities &can) { can.elements_per_launch = 7; });
  const TestVolume volume({9, 10, 11}, test::gyroid_field(7));
  const std::vector<Camera> cameras = {orbit_cameras(volume.info(), 1)[0]};
  EXPECT_GT(check(volume, cameras, {0.1f}, kSmall, {.packets = RayPackets::kOff}), 20u);
  for (const bool scanned : {false, true}) {
    EXPECT_GT(check(volume, cameras, {0.1f}, kSmall,
                    {.pipeline = blocks_pipeline({.scanned_pairs = scanned})}),
              20u);
  }
}

TEST_P(RenderOnDevice, SmallGroupsOfTwo) {
  if (is_llvmpipe(GetParam()) && !long_tests()) return;  // it compiles march for minutes, again
  pretend([](ocl::Capabilities &can) { can.max_work_group_size = 3; });
  const TestVolume volume({9, 10, 11}, test::gyroid_field(7));
  for (const PipelinePtr &pipeline : {rays_pipeline(), blocks_pipeline()}) {
    EXPECT_GT(check(volume, {orbit_cameras(volume.info(), 1)[0]}, {0.1f}, small_size(),
                    {.pipeline = pipeline, .packets = RayPackets::kOff}),
              5u);
  }
}

TEST_P(RenderOnDevice, SmallNothingToHit) {
  const glm::uvec3 dims(9, 10, 11);
  const TestVolume volume(dims, test::sphere_field(dims));
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  EXPECT_EQ(check(volume, {camera}, {-5.0f, 5.0f}, kSmall), 0u);  // no block holds the isovalue
  const Camera away = camera_along(camera.eye, camera.eye - camera.at);
  EXPECT_EQ(check(volume, {away}, {0.5f}, kSmall), 0u);  // no ray meets the volume
}

// ---- real and synthetic volumes

TEST_P(RenderOnDevice, Head) {
  const TestVolume volume = read_volume("head_41x41x41_uint8.raw.gz", 8);
  EXPECT_GT(check(volume, {20, 80, 128.5f, 200}, kMedium), 1000u);
}

TEST_P(RenderOnDevice, FuelAtLowRate) {
  const TestVolume volume = read_volume("fuel_64x33x32_uint8.raw.gz", 2);
  EXPECT_GT(check(volume, {1, 10, 70, 150}, kMedium), 1000u);
}

/// Blocks of lengths of their own, and integers that are drawn as they are in their file.
TEST_P(RenderOnDevice, SmallErrorBounds) {
  const VolumeInfo info = test::grid_info({9, 10, 11});
  const TestVolume volume(info, test::sample(info.dims, test::noise_field(5)), ErrorGoal{0.05});
  EXPECT_GT(check(volume, {orbit_cameras(info, 1)[0]}, {0.5f}, kSmall), 20u);
}

TEST_P(RenderOnDevice, ErrorBounds) {
  const VolumeInfo info = test::grid_info({37, 30, 26});
  for (const double tolerance : {0.5, 0.01, 1e-6}) {
    SCOPED_TRACE(tolerance);
    const TestVolume volume(info, test::sample(info.dims, test::gyroid_field(9)),
                            ErrorGoal{tolerance});
    EXPECT_GT(check(volume, {0.2f}, kMedium), 500u);
  }
}

/// Fewer bit planes than the volume has: the twin of voxels that libzfp decodes likewise; and all
/// of them again.
TEST_P(RenderOnDevice, SmallValueErrors) {
  const VolumeInfo info = test::grid_info({9, 10, 11});
  const std::vector<float> source = test::sample(info.dims, test::gyroid_field(7));
  const Camera camera = orbit_cameras(info, 1)[0];
  const ImageSize size = small_size();
  for (const TestVolume &volume :
       {TestVolume(info, source, 8), TestVolume(info, source, ErrorGoal{0.001})}) {
    DeviceRenderer renderer(*device_, volume.compressed, {.size = size});
    for (const double voxel_error : {0.0, 0.3, 0.02, 1e-9, 0.0}) {
      SCOPED_TRACE(fmt::format("{} bits per block, value error {}",
                               volume.compressed.bits_per_block, voxel_error));
      const std::vector<float> voxels = decode_with_libzfp(volume.compressed, voxel_error);
      for (std::size_t i = 0; i < voxels.size(); ++i)
        ASSERT_LE(std::abs(voxels[i] - volume.voxels[i]), voxel_error);
      renderer.render({.camera = camera, .isovalue = 0.1f, .voxel_error = voxel_error});
      expect_same_hits(renderer.hits(),
                       twin_hits(make_frame_params(info, camera, size, 0.1f), voxels), size.width);
    }
    for (const double bad : {-1.0, double{NAN}, double{INFINITY}})
      EXPECT_THROW(renderer.render({.camera = camera, .isovalue = 0.1f, .voxel_error = bad}),
                   Error);
  }
}

/// Blocks whose range does not hold the isovalue, but whose fewer bit planes do, are drawn as well.
TEST_P(RenderOnDevice, ValueErrorsOfIntegersAndFewValues) {
  const auto open = [] { return open_volume(ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz"); };
  std::vector<float> source(open()->info().num_voxels());
  open()->read_layers(0, open()->info().dims.z, source);
  const TestVolume volume(open()->info(), source, ErrorGoal{.exact = true});
  DeviceRenderer renderer(*device_, volume.compressed, {.size = kMedium});
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  for (const double voxel_error : {0.5, 4.0, 64.0}) {
    const std::vector<float> voxels = decode_with_libzfp(volume.compressed, voxel_error);
    for (const float isovalue : {0.7f, 70.0f, 255.5f}) {
      SCOPED_TRACE(fmt::format("value error {}, isovalue {}", voxel_error, isovalue));
      renderer.render({.camera = camera, .isovalue = isovalue, .voxel_error = voxel_error});
      const FrameParams frame = make_frame_params(volume.info(), camera, kMedium, isovalue);
      expect_same_hits(renderer.hits(), twin_hits(frame, voxels), kMedium.width);
    }
  }
}

TEST_P(RenderOnDevice, ExactVolumesAreTheirSource) {
  const auto open = [] { return open_volume(ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz"); };
  std::vector<float> source(open()->info().num_voxels());
  open()->read_layers(0, open()->info().dims.z, source);
  const TestVolume volume(open()->info(), source, ErrorGoal{.exact = true});
  ASSERT_EQ(volume.voxels, source);
  EXPECT_GT(check(volume, {1, 70, 69.5f}, kMedium), 1000u);
}

/// Slots have the volume's type. The values take its whole range; both normals, several isovalues
/// of one cache, fewer bit planes, both pipelines.
TEST_P(RenderOnDevice, SmallShortIntegersInSlotsOfTheirType) {
  for (const VoxelType type :
       {VoxelType::kUint8, VoxelType::kInt8, VoxelType::kUint16, VoxelType::kInt16}) {
    SCOPED_TRACE(to_string(type));
    VolumeInfo info = test::grid_info({13, 10, 11});
    info.type = type;
    const auto [least, greatest] = whole_numbers_of(type, BlockPrecision{.whole_numbers = true});
    std::vector<float> source = test::sample(info.dims, test::noise_field(5));
    for (float &voxel : source)
      voxel = std::rint(least + (0.5f + 0.5f * voxel) * (greatest - least));
    source.front() = least;
    source.back() = greatest;
    const TestVolume volume(info, source, ErrorGoal{.exact = true});
    ASSERT_EQ(volume.voxels, source);
    const float middle = std::rint(0.5f * (least + greatest));
    const auto cameras = orbit_cameras(info, 1);
    const ImageSize size = small_size();
    EXPECT_GT(check(volume, cameras, {middle, middle + 0.5f}, size), 10u);
    if (is_simulator(GetParam()) && type != VoxelType::kInt8) continue;
    EXPECT_GT(check(volume, cameras, {middle}, size, {.pipeline = blocks_pipeline()}), 5u);
    DeviceRenderer renderer(*device_, volume.compressed, {.size = size});
    const MemoryPlan &plan = renderer.memory_plan();
    EXPECT_EQ(plan.buffers["block cache"].bytes(),
              std::uint64_t{plan.cache_slots} * ISO_BLOCK_VOXELS * size_of(type));
    const float voxel_error = std::exp2(std::floor(std::log2((greatest - least) / 8)));
    renderer.render({.camera = cameras[0], .isovalue = middle, .voxel_error = voxel_error});
    expect_same_hits(renderer.hits(),
                     twin_hits(make_frame_params(info, cameras[0], size, middle),
                               decode_with_libzfp(volume.compressed, voxel_error)),
                     size.width);
  }
}

TEST_P(RenderOnDevice, SheetsAndNoiseAtEveryRate) {
  for (const std::uint32_t rate : {1u, 4u, 32u}) {
    SCOPED_TRACE(fmt::format("rate {}", rate));
    EXPECT_GT(check(TestVolume({37, 30, 26}, test::gyroid_field(9), rate), {0.2f}, kMedium), 500u);
    EXPECT_GT(check(TestVolume({19, 22, 17}, test::noise_field(rate), rate), {0.7f}, kMedium),
              500u);
  }
}

/// At low rates zfp turns flat steps into ripples: many values near, at and beyond the isovalue.
TEST_P(RenderOnDevice, PlateausAtLowRates) {
  for (const std::uint32_t rate : {1u, 2u, 4u, 16u}) {
    SCOPED_TRACE(fmt::format("rate {}", rate));
    check(TestVolume({33, 30, 26}, test::plateau_field(), rate), {51, 102, 76.5f}, kMedium);
  }
}

TEST_P(RenderOnDevice, DimsNotMultiplesOfFour) {
  for (const glm::uvec3 dims : {glm::uvec3(17, 18, 19), {16, 5, 33}, {21, 2, 22}, {2, 2, 40}}) {
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    EXPECT_GT(check(TestVolume(dims, test::gyroid_field(8), 16), {-0.1f}, kMedium), 50u);
  }
}

TEST_P(RenderOnDevice, SaddleAndAnisotropicSpacing) {
  const glm::uvec3 dims(21, 18, 23);
  const auto voxels = test::sample(
      dims, [](const glm::dvec3 &p) { return (p.x - 9.5) * (p.y - 8.25) + 4 * (p.z - 11); });
  for (const glm::dvec3 &spacing :
       {glm::dvec3(1), glm::dvec3(1, 1, 1000), glm::dvec3(1e-3, 5e-3, 2e-3)}) {
    const TestVolume volume(test::grid_info(dims, spacing), voxels, 16);
    std::vector<Camera> cameras = orbit_cameras(volume.info(), 2);
    // And one that sees the pillar of 1:1:1000 end on.
    const glm::dvec3 extent = spacing * glm::dvec3(dims - 1u);
    const glm::dvec3 eye = extent * glm::dvec3(0.6, 0.57, -0.3);
    const double fovy =
        2 * std::atan(std::max(extent.x, extent.y) / glm::length(0.5 * extent - eye));
    cameras.push_back(camera_along(eye, 0.5 * extent - eye, {0, 1, 0}, glm::degrees(fovy)));
    EXPECT_GT(check(volume, cameras, {0, 13.25f}, kMedium), 500u);
  }
}

TEST_P(RenderOnDevice, ConstantVolumes) {
  const TestVolume volume({9, 8, 5}, [](const glm::dvec3 &) { return 3.0; });
  EXPECT_EQ(check(volume, {2.5f, volume.voxels[0], 3.5f}, kMedium), 0u);
  const TestVolume zeros({9, 8, 5}, [](const glm::dvec3 &) { return 0.0; });
  EXPECT_EQ(check(zeros, {-1, 0, 1}, kMedium), 0u);
}

/// Isovalues that are voxels: at block borders, the smallest and the largest of all, and just
/// beside them.
TEST_P(RenderOnDevice, IsovaluesExactlyAtVoxels) {
  const TestVolume volume({13, 12, 10}, test::noise_field(11), 6);
  const auto [low, high] = std::minmax_element(volume.voxels.begin(), volume.voxels.end());
  std::vector<float> isovalues{*low,
                               std::nextafter(*low, -INFINITY),
                               std::nextafter(*low, INFINITY),
                               *high,
                               std::nextafter(*high, INFINITY),
                               INFINITY,
                               -INFINITY,
                               volume.voxel(3, 4, 5),
                               volume.voxel(4, 4, 4),
                               volume.voxel(8, 7, 3)};
  EXPECT_GT(check(volume, {orbit_cameras(volume.info(), 1)[0]}, isovalues, kMedium), 50u);
}

TEST_P(RenderOnDevice, MoreDistinctValuesThanTheQuantileTableHolds) {
  // One outlier stretches the range by 1e6; the surface lives in what is left.
  const TestVolume volume(
      {30, 31, 29},
      [gyroid = test::gyroid_field(9)](const glm::dvec3 &p) {
        return p == glm::dvec3(14, 15, 2) ? 1e6 : gyroid(p);
      },
      16);
  EXPECT_GT(check(volume, {-1.2f, 0.0f, 1.3f, 5e5f}, kMedium), 1000u);
}

// ---- awkward rays

TEST_P(RenderOnDevice, EyeInsideOnVoxelsAndOnPlanes) {
  const TestVolume volume({22, 19, 25}, test::gyroid_field(11), 8);
  std::vector<Camera> cameras;
  for (const glm::dvec3 &eye :
       {glm::dvec3(8.3, 7.1, 12.9), {8, 8, 12}, {8, 7.5, 12.5}, {0, 0, 0}, {21, 9, 24}}) {
    cameras.push_back(camera_along(eye, {0.3, -0.2, 1}, {0, 1, 0}, 110));
    cameras.push_back(camera_along(eye, {0, 0, -1}, {0, 1, 0}, 110));
  }
  EXPECT_GT(check(volume, cameras, {0.05f}, {61, 41}), 1000u);
}

/// Rays exactly along axes, in cell planes and block planes, through edges and the exact centre.
TEST_P(RenderOnDevice, AxisParallelRays) {
  const TestVolume volume({17, 16, 21}, test::gyroid_field(8), 8);
  std::vector<Camera> cameras;
  for (const glm::dvec3 &through :
       {glm::dvec3(8, 7.5, 10), {8, 8, 8}, {7.5, 6.25, 9.5}, {0, 0, 0}, {16, 15, 20}}) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {1.0, -1.0}) {
        glm::dvec3 direction(0.0);
        direction[axis] = sign;
        const glm::dvec3 up = axis == 1 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
        cameras.push_back(camera_along(through - 30.0 * direction, direction, up, 40));
      }
    }
  }
  // Odd sizes have a middle column and row; even sizes straddle the planes.
  EXPECT_GT(check(volume, cameras, {0.05f}, {33, 21}), 1000u);
  EXPECT_GT(check(volume, {cameras[0], cameras[3], cameras[10]}, {0.05f}, {32, 22}), 100u);
  EXPECT_GT(check(volume, cameras, {0.05f}, {1, 1}), 5u);
}

TEST_P(RenderOnDevice, DiagonalRaysThroughEdgesAndCorners) {
  const TestVolume volume({17, 17, 17}, test::gyroid_field(8), 8);
  std::vector<Camera> cameras;
  for (const glm::dvec3 &direction :
       {glm::dvec3(1, 1, 1), {-1, 1, 1}, {1, 1, 0}, {0, -1, 1}, {-1, 0, -1}}) {
    cameras.push_back(
        camera_along(glm::dvec3(8) - 20.0 * direction, direction, {0.1, 1.0, 0.3}, 40));
  }
  EXPECT_GT(check(volume, cameras, {0.05f}, {33, 33}), 1000u);
}

TEST_P(RenderOnDevice, FarCameras) {
  const TestVolume volume({33, 34, 35}, test::gyroid_field(9), 8);
  std::vector<Camera> cameras;
  for (const double distance : {3000.0, 1e5, 5e6}) {
    const glm::dvec3 direction = glm::normalize(glm::dvec3(1.0, 0.7, -1.3));
    cameras.push_back(camera_along(glm::dvec3(16) - distance * direction, direction, {0, 1, 0},
                                   glm::degrees(2 * std::atan(17.0 / distance))));
  }
  EXPECT_GT(check(volume, cameras, {0.05f}, kMedium), 1000u);
}

TEST_P(RenderOnDevice, FlippedAndTurnedAxes) {
  const glm::uvec3 dims(18, 21, 15);
  VolumeInfo info = test::grid_info(dims, {1.0, 0.5, 2.0});
  info.origin = {-40, 7, 300};
  info.direction = glm::dmat3{{0, -1, 0}, {0.8, 0, 0.6}, {0.6, 0, -0.8}};
  EXPECT_GT(check(TestVolume(info, test::sample(dims, test::gyroid_field(8)), 8), {0.1f}, kMedium),
            500u);
}

/// Values near the ends of what zfp holds: overflow must not tell devices apart, nor denormals
/// where they are kept.
TEST_P(RenderOnDevice, TinyAndHugeValues) {
  for (const int k : {-95, -60, 60, 120}) {
    // Products of values of 2^-95 and positions in a cell are denormal, which OpenCL lets a device
    // flush (kernels_cl/README.md): no bits to compare there. llvmpipe is the one that does.
    if (k == -95 && !GetParam().capabilities.denormals) continue;
    SCOPED_TRACE(fmt::format("times 2^{}", k));
    const auto voxels = test::sample(
        {11, 12, 10},
        [k, noise = test::noise_field(5)](const glm::dvec3 &p) { return std::ldexp(noise(p), k); });
    EXPECT_GT(check(TestVolume(test::grid_info({11, 12, 10}), voxels, 16), {std::ldexp(0.25f, k)},
                    kMedium),
              500u);
  }
}

// ---- refusals

TEST_P(RenderOnDevice, BadOptionsAreErrors) {
  const TestVolume volume({9, 10, 11}, test::gyroid_field(7));
  const auto refused = [&](RendererOptions options) {
    EXPECT_THROW(DeviceRenderer(*device_, volume.compressed, options), Error);
  };
  const RendererOptions good{.size = kSmall};
  for (const std::uint32_t slots : {1u, 7u, 0x40000001u, 0xFFFFFFFFu}) {
    RendererOptions options = good;
    options.cache_slots = slots;
    SCOPED_TRACE(fmt::format("{} slots", slots));
    refused(options);
  }
  for (const std::uint32_t limit : {0u, 65u}) {
    RendererOptions options = good;
    options.max_speculation = limit;
    SCOPED_TRACE(fmt::format("speculation {}", limit));
    refused(options);
  }
  for (const std::uint32_t group : {0u, 1u, 4u, 48u, 512u, 0x80000000u}) {
    RendererOptions options = good;
    options.group_size = group;
    SCOPED_TRACE(fmt::format("groups of {}", group));
    refused(options);
  }
  for (const ImageSize size : {ImageSize{0, 8},
                               {8, 0},
                               {1u << 15, 1u << 14},
                               {0xFFFFFFFFu, 0xFFFFFFFFu},
                               {1u << 12, 1u << 11, 6},
                               {8, 8, 0},
                               {8, 8, 9},
                               {1, 1, 0xFFFFFFFFu}}) {
    SCOPED_TRACE(fmt::format("{}x{}, {} samples", size.width, size.height, size.samples));
    refused({.size = size});
  }
  EXPECT_EQ(device_->ledger().current(), 0u) << "nothing is left behind";
}

TEST_P(RenderOnDevice, BadFramesAreErrorsAndTheNextIsRight) {
  const TestVolume volume({9, 10, 11}, test::gyroid_field(7));
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer renderer(*device_, volume.compressed, {.size = kSmall});
  EXPECT_THROW(renderer.render({camera, NAN}), Error);
  for (const Camera &bad :
       {Camera{camera.eye, camera.eye, camera.up}, Camera{camera.eye, camera.at, {0, 0, 0}},
        Camera{camera.eye, camera.at, camera.at - camera.eye},
        Camera{camera.eye, camera.at, camera.up, 180.0},
        Camera{camera.eye, camera.at, camera.up, 0.0}, Camera{{NAN, 0, 0}, camera.at, camera.up},
        Camera{{1e9, 0, 0}, camera.at, camera.up}}) {
    EXPECT_THROW(renderer.render({bad, 0.1f}), Error);
  }
  renderer.render({camera, 0.1f});
  expect_same_hits(renderer.hits(), twin_hits(volume, camera, kSmall, 0.1f), kSmall.width);
}

}  // namespace
}  // namespace isowave::core
