// Ambient rays and rays of any origin: directions and geometry against plain double precision, then
// whole frames of devices and the host against the twin.

#include "core/stages/ambient.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "core/base/error.hpp"
#include "core/frame/timed_renderer.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/view/detail.hpp"
#include "reference/random.hpp"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/ray_cases.hpp"
#include "tests/test_devices.hpp"
#include "tests/test_pipelines.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;
using testing::Each;
using testing::HasSubstr;

constexpr float kIsovalue = 0.2f;
constexpr ImageSize kFrame{37, 29};

glm::dvec3 to_vec(const AmbientDirection &d) {
  return {d.x, d.y, d.z};
}

glm::dvec3 direction_of(Random &random) {
  const auto d = random.direction();
  return {d[0], d[1], d[2]};
}

// ---- the directions

TEST(AmbientDirections, AreDistributedByTheirCosine) {
  for (const std::uint32_t num_rays : {1u, 2u, 7u, 16u, 255u}) {
    SCOPED_TRACE(num_rays);
    const auto directions = make_ambient_directions(num_rays);
    ASSERT_EQ(directions.size(), num_rays * ISO_AMBIENT_PATTERNS);
    glm::dvec3 mean(0);
    for (const AmbientDirection &d : directions) {
      EXPECT_NEAR(glm::length(to_vec(d)), 1, 1e-6);
      EXPECT_GT(d.z, 0);
      mean += to_vec(d) / double(directions.size());
    }
    // The cosine's mean is 2/3: the midpoint rule for the integral of sqrt(1 - u) is off by no more
    // than a step of u. Turned by whole parts of a circle, those of one k would add up to 0, were
    // their radii the same: these differ by sqrt((k + 1) / n) - sqrt(k / n), whose mean is 1/n.
    EXPECT_NEAR(mean.z, 2.0 / 3, 1.0 / double(directions.size()));
    EXPECT_LE(std::hypot(mean.x, mean.y), 1.0 / num_rays);
  }
}

TEST(AmbientDirections, ATileHasAllPatterns) {
  FrameParams frame{};
  frame.view.width = 13;  // so that rows do not begin with a tile
  for (const auto &[x, y] : {std::pair(0u, 0u), {1u, 2u}, {9u, 3u}}) {
    std::set<uint> patterns;
    for (uint i = 0; i < 16; ++i)
      patterns.insert(ambient_pattern(&frame, x + i % 4 + frame.view.width * (y + i / 4)));
    EXPECT_EQ(patterns.size(), ISO_AMBIENT_PATTERNS);
    EXPECT_EQ(*patterns.rbegin(), ISO_AMBIENT_PATTERNS - 1);
  }
}

TEST(AmbientDirections, TooManyAreRefused) {
  check_ambient_rays(ISO_MAX_AMBIENT_RAYS);
  EXPECT_THAT([] { check_ambient_rays(256); },
              testing::ThrowsMessage<Error>(HasSubstr("256 ambient rays of a hit are too many")));
}

// ---- where rays begin, and where they go

