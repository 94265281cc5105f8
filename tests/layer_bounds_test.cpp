// Bounds of the first layer of frames of several and translucent surfaces and slices: never
// exceeded against the volume before compression, in double precision; and what is chosen by them.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>

#include "core/accuracy/bounded_renderer.hpp"
#include "core/accuracy/ray_sample.hpp"
#include "core/accuracy/with_choices.hpp"
#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "kernels_cl/portable/grid_dda.h"
#include "reference/accuracy.hpp"
#include "reference/bound_check.hpp"
#include "reference/root_oracle.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/bounds_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::BoundsScene;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{72, 54};

std::vector<SurfaceStyle> surfaces_at(std::span<const float> isovalues, float opacity = 0.4f) {
  std::vector<SurfaceStyle> surfaces;
  for (const float isovalue : isovalues) surfaces.push_back({isovalue, {1, 0, 0}, opacity});
  return surfaces;
}

/// A ray's nearest hit with all surfaces and slices of a volume before compression.
class FirstLayerOracle final : public HitOracle {
 public:
  FirstLayerOracle(const BoundsScene &scene, const FrameRequest &request)
      : info_(scene.volume.info),
        voxels_(scene.source),
        slices_(request.slices.planes),
        has_gaps_(!scene.volume.no_data.empty()) {
    const glm::uvec3 &dims = info_.dims;
    for (const SurfaceStyle &surface : request.surfaces)
      surfaces_.emplace_back(voxels_, std::array{dims.x, dims.y, dims.z}, surface.isovalue);
  }

  OracleHit first_hit(const OracleRay &ray) const override {
    OracleHit nearest{.t = kInfinity};
    for (const RootOracle &surface : surfaces_) {
      const OracleHit hit = surface.first_hit(ray);
      if (hit.hit && hit.t < nearest.t) nearest = hit;
    }
    for (const Slice &slice : slices_) {
      const double t = place_on(slice.plane, ray);
      if (t < nearest.t) nearest = {true, t, {}};
    }
    return nearest;
  }
  /// Whether rounding decides if a slice is seen: it is hit at a face of a cell, beside which data
  /// or the volume may end.
  bool is_undecided(const OracleRay &ray) const {
    return std::ranges::any_of(slices_, [&](const Slice &slice) {
      const glm::dvec3 at = point_on(ray, place_on_plane(slice.plane, ray));
      for (int axis = 0; axis < 3; ++axis) {
        const double face = std::rint(at[axis]);
        const bool may_end = has_gaps_ || face <= 0 || face >= info_.dims[axis] - 1.0;
        if (may_end && std::abs(at[axis] - face) < 1e-3) return true;
      }
      return false;
    });
  }
  double field(const std::array<double, 3> &point) const override {
    return surfaces_.front().field(point);
  }
  std::array<double, 3> gradient(const std::array<double, 3> &point) const override {
    return surfaces_.front().gradient(point);
  }

 private:
  static glm::dvec3 point_on(const OracleRay &ray, double t) {
    return {ray.origin[0] + t * ray.direction[0], ray.origin[1] + t * ray.direction[1],
            ray.origin[2] + t * ray.direction[2]};
  }
  double place_on_plane(const ClipPlane &plane, const OracleRay &ray) const {
    const glm::dmat3 to_world = info_.index_to_world();
    const glm::dvec3 direction = point_on(ray, 1) - point_on(ray, 0);
    return (plane.offset - glm::dot(plane.normal, info_.origin + to_world * point_on(ray, 0))) /
           glm::dot(plane.normal, to_world * direction);
  }
  /// t, or infinity: there is none, or a voxel there has no data.
  double place_on(const ClipPlane &plane, const OracleRay &ray) const {
    const double t = place_on_plane(plane, ray);
    const glm::dvec3 at = point_on(ray, t);
    if (!(t >= 0) || glm::any(glm::lessThan(at, glm::dvec3(0))) ||
        glm::any(glm::greaterThan(at, glm::dvec3(info_.dims - 1u))))
      return kInfinity;
    const glm::uvec3 cell = glm::min(glm::uvec3(at), info_.dims - 2u);
    for (std::uint32_t i = 0; i < 8; ++i) {
      const glm::uvec3 voxel = cell + glm::uvec3(i & 1, i >> 1 & 1, i >> 2);
      if (std::isnan(voxels_[voxel.x + info_.dims.x * (voxel.y + info_.dims.y * voxel.z)]))
        return kInfinity;
    }
    return t;
  }

