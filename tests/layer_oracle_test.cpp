// The oracle of layers against closed forms, and its judge of frames with planted bugs.

#include "reference/layer_oracle.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "reference/twin.hpp"
#include "tests/oracle_volumes.hpp"

namespace isowave::core {
namespace {

using test::VoxelFunction;

/// Rays from an eye in the oracle's volume, of spacing 1, so that t is in voxels.
class Scene {
 public:
  Scene(const glm::uvec3 &dims, const VoxelFunction &field, const std::vector<float> &isovalues,
        const glm::dvec3 &eye, const Clip &clip = {})
      : voxels_(test::sample(dims, field)), eye_(eye) {
    std::vector<SurfaceStyle> surfaces;
    for (const float isovalue : isovalues) surfaces.push_back({isovalue});
    oracle_.emplace(test::grid_info(dims), test::camera_along(eye, {1, 0, 0}), ImageSize{4, 4},
                    clip, surfaces, voxels_);
  }

  LayerTruth truth(std::size_t surface, const glm::dvec3 &d = {1, 0, 0}) const {
    return oracle_->crossings(surface, {{eye_.x, eye_.y, eye_.z}, {d.x, d.y, d.z}});
  }
  /// places: t of crossings; they enter and leave in turn
  void expect(std::size_t surface, const std::vector<double> &places, bool first_enters = true,
              const glm::dvec3 &d = {1, 0, 0}) const {
    const LayerTruth got = truth(surface, d);
    EXPECT_FALSE(got.undecided);
    ASSERT_EQ(got.crossings.size(), places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
      const LayerCrossing &crossing = got.crossings[i];
      EXPECT_LE(crossing.begin, places[i] + 1e-12);
      EXPECT_GE(crossing.end, places[i] - 1e-12);
      EXPECT_LT(crossing.end - crossing.begin, crossing.is_cap ? 1e-4 : 1e-300);
      EXPECT_EQ(crossing.enters, first_enters == (i % 2 == 0));
      EXPECT_FALSE(crossing.may_be_cut);
    }
  }

