// A sample of a frame's rays, and the detail that is chosen by it.

#include "core/accuracy/ray_sample.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <random>

#include "core/accuracy/bounded_renderer.hpp"
#include "core/accuracy/with_choices.hpp"
#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/view/color_maps.hpp"
#include "kernels_cl/portable/grid_dda.h"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// All levels of detail, and no bounds of errors.
CompressedVolume levels_of_field(const glm::uvec3 &dims, const test::VoxelFunction &field,
                                 CompressOptions how = {.rate = 16}) {
  const std::vector<float> voxels = test::sample(dims, field);
  ArrayReader reader(test::grid_info(dims), voxels);
  how.levels = 0;
  return compress(reader, how);
}

/// The frame's ray at the place of a sample's ray; none if it is beside the picture.
std::optional<std::uint32_t> ray_in_frame(const View &view, ImageSize size, std::uint32_t ray) {
  const RayPlace place =
      place_of_ray(&view, static_cast<int>(ray % view.width), static_cast<int>(ray / view.width));
  const int columns = static_cast<int>(size.width * size.samples),
            rows = static_cast<int>(size.height * size.samples),
            column = (twice_u(&view, place.column) + columns - 1) / 2,
            row = (rows - 1 - twice_v(&view, place.row)) / 2;
  if (column < 0 || row < 0 || column >= columns || row >= rows) return {};
  return static_cast<std::uint32_t>(row * columns + column);
}

TEST(RaySample, IsOfTheFramesOwnRays) {
  const VolumeInfo info = test::grid_info({20, 30, 40});
  Camera camera = orbit_cameras(info, 1)[0];
  for (const bool is_parallel : {false, true}) {
    if (is_parallel) camera = in_parallel(camera);
    for (const ImageSize frame : {ImageSize{320, 240}, ImageSize{201, 90, 3}, ImageSize{7, 5}}) {
      for (const std::uint32_t stride : {1u, 3u, 7u}) {
        ImageSize size = frame;
        size.stride = stride;
        const FrameParams all = make_frame_params(info, camera, frame, 1),
                          some = make_frame_params(info, camera, size, 1);
        EXPECT_EQ(size.num_rays(), std::uint64_t{some.view.width} * some.view.height);
        std::map<std::uint32_t, int> times;
        for (std::uint32_t ray = 0; ray < size.num_rays(); ++ray) {
          const std::optional<std::uint32_t> in_frame = ray_in_frame(some.view, size, ray);
          ASSERT_EQ(is_in_picture(some.view, size, ray), in_frame.has_value());
          if (!in_frame) continue;
          EXPECT_EQ(++times[*in_frame], 1);
          const Ray expected = make_ray(&all, *in_frame), got = make_ray(&some, ray);
          EXPECT_EQ(got.x.o, expected.x.o);
          EXPECT_EQ(got.x.d, expected.x.d);
          EXPECT_EQ(got.y.d, expected.y.d);
          EXPECT_EQ(got.z.d, expected.z.d);
        }
        const double expected = double(frame.num_rays()) / (stride * stride);
        EXPECT_NEAR(double(times.size()), expected, 3 * std::sqrt(expected) + 1);
        if (stride == 1) {
          EXPECT_EQ(times.size(), frame.num_rays());
        }
      }
    }
  }
}

/// Over the squares of a large picture, all places in a square are taken about as often.
TEST(RaySample, TakesAllPlacesAlike) {
  ImageSize size{1280, 720};
  size.stride = 5;
  const VolumeInfo info = test::grid_info({20, 30, 40});
  const View view = make_view(info, orbit_cameras(info, 1)[0], size);
  std::array<int, 25> times{};
  for (int row = 0; row < int(view.height); ++row) {
    for (int column = 0; column < int(view.width); ++column) {
      const RayPlace place = place_of_ray(&view, column, row);
      ++times.at(static_cast<std::size_t>(place.column - 5 * column + 5 * (place.row - 5 * row)));
    }
  }
  const double expected = double(size.num_rays()) / 25;
  double chi_squared = 0;
  for (const int each : times) chi_squared += (each - expected) * (each - expected) / expected;
  EXPECT_LT(chi_squared, 43) << "of 24 degrees of freedom, 99 %";
}