  VolumeInfo info_;
  const std::vector<float> &voxels_;
  std::vector<Slice> slices_;
  bool has_gaps_;
  std::deque<RootOracle> surfaces_;
};

struct Judged {
  std::vector<HitRecord> drawn;
  Certificate certificate;
  BoundTally tally;
};

Judged judge(Renderer &renderer, const BoundsScene &scene, const FrameRequest &request) {
  renderer.render(request);
  Judged judged{renderer.hits(), {}, {}};
  judged.certificate = certify(renderer, scene.volume, request, judged.drawn);
  const FrameParams frame = make_frame_params(scene.volume.info, request.camera,
                                              size_of(request, renderer.abilities()), 0);
  const FirstLayerOracle truth(scene, request);
  std::vector<float> bounds = judged.certificate.bounds;
  for (std::uint32_t ray = 0; ray < bounds.size(); ++ray) {
    if (truth.is_undecided(exact_ray(make_ray(&frame, ray)))) bounds[ray] = INFINITY;
  }
  judged.tally = judge_bounds(truth, frame, judged.drawn, bounds);
  return judged;
}

/// Adds the tally of another frame.
void add(BoundTally &sum, const BoundTally &other) {
  sum.hits += other.hits;
  sum.misses += other.misses;
  sum.uncertain += other.uncertain;
  sum.exceeded += other.exceeded;
  sum.slack.insert(sum.slack.end(), other.slack.begin(), other.slack.end());
}

/// Expects no bound to be exceeded, and bounds that say something.
void expect_kept(BoundTally tally, double most_slack) {
  EXPECT_EQ(tally.exceeded, 0u);
  ASSERT_GT(tally.hits, 1000u);
  EXPECT_GT(tally.misses, 100u);
  EXPECT_GT(tally.hits, 2 * tally.uncertain);
  std::ranges::sort(tally.slack);
  const double median = tally.slack[tally.slack.size() / 2];
  EXPECT_LT(median, most_slack);
  testing::Test::RecordProperty("median_slack", fmt::format("{:.2f}", median));
  testing::Test::RecordProperty(
      "uncertain", fmt::format("{} of {}", tally.uncertain, tally.hits + tally.uncertain));
}

/// Slices through the volume's middle and beside it.
Slices slices_of(const VolumeInfo &info) {
  const glm::dvec3 middle = info.origin + info.index_to_world() * (0.5 * glm::dvec3(info.dims));
  const auto through = [&](const glm::dvec3 &normal, double off) -> ClipPlane {
    return {normal, glm::dot(normal, middle) + off};
  };
  return {.planes = {{through({0.2, 0.3, 1}, 1.3), 0.5f}, {through({1, 0.1, -0.2}, 7), 1}}};
}

std::vector<Camera> some_cameras(const VolumeInfo &info) {
  std::vector<Camera> cameras = orbit_cameras(info, 3);
  cameras[1] = in_parallel(cameras[1]);
  cameras[2] = test::camera_along({9, 12, 11}, {0.8, 0.4, 0.3});  // from within
  return cameras;
}

