// Layers of the twin against the oracle: every hit of every ray, of one to eight surfaces, whole
// and clipped, in perspective and in parallel projection.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "reference/layer_oracle.hpp"
#include "reference/twin.hpp"
#include "reference/voxel_field.hpp"
#include "tests/oracle_volumes.hpp"
#include "tests/ray_cases.hpp"

namespace isowave::core {
namespace {

constexpr ImageSize kSize{47, 33};

struct SurfacesCase {
  std::string name;
  std::vector<SurfaceStyle> surfaces;
};

/// At the volume's isovalue and around it, in no order. Opacities of 0.05 let rays through 16
/// layers.
std::vector<SurfacesCase> surfaces_around(float isovalue, float step) {
  const auto at = [&](float steps, float opacity) -> SurfaceStyle {
    return {isovalue + steps * step, {0.5, 0.5, 0.5}, opacity};
  };
  return {{"one", {at(0, 0.05f)}},
          {"three", {at(1, 0.3f), at(-2, 0.05f), at(0, 1)}},
          {"eight",
           {at(0, 0.05f), at(3, 0.9f), at(-1, 0.05f), at(1, 0.05f), at(2, 0.5f), at(-2, 0.05f),
            at(0.001f, 0.05f), at(-3, 0.05f)}}};
}

struct ViewCase {
  std::string name;
  Camera camera;
};

std::vector<ViewCase> views(const VolumeInfo &info) {
  const Camera outside = orbit_cameras(info, 3)[1];
  Camera within{test::place_in(info, {0.4, 0.55, 0.5}), test::place_in(info, {0.7, 0.2, 0.9})};
  within.fovy_deg = 100;
  return {{"perspective", outside}, {"parallel", in_parallel(outside)}, {"within", within}};
}

std::string counts(const LayerAccuracy &tally) {
  return fmt::format(
      "of {} rays, {} hits and {} caps, up to {} a ray: {} missed, {} false, {} in a wrong order, "
      "{} of a wrong surface, {} of a wrong side, {} of a wrong kind, {} in a wrong place, {} with "
      "a wrong gradient; {} undecided, {} cut",
      tally.rays, tally.hits, tally.caps, tally.most_hits, tally.missed, tally.false_hits,
      tally.wrong_order, tally.wrong_surfaces, tally.wrong_sides, tally.wrong_kinds,
      tally.wrong_places, tally.wrong_gradients, tally.undecided, tally.cut);
}

/// The first failures, with all hits and crossings of their rays.
std::string text(const LayerOracle &oracle, const LayerAccuracy &tally,
                 const std::vector<std::vector<HitRecord>> &layers) {
  std::string lines = counts(tally);
  for (std::size_t i = 0; i < std::min<std::size_t>(tally.failed.size(), 3); ++i) {
    const std::uint32_t pixel = tally.failed[i];
    const OracleRay ray = exact_ray(make_ray(&oracle.frame(0), pixel));
    lines += fmt::format("\n  pixel {} ({},{}):", pixel, pixel % kSize.width, pixel / kSize.width);
    for (const auto &layer : layers) {
      const HitRecord &hit = layer[pixel];
      if (!std::isfinite(hit.t)) continue;
      lines +=
          fmt::format("\n    got t {:.9} (place {:.9}) surface {} block {} cell {} at ({} {} {})",
                      hit.t, renderer_hit(oracle.frame(0), ray, hit).t, hit.cell >> ISO_SURFACE_BIT,
                      hit.block_id, hit.cell & 511u, hit.x, hit.y, hit.z);
    }
    for (std::size_t surface = 0; surface < oracle.num_surfaces(); ++surface) {
      const LayerTruth truth = oracle.crossings(surface, ray);
      lines += fmt::format("\n    surface {}{}:", surface, truth.undecided ? ", undecided" : "");
      for (const LayerCrossing &c : truth.crossings)
        lines += fmt::format(" {}{:.9}{}", c.is_cap ? "cap " : "", c.begin, c.enters ? "+" : "-");
    }
  }
  return lines;
}

/// Draws frames by the twin, and judges their layers.
class LayeredVolume {
 public:
  explicit LayeredVolume(const test::VolumeCase &of)
      : info_(of.volume.info), voxels_(decode_with_libzfp(of.volume)), twin_(of.volume) {}

