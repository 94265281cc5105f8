// Clipped frames against the oracle: every ray of twin and host, with caps and without, in
// perspective and in parallel projection, of one level of detail and of several.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "core/host/host_renderer.hpp"
#include "core/view/detail.hpp"
#include "reference/clip_oracle.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/clip_scene.hpp"
#include "tests/frame_scene.hpp"
#include "tests/oracle_volumes.hpp"
#include "tests/ray_cases.hpp"

namespace isowave::core {
namespace {

using test::ClipCase;
using test::clips;
using test::VolumeCase;

constexpr ImageSize kSize{47, 33};

struct ViewCase {
  std::string name;
  Camera camera;
  double voxel_pixels;
};

/// From outside, where the second level of detail begins in the volume's middle, and from within,
/// in what the first plane keeps and in what it removes.
std::vector<ViewCase> views(const VolumeInfo &info) {
  Camera outside = orbit_cameras(info, 3)[1];
  outside.eye += 0.3 * (outside.eye - outside.at);
  const glm::dvec3 eye = test::place_in(info, {0.4, 0.55, 0.5});
  Camera within{eye, test::place_in(info, {0.7, 0.2, 0.9})},
      removed{test::place_in(info, {0.9, 0.3, 0.8}), eye};
  within.fovy_deg = removed.fovy_deg = 100;
  const Camera parallel = in_parallel(outside);
  const auto halfway = [&](const Camera &camera, double distance) {
    const double longest = std::max({info.spacing.x, info.spacing.y, info.spacing.z});
    return 2 * longest / (distance * pixel_size_at(camera, kSize.height, 1));
  };
  const double distance = glm::length(outside.eye - outside.at);
  return {{"perspective", outside, 0},
          {"parallel", parallel, 0},
          {"within", within, 0},
          {"within what is removed", removed, 0},
          {"perspective, levels", outside, halfway(outside, distance)},
          {"perspective, three levels", outside, 1.9 * halfway(outside, distance)},
          {"parallel, the second level", parallel, 2.1 * halfway(parallel, 1)},
          {"within, levels", within, halfway(within, 0.1 * test::size_of_grid(info))}};
}

/// A frame's levels of detail, decoded.
struct Levels {
  Levels(const CompressedVolume &volume, const FrameRequest &request)
      : frames(make_level_frames(level_infos(volume, request.voxel_pixels > 0), request.camera,
                                 kSize, request.isovalue, request.voxel_pixels)) {
    for (const CompressedVolume *level : levels_of(volume, request.voxel_pixels > 0))
      voxels.push_back(decode_with_libzfp(*level));
  }
  std::vector<FrameParams> frames;
  std::vector<std::vector<float>> voxels;
};

std::string text(const HitRecord &hit) {
  return fmt::format("t {:.9} block {} cell {} at ({} {} {}) gradient ({} {} {})", hit.t,
                     hit.block_id, hit.cell, hit.x, hit.y, hit.z, hit.grad_x, hit.grad_y,
                     hit.grad_z);
}

std::string counts(const ClipAccuracy &tally) {
  return fmt::format(
      "of {} rays, {} hits and {} caps: {} missed, {} false, {} of the wrong kind, {} in a wrong "
      "place, {} with a wrong gradient; {} undecided",
      tally.rays, tally.hits, tally.caps, tally.missed, tally.false_hits, tally.wrong_kinds,
      tally.wrong_places, tally.wrong_gradients, tally.undecided);
}

/// The first failures, with all that it takes to look at them again.
std::string text(const ClipOracle &oracle, const ClipAccuracy &tally,
                 std::span<const HitRecord> hits) {
  std::string lines = counts(tally);
  for (std::size_t i = 0; i < std::min<std::size_t>(tally.failed.size(), 4); ++i) {
    const std::uint32_t pixel = tally.failed[i];
    std::vector<OracleRay> rays;
    for (const FrameParams &frame : oracle.frames())
      rays.push_back(exact_ray(make_ray(&frame, pixel)));
    const ClipTruth truth = oracle.first_hit(rays);
    const KeptPart kept = oracle.kept(rays[0], oracle.frames()[0].view.t_scale);
    lines += fmt::format(
        "\n  pixel {} ({},{}): stays from {:.9} to {:.9}, plane mask {}; right is {} at t {:.9} to "
        "{:.9} of level {}; got {}",
        pixel, pixel % kSize.width, pixel / kSize.width, kept.possibly.begin, kept.possibly.end,
        kept.begun_by, std::array{"none", "a hit", "a cap", "undecided"}[truth.kind], truth.begin,
        truth.end, truth.level, text(hits[pixel]));
  }
  return lines;
}

/// Draws a frame by twin and host, and judges its hits.
class ClippedVolume {
 public:
  explicit ClippedVolume(VolumeCase of) : of_(std::move(of)) {}