 private:
  std::vector<float> voxels_;
  glm::dvec3 eye_;
  std::optional<LayerOracle> oracle_;
};

double ramp(const glm::dvec3 &p) {
  return p.x;
}

TEST(LayerOracle, CrossesARampOnce) {
  const Scene scene({9, 7, 5}, ramp, {3.25f, 5.5f, 9}, {-2, 3.5, 1.5});
  scene.expect(0, {5.25});
  scene.expect(1, {7.5});
  scene.expect(2, {});
  const Scene back({9, 7, 5}, ramp, {3.25f, 5.5f}, {20, 3.5, 1.5});
  back.expect(0, {16.75}, false, {-1, 0, 0});
  back.expect(1, {14.5}, false, {-1, 0, 0});
}

/// On the lattice lines through the middle, the field is exact.
TEST(LayerOracle, PassesNestedSpheresTwice) {
  const auto ball = [](const glm::dvec3 &p) { return -glm::length(p - glm::dvec3(8)); };
  const Scene scene({17, 17, 17}, ball, {-5, -3, -1}, {-4, 8, 8});
  scene.expect(0, {7, 17});
  scene.expect(1, {9, 15});
  scene.expect(2, {11, 13});
  const Scene within({17, 17, 17}, ball, {-5, -1}, {6, 8, 8});
  within.expect(0, {7}, false);
  within.expect(1, {1, 3});
}

/// Along the cell's diagonal from (-1,-1,-1), the cubic whose Bernstein coefficients are b.
Scene one_cell(const std::array<double, 4> &b) {
  return {{2, 2, 2},
          [b](const glm::dvec3 &p) { return b[static_cast<std::size_t>(p.x + p.y + p.z)]; },
          {0},
          {-1, -1, -1}};
}

TEST(LayerOracle, FindsAllChangesOfACubic) {
  const glm::dvec3 diagonal(1);
  one_cell({-9, 13, -13, 9}).expect(0, {1.25, 1.5, 1.75}, true, diagonal);
  one_cell({9, -13, 13, -9}).expect(0, {1.25, 1.5, 1.75}, false, diagonal);
  one_cell({-3, 1, 1, -3}).expect(0, {1.5, 1.5}, true, diagonal);  // touches from outside
  one_cell({3, -1, -1, 3}).expect(0, {}, true, diagonal);          // and from inside
  one_cell({-1, 1, -1, 1}).expect(0, {1.5}, true, diagonal);       // (2s - 1)^3
  one_cell({0, -1, -1, -1}).expect(0, {1}, false, diagonal);
  // 9 (s - 1/3)^2 (s - 2/3), whose double root is no binary number.
  const auto rounded = one_cell({-2.0 / 3, 1, -4.0 / 3, 4.0 / 3}).truth(0, diagonal).crossings;
  ASSERT_EQ(rounded.size() % 2, 1u);
  EXPECT_NEAR(rounded.back().begin, 1 + 2.0 / 3, 1e-6);
}

TEST(LayerOracle, StartsAtCapsAndEndsAtPlanes) {
  const auto ball = [](const glm::dvec3 &p) { return -glm::length(p - glm::dvec3(8)); };
  const auto scene = [&](const Clip &clip) {
    return Scene({17, 17, 17}, ball, {-5, -3, -1}, {-4, 8, 8}, clip);
  };
  const ClipPlane from{{1, 0, 0}, 6.5}, up_to{{-1, 0, 0}, -10};
  const Scene capped = scene({{from}}), open = scene({{from}, false}),
              slab = scene({{from, up_to}});
  capped.expect(0, {10.5, 17});
  capped.expect(1, {10.5, 15});
  capped.expect(2, {11, 13});
  EXPECT_TRUE(capped.truth(0).crossings[0].is_cap);
  EXPECT_FALSE(capped.truth(0).crossings[1].is_cap);
  EXPECT_FALSE(capped.truth(2).crossings[0].is_cap);
  open.expect(0, {17}, false);
  open.expect(2, {11, 13});
  slab.expect(0, {10.5});
  slab.expect(2, {11, 13});
  EXPECT_TRUE(scene({{{{1, 0, 0}, 5}}}).truth(1).undecided);
  EXPECT_FALSE(scene({{{{1, 0, 0}, 5}}}).truth(0).undecided);
  EXPECT_TRUE(scene({{{{-1, 0, 0}, -9}}}).truth(2).crossings[1].may_be_cut);
}

TEST(LayerOracle, CellsWithoutDataHaveNoCrossings) {
  const auto ball = [](const glm::dvec3 &p) {
    return p.x == 8 ? double(test::kNone) : -glm::length(p - glm::dvec3(8));
  };
  const Scene scene({17, 17, 17}, ball, {-5, -1.5f, -0.5f}, {-4, 8, 8});
  scene.expect(0, {7, 17});
  EXPECT_TRUE(scene.truth(0).crossings[1].behind_gap);
  EXPECT_FALSE(scene.truth(0).crossings[0].behind_gap);
  scene.expect(1, {10.5, 13.5});
  scene.expect(2, {});
}

/// Each change is the first from the one before on, and sides are those of points in between.
TEST(LayerOracle, ChangesOfAGyroidAreEachTheFirst) {
  const glm::uvec3 dims(25, 25, 25);
  const std::vector<float> voxels = test::sample(dims, test::gyroid_field(6));
  const RootOracle oracle(voxels, {25, 25, 25}, 0.1f);
  Random random(5);
  std::size_t num_changes = 0;
  for (int i = 0; i < 300; ++i) {
    const OracleRay ray{random.in_box({-3, -3, -3}, {28, 28, 28}), random.direction()};
    double before = 0;
    std::optional<bool> side;
    for (const OracleChange &change : oracle.changes(ray, 0)) {
      ASSERT_GE(change.t, before);
      const OracleHit first = oracle.first_hit(ray, before);
      ASSERT_TRUE(first.hit);
      EXPECT_NEAR(first.t, change.t, 1e-12);
      ASSERT_NE(side, change.enters);
      if (change.t > before + 1e-9) {
        EXPECT_EQ(oracle.inside(ray, change.t - 1e-10), !change.enters);
      }
      side = change.enters;
      before = change.t + 1e-12;
      EXPECT_EQ(oracle.inside(ray, before), side);
      ++num_changes;
    }
    EXPECT_FALSE(oracle.first_hit(ray, before).hit);
  }
  EXPECT_GT(num_changes, 500u);
  const OracleRay ray{{-1, 3, 4}, {1, 0.3, 0.2}};
  const auto all = oracle.changes(ray, 0), two = oracle.changes(ray, 0, 2);
  ASSERT_GT(all.size(), 2u);
  ASSERT_EQ(two.size(), 2u);
  EXPECT_EQ(two[1].t, all[1].t);
}

/// A judge that is told wrong layers says so.
class LayerJudge : public testing::Test {
 protected:
  using Layers = std::vector<std::vector<HitRecord>>;
  static constexpr ImageSize kSize{40, 30};