  void expect_frame(const Camera &camera, const std::vector<SurfaceStyle> &surfaces,
                    const Clip &clip) {
    const LayerOracle oracle(info_, camera, kSize, clip, surfaces, voxels_);
    const LayeredFrame frame = twin_.render_layers({.camera = camera,
                                                    .size = kSize,
                                                    .clip = clip,
                                                    .surfaces = surfaces,
                                                    .normals = Normals::kCell});
    const LayerAccuracy tally = judge_layers(oracle, frame.layers);
    EXPECT_EQ(tally.failures(), 0u) << text(oracle, tally, frame.layers);
    EXPECT_TRUE((clip.caps && !clip.planes.empty()) || tally.caps == 0);
    const LayerAccuracy first = judge_first_layer(oracle, frame.layers[0]);
    EXPECT_EQ(first.failures(), 0u) << "first layer, " << text(oracle, first, {frame.layers[0]});
    expect_statistics(frame, oracle, tally);
    merge(sum_, tally);
  }
  const LayerAccuracy &sum() const { return sum_; }

 private:
  void expect_statistics(const LayeredFrame &frame, const LayerOracle &oracle,
                         const LayerAccuracy &tally) const {
    EXPECT_EQ(frame.stats.hits, tally.hits + tally.caps);
    EXPECT_EQ(frame.stats.layers, tally.most_hits);
    EXPECT_LE(frame.stats.rays_cut, tally.cut + tally.undecided);
    EXPECT_LE(tally.cut, frame.stats.rays_cut + tally.undecided);
    for (std::size_t ray = 0; ray < frame.colors.size(); ++ray) {
      double transmittance = 1;
      for (const auto &layer : frame.layers) {
        const HitRecord &hit = layer[ray];
        if (std::isfinite(hit.t)) transmittance *= 1 - oracle.opacity(hit.cell >> ISO_SURFACE_BIT);
      }
      ASSERT_NEAR(frame.colors[ray].transmittance, transmittance, 1e-6) << ray;
    }
  }

