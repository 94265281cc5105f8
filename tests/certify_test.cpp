// Bounds of a frame's error: never exceeded against the volume before compression, in double
// precision; and what is chosen by them.

#include "core/accuracy/certify.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>

#include "core/accuracy/choose_detail.hpp"
#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "core/volume/pyramid.hpp"
#include "core/zfp/level_bounds.hpp"
#include "kernels_cl/portable/grid_dda.h"
#include "reference/accuracy.hpp"
#include "reference/bound_check.hpp"
#include "reference/cell_oracle.hpp"
#include "reference/twin.hpp"
#include "tests/bounds_scene.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

namespace fs = std::filesystem;
using test::BoundsScene;
using test::camera_along;
using test::expect_same_hits;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kTiny{6, 5}, kSmall{12, 8}, kMedium{96, 64};

/// Checks each bound of a frame against the source. Returns the slack, bound / error, of pixels
/// with a hit, ascending.
std::vector<double> expect_kept(const Certificate &certificate, std::span<const HitRecord> drawn,
                                const BoundsScene &scene, const Camera &camera, ImageSize size,
                                float isovalue) {
  const FrameParams frame = make_frame_params(scene.volume.info, camera, size, isovalue);
  const glm::uvec3 dims = scene.volume.info.dims;
  const CellOracle truth(scene.source, {dims.x, dims.y, dims.z}, isovalue);
  const BoundTally tally = judge_bounds(truth, frame, drawn, certificate.bounds);
  EXPECT_EQ(tally.exceeded, 0u) << "of " << tally.hits << " and " << tally.misses;
  EXPECT_EQ(tally.hits + tally.misses + tally.uncertain, size.num_pixels());
  std::vector<double> slack = tally.slack;
  std::ranges::sort(slack);
  return slack;
}

class CertifyOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Draws a frame, checks its bounds, and counts the pixels that keep max_surface_error. Returns
  /// the hits.
  std::vector<HitRecord> certify_frame(DeviceRenderer &renderer, const BoundsScene &scene,
                                       const FrameRequest &request, double max_surface_error) {
    renderer.render(request);
    std::vector<HitRecord> drawn = renderer.hits();
    const Certificate certificate = certify(renderer, scene.volume, request, drawn);
    expect_kept(certificate, drawn, scene, request.camera, kMedium, request.isovalue);
    const CertificateSummary summary = summarize(certificate, max_surface_error);
    certified_ += summary.num_certified;
    all_ += summary.num_pixels;
    return drawn;
  }

  ocl::Device device_{GetParam()};
  std::uint64_t certified_ = 0, all_ = 0;  ///< pixels of certify_frame()
};
INSTANTIATE_TEST_SUITE_P(Devices, CertifyOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(CertifyOnDevice, SmallBoundsAreTheTwins) {
  const ImageSize size = is_simulator(device_.info()) ? kTiny : kSmall;
  const BoundsScene scene({9, 10, 11}, test::gyroid_field(9), {.rate = 6});
  const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = size, .cache_slots = 20, .with_bounds = true});
  for (const FieldBound bound : {FieldBound::kLower, FieldBound::kUpper, FieldBound::kNone}) {
    renderer.render({.camera = camera, .isovalue = 0.4f, .bound = bound});
    expect_same_hits(renderer.hits(), Twin(scene.volume, 0, 0, bound).render(camera, size, 0.4f),
                     size.width);
  }
}

TEST_P(CertifyOnDevice, BoundsOfLevelsAndPlanesAreTheTwins) {
  for (const CompressOptions &options :
       {CompressOptions{.rate = 8},
        CompressOptions{.precision = BlockPrecision{.min_exponent = -6}}}) {
    const BoundsScene scene({40, 37, 44}, test::gyroid_field(11), options);
    const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
    for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
      ocl::Device device(GetParam());
      DeviceRenderer renderer(
          device, scene.volume,
          {.size = kMedium, .stream = place, .with_levels = true, .with_bounds = true});
      EXPECT_EQ(device.ledger().current(), renderer.memory_plan().total());
      for (const double voxel_error : {0.0, 0.1}) {
        for (const FieldBound bound : {FieldBound::kUpper, FieldBound::kNone, FieldBound::kLower}) {
          renderer.render({.camera = camera,
                           .isovalue = 0.4f,
                           .voxel_pixels = 4,
                           .voxel_error = voxel_error,
                           .bound = bound});
          expect_same_hits(renderer.hits(),
                           Twin(scene.volume, 4, voxel_error, bound).render(camera, kMedium, 0.4f),
                           kMedium.width);
        }
      }
      EXPECT_EQ(device.ledger().current(), renderer.memory_plan().total());
      EXPECT_LE(device.ledger().peak(), renderer.memory_plan().peak());
    }
  }
}