  LayerJudge() {
    EXPECT_EQ(right_.failures(), 0u);
    EXPECT_EQ(right_.most_hits, 16u);
    EXPECT_LT(right_.undecided, 5u);
  }
  static bool hits(const HitRecord &hit) { return std::isfinite(hit.t); }
  static std::vector<SurfaceStyle> surfaces() {
    return {{0.2f, {1, 0, 0}, 0.05f}, {0.6f, {0, 1, 0}, 0.1f}, {-0.4f, {0, 0, 1}, 0.9f}};
  }
  LayeredFrame draw(const std::vector<SurfaceStyle> &surfaces) const {
    return Twin(of_.volume)
        .render_layers({.camera = camera_,
                        .size = kSize,
                        .clip = clip_,
                        .surfaces = surfaces,
                        .normals = Normals::kCell});
  }
  LayerAccuracy judge(const Layers &layers) const { return judge_layers(oracle_, layers); }
  /// Changes each ray with more than `least` hits, and counts them.
  LayerAccuracy judge_changed(std::size_t least,
                              const std::function<void(std::vector<HitRecord> &)> &change) {
    Layers layers = frame_.layers;
    num_changed_ = 0;
    for (std::size_t pixel = 0; pixel < kSize.num_rays(); ++pixel) {
      std::vector<HitRecord> ray;
      for (const auto &layer : layers) {
        if (hits(layer[pixel])) ray.push_back(layer[pixel]);
      }
      if (ray.size() <= least) continue;
      ++num_changed_;
      change(ray);
      ray.resize(layers.size(), no_hit());
      for (std::size_t layer = 0; layer < layers.size(); ++layer) layers[layer][pixel] = ray[layer];
    }
    return judge(layers);
  }
  /// All changed rays are found; but a few may be undecided.
  void expect_found(const LayerAccuracy &tally, std::uint64_t most_undecided = 5) const {
    EXPECT_GT(num_changed_, 100u);
    EXPECT_LE(tally.failures(), num_changed_);
    EXPECT_GE(tally.failures() + most_undecided, num_changed_) << tally.undecided;
  }