/// In a world of unequal, turned and sheared axes: half a voxel above the hit, on the side of the
/// eye, and at the angle to the normal that the direction says.
TEST(AmbientRays, BeginAboveTheHitAndLeaveByTheNormal) {
  VolumeInfo info = test::grid_info({20, 20, 20}, {0.5, 2, 1.25});
  info.direction =
      glm::dmat3(glm::normalize(glm::dvec3(1, 0.2, -0.1)), glm::normalize(glm::dvec3(-0.3, 1, 0.4)),
                 glm::normalize(glm::dvec3(0.1, -0.2, -1)));
  const glm::dmat3 to_world = info.index_to_world();
  const FrameParams frame = make_frame_params(info, orbit_cameras(info, 3)[1], {8, 6}, kIsovalue);
  const AmbientParams params = make_ambient_params(info, 9);
  const auto directions = make_ambient_directions(9);
  Random random(4);
  for (uint pixel = 0; pixel < 48; ++pixel) {
    HitRecord hit = no_hit();
    hit.t = 1;
    hit.block_id = block_id_at(&frame, pixel % 5, pixel % 4, pixel % 3);
    hit.cell = pixel;
    hit.x = 0.25f;
    hit.y = 0.5f;
    hit.z = 0.75f;
    const glm::dvec3 gradient = direction_of(random) * std::exp2(random.in(-60, 60));
    hit.grad_x = float(gradient.x);
    hit.grad_y = float(gradient.y);
    hit.grad_z = float(gradient.z);
    const glm::dvec3 at(4 * (pixel % 5) + (pixel & 3) + 0.25,
                        4 * (pixel % 4) + (pixel >> 2 & 3) + 0.5,
                        4 * (pixel % 3) + (pixel >> 4) + 0.75);
    const Ray ray = make_ray(&frame, pixel);
    const glm::dvec3 view = to_world * glm::dvec3(ray.x.d, ray.y.d, ray.z.d);
    glm::dvec3 normal = glm::normalize(glm::transpose(glm::inverse(to_world)) * gradient);
    if (glm::dot(normal, view) > 0) normal = -normal;
    for (const AmbientDirection &direction : directions) {
      const GivenRay given =
          ambient_ray(&frame, &params, placed_hit(&frame, 0, hit), pixel, 0, direction);
      const glm::dvec3 lift = glm::dvec3(given.o_x, given.o_y, given.o_z) - at;
      // Coordinates are below 32 and rounded by at most 2^-20 of a voxel.
      EXPECT_NEAR(glm::length(lift), 0.5, 1e-5);
      EXPECT_NEAR(glm::dot(glm::normalize(to_world * lift), normal), 1, 1e-5);
      const glm::dvec3 d = glm::normalize(to_world * glm::dvec3(given.d_x, given.d_y, given.d_z));
      EXPECT_NEAR(glm::dot(d, normal), direction.z, 1e-5);
      const GivenRay coarser =
          ambient_ray(&frame, &params, placed_hit(&frame, 2, hit), pixel, 0, direction);
      EXPECT_EQ(coarser.d_x, given.d_x / 4) << "voxels four times as long";
      EXPECT_EQ(coarser.level, 2u);
    }
  }
}

/// A frame's axes are at right angles: what two directions enclose does not change.
TEST(AmbientRays, KeepAnglesBetweenDirections) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const glm::vec3 n(i == 0 ? glm::dvec3(0, 0, -1) : direction_of(random)),
        a(direction_of(random)), b(direction_of(random));
    const AmbientDirection u = around({n.x, n.y, n.z}, {a.x, a.y, a.z}),
                           v = around({n.x, n.y, n.z}, {b.x, b.y, b.z});
    EXPECT_NEAR(glm::dot(to_vec(u), to_vec(v)), glm::dot(a, b), 1e-5);
    EXPECT_NEAR(glm::dot(to_vec(u), glm::dvec3(n)), a.z, 1e-5);
  }
}

// ---- frames

OpenCounts open_of_twin(const TestVolume &volume, const Camera &camera, ImageSize size,
                        float isovalue, std::uint32_t num_rays) {
  const Twin twin(volume.compressed);
  return twin.open(camera, size, isovalue, twin.render(camera, size, isovalue),
                   {.num_ambient = num_rays});
}

/// No ray that leaves a ball from outside meets it, and none that is inside leaves.
TEST(AmbientTwin, ABallIsOpenOutsideAndClosedInside) {
  const glm::uvec3 dims(40);
  const TestVolume ball(
      dims, [](const glm::dvec3 &v) { return glm::length(v - 19.5) / 40; }, 16);
  const Twin twin(ball.compressed);
  for (const bool inside : {false, true}) {
    const Camera camera = inside ? test::camera_along(glm::dvec3(19.5), {1, 0.1, 0.2})
                                 : orbit_cameras(ball.info(), 1)[0];
    const std::vector<HitRecord> hits = twin.render(camera, kFrame, 0.3f);
    const OpenCounts open = twin.open(camera, kFrame, 0.3f, hits, {.num_ambient = 12});
    ASSERT_GT(test::num_hits(hits), 100u);
    for (std::size_t i = 0; i < hits.size(); ++i)
      ASSERT_EQ(open.counts[i], std::isfinite(hits[i].t) && !inside ? 12 : 0) << "pixel " << i;
  }
}

class AmbientOnDevice : public testing::TestWithParam<PipelineOnDevice> {
 protected:
  static TestVolume volume_of_test() { return {{30, 27, 33}, test::gyroid_field(11)}; }