TEST(LayerBounds, AreKeptInRandomScenes) {
  std::mt19937 random(45);
  const auto number = [&](double low, double high) {
    return static_cast<float>(low + (high - low) * double(random()) * 0x1p-32);
  };
  BoundTally sum;
  for (int i = 0; i < 6; ++i) {
    SCOPED_TRACE(i);
    const glm::uvec3 dims(24 + random() % 17, 24 + random() % 17, 24 + random() % 17);
    CompressOptions options{.rate = 4 + static_cast<std::uint32_t>(random() % 5)};
    if (i % 3 == 0)
      options.precision = BlockPrecision{.min_exponent = -5 - static_cast<int>(random() % 8)};
    const BoundsScene scene(
        dims,
        i % 2 == 0
            ? test::gyroid_field(number(11, 25))
            : [&, blobs = test::gyroid_field(number(9, 17)), ball = test::sphere_field(dims)](
                  const glm::dvec3 &at) { return 0.3 * blobs(at) + 2 * ball(at) - 0.8; },
        options);
    HostRenderer renderer(scene.volume);
    for (const Camera &camera : some_cameras(scene.volume.info)) {
      FrameRequest request{.camera = camera, .size = kSize};
      const std::array isovalues{number(-0.6, -0.1), number(-0.1, 0.4), number(0.4, 0.9)};
      request.surfaces = surfaces_at(std::span(isovalues).first(2 + random() % 2));
      std::ranges::shuffle(request.surfaces, random);
      request.surfaces[0].opacity = 1;
      request.voxel_error = i == 5 ? 0.02 : 0;
      add(sum, judge(renderer, scene, request).tally);
    }
  }
  expect_kept(sum, 8);
}

/// How many first hits lie on slices, whose numbers follow two surfaces', and have exact bounds.
std::uint64_t count_exact_on_slices(const Judged &judged) {
  std::uint64_t count = 0;
  for (std::size_t ray = 0; ray < judged.drawn.size(); ++ray) {
    const HitRecord &hit = judged.drawn[ray];
    count += std::isfinite(hit.t) && surface_of(hit) >= 2 && judged.certificate.bounds[ray] < 1e-3f;
  }
  return count;
}

/// Coarser levels are further off. Their slices are where those of the finest level are.
TEST(LayerBounds, AreKeptAtLevelsOfDetail) {
  const BoundsScene scene({36, 33, 39}, test::gyroid_field(21), {.rate = 12});
  HostRenderer renderer(scene.volume);
  BoundTally sum;
  std::uint64_t num_on_slices = 0;
  for (const Camera &camera : some_cameras(scene.volume.info)) {
    FrameRequest request{.camera = camera, .size = kSize};
    request.surfaces = surfaces_at(std::array{0.2f, 0.9f});
    request.slices = slices_of(scene.volume.info);
    for (const double voxel_pixels : {2.0, 6.0}) {
      request.voxel_pixels = voxel_pixels;
      const Judged judged = judge(renderer, scene, request);
      add(sum, judged.tally);
      num_on_slices += count_exact_on_slices(judged);
    }
  }
  EXPECT_EQ(sum.exceeded, 0u);
  EXPECT_GT(sum.hits, 1000u);
  EXPECT_GT(num_on_slices, 500u);
}

/// Slices are where they are drawn, and hide what is uncertain behind them.
TEST(LayerBounds, AreKeptBesideSlices) {
  const BoundsScene scene({36, 33, 39}, test::gyroid_field(14), {.rate = 7});
  HostRenderer renderer(scene.volume);
  BoundTally sum;
  std::uint64_t num_on_slices = 0;
  for (const Camera &camera : some_cameras(scene.volume.info)) {
    FrameRequest request{.camera = camera, .size = kSize};
    request.surfaces = surfaces_at(std::array{0.2f, 0.9f});
    request.slices = slices_of(scene.volume.info);
    const Judged judged = judge(renderer, scene, request);
    add(sum, judged.tally);
    num_on_slices += count_exact_on_slices(judged);
  }
  expect_kept(sum, 1e3);  // most are of slices, whose error is next to nothing
  EXPECT_GT(num_on_slices, 500u);
}

TEST(LayerBounds, AreKeptBesideVoxelsWithoutData) {
  const auto field = [gyroid = test::gyroid_field(13)](const glm::dvec3 &at) {
    const bool is_hole = glm::length(at - glm::dvec3(12, 10, 14)) < 5 ||
                         static_cast<int>(at.x + 3 * at.y + 7 * at.z) % 97 == 0;
    return is_hole ? double{NAN} : gyroid(at);
  };
  const BoundsScene scene({30, 27, 29}, field, {.rate = 12});
  ASSERT_FALSE(scene.volume.no_data.empty());
  HostRenderer renderer(scene.volume);
  BoundTally sum;
  std::uint64_t num_through = 0;  // rays that pass a slice unseen, where it has no data
  for (const Camera &camera : some_cameras(scene.volume.info)) {
    FrameRequest request{.camera = camera, .size = kSize};
    request.surfaces = surfaces_at(std::array{-0.4f, 0.3f});
    const Judged plain = judge(renderer, scene, request);
    request.slices = slices_of(scene.volume.info);
    const Judged sliced = judge(renderer, scene, request);
    add(sum, plain.tally);
    add(sum, sliced.tally);
    for (std::size_t ray = 0; ray < plain.drawn.size(); ++ray) {
      if (plain.drawn[ray].t != sliced.drawn[ray].t) continue;
      EXPECT_EQ(sliced.certificate.bounds[ray], plain.certificate.bounds[ray]) << ray;
      num_through += std::isfinite(plain.drawn[ray].t);
    }
  }
  EXPECT_GT(num_through, 100u);
  expect_kept(sum, 1e3);
}