TEST(RaySample, HasAboutTheSameSizeForAllPictures) {
  for (const ImageSize size : {ImageSize{64, 48}, ImageSize{640, 360}, ImageSize{1280, 720},
                               ImageSize{3840, 2160, 2}, ImageSize{16384, 16384}}) {
    const ImageSize sample = sample_of(size);
    EXPECT_EQ(sample.stride % 2, 1u);
    EXPECT_GE(sample.num_rays(), std::min<std::uint64_t>(size.num_rays(), 8000));
    EXPECT_LE(sample.num_rays(), 34000u);
  }
  ImageSize even{64, 48};
  even.stride = 2;
  EXPECT_THAT([&] { check_image_size(even); }, ThrowsMessage<Error>(HasSubstr("one in 2 rays")));
}

/// The probability that of n rays k or more are within, each with probability p.
double tail(int n, int k, double p) {
  double sum = 0;
  for (int i = k; i <= n; ++i)
    sum += std::exp(std::lgamma(n + 1) - std::lgamma(i + 1) - std::lgamma(n - i + 1) +
                    i * std::log(p) + (n - i) * std::log1p(-p));
  return sum;
}

TEST(RaySample, LowestShareIsClopperPearsons) {
  for (const auto &[within, hits] :
       {std::pair{299, 299}, {995, 1000}, {50, 100}, {1, 10}, {8000, 8192}}) {
    const double lowest = lowest_share(within, hits);
    EXPECT_NEAR(tail(hits, within, lowest), 0.05, 1e-6) << within << " of " << hits;
    EXPECT_LT(lowest, double(within) / hits);
  }
  EXPECT_EQ(lowest_share(0, 10), 0);
  EXPECT_FALSE(suffices({.num_hits = 298, .num_within = 298}));
  EXPECT_TRUE(suffices({.num_hits = 299, .num_within = 299}));
  EXPECT_FALSE(suffices({.num_hits = 5000, .num_within = 4950})) << "99 %, but by chance";
  EXPECT_TRUE(suffices({.num_hits = 5000, .num_within = 4964}));
  EXPECT_FALSE(suffices({}));
}

/// If the share of all rays is just too small, a sample says otherwise in 5 % of cases at most.
TEST(RaySample, IsRarelyWrong) {
  for (const int hits : {299, 1000, 5000}) {
    int within = hits;
    const auto is_enough = [&](int number) {
      return suffices({.num_hits = std::uint64_t(hits), .num_within = std::uint64_t(number)});
    };
    while (is_enough(within - 1)) --within;
    EXPECT_LE(tail(hits, within, kSampledShare), 0.05);
    EXPECT_GT(tail(hits, within - 1, kSampledShare), 0.05) << "and no stricter than that";
  }
}

/// Rays along -z whose hits face the eye.
SeenFrame facing(std::vector<float> depth) {
  SeenFrame frame{std::move(depth), {}, {}};
  for (const float t : frame.depth) {
    frame.normals.push_back({0, 0, 1});
    frame.positions.emplace_back(0, 0, double{-t});
  }
  return frame;
}

TEST(RaySample, HitsAreComparedAlongTheRay) {
  const Camera camera{.eye = {0, 0, 0}, .at = {0, 0, -1}, .fovy_deg = 90};
  const float no = INFINITY;  // a pixel at distance 100 is 2 units high
  const SampledShare share =
      compare_hits(camera, {1, 100}, std::array{facing({100.0f, 100.0f, no, 100.0f, no})},
                   std::array{facing({101.9f, 102.2f, no, no, 100.0f})}, 1);
  EXPECT_EQ(share.num_rays, 5u);
  EXPECT_EQ(share.num_hits, 4u);
  EXPECT_EQ(share.num_within, 1u);
}