  const VolumeInfo &info() const { return of_.volume.info; }
  void expect_frame(const ViewCase &view, const Clip &clip) {
    const FrameRequest request{.camera = view.camera,
                               .isovalue = of_.isovalue,
                               .size = kSize,
                               .clip = clip,
                               .voxel_pixels = view.voxel_pixels};
    const Levels levels(of_.volume, request);
    const ClipOracle oracle(info(), view.camera, clip, levels.frames, levels.voxels);
    twin_.render(request);
    const ClipAccuracy tally = judge_clipped(oracle, twin_.hits());
    EXPECT_EQ(tally.failures(), 0u) << "twin, " << text(oracle, tally, twin_.hits());
    EXPECT_TRUE(clip.caps || tally.caps == 0);
    host_.render(request);
    test::expect_same_hits(host_.hits(), twin_.hits(), kSize.width);
    merge(sum_, tally);
  }
  const ClipAccuracy &sum() const { return sum_; }

 private:
  VolumeCase of_;
  TwinRenderer twin_{of_.volume, kSize};
  HostRenderer host_{of_.volume};
  ClipAccuracy sum_;
};

class ClippedFrames : public testing::TestWithParam<VolumeCase (*)()> {};
INSTANTIATE_TEST_SUITE_P(Volumes, ClippedFrames,
                         testing::Values(test::gyroid_volume, test::noise_volume,
                                         test::holes_volume, test::head_volume),
                         [](const auto &of) { return of.param().name; });

TEST_P(ClippedFrames, AreTheOracles) {
  ClippedVolume volume(GetParam()());
  for (const ViewCase &view : views(volume.info())) {
    for (const ClipCase &clip : clips(volume.info())) {
      for (const bool with_caps : {true, false}) {
        SCOPED_TRACE(
            fmt::format("{}, {}, {} caps", view.name, clip.name, with_caps ? "with" : "without"));
        volume.expect_frame(view, {clip.planes, with_caps});
      }
    }
  }
  const ClipAccuracy &sum = volume.sum();
  EXPECT_GT(sum.hits, sum.rays / 20);
  EXPECT_GT(sum.caps, sum.rays / 200);
  EXPECT_LT(sum.undecided, sum.rays / 1000);
  RecordProperty("counts", counts(sum));
}

/// Planes are voxel planes, the domain's faces, each other, and planes that rays run in; eyes are
/// on planes. What is certain there is right.
TEST(ClippedFramesOnTheGrid, AreTheOracles) {
  const glm::uvec3 dims(22, 19, 25);
  ClippedVolume volume(test::of_field("gyroid", test::grid_info(dims),
                                      test::sample(dims, test::gyroid_field(11)), 0.3f));
  const glm::dvec3 last = glm::dvec3(dims) - 1.0, middle = glm::floor(0.5 * last);
  const std::array box = box_planes({4, 5, 8}, {16, 12, 17}), domain = box_planes({0, 0, 0}, last);
  std::vector<ClipPlane> both(box.begin(), box.end());
  both.insert(both.end(), domain.begin(), domain.end());
  const std::vector<ClipPlane> twice{
      {{0, 0, 1}, middle.z}, {{0, 0, 2}, 2 * middle.z}, {{1, 1, 0}, 9}, {{2, 2, 0}, 18}};
  const std::vector<ClipPlane> nothing{{{0, 1, 0}, middle.y}, {{0, -1, 0}, -middle.y}};
  int turn = 0;
  for (const CameraCase &c : camera_cases(dims)) {
    for (const auto &planes :
         {std::vector<ClipPlane>(box.begin(), box.end()), both, twice, nothing}) {
      ++turn;
      SCOPED_TRACE(fmt::format("{}, {} planes", c.name, planes.size()));
      volume.expect_frame({c.name, c.camera, turn % 3 == 0 ? 1.5 : 0}, {planes, turn % 4 != 0});
    }
  }
  EXPECT_GT(volume.sum().caps, 1000u);
  EXPECT_LT(volume.sum().undecided, volume.sum().rays / 50);
  RecordProperty("counts", counts(volume.sum()));
}

/// Grids of every kind, cut by planes of any direction.
TEST(ClippedFramesAnywhere, AreTheOracles) {
  Random random(12);
  ClipAccuracy all;
  for (const test::GridCase &grid : test::clipped_grids()) {
    if (grid.info.brick != BrickOf{}) continue;
    ClippedVolume volume(test::of_field("gyroid", grid.info,
                                        test::sample(grid.info.dims, test::gyroid_field(9)), 0.1f));
    for (const Camera &camera : test::clipping_cameras(grid.info)) {
      for (int i = 0; i < 4; ++i) {
        const Clip clip = test::random_clip(grid.info, random);
        SCOPED_TRACE(fmt::format("{}, clip {}", grid.name, i));
        volume.expect_frame({grid.name, camera, i % 2 == 0 ? 0.0 : random.in(0.5, 8)}, clip);
      }
    }
    EXPECT_GT(volume.sum().caps, 10u);
    merge(all, volume.sum());
  }
  EXPECT_GT(all.hits, all.rays / 20);
  EXPECT_GT(all.caps, all.rays / 200);
  EXPECT_LT(all.undecided, all.rays / 1000);
  RecordProperty("counts", counts(all));
}

/// A judge that is told wrong hits says so.
class ClipJudge : public testing::Test {
 protected:
  ClipAccuracy judge(std::span<const HitRecord> hits) const { return judge_clipped(oracle_, hits); }
  ClipAccuracy judge_changed(const std::function<void(HitRecord &)> &change) const {
    std::vector<HitRecord> hits = hits_;
    for (HitRecord &hit : hits) {
      if (std::isfinite(hit.t)) change(hit);
    }
    return judge(hits);
  }
  std::vector<HitRecord> hits_of(const Clip &clip) const {
    FrameRequest request = request_;
    request.clip = clip;
    TwinRenderer twin(of_.volume, kSize);
    twin.render(request);
    return twin.hits();
  }
  static bool is_cap(const HitRecord &hit) { return (hit.cell & ISO_CAP) != 0; }