/// A surface without a bound spoils no pixel in which another one is surely in front; and one that
/// may be in front spoils it, or is within the bound.
TEST(LayerBounds, OneSurfaceMayHideWhatIsUncertainOfAnother) {
  const BoundsScene scene({40, 40, 40}, test::gyroid_field(18), {.rate = 12});
  HostRenderer renderer(scene.volume);
  FrameRequest request{.camera = orbit_cameras(scene.volume.info, 1)[0], .size = kSize};
  request.voxel_error = 0.03;
  const auto bounds_of = [&](std::span<const float> isovalues) {
    request.surfaces = surfaces_at(isovalues);
    return judge(renderer, scene, request);
  };
  const Judged a = bounds_of(std::array{0.1f}), b = bounds_of(std::array{0.5f}),
               both = bounds_of(std::array{0.1f, 0.5f});
  std::uint64_t hidden = 0, spoilt = 0, wider = 0;
  for (std::size_t ray = 0; ray < both.drawn.size(); ++ray) {
    const float of_a = a.certificate.bounds[ray], of_b = b.certificate.bounds[ray],
                of_both = both.certificate.bounds[ray];
    const bool one_lacks = std::isinf(of_a) != std::isinf(of_b);
    hidden += one_lacks && std::isfinite(of_both) && of_both <= std::min(of_a, of_b);
    spoilt += one_lacks && std::isinf(of_both);
    wider += one_lacks && std::isfinite(of_both) && of_both > std::min(of_a, of_b);
    EXPECT_TRUE(!std::isinf(of_a) || !std::isinf(of_b) || std::isinf(of_both));
    if (!one_lacks && std::isfinite(of_a)) {
      EXPECT_TRUE(std::isfinite(of_both));
    }
  }
  EXPECT_EQ(both.tally.exceeded, 0u);
  EXPECT_GT(hidden, 10u);
  EXPECT_GT(wider, 10u);
  EXPECT_GT(spoilt, 0u);
}

/// One surface, as a layer, has the bounds that it has alone.
TEST(LayerBounds, OfOneSurfaceAreThoseOfItsIsovalue) {
  const BoundsScene scene({40, 37, 44}, test::gyroid_field(17), {.rate = 9});
  HostRenderer renderer(scene.volume);
  for (const Camera &camera : some_cameras(scene.volume.info)) {
    FrameRequest request{.camera = camera, .isovalue = 0.2f, .size = kSize};
    renderer.render(request);
    const std::vector<float> depth = renderer.depth(),
                             alone = certify(renderer, scene.volume, request, depth).bounds;
    request.surfaces = surfaces_at(std::array{0.2f});
    EXPECT_EQ(certify(renderer, scene.volume, request, depth).bounds, alone);
  }
}