TEST_P(CertifyOnDevice, NoCertifiedPixelIsFartherOff) {
  for (const glm::uvec3 &dims : {glm::uvec3(64, 60, 56), glm::uvec3(33, 48, 40)}) {
    for (const auto &field :
         {test::gyroid_field(24), test::sphere_field(dims), test::noise_field(7)}) {
      for (const CompressOptions &options :
           {CompressOptions{.rate = 8},
            CompressOptions{.precision = BlockPrecision{.min_exponent = -8}}}) {
        const BoundsScene scene(dims, field, options);
        DeviceRenderer renderer(device_, scene.volume,
                                {.size = kMedium, .with_levels = true, .with_bounds = true});
        std::vector<Camera> cameras = orbit_cameras(scene.volume.info, 2);
        cameras.push_back(camera_along({20, 18, 16}, {0.3, 0.2, 1}));  // from within
        for (const Camera &camera : cameras) {
          for (const Detail &detail :
               {Detail{0, 0}, Detail{0, 0.02}, Detail{1.5, 0}, Detail{4, 0.02}}) {
            const FrameRequest request = with_detail({camera, 0.3f}, detail);
            const std::vector<HitRecord> drawn = certify_frame(renderer, scene, request, 10);
            renderer.render(request);  // and the volume is drawn again
            expect_same_hits(renderer.hits(), drawn, kMedium.width);
          }
        }
      }
    }
  }
  EXPECT_GT(2 * certified_, all_) << "too few for a test";
}

TEST_P(CertifyOnDevice, RealVolumes) {
  for (const char *file : {"fuel_64x33x32_uint8.raw.gz", "head_41x41x41_uint8.raw.gz"}) {
    const BoundsScene scene(file, {.rate = 8});
    DeviceRenderer renderer(device_, scene.volume,
                            {.size = kMedium, .with_levels = true, .with_bounds = true});
    for (const float isovalue : {20.0f, 80.0f, 160.0f}) {
      for (const Camera &camera : orbit_cameras(scene.volume.info, 3)) {
        for (const double voxel_pixels : {0.0, 2.0}) {
          certify_frame(renderer, scene,
                        {.camera = camera, .isovalue = isovalue, .voxel_pixels = voxel_pixels}, 4);
        }
      }
    }
  }
  EXPECT_GT(2 * certified_, all_) << "too few for a test";
}

/// From so far that most of an error is what t loses in float32.
TEST_P(CertifyOnDevice, FarAway) {
  const BoundsScene scene(
      "head_41x41x41_uint8.raw.gz",
      {.precision = BlockPrecision{.min_exponent = -16, .max_voxel_error = 0x1p-16}});
  Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  camera.eye = camera.at + 700.0 * (camera.eye - camera.at);
  camera.fovy_deg /= 700;
  DeviceRenderer renderer(device_, scene.volume, {.size = kMedium, .with_bounds = true});
  renderer.render({camera, 80});
  const std::vector<HitRecord> drawn = renderer.hits();
  const std::vector<double> slack = expect_kept(
      certify(renderer, scene.volume, {camera, 80}, drawn), drawn, scene, camera, kMedium, 80);
  ASSERT_GT(slack.size(), 500u);
  EXPECT_LT(slack[0], 3) << "farther off than rounding explains";
}

/// Voxels are exact, and the eye is among them: what is left is mostly what float32 loses of
/// values.
TEST_P(CertifyOnDevice, ExactVolumes) {
  const auto noise = [field = test::noise_field(3)](const glm::dvec3 &at) mutable {
    return std::rint(127.5 + 127.5 * field(at));
  };
  const BoundsScene scene({40, 40, 40}, noise,
                          {.precision = BlockPrecision{
                               .min_exponent = -6, .whole_numbers = true, .max_voxel_error = 0}});
  DeviceRenderer renderer(device_, scene.volume, {.size = kMedium, .with_bounds = true});
  for (const double x : {12.0, 19.0, 26.0}) {
    for (const glm::dvec3 &direction : {glm::dvec3{0.2, 0.3, 1}, glm::dvec3{1, -0.2, 0.1}}) {
      const Camera camera = camera_along({x, 20, 21}, direction);
      for (const float isovalue : {60.0f, 120.5f})
        certify_frame(renderer, scene, {camera, isovalue}, 0.01);
    }
  }
  EXPECT_GT(all_, 10000u);
  EXPECT_GT(20 * certified_, 19 * all_);
}