TEST(RaySample, HitsAreComparedBesideTheRay) {
  const Camera camera{.eye = {0, 0, 0}, .at = {0, 0, -1}, .fovy_deg = 90};
  const float no = INFINITY;
  const std::array finest{facing({100, 100, 100, no, no}), facing({120, no, 120, 100, no})},
      // Between the two, behind the only one, behind both, a silhouette that moved, a false one.
      other{facing({110, 110, 125, 100, 100}), facing({100, 100, 100, no, 120})};
  EXPECT_EQ(compare_hits(camera, {1, 100}, finest, other, 1).num_within, 2u);
  EXPECT_EQ(compare_hits(camera, {1, 100}, other, finest, 1).num_within, 2u)
      << "in both directions";
}

/// Where the rays of a square picture meet a ball.
///
/// camera  at the origin
SeenFrame frame_of_ball(const Camera &camera, std::uint32_t side, const glm::dvec3 &center,
                        double radius) {
  const glm::dvec3 forward = glm::normalize(camera.at - camera.eye),
                   right = glm::normalize(glm::cross(forward, camera.up)),
                   up = glm::cross(right, forward);
  const double pixel = pixel_size_at(camera, side, 1);
  SeenFrame frame;
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::uint32_t x = 0; x < side; ++x) {
      const double u = (x + 0.5 - side / 2.0) * pixel, v = (side / 2.0 - y - 0.5) * pixel;
      const glm::dvec3 way = glm::normalize(forward + u * right + v * up);
      const double along = glm::dot(way, center),
                   in2 = along * along - glm::dot(center, center) + radius * radius;
      const double t = in2 < 0 ? INFINITY : along - std::sqrt(in2);
      const glm::dvec3 at = in2 < 0 ? glm::dvec3(0) : t * way, normal = (at - center) / radius;
      frame.depth.push_back(static_cast<float>(t));
      frame.normals.push_back({float(normal.x), float(normal.y), float(normal.z)});
      frame.positions.push_back(at);
    }
  }
  return frame;
}

std::vector<SeenFrame> frames_of_ball(const Camera &camera, std::uint32_t side, double limit,
                                      const glm::dvec3 &center, double radius) {
  std::vector<SeenFrame> seen;
  for (const Camera &beside : cameras_beside(camera, side, limit))
    seen.push_back(frame_of_ball(beside, side, center, radius));
  return seen;
}

TEST(RaySample, HitsAreWhereTheRendererSaysTheyAre) {
  const CompressedVolume volume = levels_of_field({24, 20, 22}, test::gyroid_field(9));
  HostRenderer renderer(volume);
  Camera camera = orbit_cameras(volume.info, 1)[0];
  for (const ImageSize size : {ImageSize{320, 240}, ImageSize{160, 120, 2}, ImageSize{33, 20}}) {
    const ImageSize sample = sample_of(size);
    renderer.render({.camera = camera, .isovalue = 0.3f, .size = sample});
    const SeenFrame seen = seen_frame(renderer, camera);
    const FrameArrays arrays = renderer.fetch({.positions = true}, {});
    std::size_t num_hits = 0;
    for (std::size_t ray = 0; ray < seen.depth.size(); ++ray) {
      if (std::isinf(seen.depth[ray])) continue;
      const auto &[x, y, z] = arrays.positions[ray];
      ASSERT_LT(glm::distance(seen.positions[ray], glm::dvec3(x, y, z)), 1e-4) << ray;
      ++num_hits;
    }
    EXPECT_GT(num_hits, 50u);
    camera = in_parallel(camera);
  }
}