  VolumeCase of_ = test::gyroid_volume();
  FrameRequest request_{.camera = views(of_.volume.info)[0].camera,
                        .isovalue = of_.isovalue,
                        .size = kSize,
                        .clip = {clips(of_.volume.info)[2].planes}};
  Levels levels_{of_.volume, request_};
  ClipOracle oracle_{of_.volume.info, request_.camera, request_.clip, levels_.frames,
                     levels_.voxels};
  std::vector<HitRecord> hits_ = hits_of(request_.clip);
  ClipAccuracy right_ = judge(hits_);
};

TEST_F(ClipJudge, FindsFramesThatAreClippedElsewhere) {
  ASSERT_EQ(right_.failures(), 0u) << counts(right_);
  ASSERT_GT(right_.hits, 100u);
  ASSERT_GT(right_.caps, 50u);
  const ClipAccuracy whole = judge(hits_of({}));
  EXPECT_GT(whole.false_hits, 200u) << counts(whole);
  const ClipAccuracy open = judge(hits_of({request_.clip.planes, false}));
  EXPECT_GT(open.missed + open.wrong_kinds, right_.caps * 9 / 10) << counts(open);
  Clip moved = request_.clip;
  for (ClipPlane &plane : moved.planes) plane.offset += 1e-3;
  const ClipAccuracy by_a_thousandth = judge(hits_of(moved));
  EXPECT_GT(by_a_thousandth.failures(), right_.caps * 9 / 10) << counts(by_a_thousandth);
}

TEST_F(ClipJudge, FindsCapsThatAreNone) {
  const ClipAccuracy not_caps = judge_changed([](HitRecord &hit) { hit.cell &= ~ISO_CAP; });
  EXPECT_EQ(not_caps.wrong_kinds, right_.caps);
  const ClipAccuracy all_caps = judge_changed([](HitRecord &hit) { hit.cell |= ISO_CAP; });
  EXPECT_EQ(all_caps.wrong_kinds, right_.hits);
  const ClipAccuracy by_neighbour = judge_changed([&](HitRecord &hit) {
    std::size_t plane = 0;
    while (is_cap(hit) && std::abs(oracle_.cap_gradient(plane)[0] - hit.grad_x) > 1e-6) ++plane;
    const auto [x, y, z] = oracle_.cap_gradient((plane + 1) % 6);
    hit.grad_x = static_cast<float>(x);
    hit.grad_y = static_cast<float>(y);
    hit.grad_z = static_cast<float>(z);
  });
  EXPECT_GT(by_neighbour.wrong_gradients, right_.caps * 9 / 10);
  EXPECT_EQ(by_neighbour.failures(), by_neighbour.wrong_gradients);
  const ClipAccuracy turned = judge_changed([](HitRecord &hit) {
    if (is_cap(hit)) hit.grad_x = -hit.grad_x;
  });
  EXPECT_EQ(turned.wrong_gradients, right_.caps);
}

TEST_F(ClipJudge, FindsHitsAThousandthOfAVoxelAway) {
  const FrameParams &frame = levels_.frames[0];
  const auto moved = [&](bool with_place) {
    std::vector<HitRecord> hits = hits_;
    for (std::uint32_t pixel = 0; pixel < hits.size(); ++pixel) {
      HitRecord &hit = hits[pixel];
      const OracleRay ray = exact_ray(make_ray(&frame, pixel));
      const double step = 1e-3 / speed_of(ray);
      hit.t += static_cast<float>(step * frame.view.t_scale);
      if (!with_place) continue;
      hit.x += static_cast<float>(step * ray.direction[0]);
      hit.y += static_cast<float>(step * ray.direction[1]);
      hit.z += static_cast<float>(step * ray.direction[2]);
    }
    return judge(hits);
  };
  EXPECT_EQ(moved(false).wrong_places, right_.hits + right_.caps);
  const ClipAccuracy with_place = moved(true);
  EXPECT_EQ(with_place.failures(), with_place.wrong_places);
  EXPECT_GT(with_place.wrong_places, right_.hits + right_.caps * 9 / 10) << counts(with_place);
}

TEST_F(ClipJudge, FindsRaysThatMiss) {
  std::vector<HitRecord> hits = hits_;
  for (HitRecord &hit : hits) hit.t = std::numeric_limits<float>::infinity();
  EXPECT_EQ(judge(hits).missed, right_.hits + right_.caps);
  hits.pop_back();
  EXPECT_THROW(judge(hits), std::invalid_argument);
}

}  // namespace
}  // namespace isowave::core