TEST(LayerBounds, ErrorsOfLabelsAndOfClippedSurfacesAreRefused) {
  const BoundsScene scene({20, 20, 20}, test::gyroid_field(9), {.rate = 9});
  HostRenderer inner(scene.volume);
  BoundedRenderer renderer(inner, scene.volume, scene.volume.rate());
  FrameRequest request{.camera = orbit_cameras(scene.volume.info, 1)[0], .size = kSize};
  request.surfaces = surfaces_at(std::array{0.2f, 0.5f});
  request.max_surface_error = 1;
  const auto refuse = [&](const char *text, const auto &change) {
    FrameRequest changed = request;
    change(changed);
    EXPECT_THAT([&] { renderer.render(changed); }, ThrowsMessage<Error>(HasSubstr(text)));
  };
  refuse("labels are drawn without max_surface_error: leave out max_surface_error",
         [](FrameRequest &r) { r.surfaces = {{.labels = {1}}}; });
  refuse("errors are proven of whole surfaces", [](FrameRequest &r) {
    r.clip = {{{{1, 0, 0}, 5}}};
  });
  refuse("max_surface_error chooses the detail: leave out voxel_pixels",
         [](FrameRequest &r) { r.voxel_pixels = 1; });
  refuse("without max_image_error: leave out max_image_error", [](FrameRequest &r) {
    r.max_surface_error.reset();
    r.max_image_error = 0.1;
  });
  refuse("without bound: leave out bound", [](FrameRequest &r) { r.bound = FieldBound::kLower; });
}

/// Levels and bit planes are chosen so that the first layer keeps the error.
TEST(LayerBounds, ChooseTheDetailOfTheFirstLayer) {
  const BoundsScene scene({48, 48, 48}, test::gyroid_field(24), {.rate = 24});
  HostRenderer inner(scene.volume);
  BoundedRenderer renderer(inner, scene.volume, scene.volume.rate());
  FrameRequest request{.camera = orbit_cameras(scene.volume.info, 1)[0], .size = kSize};
  request.surfaces = surfaces_at(std::array{0.3f, 0.6f});
  int num_coarse = 0;
  for (const Evidence by : {Evidence::kProof, Evidence::kSample}) {
    for (const double error : {0.1, 1.0, 8.0}) {
      request.max_surface_error = error;
      request.by = by;
      const DetailChoice choice = renderer.render(request).detail.value();
      EXPECT_TRUE(choice.reachable);
      num_coarse += choice.detail.voxel_pixels > 0 ? 1 : 0;
      EXPECT_GT(choice.detail.voxel_error, 0);
      const std::vector<HitRecord> drawn = renderer.hits();
      const FrameRequest chosen = as_chosen(request, choice, kSize);
      const Certificate certificate = certify(renderer, scene.volume, chosen, drawn);
      const CertificateSummary summary = summarize(certificate, error);
      if (by == Evidence::kProof) {
        EXPECT_GE(double(summary.num_certified) / double(summary.num_pixels),
                  choice.tries[0].kept - kLostShare);
      } else {
        EXPECT_GE(choice.sample.value().lowest, kSampledShare);
      }
      EXPECT_EQ(judge(inner, scene, chosen).tally.exceeded, 0u);
    }
  }
  EXPECT_GE(num_coarse, 2);
  EXPECT_LT(num_coarse, 6) << "a judge that always says yes";
}

/// A surface that is hidden need not keep the error, and one that is seen through must.
TEST(LayerBounds, WhatIsHiddenIsNotJudged) {
  const glm::uvec3 dims(40, 40, 40);
  // Flat within, so that any error moves the inner surface by much.
  const auto field = [ball = test::sphere_field(dims)](const glm::dvec3 &at) {
    const double value = ball(at);
    return value < 0.55 ? value : 0.55 + 0.002 * (value - 0.55);
  };
  const BoundsScene scene(dims, field, {.rate = 24});
  HostRenderer inner(scene.volume);
  BoundedRenderer renderer(inner, scene.volume, scene.volume.rate());
  FrameRequest request{.camera = orbit_cameras(scene.volume.info, 1)[0], .size = kSize};
  const auto chosen = [&](std::span<const float> isovalues) {
    request.surfaces = surfaces_at(isovalues);
    return renderer.render(request).detail.value().detail.voxel_error;
  };
  for (const Evidence by : {Evidence::kProof, Evidence::kSample}) {
    request.max_surface_error = 0.5;
    request.by = by;
    const double outer = chosen(std::array{0.47f});
    EXPECT_GT(outer, 0);
    EXPECT_EQ(chosen(std::array{0.47f, 0.5503f}), outer);
    EXPECT_LT(chosen(std::array{0.5503f}), outer);
  }
}