/// A ball keeps the error if its surface moves by less: also where rays graze it, which is far
/// along the ray.
TEST(RaySample, SilhouettesMayMoveAcrossTheRay) {
  const Camera camera{.eye = {0, 0, 0}, .at = {0, 0, -1}, .fovy_deg = 60};
  constexpr std::uint32_t kSide = 200;
  const glm::dvec3 center(0, 0, -100);
  const double radius = 35;
  for (const double limit : {0.5, 1.0, 2.0, 4.0}) {
    const double pixel = pixel_size_at(camera, kSide, 100), error = limit * pixel;
    const std::vector truth = frames_of_ball(camera, kSide, limit, center, radius);
    const auto share_of = [&](const glm::dvec3 &at, double with_radius) {
      const std::vector other = frames_of_ball(camera, kSide, limit, at, with_radius);
      return compare_hits(camera, {kSide, kSide}, truth, other, limit).share();
    };
    for (const double by : {-0.6, 0.6}) {
      EXPECT_GT(share_of(center, radius + by * error), 0.999) << limit;
      EXPECT_GT(share_of(center + glm::dvec3(by * error, 0, 0), radius), 0.999) << limit;
    }
    for (const double by : {-2.5, 2.5}) {
      EXPECT_LT(share_of(center, radius + by * error), 0.5) << limit;
      EXPECT_LT(share_of(center + glm::dvec3(by * error, 0, 0), radius), 0.99) << limit;
      EXPECT_LT(share_of(center + glm::dvec3(0, 0, by * error), radius), 0.2) << limit;
    }
    // A ball that is lost, or that stands where there is none.
    const double near = pixel_size_at(camera, kSide, 65), small = 0.3 * near;
    const std::vector ball = frames_of_ball(camera, kSide, limit, {near / 2, near / 2, -65}, small),
                      nothing = frames_of_ball(camera, kSide, limit, {0, 0, 100}, small);
    EXPECT_EQ(compare_hits(camera, {kSide, kSide}, ball, nothing, limit).num_within, 0u);
    EXPECT_EQ(compare_hits(camera, {kSide, kSide}, nothing, ball, limit).num_within, 0u);
    EXPECT_GT(compare_hits(camera, {kSide, kSide}, nothing, ball, limit).num_hits, 0u);
  }
}

FrameRequest request_by_sample(const Camera &camera, ImageSize size, float isovalue,
                               double max_surface_error) {
  FrameRequest request{.camera = camera, .isovalue = isovalue, .size = size};
  request.normals = Normals::kCell;
  request.max_surface_error = max_surface_error;
  request.by = Evidence::kSample;
  return request;
}

/// Random numbers by a seed.
struct Random {
  double between(double low, double high) { return std::uniform_real_distribution(low, high)(of); }

  std::mt19937 of;
};

/// Waves in random directions, with a little noise.
CompressedVolume random_volume(Random &random) {
  const auto side = [&] { return static_cast<std::uint32_t>(random.between(72, 108)); };
  std::vector<std::pair<glm::dvec3, double>> waves(4);
  for (auto &[direction, phase] : waves) {
    const glm::dvec3 along(random.between(-1, 1), random.between(-1, 1), random.between(-1, 1));
    direction = glm::normalize(along + 0.01) * (2 * M_PI / random.between(50, 250));
    phase = random.between(0, 6);
  }
  const double noise = random.between(0, 0.02);
  const test::VoxelFunction rough = test::noise_field(static_cast<std::uint32_t>(random.of()));
  return levels_of_field({side(), side(), side()}, [&](const glm::dvec3 &at) {
    double value = noise * rough(at);
    for (const auto &[direction, phase] : waves) value += std::sin(glm::dot(direction, at) + phase);
    return value;
  });
}

/// A view of a volume, an isovalue and an error.
FrameRequest random_request(const VolumeInfo &info, ImageSize size, Random &random) {
  Camera camera = orbit_cameras(info, 16)[static_cast<std::size_t>(random.between(0, 16))];
  camera.eye = camera.at + random.between(0.5, 1.4) * (camera.eye - camera.at);
  if (random.between(0, 1) < 0.2) camera = in_parallel(camera);
  return request_by_sample(camera, size, static_cast<float>(random.between(-1, 1)),
                           std::exp2(random.between(-1, 3)));
}

/// Share of all hits of a frame that keep an error, with a detail and at full detail.
double share_of_frame(Renderer &renderer, const FrameRequest &request, const Detail &detail,
                      double limit) {
  std::vector<SeenFrame> truth, drawn;
  for (const Camera &camera : cameras_beside(request.camera, request.size->height, limit)) {
    renderer.render(with_detail(seen_from(camera, request), {}));
    truth.push_back(seen_frame(renderer, camera));
    renderer.render(with_detail(seen_from(camera, request), detail));
    drawn.push_back(seen_frame(renderer, camera));
  }
  return compare_hits(request.camera, *request.size, truth, drawn, limit).share();
}