  /// Each camera twice by one renderer.
  void expect_frames(const CompressedVolume &volume, const std::vector<Camera> &cameras,
                     RendererOptions options, std::uint32_t num_rays, double voxel_pixels = 0) {
    SCOPED_TRACE(fmt::format("{} slots, {} pixels", options.cache_slots, voxel_pixels));
    options.with_given_rays = true;
    options.with_levels = voxel_pixels > 0;
    const Twin twin(volume, voxel_pixels);
    DeviceRenderer renderer(device_, volume, GetParam().with(options));
    for (const Camera &camera : cameras) {
      const auto hits = twin.render(camera, options.size, kIsovalue);
      const OpenCounts open =
          twin.open(camera, options.size, kIsovalue, hits, {.num_ambient = num_rays});
      EXPECT_GT(std::set<uchar>(open.counts.begin(), open.counts.end()).size(), 2u)
          << "all is open, or closed";
      for (int again = 0; again < 2; ++again) {
        const FrameStats stats = renderer.render({.camera = camera,
                                                  .isovalue = kIsovalue,
                                                  .voxel_pixels = voxel_pixels,
                                                  .ambient_rays = num_rays});
        expect_same_hits(renderer.hits(), hits, options.size.ray_columns());
        EXPECT_EQ(renderer.open().num_ambient, num_rays);
        EXPECT_EQ(renderer.open().counts, open.counts);
        EXPECT_GE(stats.ambient.passes, num_rays);
        EXPECT_LE(stats.ambient.ms, stats.total_ms);
        if (voxel_pixels > 0) continue;
        const FrameParams frame = make_frame_params(volume.info, camera, options.size, kIsovalue);
        const ShadeParams shading = make_shade_params(volume.info, {});
        const Image8 picture = shade_scalar(frame, shading, hits, options.size.samples, open);
        EXPECT_EQ(renderer.shade().pixels, picture.pixels);
        EXPECT_NE(picture.pixels, shade_scalar(frame, shading, hits, options.size.samples).pixels);
      }
    }
    EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
  }

  ocl::Device device_{GetParam().device};
};
INSTANTIATE_TEST_SUITE_P(Devices, AmbientOnDevice, testing::ValuesIn(pipelines_under_test()),
                         pipeline_test_name);

TEST_P(AmbientOnDevice, SmallFrames) {
  const TestVolume volume({14, 15, 13}, test::gyroid_field(6));
  expect_frames(volume.compressed, {orbit_cameras(volume.info(), 1)[0]}, {.size = {8, 6}}, 3);
}

TEST_P(AmbientOnDevice, FramesOfOneLevel) {
  const TestVolume volume = volume_of_test();
  std::vector<Camera> cameras = orbit_cameras(volume.info(), 2);
  cameras.push_back(test::camera_along({15, 14, 16}, {0.3, 1, 0.2}));  // inside
  expect_frames(volume.compressed, cameras, {.size = kFrame}, 5);
  expect_frames(volume.compressed, {cameras[1]}, {.size = {13, 9, 2}}, 4);
}

TEST_P(AmbientOnDevice, FramesWithHardlyAnyMemory) {
  const TestVolume volume = volume_of_test();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  expect_frames(volume.compressed, {camera}, {.size = {15, 11}, .cache_slots = 8}, 2);
  expect_frames(volume.compressed, {camera},
                {.size = kFrame, .cache_slots = 40, .stream = StreamPlace::kHost}, 2);
}

TEST_P(AmbientOnDevice, FramesOfSeveralLevels) {
  if (!GetParam().pipeline->has_levels()) GTEST_SKIP() << "draws one level";
  const glm::uvec3 dims(50, 44, 60);
  ArrayReader reader(test::grid_info(dims), test::sample(dims, test::gyroid_field(14)));
  const CompressedVolume volume = compress(reader, CompressOptions{.rate = 8, .levels = 0});
  const std::vector<Camera> cameras = orbit_cameras(volume.info, 2);
  for (const double voxel_pixels : {0.7, 6.0})  // several levels, and a coarser one alone
    expect_frames(volume, cameras, {.size = kFrame}, 3, voxel_pixels);
}

