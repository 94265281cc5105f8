// Drawing on the host: the bits of the twin, which skips nothing, and of devices; what it refuses,
// and how it stops.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <isowave/isowave.hpp>
#include <thread>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/io/open_volume.hpp"
#include "core/platform/memory.hpp"
#include "core/render/device_renderer.hpp"
#include "core/stages/ambient.hpp"
#include "reference/random.hpp"
#include "tests/api_support.hpp"
#include "tests/frame_scene.hpp"
#include "tests/ray_cases.hpp"
#include "tests/run_program.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::error_of;
using test::expect_same_hits;
using test::TestVolume;
using test::twin_hits;
using testing::HasSubstr;

constexpr ImageSize kOdd{23, 17};  // middle rows and columns run along axes

/// Draws all isovalues from all cameras. Returns the number of hits.
std::uint64_t check(const TestVolume &volume, const std::vector<Camera> &cameras,
                    const std::vector<float> &isovalues, ImageSize size = kOdd) {
  std::uint64_t hits = 0;
  HostRenderer renderer(volume.compressed);
  for (const float isovalue : isovalues) {
    for (std::size_t view = 0; view < cameras.size(); ++view) {
      SCOPED_TRACE(fmt::format("isovalue {}, view {}", isovalue, view));
      const FrameStats stats =
          renderer.render({.camera = cameras[view], .isovalue = isovalue, .size = size});
      const auto expected = twin_hits(volume, cameras[view], size, isovalue);
      expect_same_hits(renderer.hits(), expected, size.ray_columns());
      EXPECT_EQ(stats.rays_hit, test::num_hits(expected));
      const FrameParams frame = make_frame_params(volume.info(), cameras[view], size, isovalue);
      EXPECT_EQ(
          renderer.shade().pixels,
          shade_scalar(frame, make_shade_params(volume.info(), {}), expected, size.samples).pixels);
      hits += stats.rays_hit;
    }
  }
  return hits;
}

TEST(HostRenderer, HardRaysThroughOddVolumes) {
  for (const glm::uvec3 dims : {glm::uvec3(21, 18, 23), {33, 9, 17}, {37, 38, 39}}) {
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    EXPECT_GT(check({dims, test::gyroid_field(9), 8}, hard_cameras(dims), {0.0f, 0.7f}), 2000u);
    EXPECT_GT(check({dims, test::sphere_field(dims), 12}, hard_cameras(dims), {0.4f}), 500u);
    EXPECT_GT(check({dims, test::noise_field(5), 16}, hard_cameras(dims), {0.6f}), 500u);
  }
}

TEST(HostRenderer, OneCellOneBlockAndThinVolumes) {
  for (const glm::uvec3 dims :
       {glm::uvec3(2, 2, 2), {4, 4, 4}, {5, 5, 5}, {5, 2, 9}, {2, 13, 6}, {17, 16, 2}}) {
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    const TestVolume volume(dims, test::noise_field(4), 16);
    EXPECT_GT(check(volume, orbit_cameras(volume.info(), 5), {0.1f}), 50u);
  }
}

/// Voxels of large plateaus, kept exactly, and isovalues that they equal, pass, or that are beyond
/// all.
TEST(HostRenderer, IsovaluesThatAreVoxels) {
  const glm::uvec3 dims(30, 27, 33);
  VolumeInfo info = test::grid_info(dims);
  info.type = VoxelType::kUint8;
  const TestVolume volume(info, test::sample(dims, test::plateau_field()),
                          ErrorGoal{.exact = true});
  EXPECT_GT(check(volume, orbit_cameras(info, 3), {51, 102, 102.5f, 255}), 1000u);
  EXPECT_EQ(check(volume, orbit_cameras(info, 1), {-1, 0, 256, INFINITY, -INFINITY}), 0u);
}

TEST(HostRenderer, HugeAndTinyValues) {
  const glm::uvec3 dims(19, 22, 21);
  for (const double scale : {1e-20, 1e30}) {
    SCOPED_TRACE(scale);
    const auto field = test::gyroid_field(8);
    const TestVolume volume(
        dims, [&](const glm::dvec3 &p) { return scale * field(p); }, 24);
    EXPECT_GT(check(volume, orbit_cameras(volume.info(), 3), {static_cast<float>(0.2 * scale)}),
              200u);
  }
}