/// In at least 95 of 100 scenes, 99 % of all hits keep the error that was judged by a sample. A
/// judge that always says yes fails.
TEST(RaySample, PromiseHoldsInRandomScenes) {
  constexpr ImageSize kSize{320, 240};
  ASSERT_GT(sample_of(kSize).stride, 1u);
  const int num_volumes = std::getenv("ISOWAVE_LONG_TESTS") != nullptr ? 10 : 1;
  int num_kept = 0, num_coarse = 0, num_lost_always = 0;
  Random random{std::mt19937(1)};
  for (int volumes = 0; volumes < num_volumes; ++volumes) {
    const CompressedVolume volume = random_volume(random);
    HostRenderer renderer(volume);
    BoundedRenderer bounded(renderer, volume, volume.rate());
    for (int views = 0; views < 10; ++views) {
      FrameRequest request = random_request(volume.info, kSize, random);
      const double limit = request.max_surface_error.value();
      const Detail chosen = bounded.render(request).detail->detail;
      request.max_surface_error.reset();
      request.by = Evidence::kProof;
      const auto is_kept = [&](const Detail &detail) {
        return share_of_frame(renderer, request, detail, limit) >= kSampledShare;
      };
      num_coarse += chosen.voxel_pixels > 0;
      num_kept += chosen == Detail{} || is_kept(chosen);
      if (num_lost_always <= 5) num_lost_always += !is_kept({8, 0});
    }
  }
  EXPECT_GE(100 * num_kept, 95 * 10 * num_volumes);
  EXPECT_GE(num_coarse, 3 * num_volumes);
  EXPECT_GT(num_lost_always, 5) << "a judge that always says yes";
  RecordProperty("kept", num_kept);
  RecordProperty("coarse", num_coarse);
}

/// All views of a series have the detail that is chosen once, for all of them.
TEST(RaySample, SeriesHaveOneDetail) {
  const CompressedVolume volume =
      levels_of_field({64, 60, 56}, test::gyroid_field(40), {.rate = 16, .measure_error = true});
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  Camera near = orbit_cameras(volume.info, 1)[0], far = near;
  near.eye -= 0.3 * (near.eye - near.at);
  far.eye += 2.5 * (far.eye - far.at);
  for (const Evidence by : {Evidence::kSample, Evidence::kProof}) {
    FrameRequest request = request_by_sample(near, {320, 240}, 0.3f, 2);
    request.by = by;
    const Detail of_near = bounded.render(request).detail->detail;
    const Detail of_far = bounded.render(seen_from(far, request)).detail->detail;
    if (by == Evidence::kSample) {
      ASSERT_NE(of_near, of_far);
    }
    request.series = {near, far};
    const DetailChoice first = bounded.render(request).detail.value(),
                       second = bounded.render(seen_from(far, request)).detail.value();
    EXPECT_EQ(first.detail, second.detail);
    EXPECT_GT(first.total_ms, 0);
    EXPECT_EQ(second.total_ms, 0) << "chosen for the first view";
    // The order of requests does not matter, nor what was drawn before.
    BoundedRenderer other(renderer, volume, volume.rate());
    EXPECT_EQ(other.render(seen_from(far, request)).detail->detail, first.detail);
    request.isovalue = 0.1f;
    EXPECT_GT(bounded.render(request).detail->total_ms, 0) << "another isovalue";
    if (by == Evidence::kSample) {
      FrameRequest clipped = request;
      clipped.clip.planes = {{{1, 0, 0}, near.at.x}};
      EXPECT_GT(bounded.render(clipped).detail->total_ms, 0) << "another part";
    }
    request.series = {near};
    request.isovalue = 0.3f;
    EXPECT_EQ(bounded.render(request).detail->detail, of_near);
    request.max_surface_error.reset();
    request.by = Evidence::kProof;
    EXPECT_THAT([&] { bounded.render(request); }, ThrowsMessage<Error>(HasSubstr("series")));
  }
}