/// The goal is that half of the pixels have a bound of at most 8 times their error.
TEST_P(CertifyOnDevice, BoundsAreTight) {
  for (const CompressOptions &options :
       {CompressOptions{.rate = 4}, CompressOptions{.precision = BlockPrecision{.min_exponent = -6,
                                                                 .max_voxel_error = 0.015625}}}) {
    const BoundsScene scene({96, 96, 96}, test::gyroid_field(48), options);
    DeviceRenderer renderer(device_, scene.volume,
                            {.size = kMedium, .with_levels = true, .with_bounds = true});
    const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
    for (const double voxel_pixels : {0.0, 2.0}) {
      const FrameRequest request{.camera = camera, .isovalue = 0.3f, .voxel_pixels = voxel_pixels};
      renderer.render(request);
      const std::vector<HitRecord> drawn = renderer.hits();
      const Certificate certificate = certify(renderer, scene.volume, request, drawn);
      const std::vector<double> slack =
          expect_kept(certificate, drawn, scene, camera, kMedium, 0.3f);
      ASSERT_GT(slack.size(), 100u);
      // The error of a coarse level changes its sign between voxels: there, only the larger errors
      // say how tight a bound is.
      EXPECT_LT(voxel_pixels == 0 ? slack[slack.size() / 2] : slack[slack.size() / 10], 8);
      const CertificateSummary summary = summarize(certificate, 1e9);
      EXPECT_GT(summary.num_certified, summary.num_pixels * 7 / 10) << voxel_pixels;
    }
  }
}

/// The judge of the other tests: bounds that promise too much do not pass.
TEST_P(CertifyOnDevice, BoundsThatPromiseTooMuchAreFound) {
  const BoundsScene scene({33, 48, 40}, test::gyroid_field(24), {.rate = 4});
  const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  DeviceRenderer renderer(device_, scene.volume, {.size = kMedium, .with_bounds = true});
  renderer.render({camera, 0.3f});
  const std::vector<HitRecord> drawn = renderer.hits();
  const std::vector<float> bounds = certify(renderer, scene.volume, {camera, 0.3f}, drawn).bounds;
  const CellOracle truth(scene.source, {33, 48, 40}, 0.3f);
  const FrameParams frame = make_frame_params(scene.volume.info, camera, kMedium, 0.3f);
  const auto exceeded = [&](const std::function<float(float)> &change) {
    std::vector<float> changed = bounds;
    std::ranges::transform(changed, changed.begin(), change);
    return judge_bounds(truth, frame, drawn, changed).exceeded;
  };
  EXPECT_EQ(exceeded([](float bound) { return bound; }), 0u);
  EXPECT_GT(exceeded([](float bound) { return bound / 1000; }), 100u);
  EXPECT_GT(exceeded([](float) { return 0.0f; }), 100u) << "hits that are said to miss";
  EXPECT_GT(exceeded([](float bound) { return bound == 0 ? 1.0f : bound; }), 100u)
      << "and the other way";
  EXPECT_THROW(judge_bounds(truth, frame, drawn, {}), std::invalid_argument);
}