TEST(HostRenderer, SpacingAndSamples) {
  VolumeInfo info = test::grid_info({14, 31, 23}, {1, 0.25, 3});
  info.origin = {100, -7, 3};
  const TestVolume volume(info, test::sample(info.dims, test::gyroid_field(10)), 8);
  for (const std::uint32_t samples : {2u, 3u, 5u})
    EXPECT_GT(check(volume, orbit_cameras(info, 2), {0.1f}, {19, 11, samples}), 200u);
}

TEST(HostRenderer, BlocksOfTheirOwnLengths) {
  const glm::uvec3 dims(26, 31, 29);
  const TestVolume volume(test::grid_info(dims), test::sample(dims, test::gyroid_field(11)),
                          ErrorGoal{.tolerance = 0.01});
  ASSERT_TRUE(volume.compressed.is_indexed());
  EXPECT_GT(check(volume, orbit_cameras(volume.info(), 3), {0.3f}), 500u);
}

/// Thousands of blocks, so that threads decode several runs, and whole macrocells are empty.
TEST(HostRenderer, RealVolumes) {
  for (const auto &[name, isovalue] :
       {std::pair("head_41x41x41_uint8.raw.gz", 60.0f), {"fuel_64x33x32_uint8.raw.gz", 10.0f}}) {
    const auto reader = open_volume(std::string(ISOWAVE_TEST_DATA "/") + name);
    const TestVolume volume(*reader, 6);
    EXPECT_GT(check(volume, orbit_cameras(volume.info(), 3), {isovalue}, {96, 64}), 1000u) << name;
  }
  const glm::uvec3 dims(130, 127, 101);
  const TestVolume volume(dims, test::sphere_field(dims), 4);
  EXPECT_GT(check(volume, orbit_cameras(volume.info(), 2), {0.8f, 0.2f}, {96, 64}), 1000u);
}

TEST(HostRenderer, FilesAndMemoryGiveTheSame) {
  const glm::uvec3 dims(70, 41, 53);
  const test::TemporaryFolder folder;
  for (const auto &goal :
       {std::optional<ErrorGoal>(), std::optional(ErrorGoal{.tolerance = 0.02})}) {
    const std::vector<float> voxels = test::sample(dims, test::gyroid_field(13));
    const TestVolume volume = goal ? TestVolume(test::grid_info(dims), voxels, *goal)
                                   : TestVolume(test::grid_info(dims), voxels, 7);
    write_zfp_file(volume.compressed, folder / "a.zfp");
    const CompressedVolume file = open_zfp_file(folder / "a.zfp");
    HostRenderer from_file(file), from_memory(volume.compressed);
    const FrameRequest request{orbit_cameras(volume.info(), 1)[0], 0.2f, kOdd};
    EXPECT_GT(from_file.render(request).rays_hit, 100u);
    from_memory.render(request);
    expect_same_hits(from_file.hits(), from_memory.hits(), kOdd.width);
  }
}

TEST(HostRenderer, BandsGrowFromTheTopAndCanBeStopped) {
  const glm::uvec3 dims(40, 40, 40);
  const TestVolume volume(dims, test::gyroid_field(9), 8);
  // Each band has a tile for each of eight turns of a thread.
  HostRenderer renderer(volume.compressed, {.num_threads = 1});
  const ImageSize size{128, 100};
  FrameRequest request{orbit_cameras(volume.info(), 1)[0], 0.2f, size};
  renderer.render(request);
  const std::vector<HitRecord> whole = renderer.hits();
  double done = 0;
  request.on_pass = [&](const PassStats &pass) {
    EXPECT_GT(pass.completed_percent, done);
    done = pass.completed_percent;
    const auto rows = static_cast<std::size_t>(std::lround(done * size.height / 100));
    const std::size_t drawn = rows * size.width;
    const std::vector<HitRecord> so_far = renderer.hits();
    EXPECT_EQ(std::memcmp(so_far.data(), whole.data(), drawn * sizeof(HitRecord)), 0);
    EXPECT_EQ(test::num_hits({so_far.begin() + std::ptrdiff_t(drawn), so_far.end()}), 0u);
    EXPECT_EQ(renderer.shade().pixels.size(), 3 * size.num_pixels());
    return true;
  };
  const FrameStats watched = renderer.render(request);
  EXPECT_EQ(done, 100);
  EXPECT_EQ(watched.passes.size(), 7u);
  EXPECT_FALSE(watched.cancelled);
  expect_same_hits(renderer.hits(), whole, size.width);

  request.on_pass = [&](const PassStats &pass) { return pass.completed_percent < 40; };
  const FrameStats stopped = renderer.render(request);
  EXPECT_TRUE(stopped.cancelled);
  EXPECT_EQ(stopped.passes.size(), 3u);
  request.on_pass = [&](const PassStats &) -> bool { throw Error("my own"); };
  EXPECT_EQ(error_of([&] { renderer.render(request); }), "my own");
  request.on_pass = [&](const PassStats &pass) { return pass.completed_percent < 100; };
  EXPECT_FALSE(renderer.render(request).cancelled) << "nothing was left";
  expect_same_hits(renderer.hits(), whole, size.width);
}