  VolumeInfo info_;
  std::vector<float> voxels_;
  Twin twin_;
  LayerAccuracy sum_;
};

/// The field at its first extremum along a ray, within a cell or between two; none if there is
/// none.
std::optional<double> extremum_on(const RootOracle &field, const OracleRay &ray,
                                  const glm::uvec3 &dims) {
  const auto domain = clip(ray, {0, 0, 0}, {int(dims.x) - 1, int(dims.y) - 1, int(dims.z) - 1});
  if (!domain || domain->t_exit <= domain->t_enter) return std::nullopt;
  constexpr int kSteps = 400;
  const double step = (domain->t_exit - domain->t_enter) / kSteps;
  const auto value_at = [&](double t) {
    std::array<double, 3> point;
    for (std::size_t axis = 0; axis < 3; ++axis)
      point[axis] = ray.origin[axis] + t * ray.direction[axis];
    return field.field(point);
  };
  for (int i = 1; i < kSteps; ++i) {
    double low = domain->t_enter + (i - 1) * step, high = low + 2 * step;
    const double middle = value_at(low + step);
    const double sign = middle > value_at(low) ? 1 : -1;
    if (sign * (middle - value_at(high)) <= 0) continue;
    for (int k = 0; k < 60; ++k) {  // the third with the lesser value goes
      const double a = low + (high - low) / 3, b = high - (high - low) / 3;
      const bool rises = sign * (value_at(a) - value_at(b)) < 0;
      (rises ? low : high) = rises ? a : b;
    }
    return value_at(0.5 * (low + high));
  }
  return std::nullopt;
}

struct LayersCase {
  test::VolumeCase (*volume)();
  float step;  ///< between isovalues
  const char *name;
};
class LayeredFrames : public testing::TestWithParam<LayersCase> {};
INSTANTIATE_TEST_SUITE_P(Volumes, LayeredFrames,
                         testing::Values(LayersCase{test::gyroid_volume, 0.3f, "gyroid"},
                                         LayersCase{test::noise_volume, 0.1f, "noise"},
                                         LayersCase{test::holes_volume, 0.3f, "holes"},
                                         LayersCase{test::head_volume, 20, "head"}),
                         [](const auto &of) { return of.param.name; });

TEST_P(LayeredFrames, AreTheOracles) {
  const test::VolumeCase of = GetParam().volume();
  LayeredVolume volume(of);
  for (const ViewCase &view : views(of.volume.info)) {
    std::size_t turn = 0;
    for (const SurfacesCase &c : surfaces_around(of.isovalue, GetParam().step)) {
      const test::ClipCase cut = test::clips(of.volume.info)[turn++];
      SCOPED_TRACE(fmt::format("{}, {}", view.name, c.name));
      volume.expect_frame(view.camera, c.surfaces, {});
      SCOPED_TRACE(cut.name);
      volume.expect_frame(view.camera, c.surfaces, {cut.planes});
      volume.expect_frame(view.camera, c.surfaces, {cut.planes, false});
    }
  }
  const LayerAccuracy &sum = volume.sum();
  EXPECT_EQ(sum.most_hits, 16u);
  EXPECT_GT(sum.hits, sum.rays);
  EXPECT_GT(sum.caps, sum.rays / 100);
  EXPECT_GT(sum.cut, 10u);
  EXPECT_LT(sum.undecided, sum.rays / 1000);
  RecordProperty("counts", counts(sum));
}

/// Voxels are whole numbers, as are isovalues: surfaces go through voxels, edges and faces of
/// cells, and rays touch them there or run in them.
TEST(LayeredFramesOnTheGrid, AreTheOracles) {
  const glm::uvec3 dims(15, 12, 17);
  const auto field = test::gyroid_field(7);
  LayeredVolume volume(
      test::of_whole_numbers(dims, [&](const glm::dvec3 &p) { return std::round(2 * field(p)); }));
  const auto box = box_planes({3, 2, 5}, {11, 9, 13});
  const Clip clip{{box.begin(), box.end()}};
  for (const CameraCase &c : camera_cases(dims)) {
    SCOPED_TRACE(c.name);
    for (const bool is_clipped : {false, true}) {
      volume.expect_frame(c.camera,
                          {{0, {1, 1, 1}, 0.2f}, {1, {1, 1, 1}, 0.05f}, {-1, {1, 1, 1}, 0.05f}},
                          is_clipped ? clip : Clip{});
    }
  }
  EXPECT_GT(volume.sum().hits, volume.sum().rays / 2);
  EXPECT_LT(volume.sum().undecided, volume.sum().rays / 50);
  RecordProperty("counts", counts(volume.sum()));
}

/// Isovalues are a few roundings from extrema of the field along rays, which nearly touch surfaces.
TEST(LayeredFramesNearExtrema, AreTheOracles) {
  Random random(9);
  LayerAccuracy all;
  for (int i = 0; i < 30; ++i) {
    const glm::uvec3 dims(7, 6, 5);
    const test::VolumeCase of = test::of_field(
        "noise", test::grid_info(dims), test::sample(dims, test::noise_field(100u + i)), 0.5f);
    const std::vector<float> voxels = decode_with_libzfp(of.volume);
    const RootOracle field(voxels, {dims.x, dims.y, dims.z}, 0);
    LayeredVolume volume(of);
    for (const ViewCase &view : views(of.volume.info)) {
      const FrameParams frame = make_frame_params(of.volume.info, view.camera, kSize, 0);
      std::vector<SurfaceStyle> surfaces;
      while (surfaces.size() < 8) {
        const OracleRay ray = exact_ray(make_ray(&frame, random.below(kSize.width * kSize.height)));
        const auto value = extremum_on(field, ray, dims);
        if (!value) continue;
        float isovalue = static_cast<float>(*value);
        for (std::uint32_t steps = random.below(4); steps > 0; --steps)
          isovalue = std::nextafter(isovalue, surfaces.size() % 2 == 0 ? 9.0f : -9.0f);
        surfaces.push_back({isovalue, {1, 1, 1}, 0.05f});
      }
      SCOPED_TRACE(fmt::format("volume {}, {}", i, view.name));
      volume.expect_frame(view.camera, surfaces, {});
    }
    merge(all, volume.sum());
  }
  EXPECT_LT(all.undecided, all.rays / 50);
  RecordProperty("counts", counts(all));
}

}  // namespace
}  // namespace isowave::core