TEST_P(CertifyOnDevice, ChoosesLessForMore) {
  const glm::uvec3 dims(96, 96, 96);
  const BoundsScene scene(dims, test::sphere_field(dims),
                          {.precision = BlockPrecision{.min_exponent = -10}});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kMedium, .with_levels = true, .with_bounds = true});
  Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  camera.eye += 0.35 * (camera.eye - camera.at);  // so far that levels spare most blocks
  double voxel_pixels = -1, voxel_error = -1;
  for (const double max_surface_error : {0.00005, 0.05, 1.0, 4.0}) {
    const DetailChoice choice =
        choose_detail(renderer, scene.volume, {camera, 0.5f}, max_surface_error);
    EXPECT_GE(choice.detail.voxel_pixels, voxel_pixels);
    if (choice.detail.voxel_pixels == voxel_pixels) {
      EXPECT_GE(choice.detail.voxel_error, voxel_error);
    }
    voxel_pixels = choice.detail.voxel_pixels;
    voxel_error = choice.detail.voxel_error;
    if (max_surface_error == 0.00005) {
      EXPECT_FALSE(choice.reachable);
      ASSERT_TRUE(choice.tolerance);
      EXPECT_LT(*choice.tolerance, *scene.volume.max_voxel_error);
      EXPECT_EQ(voxel_pixels, 0);
    } else {
      EXPECT_TRUE(choice.reachable);
      const FrameRequest request = with_detail({camera, 0.5f}, choice.detail);
      renderer.render(request);
      const std::vector<HitRecord> drawn = renderer.hits();
      const CertificateSummary summary =
          summarize(certify(renderer, scene.volume, request, drawn), max_surface_error);
      EXPECT_GE(double(summary.num_certified) / double(summary.num_pixels),
                choice.tries[0].kept - kLostShare)
          << "a picture so small is tried as it is";
    }
  }
  EXPECT_GT(voxel_pixels, 0);
}

TEST_P(CertifyOnDevice, LeavesOutPlanesOfManyBitsOnly) {
  for (const std::uint32_t rate : {8u, 16u, 24u}) {
    const BoundsScene scene({48, 48, 48}, test::gyroid_field(24), {.rate = rate});
    DeviceRenderer renderer(device_, scene.volume,
                            {.size = kMedium, .with_levels = true, .with_bounds = true});
    const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
    const DetailChoice choice = choose_detail(renderer, scene.volume, {camera, 0.3f}, 1);
    EXPECT_TRUE(choice.reachable);
    EXPECT_EQ(choice.detail.voxel_error > 0, rate > 16) << "rate " << rate;
  }
}

/// Where coarse levels would draw only what is farthest, they spare too little for what several
/// levels cost.
TEST_P(CertifyOnDevice, TakesNoLevelsThatSpareLittle) {
  const BoundsScene scene({96, 96, 96}, test::gyroid_field(48),
                          {.precision = BlockPrecision{.min_exponent = -10}});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kMedium, .with_levels = true, .with_bounds = true});
  const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  const DetailChoice choice = choose_detail(renderer, scene.volume, {camera, 0.3f}, 0.05);
  EXPECT_TRUE(std::ranges::any_of(choice.tries, [&](const DetailChoice::Try &each) {
    return each.detail.voxel_pixels > 0.6 && each.kept >= choice.tries[0].kept - kLostShare;
  })) << "the error would allow them";
  EXPECT_EQ(choice.detail.voxel_pixels, 0);
  EXPECT_EQ(renderer.render(with_detail({camera, 0.3f}, choice.detail)).last_level, 0u);
}

/// Coarse levels reach a little out of the volume; where a ray is there at a border, on one side
/// for certain, nothing is unknown.
TEST_P(CertifyOnDevice, RaysThatEnterBehindABorderAreCertain) {
  const glm::uvec3 dims(96, 96, 96);
  const BoundsScene scene(dims, test::sphere_field(dims),
                          {.precision = BlockPrecision{.min_exponent = -10}});
  const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kMedium, .with_levels = true, .with_bounds = true});
  for (const double voxel_pixels :
       {1.0, 1.4}) {  // a border among the places where rays enter, or in the surface
    FrameRequest request{.camera = camera, .isovalue = 0.5f, .voxel_pixels = voxel_pixels};
    const auto hits_of = [&](FieldBound bound) {
      request.bound = bound;
      renderer.render(request);
      return renderer.hits();
    };
    const auto lower = hits_of(FieldBound::kLower), upper = hits_of(FieldBound::kUpper),
               drawn = hits_of(FieldBound::kNone);
    const Certificate certificate = certify(renderer, scene.volume, request, drawn);
    std::size_t num_hits = 0;
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      const int met =
          std::isfinite(lower[i].t) + std::isfinite(upper[i].t) + std::isfinite(drawn[i].t);
      if (met == 0) {
        EXPECT_EQ(certificate.bounds[i], 0) << "ray " << i;
      } else if (met == 3) {
        EXPECT_TRUE(std::isfinite(certificate.bounds[i])) << "ray " << i;
      }
      num_hits += met == 3;
    }
    EXPECT_GT(num_hits, 500u);
  }
}