/// Views share a choice, and frames of other surfaces have their own.
TEST(LayerBounds, SeriesOfOtherSurfacesHaveAnotherChoice) {
  const BoundsScene scene({32, 32, 32}, test::gyroid_field(16), {.rate = 20});
  HostRenderer inner(scene.volume);
  BoundedRenderer renderer(inner, scene.volume, scene.volume.rate());
  FrameRequest request{.camera = orbit_cameras(scene.volume.info, 1)[0], .size = kSize};
  request.series = orbit_cameras(scene.volume.info, 2);
  request.max_surface_error = 0.5;
  const auto is_chosen_anew = [&] { return renderer.render(request).detail.value().total_ms > 0; };
  request.surfaces = surfaces_at(std::array{0.3f, 0.6f});
  EXPECT_TRUE(is_chosen_anew());
  EXPECT_FALSE(is_chosen_anew());
  request.surfaces[1].isovalue = 0.7f;
  EXPECT_TRUE(is_chosen_anew());
  request.slices = slices_of(scene.volume.info);
  EXPECT_TRUE(is_chosen_anew());
  EXPECT_FALSE(is_chosen_anew());
}

class LayerBoundsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, LayerBoundsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Device, host and twin have the same bits, whatever was drawn before.
TEST_P(LayerBoundsOnDevice, SmallFramesHaveTheSameBounds) {
  const BoundsScene scene({14, 13, 12}, test::gyroid_field(8), {.rate = 18});
  const ImageSize size = is_simulator(GetParam()) ? ImageSize{12, 8} : ImageSize{40, 30};
  ocl::Device device(GetParam());
  RendererOptions options = with_choices({.size = size, .max_surfaces = 2}, scene.volume);
  DeviceRenderer on_device(device, scene.volume, options);
  EXPECT_EQ(device.ledger().current(), on_device.memory_plan().total());
  HostRenderer on_host(scene.volume);
  TwinRenderer twin(scene.volume, size);
  FrameRequest request{.camera = orbit_cameras(scene.volume.info, 1)[0], .size = size};
  request.normals = Normals::kCell;
  request.surfaces = surfaces_at(std::array{0.1f, 0.5f});
  for (const bool has_slices : {false, true}) {
    if (has_slices) request.slices = slices_of(scene.volume.info);
    on_device.render(request);
    const std::vector<float> depth = on_device.depth();
    const std::vector<float> expected = certify(twin, scene.volume, request, depth).bounds;
    for (int i = 0; i < 2; ++i) {
      on_device.render(request);
      EXPECT_EQ(on_device.depth(), depth) << "the frames of bounds leave the volume's values";
      EXPECT_EQ(certify(on_device, scene.volume, request, depth).bounds, expected);
    }
    EXPECT_EQ(certify(on_host, scene.volume, request, depth).bounds, expected);
    EXPECT_GT(summarize(expected, 10).num_certified, 5u);
  }
}

TEST_P(LayerBoundsOnDevice, ChoicesAreTheHosts) {
  const BoundsScene scene({40, 37, 44}, test::gyroid_field(17), {.rate = 20});
  ocl::Device device(GetParam());
  DeviceRenderer on_device(device, scene.volume,
                           with_choices({.size = kSize, .max_surfaces = 3}, scene.volume));
  HostRenderer on_host(scene.volume);
  BoundedRenderer of_device(on_device, scene.volume, scene.volume.rate()),
      of_host(on_host, scene.volume, scene.volume.rate());
  FrameRequest request{.camera = orbit_cameras(scene.volume.info, 1)[0], .size = kSize};
  request.surfaces = surfaces_at(std::array{0.2f, 0.8f});
  request.max_surface_error = 0.5;
  for (const Evidence by : {Evidence::kProof, Evidence::kSample}) {
    request.by = by;
    const DetailChoice expected = of_host.render(request).detail.value(),
                       got = of_device.render(request).detail.value();
    EXPECT_EQ(got.detail, expected.detail);
    EXPECT_GT(got.detail.voxel_error, 0);
    EXPECT_EQ(got.median, expected.median);
    EXPECT_EQ(of_device.depth(), of_host.depth());
    EXPECT_EQ(of_device.shade().pixels, of_host.shade().pixels);
  }
}

}  // namespace
}  // namespace isowave::core