/// Rays of any origin and direction, the last ones along axes and in planes of cells.
std::vector<WorldRay> any_rays(const glm::uvec3 &dims, std::size_t count) {
  Random random(11);
  const glm::dvec3 extent = glm::dvec3(dims) - 1.0;
  std::vector<WorldRay> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 from =
                         extent * glm::dvec3(random.in(-1, 2), random.in(-1, 2), random.in(-1, 2)),
                     to = extent * glm::dvec3(random.in(0, 1), random.in(0, 1), random.in(0, 1));
    glm::vec3 origin(from), direction(to - from);
    if (i % 4 == 3) {
      direction[static_cast<int>(i / 4 % 3)] = 0;
      origin = glm::round(origin);
    }
    // Numbers that float32 holds, the largest component between 1/2 and 1.
    const glm::vec3 sizes = glm::abs(direction);
    direction *= 0.75f / std::max({sizes.x, sizes.y, sizes.z});
    rays.push_back({origin, direction});
  }
  return rays;
}

TEST(HostRenderer, RaysOfAnyOriginHitWhatTheTwinFinds) {
  const glm::uvec3 dims(33, 29, 37);
  const TestVolume volume(dims, test::gyroid_field(9), 12);
  HostRenderer renderer(volume.compressed);
  const std::vector<WorldRay> rays = any_rays(dims, 4000);
  FrameParams frame = make_grid_params(volume.info());
  frame.view.t_scale = 1;
  frame.surface.isovalue = 0.2f;
  std::vector<HitRecord> expected;
  for (const WorldRay &ray : rays) {
    const glm::vec3 o(ray.origin), d(ray.direction);
    expected.push_back(trace_scalar(
        frame, volume.voxels, kDefaultSolver,
        make_whole_ray(make_ray_axis(o.x, d.x), make_ray_axis(o.y, d.y), make_ray_axis(o.z, d.z))));
    const float largest = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
    ASSERT_TRUE(largest >= 0.5f && largest < 1.0f);
  }
  EXPECT_GT(test::num_hits(expected), 1000u);
  expect_same_hits(renderer.cast_rays(rays, 0.2f, Normals::kCell), expected, 1);
  smooth_gradients(frame, volume.voxels, expected);
  expect_same_hits(renderer.cast_rays(rays, 0.2f, Normals::kSmooth), expected, 1);

  // t counts in lengths of the direction.
  std::vector<WorldRay> longer = rays;
  for (WorldRay &ray : longer) ray.direction *= 8.0;
  for (HitRecord &hit : expected) hit.t /= 8;
  expect_same_hits(renderer.cast_rays(longer, 0.2f, Normals::kSmooth), expected, 1);
  EXPECT_TRUE(renderer.cast_rays({}, 0.2f, Normals::kSmooth).empty());
}

TEST(HostRenderer, RaysThatCannotBeTracedAreOneLine) {
  const TestVolume volume({20, 20, 20}, test::gyroid_field(9), 8);
  HostRenderer renderer(volume.compressed);
  const auto error_of_ray = [&](const WorldRay &ray, float isovalue = 0.2f) {
    const std::vector<WorldRay> rays = {{{0, 0, 0}, {1, 0, 0}}, ray};
    return error_of([&] { renderer.cast_rays(rays, isovalue, Normals::kCell); });
  };
  EXPECT_THAT(error_of_ray({{0, 0, 0}, {0, 0, 0}}), HasSubstr("ray 1 has no direction"));
  EXPECT_THAT(error_of_ray({{0, 0, 0}, {0, NAN, 1}}), HasSubstr("ray 1 has no direction"));
  EXPECT_THAT(error_of_ray({{0, INFINITY, 0}, {1, 0, 0}}), HasSubstr("ray 1 begins"));
  EXPECT_THAT(error_of_ray({{0, 2e7, 0}, {1, 0, 0}}), HasSubstr("ray 1 begins 2e+07 voxels"));
  EXPECT_THAT(error_of_ray({{0, 0, 0}, {1, 0, 0}}, NAN), HasSubstr("NaN"));
}