TEST_P(CertifyOnDevice, PicturesBelowTheLargestAreTheTwins) {
  const BoundsScene scene({20, 20, 20}, test::gyroid_field(10), {.rate = 8});
  const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  DeviceRenderer renderer(device_, scene.volume, {.size = kMedium});
  for (const ImageSize size : {kSmall, kMedium, ImageSize{7, 5}}) {
    renderer.render({camera, 0.3f, size});
    const auto expected = Twin(scene.volume).render(camera, size, 0.3f);
    expect_same_hits(renderer.hits(), expected, size.width);
    const FrameParams frame = make_frame_params(scene.volume.info, camera, size, 0.3f);
    EXPECT_EQ(renderer.shade().pixels,
              shade_scalar(frame, make_shade_params(scene.volume.info, {}), expected).pixels);
  }
}

/// Bounds are in pixels of the picture, one for each ray.
TEST_P(CertifyOnDevice, PixelsOfSeveralRaysAreAsWide) {
  const BoundsScene scene({30, 30, 30}, test::gyroid_field(10), {.rate = 8});
  const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  const auto bounds = [&](ImageSize size, double voxel_pixels) {
    DeviceRenderer renderer(device_, scene.volume,
                            {.size = size, .with_levels = true, .with_bounds = true});
    const FrameRequest request{.camera = camera, .isovalue = 0.3f, .voxel_pixels = voxel_pixels};
    renderer.render(request);
    return certify(renderer, scene.volume, request, renderer.hits()).bounds;
  };
  const std::vector<float> four = bounds({30, 20, 2}, 0.6), one = bounds({60, 40}, 1.2);
  ASSERT_EQ(four.size(), one.size());
  std::size_t num_bounded = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_FLOAT_EQ(2 * four[i], one[i]);
    num_bounded += one[i] > 0 && std::isfinite(one[i]);
  }
  EXPECT_GT(num_bounded, 200u);
}

TEST_P(CertifyOnDevice, RefusesWhatIsNotKnown) {
  const BoundsScene scene({20, 20, 20}, test::gyroid_field(10), {.rate = 8});
  const Camera camera = orbit_cameras(scene.volume.info, 1)[0];
  const auto certify_with = [&](const CompressedVolume &volume, const RendererOptions &options) {
    DeviceRenderer renderer(device_, volume, options);
    const FrameRequest request{
        .camera = camera, .isovalue = 0.3f, .voxel_pixels = options.with_levels ? 1.0 : 0.0};
    renderer.render(request);
    certify(renderer, volume, request, renderer.hits());
  };
  EXPECT_NO_THROW(
      certify_with(scene.volume, {.size = kSmall, .with_levels = true, .with_bounds = true}));
  CompressedVolume volume = scene.volume;
  volume.max_voxel_error.reset();
  volume.bounds = {};
  EXPECT_THAT([&] { certify_with(volume, {.size = kSmall, .with_bounds = true}); },
              ThrowsMessage<Error>(HasSubstr("measure the error")));
  volume = scene.volume;
  volume.coarser_levels[0].bounds = {};
  EXPECT_NO_THROW(certify_with(volume, {.size = kSmall, .with_bounds = true}));
  EXPECT_THAT(
      [&] { certify_with(volume, {.size = kSmall, .with_levels = true, .with_bounds = true}); },
      ThrowsMessage<Error>(HasSubstr("with its levels")));
  volume = scene.volume;
  volume.value_range = {-INFINITY, INFINITY};
  EXPECT_THAT([&] { certify_with(volume, {.size = kSmall, .with_bounds = true}); },
              ThrowsMessage<Error>(HasSubstr("range of values")));
  EXPECT_THAT(
      [&] {
        certify_with(scene.volume,
                     {.size = kSmall, .solver = solver_from_string("linear"), .with_bounds = true});
      },
      ThrowsMessage<Error>(HasSubstr("bernstein")));
  DeviceRenderer renderer(device_, scene.volume, {.size = kSmall, .with_bounds = true});
  renderer.render({camera, 0.3f});
  const std::vector<HitRecord> hits = renderer.hits();
  for (const FrameRequest &bad :
       {FrameRequest{.camera = camera, .isovalue = 0.3f, .voxel_pixels = 1},
        FrameRequest{.camera = camera, .isovalue = 0.3f, .voxel_error = -1},
        FrameRequest{.camera = camera, .isovalue = 0.3f, .voxel_error = NAN},
        FrameRequest{.camera = camera, .isovalue = 0.3f, .size = ImageSize{13, 8}}}) {
    EXPECT_THROW(renderer.render(bad), Error);
    EXPECT_EQ(renderer.render({camera, 0.3f}).passes[0].counts.requested_count, 0u)
        << "the cache is as it was";
    expect_same_hits(renderer.hits(), hits, kSmall.width);
  }
  for (const double bad : {0.0, -1.0, double{INFINITY}, double{NAN}})
    EXPECT_THROW(choose_detail(renderer, scene.volume, {camera, 0.3f}, bad), Error);
}