  test::VolumeCase of_ = test::gyroid_volume();
  std::vector<float> voxels_ = decode_with_libzfp(of_.volume);
  Camera camera_ = orbit_cameras(of_.volume.info, 3)[1];
  Clip clip_{test::clips(of_.volume.info)[0].planes};
  std::vector<SurfaceStyle> surfaces_ = surfaces();
  LayerOracle oracle_{of_.volume.info, camera_, kSize, clip_, surfaces_, voxels_};
  LayeredFrame frame_ = draw(surfaces_);
  LayerAccuracy right_ = judge(frame_.layers);
  std::uint64_t num_changed_ = 0;
};

TEST_F(LayerJudge, FindsAMissingLayer) {
  for (const std::size_t at : {0u, 1u, 2u}) {
    const LayerAccuracy tally = judge_changed(
        at, [&](auto &ray) { ray.erase(ray.begin() + static_cast<std::ptrdiff_t>(at)); });
    EXPECT_GT(tally.missed, tally.failures() * 9 / 10) << at;
    expect_found(tally);
  }
  const LayerAccuracy hole = judge_changed(1, [](auto &ray) { ray[0] = no_hit(); });
  EXPECT_EQ(hole.wrong_order, num_changed_);
}

TEST_F(LayerJudge, FindsASwappedPair) {
  const LayerAccuracy tally = judge_changed(1, [](auto &ray) { std::swap(ray[0], ray[1]); });
  EXPECT_EQ(tally.wrong_order, tally.failures());
  expect_found(tally);
}

TEST_F(LayerJudge, FindsAHitAThousandthOfAVoxelAway) {
  const FrameParams &frame = oracle_.frame(0);
  for (const bool with_place : {false, true}) {
    Layers layers = frame_.layers;
    num_changed_ = 0;
    for (std::uint32_t pixel = 0; pixel < kSize.num_rays(); ++pixel) {
      HitRecord &hit = layers[2][pixel];
      if (!hits(hit) || (hit.cell & ISO_CAP) != 0) continue;
      const OracleRay ray = exact_ray(make_ray(&frame, pixel));
      const double step = 1e-3 / speed_of(ray);
      ++num_changed_;
      hit.t += static_cast<float>(step * frame.view.t_scale);
      if (!with_place) continue;
      hit.x += static_cast<float>(step * ray.direction[0]);
      hit.y += static_cast<float>(step * ray.direction[1]);
      hit.z += static_cast<float>(step * ray.direction[2]);
    }
    const LayerAccuracy tally = judge(layers);
    EXPECT_GT(tally.wrong_places, tally.failures() * 9 / 10);
    expect_found(tally);
  }
}

TEST_F(LayerJudge, FindsAnExtraHit) {
  const LayerAccuracy twice = judge_changed(1, [](auto &ray) {
    ray.insert(ray.begin() + 1, ray[0]);
    ray.resize(16, no_hit());
  });
  expect_found(twice);
  const LayerAccuracy between = judge_changed(1, [&](auto &ray) {
    HitRecord extra = ray[0];  // a voxel's tenth behind it
    extra.x = extra.x > 0.5f ? extra.x - 0.1f : extra.x + 0.1f;
    ray.insert(ray.begin() + 1, extra);
    ray.resize(16, no_hit());
  });
  expect_found(between);
}

TEST_F(LayerJudge, FindsAWrongSurface) {
  const auto number = [](HitRecord hit, std::uint32_t surface) {
    hit.cell &= (1u << ISO_SURFACE_BIT) - 1;
    return with_surface(hit, surface);
  };
  const LayerAccuracy none = judge_changed(0, [&](auto &ray) { ray[0] = number(ray[0], 3); });
  EXPECT_EQ(none.wrong_surfaces, num_changed_);
  const LayerAccuracy other =
      judge_changed(1, [&](auto &ray) { ray[1] = number(ray[1], (surface_of(ray[1]) + 1) % 3); });
  EXPECT_GT(other.wrong_surfaces, num_changed_ / 10);
  expect_found(other);
}

TEST_F(LayerJudge, FindsRaysThatEndTooEarlyOrTooLate) {
  const LayerAccuracy early = judge_changed(1, [](auto &ray) { ray.pop_back(); });
  EXPECT_EQ(early.missed, early.failures());
  expect_found(early);
  // More opaque surfaces end rays where these go on, and the other way round.
  std::vector<SurfaceStyle> opaque = surfaces_;
  opaque[0].opacity = 0.97f;
  const LayeredFrame short_frame = draw(opaque);
  const LayerOracle of_opaque(of_.volume.info, camera_, kSize, clip_, opaque, voxels_);
  EXPECT_EQ(judge_layers(of_opaque, short_frame.layers).failures(), 0u);
  EXPECT_GT(judge_layers(of_opaque, frame_.layers).false_hits, right_.rays / 8);
  EXPECT_GT(judge(short_frame.layers).missed, right_.rays / 8);
}

TEST_F(LayerJudge, FindsFramesThatAreClippedElsewhere) {
  EXPECT_GT(right_.caps, 50u);
  Clip moved = clip_;
  moved.planes[0].offset += 1e-3;
  const LayeredFrame frame = Twin(of_.volume)
                                 .render_layers({.camera = camera_,
                                                 .size = kSize,
                                                 .clip = moved,
                                                 .surfaces = surfaces_,
                                                 .normals = Normals::kCell});
  EXPECT_GT(judge(frame.layers).wrong_places, right_.caps / 4);
  const LayerAccuracy no_caps = judge_changed(0, [](auto &ray) {
    for (HitRecord &hit : ray) hit.cell &= ~ISO_CAP;
  });
  EXPECT_GT(no_caps.wrong_kinds, right_.caps / 4);
}

TEST_F(LayerJudge, JudgesAFirstLayer) {
  const std::vector<HitRecord> &first = frame_.layers[0];
  const LayerAccuracy right = judge_first_layer(oracle_, first);
  EXPECT_EQ(right.failures(), 0u);
  EXPECT_EQ(right.hits + right.caps, std::uint64_t(std::ranges::count_if(first, hits)));
  const LayerAccuracy second = judge_first_layer(oracle_, frame_.layers[1]);
  EXPECT_GT(second.missed, (right.hits + right.caps) * 9 / 10);
  const LayerAccuracy none =
      judge_first_layer(oracle_, std::vector<HitRecord>(first.size(), no_hit()));
  EXPECT_LE(none.missed, right.hits + right.caps);
  EXPECT_GE(none.missed + 5, right.hits + right.caps);
  EXPECT_THROW(judge_first_layer(oracle_, {}), std::invalid_argument);
}

}  // namespace
}  // namespace isowave::core