/// Cut short in every pass: the picture shows the rays that are through, and the next frame is as
/// if that had not been.
TEST_P(AmbientOnDevice, CancelledRoundsLeaveNoTrace) {
  const TestVolume volume = volume_of_test();
  const auto cameras = orbit_cameras(volume.info(), 2);
  const auto next = test::twin_hits(volume, cameras[1], kFrame, 0.1f);
  const auto hits = test::twin_hits(volume, cameras[0], kFrame, kIsovalue);
  DeviceRenderer renderer(
      device_, volume.compressed,
      GetParam().with({.size = kFrame, .cache_slots = 60, .with_given_rays = true}));
  FrameRequest request{.camera = cameras[0], .isovalue = kIsovalue, .ambient_rays = 3};
  const FrameStats whole = renderer.render(request);
  const std::uint32_t before = std::uint32_t(whole.passes.size()) + whole.normals.passes;
  std::set<std::uint32_t> shown;
  // After any number of passes: on a GPU, frames of so few slots do not all take as many.
  for (std::uint32_t stop = before / 2;; ++stop) {
    renderer.clear_cache();
    std::uint32_t passes = 0;
    request.on_pass = [&](const PassStats &) { return passes++ < stop; };
    const FrameStats stats = renderer.render(request);
    if (!stats.cancelled) break;
    if (stats.ambient.passes > 0) {
      expect_same_hits(renderer.hits(), hits, kFrame.width);
      const std::uint32_t rounds = renderer.open().num_ambient;
      EXPECT_LT(rounds, 3u);
      shown.insert(rounds);
      renderer.shade();
    }
    renderer.render({cameras[1], 0.1f});
    expect_same_hits(renderer.hits(), next, kFrame.width);
    EXPECT_EQ(renderer.open().num_ambient, 0u);
  }
  EXPECT_GE(shown.size(), 1u);
}

TEST_P(AmbientOnDevice, PicturesWithinATimeHaveThemWhenWhole) {
  const TestVolume volume = volume_of_test();
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer renderer(
      device_, volume.compressed,
      GetParam().with({.size = kFrame, .with_kept_picture = true, .with_given_rays = true}));
  const FrameRequest request{.camera = camera, .isovalue = kIsovalue, .ambient_rays = 3};
  renderer.render(request);
  const Image8 whole = renderer.shade();
  TimedRenderer frames(renderer);
  const FrameStats drawn = frames.render(within_ms(1e9, request));
  EXPECT_TRUE(drawn.complete);
  EXPECT_EQ(renderer.shade().pixels, whole.pixels);
  EXPECT_GT(drawn.ambient.passes, 0u);
  TimedRenderer hurried(renderer);
  EXPECT_EQ(hurried.render(within_ms(1e-6, request)).ambient.passes, 0u);
  EXPECT_EQ(renderer.open().num_ambient, 0u) << "of an enlarged picture";
}

TEST_P(AmbientOnDevice, RaysOfAnyOriginHitWhatTheHostFinds) {
  const TestVolume volume = volume_of_test();
  HostRenderer host(volume.compressed);
  Random random(8);
  std::vector<WorldRay> rays;
  for (int i = 0; i < 3000; ++i)
    rays.push_back({direction_of(random) * random.in(0, 40) + 14.0,
                    direction_of(random) * std::exp2(random.in(-20, 20))});
  for (int axis = 0; axis < 3; ++axis) {  // along axes and planes
    glm::dvec3 direction(0);
    direction[axis] = 2;
    rays.push_back({glm::dvec3(8), direction});
    rays.push_back({glm::dvec3(12.5), -direction});
  }
  // More rays than the picture has, of a cache that a part of them turns over.
  DeviceRenderer renderer(
      device_, volume.compressed,
      GetParam().with({.size = kFrame, .cache_slots = 200, .with_given_rays = true}));
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  renderer.render({.camera = camera, .isovalue = 0.1f, .ambient_rays = 2});
  const Image8 picture = renderer.shade();
  for (const Normals normals : {Normals::kSmooth, Normals::kCell}) {
    const std::vector<HitRecord> expected = host.cast_rays(rays, kIsovalue, normals);
    ASSERT_GT(test::num_hits(expected), 1000u);
    expect_same_hits(renderer.cast_rays(rays, kIsovalue, normals), expected, 1);
  }
  const std::vector<WorldRay> one(rays.begin(), rays.begin() + 1);
  expect_same_hits(renderer.cast_rays(one, kIsovalue, Normals::kSmooth),
                   host.cast_rays(one, kIsovalue, Normals::kSmooth), 1);
  EXPECT_TRUE(renderer.cast_rays({}, kIsovalue, Normals::kSmooth).empty());
  EXPECT_EQ(renderer.shade().pixels, picture.pixels) << "the last frame's";
}