/// A pixel covers the same at all distances.
TEST_P(CertifyOnDevice, FramesOfParallelProjection) {
  const BoundsScene scene({40, 36, 44}, test::gyroid_field(13), {.rate = 8});
  DeviceRenderer renderer(device_, scene.volume, {.size = kMedium, .with_bounds = true});
  for (const Camera &camera : orbit_cameras(scene.volume.info, 2)) {
    const FrameRequest request{.camera = in_parallel(camera), .isovalue = 0.3f};
    certify_frame(renderer, scene, request, 1);
  }
  EXPECT_GT(certified_, all_ / 2);
}

TEST_P(CertifyOnDevice, HitsOfAnotherPictureAreRefused) {
  const BoundsScene scene({20, 20, 20}, test::gyroid_field(10), {.rate = 8});
  const FrameRequest request{orbit_cameras(scene.volume.info, 1)[0], 0.3f, kSmall};
  DeviceRenderer renderer(device_, scene.volume, {.size = kSmall, .with_bounds = true}),
      plain(device_, scene.volume, {.size = kSmall});
  renderer.render(request);
  const std::vector<HitRecord> hits = renderer.hits();
  EXPECT_THAT([&] { certify(renderer, scene.volume, request, std::span(hits).first(9)); },
              ThrowsMessage<Error>(HasSubstr("9 hits are not those of 96 rays")));
  expect_same_hits(renderer.hits(), hits, kSmall.width);
  EXPECT_THAT([&] { certify(plain, scene.volume, request, hits); },
              ThrowsMessage<Error>(HasSubstr("draws no bounds")));
}

/// Whatever kind of frame comes between, and wherever it ends: the next is right.
TEST_P(CertifyOnDevice, RequestsOfAllKindsInAnyOrder) {
  const BoundsScene scene({30, 27, 33}, test::gyroid_field(10), {.rate = 8});
  const std::vector<Camera> cameras = orbit_cameras(scene.volume.info, 2);
  DeviceRenderer renderer(
      device_, scene.volume,
      {.size = kMedium, .cache_slots = 100, .with_levels = true, .with_bounds = true});
  const FieldBound bounds[] = {FieldBound::kNone, FieldBound::kUpper, FieldBound::kLower};
  for (int i = 0; i < 24; ++i) {
    SCOPED_TRACE(fmt::format("request {}", i));
    const ImageSize size = i % 5 == 0 ? kSmall : kMedium;
    const FrameRequest request{.camera = cameras[i % 2],
                               .isovalue = i % 3 == 0 ? 0.4f : 0.2f,
                               .size = size,
                               .voxel_pixels = i % 4 < 2 ? 0.0 : 3.0,
                               .voxel_error = i % 7 < 3 ? 0.05 : 0.0,
                               .bound = bounds[i / 2 % 3]};
    FrameRequest broken = request;
    broken.bound = bounds[i % 3];
    broken.voxel_error = 0.2;
    broken.on_pass = [](const PassStats &) -> bool { throw std::runtime_error("enough"); };
    if (i % 2 == 0) {
      EXPECT_THROW(renderer.render(broken), std::runtime_error);
    } else {
      broken.isovalue = NAN;
      EXPECT_THROW(renderer.render(broken), Error);
    }
    renderer.render(request);
    expect_same_hits(renderer.hits(),
                     Twin(scene.volume, request.voxel_pixels, request.voxel_error, request.bound)
                         .render(request.camera, size, request.isovalue),
                     size.width);
  }
}

}  // namespace
}  // namespace isowave::core