TEST(RaySample, NeedsNoErrors) {
  const CompressedVolume volume = levels_of_field({64, 60, 56}, test::gyroid_field(40));
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  Camera camera = orbit_cameras(volume.info, 1)[0];
  camera.eye -= 0.3 * (camera.eye - camera.at);
  FrameRequest request = request_by_sample(camera, {320, 240}, 0.3f, 2);
  const DetailChoice choice = bounded.render(request).detail.value();
  EXPECT_GT(choice.detail.voxel_pixels, 0);
  ASSERT_TRUE(choice.sample);
  EXPECT_GE(choice.sample->lowest, kSampledShare);
  EXPECT_EQ(choice.sample->lowest,
            lowest_share(choice.sample->num_within, choice.sample->num_hits));
  request.by = Evidence::kProof;
  EXPECT_THAT([&] { bounded.render(request); }, ThrowsMessage<Error>(HasSubstr("not known")));
  // Full detail is full detail.
  const FrameStats tiny = bounded.render(request_by_sample(camera, {12, 8}, 0.3f, 1));
  EXPECT_EQ(tiny.detail->detail, Detail{}) << "too few rays hit";
  EXPECT_EQ(tiny.detail->sample->lowest, 1);
}

/// Several surfaces have coarser levels if the first hits of a sample keep the error. Slices stay
/// the finest.
TEST(RaySample, SeveralSurfacesHaveOneDetail) {
  const CompressedVolume volume =
      levels_of_field({64, 60, 56}, test::gyroid_field(40), {.rate = 16, .measure_error = true});
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  const Camera camera = orbit_cameras(volume.info, 1)[0];
  FrameRequest request = request_by_sample(camera, {160, 120}, 0.3f, 2);
  request.normals = Normals::kCell;
  const Detail of_one = bounded.render(request).detail->detail;
  request.surfaces = {{0.3f, {0.9f, 0.9f, 0.2f}}};
  EXPECT_EQ(bounded.render(request).detail->detail, of_one) << "one opaque surface";
  request.surfaces = {{0.3f, {0.9f, 0.9f, 0.2f}, 0.4f}, {0.6f, {0.1f, 0.4f, 0.8f}}};
  const DetailChoice choice = bounded.render(request).detail.value();
  ASSERT_GT(choice.detail.voxel_pixels, 0);
  EXPECT_GE(choice.sample.value().lowest, kSampledShare);
  EXPECT_GE(share_of_frame(renderer, without_error(request), choice.detail, 2), kSampledShare);
  FrameRequest strict = request;
  strict.max_surface_error = 0.25;
  EXPECT_LT(bounded.render(strict).detail->detail.voxel_pixels, choice.detail.voxel_pixels)
      << "a judge that always says yes";
  FrameRequest sliced = request;
  sliced.slices = {{{{{1, 0, 0}, camera.at.x}, 1.0f}}, -1, 1, color_map("viridis")};
  EXPECT_EQ(bounded.render(sliced).detail->detail.voxel_pixels, 0);
}

TEST(RaySample, BadRequestsAreOneLine) {
  const CompressedVolume volume = levels_of_field({20, 20, 20}, test::gyroid_field(9));
  HostRenderer renderer(volume);
  BoundedRenderer bounded(renderer, volume, volume.rate());
  FrameRequest request = request_by_sample(orbit_cameras(volume.info, 1)[0], {20, 20}, 0.3f, 1);
  EXPECT_THAT([&] { renderer.render(request); }, ThrowsMessage<Error>(HasSubstr("no detail")));
  request.max_surface_error.reset();
  EXPECT_THAT([&] { bounded.render(request); },
              ThrowsMessage<Error>(HasSubstr("give max_surface_error")));
  request.by = Evidence::kProof;
  request.size->stride = 3;
  bounded.render(request);
  EXPECT_THROW(bounded.shade(), std::logic_error) << "a sample is no picture";
}

class RaySampleOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, RaySampleOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// A sample has the hits of the frame's rays, at all levels of detail, by all renderers.
TEST_P(RaySampleOnDevice, SmallSamplesHaveTheFramesHits) {
  const CompressedVolume volume = levels_of_field({30, 28, 33}, test::gyroid_field(14));
  const ImageSize frame = is_simulator(GetParam()) ? ImageSize{20, 16} : ImageSize{81, 60};
  ImageSize some = frame;
  some.stride = 3;
  ocl::Device device(GetParam());
  DeviceRenderer on_device(device, volume, {.size = frame, .with_levels = true});
  HostRenderer on_host(volume);
  TwinRenderer twin(volume, frame);
  Camera camera = orbit_cameras(volume.info, 1)[0];
  for (const bool is_parallel : {false, true}) {
    if (is_parallel) camera = in_parallel(camera);
    const View view = make_view(volume.info, camera, some);
    for (const double voxel_pixels : {0.0, 6.0}) {
      FrameRequest request{
          .camera = camera, .isovalue = 0.2f, .size = frame, .voxel_pixels = voxel_pixels};
      request.normals = Normals::kCell;
      on_host.render(request);
      const std::vector<HitRecord> all = on_host.hits();
      request.size = some;
      for (Renderer *renderer :
           {static_cast<Renderer *>(&on_device), static_cast<Renderer *>(&on_host),
            static_cast<Renderer *>(&twin)}) {
        const FrameStats stats = renderer->render(request);
        EXPECT_EQ(stats.last_level > 0, voxel_pixels > 0 && renderer != &twin);
        const std::vector<HitRecord> hits = renderer->hits();
        ASSERT_EQ(hits.size(), some.num_rays());
        std::vector<HitRecord> expected, got;
        for (std::uint32_t ray = 0; ray < hits.size(); ++ray) {
          const std::optional<std::uint32_t> in_frame = ray_in_frame(view, some, ray);
          if (!in_frame) continue;
          expected.push_back(all[*in_frame]);
          got.push_back(hits[ray]);
        }
        test::expect_same_hits(got, expected, some.ray_columns());
        EXPECT_GT(test::num_hits(got), got.size() / 5);
      }
    }
  }
}

TEST_P(RaySampleOnDevice, ChoicesAreTheSame) {
  if (is_simulator(GetParam())) GTEST_SKIP() << "too many rays";
  constexpr ImageSize kSize{320, 240};
  for (const std::uint32_t rate : {8u, 20u}) {
    const CompressedVolume volume =
        levels_of_field({64, 60, 56}, test::gyroid_field(40), {.rate = rate});
    ocl::Device device(GetParam());
    DeviceRenderer on_device(device, volume, {.size = kSize, .with_levels = true});
    HostRenderer on_host(volume);
    TwinRenderer twin(volume, kSize);
    Camera camera = orbit_cameras(volume.info, 1)[0];
    camera.eye -= 0.3 * (camera.eye - camera.at);
    for (const double error : {0.02, 2.0, 4.0}) {
      const FrameRequest request = request_by_sample(camera, kSize, 0.3f, error);
      std::vector<FrameStats> stats;
      std::vector<std::vector<float>> depths;
      for (Renderer *renderer :
           {static_cast<Renderer *>(&on_device), static_cast<Renderer *>(&on_host),
            static_cast<Renderer *>(&twin)}) {
        BoundedRenderer bounded(*renderer, volume, volume.rate());
        stats.push_back(bounded.render(request));
        depths.push_back(bounded.depth());
      }
      const DetailChoice &choice = stats.front().detail.value();
      EXPECT_EQ(choice.detail.voxel_pixels > 0, error >= 2) << error;
      if (rate < kMinPlaneRate || error == 4) {
        EXPECT_EQ(choice.detail.voxel_error > 0, rate > kMinPlaneRate);
      }
      for (std::size_t i = 1; i < stats.size(); ++i) {
        const DetailChoice &other = stats[i].detail.value();
        EXPECT_EQ(other.detail, choice.detail);
        EXPECT_EQ(other.sample->num_hits, choice.sample->num_hits);
        EXPECT_EQ(other.sample->num_within, choice.sample->num_within);
        EXPECT_EQ(other.sample->lowest, choice.sample->lowest);
        ASSERT_EQ(other.tries.size(), choice.tries.size());
        for (std::size_t k = 0; k < choice.tries.size(); ++k)
          EXPECT_EQ(other.tries[k].kept, choice.tries[k].kept);
        EXPECT_EQ(depths[i], depths.front());
      }
    }
  }
}

}  // namespace
}  // namespace isowave::core