TEST(HostRenderer, MemoryIsStatedAndLimited) {
  const TestVolume volume({34, 21, 18}, test::gyroid_field(9), 8);
  // 9 x 6 x 5 blocks with two bytes of state; 3 x 2 x 2 macrocells of 64 ranges, one of their own
  // and a mask; a byte for each page of 64 float32 and of a word of 64 bits a block; 256
  // thresholds. One ray at a time needs eight blocks and their cells that change.
  const std::uint64_t page = platform::page_bytes(), blocks = 9 * 6 * 5;
  const std::uint64_t bytes = 2 * blocks + 3 * 2 * 2 * (65 * 8 + 8) +
                              (256 * blocks + page - 1) / page + (8 * blocks + page - 1) / page +
                              256 * 4;
  HostRenderer renderer(volume.compressed, {.memory_limit = bytes + 9 * page});
  EXPECT_EQ(renderer.memory_bytes(), bytes);
  EXPECT_THAT(
      error_of([&] { HostRenderer(volume.compressed, {.memory_limit = bytes + 9 * page - 1}); }),
      testing::AllOf(HasSubstr("takes 1 MiB"), HasSubstr("0 MiB are allowed")));
  CompressedVolume huge;
  huge.info = test::grid_info(glm::uvec3(65'536, 65'536, 1'000));
  EXPECT_THAT(error_of([&] { HostRenderer{huge}; }),
              HasSubstr(fmt::format("{} MiB are allowed", platform::host_memory() / 4 >> 20)));
  // Whole pages of what frames decode come on top.
  HostRenderer free(volume.compressed);
  free.render({orbit_cameras(volume.info(), 1)[0], 0.2f, kOdd});
  EXPECT_GT(free.num_decoded_blocks(), 100u);
  EXPECT_GE(free.memory_bytes(), bytes + 256 * free.num_decoded_blocks());
  EXPECT_EQ((free.memory_bytes() - bytes) % page, 0u);
  EXPECT_LE(free.memory_bytes(), bytes + (256 * blocks + page - 1) / page * page +
                                     (8 * blocks + page - 1) / page * page);
}

/// Where the blocks of a frame do not fit, they are decoded more than once: the same bits, of hits,
/// ambient rays and rays of any origin.
TEST(HostRenderer, AnyLimitGivesTheSameBits) {
  const glm::uvec3 dims(70, 41, 53);
  const TestVolume volume(dims, test::gyroid_field(13), 9);
  FrameRequest request{orbit_cameras(volume.info(), 1)[0], 0.2f, ImageSize{41, 33}};
  request.ambient_rays = 3;
  const std::vector<WorldRay> rays = any_rays(dims, 3000);
  HostRenderer whole(volume.compressed);
  whole.render(request);
  EXPECT_GT(test::num_hits(whole.hits()), 300u);
  const auto cast = whole.cast_rays(rays, 0.1f, Normals::kSmooth);
  const std::uint64_t least = HostBlocks::least_bytes(volume.info());
  std::uint64_t fewest = ~std::uint64_t{0};
  for (const std::uint64_t pages : {0, 5, 50}) {
    for (const std::uint32_t threads : {1, 2}) {
      SCOPED_TRACE(fmt::format("{} pages more, {} threads", pages, threads));
      const std::uint64_t limit = least + pages * platform::page_bytes();
      HostRenderer renderer(volume.compressed, {.memory_limit = limit, .num_threads = threads});
      for (const bool is_watched : {false, true}) {
        if (is_watched)
          request.on_pass = [&](const PassStats &) { return renderer.memory_bytes() <= limit; };
        EXPECT_FALSE(renderer.render(request).cancelled);
        request.on_pass = {};
        expect_same_hits(renderer.hits(), whole.hits(), 41);
        EXPECT_EQ(renderer.open().counts, whole.open().counts);
      }
      expect_same_hits(renderer.cast_rays(rays, 0.1f, Normals::kSmooth), cast, 1);
      EXPECT_LE(renderer.memory_bytes(), limit);
      EXPECT_GT(renderer.num_decoded_blocks(), 2 * whole.num_decoded_blocks());
      fewest = std::min(fewest, renderer.num_decoded_blocks());
    }
  }
  EXPECT_GT(fewest, whole.num_decoded_blocks());
}

TEST(HostRenderer, FurtherFramesDecodeWhatTheyDoNotFind) {
  const TestVolume volume({44, 41, 37}, test::gyroid_field(13), 9);
  HostRenderer renderer(volume.compressed);
  const FrameRequest request{orbit_cameras(volume.info(), 1)[0], 0.2f, kOdd};
  const auto decoded_by = [&] {
    const std::uint64_t before = renderer.num_decoded_blocks();
    renderer.render(request);
    return renderer.num_decoded_blocks() - before;
  };
  const std::uint64_t first = decoded_by();
  const std::vector<HitRecord> hits = renderer.hits();
  EXPECT_GT(first, 100u);
  EXPECT_EQ(decoded_by(), 0u);
  const std::uint64_t bytes = renderer.memory_bytes();
  renderer.clear_cache();
  EXPECT_EQ(decoded_by(), first);
  EXPECT_EQ(renderer.memory_bytes(), bytes);
  expect_same_hits(renderer.hits(), hits, kOdd.width);
}

/// A file that becomes shorter between two frames, and is mended.
TEST(HostRenderer, FilesThatCannotBeReadAreOneLine) {
  const TestVolume volume({44, 41, 37}, test::gyroid_field(13), 9);
  const test::TemporaryFolder folder;
  const auto path = folder / "a.zfp";
  write_zfp_file(volume.compressed, path);
  const CompressedVolume file = open_zfp_file(path);
  HostRenderer renderer(file);
  const FrameRequest request{orbit_cameras(volume.info(), 1)[0], 0.2f, kOdd};
  const std::uintmax_t size = std::filesystem::file_size(path);
  std::vector<char> bytes(size);
  std::ifstream(path, std::ios::binary).read(bytes.data(), std::streamsize(size));
  std::filesystem::resize_file(path, size / 3);
  for (int i = 0; i < 3; ++i) {
    EXPECT_THAT(error_of([&] { renderer.render(request); }), HasSubstr("a.zfp"));
    EXPECT_THAT(error_of([&] { renderer.shade(); }), HasSubstr("no picture"));
  }
  const std::vector<WorldRay> rays = any_rays(volume.info().dims, 500);
  EXPECT_THAT(error_of([&] { renderer.cast_rays(rays, 0.2f, Normals::kSmooth); }),
              HasSubstr("a.zfp"));
  EXPECT_THAT(error_of([&] { HostRenderer{file}; }), HasSubstr("a.zfp"));
  std::fstream(path, std::ios::binary | std::ios::in | std::ios::out)
      .write(bytes.data(), std::streamsize(size));
  renderer.render(request);
  HostRenderer from_memory(volume.compressed);
  from_memory.render(request);
  EXPECT_GT(test::num_hits(from_memory.hits()), 100u);
  expect_same_hits(renderer.hits(), from_memory.hits(), kOdd.width);
}

TEST(HostRenderer, RequestsThatFailAreOneLine) {
  const TestVolume volume({20, 20, 20}, test::gyroid_field(9), 8);
  HostRenderer renderer(volume.compressed);
  const FrameRequest good{orbit_cameras(volume.info(), 1)[0], 0.2f, kOdd};
  EXPECT_THAT(error_of([&] { renderer.shade(); }), HasSubstr("no picture"));
  renderer.render(good);
  const std::vector<HitRecord> hits = renderer.hits();
  const auto expect_error = [&](const char *text, const auto &change) {
    FrameRequest bad = good;
    change(bad);
    EXPECT_THAT(error_of([&] { renderer.render(bad); }), HasSubstr(text));
    expect_same_hits(renderer.hits(), hits, kOdd.width);
  };
  expect_error("NaN", [](FrameRequest &r) { r.isovalue = NAN; });
  expect_error("eye", [](FrameRequest &r) { r.camera.at = r.camera.eye; });
  expect_error("0 x 17", [](FrameRequest &r) { r.size = {0, 17}; });
  expect_error("rays a pixel", [](FrameRequest &r) { r.size = {23, 17, 9}; });
  expect_error("leave out voxel_pixels", [](FrameRequest &r) { r.voxel_pixels = 1; });
  expect_error("error is not known", [](FrameRequest &r) { r.bound = FieldBound::kUpper; });
  expect_error("leave out max_surface", [](FrameRequest &r) { r.max_surface_error = 1; });
  expect_error("leave out time_budget", [](FrameRequest &r) { r.time_budget_ms = 1; });
  const float nan = NAN;
  EXPECT_THAT(error_of([&] { renderer.camera({&nan, 1}, kOdd); }), HasSubstr("NaN"));
}

class HostRendererOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, HostRendererOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(HostRendererOnDevice, SmallFramesAreTheDevices) {
  const glm::uvec3 dims(9, 10, 11);
  const TestVolume volume(dims, test::sphere_field(dims));
  ocl::Device device(GetParam());
  const ImageSize size{12, 8};
  DeviceRenderer renderer(device, volume.compressed, {.size = size});
  HostRenderer host(volume.compressed);
  const FrameRequest request{orbit_cameras(volume.info(), 1)[0], 0.5f, size};
  EXPECT_EQ(renderer.render(request).rays_hit, host.render(request).rays_hit);
  expect_same_hits(host.hits(), renderer.hits(), size.width);
  EXPECT_EQ(host.shade().pixels, renderer.shade().pixels);
}

TEST_P(HostRendererOnDevice, WholeFramesAreThoseOfTheFrontDoor) {
  const auto volume = test::public_volume();
  isowave::Renderer renderer(isowave::open_device(std::to_string(GetParam().index)), volume,
                             {.largest = {64, 48, 2}, .with_levels = true});
  isowave::Renderer host = isowave::make_host_renderer(volume);
  isowave::FrameRequest request =
      test::public_request(orbit_cameras(test::grid_info({64, 33, 32}), 1)[0]);
  request.voxel_pixels = 2;
  const Frame expected = renderer.render(request), got = host.render(request);
  EXPECT_GT(expected.statistics.hits, 1000u);
  EXPECT_EQ(got.statistics.hits, expected.statistics.hits);
  EXPECT_EQ(got.statistics.rays, expected.statistics.rays);
  EXPECT_EQ(got.rows, expected.rows);
  EXPECT_EQ(got.picture, expected.picture);
  EXPECT_EQ(got.depth, expected.depth);
  EXPECT_EQ(got.normals, expected.normals);
  ASSERT_EQ(got.hits.size(), expected.hits.size());
  for (std::size_t i = 0; i < got.hits.size(); ++i) {
    EXPECT_EQ(got.hits[i].t, expected.hits[i].t) << i;
    EXPECT_EQ(got.hits[i].cell, expected.hits[i].cell) << i;
    EXPECT_EQ(got.hits[i].position, expected.hits[i].position) << i;
    EXPECT_EQ(got.hits[i].gradient, expected.hits[i].gradient) << i;
  }
}

/// By the blocks that a device's 8-bit ranges take as active.
TEST_P(HostRendererOnDevice, CamerasAreTheDevices) {
  const glm::uvec3 dims(61, 50, 47);
  const TestVolume fields[] = {{dims, test::sphere_field(dims), 9},
                               {dims, test::gyroid_field(40), 5},
                               {glm::uvec3(5, 2, 9), test::noise_field(4), 16}};
  ocl::Device device(GetParam());
  const ImageSize size{64, 48};
  for (const TestVolume &volume : fields) {
    DeviceRenderer renderer(device, volume.compressed, {.size = size});
    HostRenderer host(volume.compressed);
    for (const float isovalue :
         {-INFINITY, -9.0f, -0.99f, 0.0f, 0.31f, 0.5f, 0.93f, 1.2f, 7.0f, INFINITY}) {
      const Camera expected = renderer.camera({&isovalue, 1}),
                   got = host.camera({&isovalue, 1}, size);
      EXPECT_EQ(got.eye, expected.eye) << isovalue;
      EXPECT_EQ(got.at, expected.at) << isovalue;
    }
  }
}

}  // namespace
}  // namespace isowave::core