TEST_P(AmbientOnDevice, SmallMistakesAreOneLine) {
  const TestVolume volume({9, 9, 9}, test::gyroid_field(6));
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  DeviceRenderer without(device_, volume.compressed, GetParam().with({.size = {4, 4}}));
  EXPECT_THAT([&] { without.render({.camera = camera, .isovalue = 0, .ambient_rays = 1}); },
              testing::ThrowsMessage<Error>(HasSubstr("made with_rays")));
  EXPECT_THAT([&] { without.cast_rays({}, 0, Normals::kCell); },
              testing::ThrowsMessage<Error>(HasSubstr("made with_rays")));
  DeviceRenderer renderer(device_, volume.compressed,
                          GetParam().with({.size = {4, 4}, .with_given_rays = true}));
  EXPECT_THAT([&] { renderer.render({.camera = camera, .isovalue = 0, .ambient_rays = 256}); },
              testing::ThrowsMessage<Error>(HasSubstr("too many")));
  EXPECT_THAT([&] { renderer.cast_rays({}, NAN, Normals::kCell); },
              testing::ThrowsMessage<Error>(HasSubstr("NaN")));
  const std::vector<WorldRay> bad(1, {glm::dvec3(0), glm::dvec3(0)});
  EXPECT_THAT([&] { renderer.cast_rays(bad, 0, Normals::kCell); },
              testing::ThrowsMessage<Error>(HasSubstr("ray 0 has no direction")));
}

TEST(AmbientHost, FramesEqualTheTwin) {
  const TestVolume volume({30, 27, 33}, test::gyroid_field(11));
  HostRenderer host(volume.compressed);
  for (const ImageSize size : {kFrame, ImageSize{13, 9, 2}}) {
    for (const Camera &camera : orbit_cameras(volume.info(), 2)) {
      const OpenCounts open = open_of_twin(volume, camera, size, kIsovalue, 5);
      const FrameRequest request{
          .camera = camera, .isovalue = kIsovalue, .size = size, .ambient_rays = 5};
      const FrameStats stats = host.render(request);
      EXPECT_EQ(host.open().counts.size(), open.counts.size());
      const std::vector<HitRecord> hits = host.hits();
      for (std::size_t i = 0; i < open.counts.size(); ++i) {
        if (std::isfinite(hits[i].t)) {
          ASSERT_EQ(host.open().counts[i], open.counts[i]);
        }
      }
      const FrameParams frame = make_frame_params(volume.info(), camera, size, kIsovalue);
      const ShadeParams shading = make_shade_params(volume.info(), {});
      EXPECT_EQ(host.shade().pixels, shade_scalar(frame, shading, hits, size.samples, open).pixels);
      EXPECT_GT(stats.ambient.ms, 0);
    }
  }
}

/// Bands of the picture that have no ambient rays yet are open.
TEST(AmbientHost, CanBeStoppedBetweenBands) {
  const TestVolume volume({30, 27, 33}, test::gyroid_field(11));
  HostRenderer host(volume.compressed, {.num_threads = 1});
  FrameRequest request{.camera = orbit_cameras(volume.info(), 1)[0],
                       .isovalue = kIsovalue,
                       .size = ImageSize{128, 96},
                       .ambient_rays = 2};
  host.render(request);
  const OpenCounts whole = host.open();
  std::size_t passes = 0;
  request.on_pass = [&](const PassStats &pass) {
    passes += pass.completed_percent == 100;
    return passes < 4;  // the last band of the hits, and three of ambient rays
  };
  const FrameStats stats = host.render(request);
  EXPECT_TRUE(stats.cancelled);
  EXPECT_EQ(stats.ambient.passes, 3u);
  const OpenCounts part = host.open();
  const std::size_t done = 3 * 16 * 128;
  EXPECT_TRUE(std::equal(whole.counts.begin(), whole.counts.begin() + done, part.counts.begin()));
  EXPECT_THAT(std::vector(part.counts.begin() + done, part.counts.end()), Each(2));
  EXPECT_THAT([&] { host.render({.size = kFrame, .ambient_rays = 256}); },
              testing::ThrowsMessage<Error>(HasSubstr("too many")));
}

}  // namespace
}  // namespace isowave::core
