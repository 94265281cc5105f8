// Teams of threads that draw a volume's bricks together, each on a device of its own: pictures pass
// by pass, within a time, within an error, with ambient rays; and what they do where one fails.

#include "core/bricks/team_renderer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>
#include <thread>
#include <tuple>

#include "core/accuracy/bounded_renderer.hpp"
#include "core/accuracy/certify.hpp"
#include "core/base/error.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/frame/timed_renderer.hpp"
#include "core/view/detail.hpp"
#include "tests/brick_team.hpp"

namespace isowave::core {
namespace {

using test::camera_along;
using test::TestVolume;
using test::ThreadTeam;

constexpr float kIsovalue = test::kBrickIsovalue;
constexpr ImageSize kFrame = test::kBrickFrame;

class BrickTeamOnDevice : public test::BrickTeam {};
INSTANTIATE_TEST_SUITE_P(Devices, BrickTeamOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Ids are a brick's own: the whole has 2^42 blocks.
TEST_P(BrickTeamOnDevice, BrickOfAVolumeWithMoreBlocksThanIds) {
  const VolumeInfo whole = test::grid_info(glm::uvec3(65536));
  const BlockBox own{{8000, 9000, 10000}, {8006, 9006, 10006}};
  VolumeInfo info = brick_info(whole, own);
  info.brick.before = info.brick.behind = glm::uvec3(0);  // the twin draws all that a brick keeps
  TestVolume volume(info.dims, test::gyroid_field(9));
  volume.compressed.info = info;
  const glm::dvec3 middle = 2.0 * glm::dvec3(own.begin + own.end);
  const Camera camera = test::camera_along(middle - glm::dvec3(25, 20, 30), {0.5, 0.4, 0.6});
  const Cuts cuts(blocks_along(whole), 1);
  test::ThreadMeeting meeting(1);
  ThreadTeam team(meeting, 0);
  ocl::Device device(GetParam());
  TeamRenderer renderer(device, volume.compressed, {.size = kFrame}, cuts, {whole}, team);
  const FrameStats stats = renderer.render({.camera = camera, .isovalue = kIsovalue});
  EXPECT_EQ(renderer.depth(), depth_of(test::twin_hits(volume, camera, kFrame, kIsovalue)));
  EXPECT_GT(renderer.num_hits(stats), 200u);
}

/// Rank 0 of a team whose others have drawn nothing.
class FirstOfMany : public TeamOfOne {
 public:
  explicit FirstOfMany(std::uint32_t size) : size_(size) {}
  std::uint32_t size() const override { return size_; }

 private:
  std::uint32_t size_;
};

/// Half a word has room for the places of 255 bricks.
TEST_P(BrickTeamOnDevice, AWordForEachColourOfManyBricks) {
  for (const std::uint32_t size : {255u, 256u}) {
    const Cuts cuts(blocks_along(volume_.info()), size);
    const CompressedVolume brick = cut_brick(volume_.compressed, cuts.bricks().front());
    FirstOfMany team(size);
    ocl::Device device(GetParam());
    FrameRequest request = request_;
    request.camera = camera_along({-20, -18, -16}, {0.6, 0.5, 0.5});
    DeviceRenderer alone(device, brick, {.size = kFrame});
    alone.render(request);
    TeamRenderer renderer(device, brick, {.size = kFrame}, cuts, {volume_.info()}, team);
    renderer.render(request);
    EXPECT_EQ(renderer.shade({.transparent = true}).pixels,
              alone.shade({.transparent = true}).pixels);
    const CompositionStats before = renderer.composition();
    EXPECT_EQ(renderer.shade({}).pixels, alone.shade().pixels);
    EXPECT_GT(renderer.num_hits({}), 0u);
    const std::uint64_t rays = kFrame.num_rays();
    EXPECT_EQ(renderer.composition().bytes - before.bytes,
              size == 255 ? 8 * ((rays + 1) / 2) : 8 * rays);
  }
}

/// Bricks are put together from where parallel rays come from, wherever their eye is.
TEST_P(BrickTeamOnDevice, ParallelRays) {
  for (Camera camera : orbit_cameras(volume_.info(), 3)) {
    camera.eye = 0.5 * (camera.eye + camera.at);
    request_.camera = in_parallel(camera);
    const RendererOptions options{.size = kFrame};
    const Image8 whole = picture_of_one(request_, options);
    on_ranks(4, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
      renderer.render(request_);
      const Image8 image = renderer.shade({});
      EXPECT_TRUE(rank != 0 || image.pixels == whole.pixels);
    });
  }
}

/// With one ray a pixel, colours are put together; with several, hits; ambient rays have both
/// whole.
TEST_P(BrickTeamOnDevice, TransparentPictures) {
  constexpr Appearance kTransparent{.transparent = true};
  for (const std::uint32_t samples : {1u, 2u}) {
    for (const std::uint32_t ambient_rays : {0u, 1u}) {
      request_.ambient_rays = ambient_rays;
      const RendererOptions options{.size = {kFrame.width, kFrame.height, samples},
                                    .with_given_rays = true};
      const Image8 whole = picture_of_one(request_, options, kTransparent);
      ASSERT_EQ(whole.channels, 4u);
      on_ranks(3, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
        std::vector<Image8> images;
        FrameRequest request = request_;
        request.on_pass = [&](const PassStats &) {
          images.push_back(renderer.shade(kTransparent));
          return true;
        };
        renderer.render(request);
        images.push_back(renderer.shade(kTransparent));
        const Image8 opaque = renderer.shade({});
        if (rank != 0) return;
        EXPECT_GT(images.size(), 2u);
        EXPECT_EQ(images.front().channels, 4u);
        EXPECT_EQ(images[images.size() - 2].pixels, whole.pixels);
        EXPECT_EQ(images.back().pixels, whole.pixels);
        EXPECT_EQ(images.back().channels, 4u);
        EXPECT_EQ(opaque.channels, 3u);
      });
    }
  }
}

/// A cap is drawn by the brick that has it, and ambient rays are clipped in all bricks.
TEST_P(BrickTeamOnDevice, ClippedVolumes) {
  const RendererOptions options{.size = kFrame, .with_given_rays = true};
  request_.ambient_rays = 2;
  const Image8 all = picture_of_one(request_, options);
  const glm::dvec3 middle = 0.5 * glm::dvec3(volume_.info().dims - 1u);
  const glm::dvec3 towards_eye = glm::normalize(camera_.eye - middle);
  for (const bool caps : {true, false}) {
    request_.clip = {{{-towards_eye, -glm::dot(towards_eye, middle)}, {{0.1, 1, 0.2}, 9}}, caps};
    const Image8 whole = picture_of_one(request_, options);
    EXPECT_NE(whole.pixels, all.pixels);
    on_ranks(4, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
      renderer.render(request_);
      const Image8 image = renderer.shade({});
      EXPECT_TRUE(rank != 0 || image.pixels == whole.pixels);
    });
  }
}

/// Shadow rays go through the bricks of all ranks.
TEST_P(BrickTeamOnDevice, Shadows) {
  const RendererOptions options{.size = kFrame, .with_given_rays = true};
  request_.ambient_rays = 1;
  request_.shadow_rays = 2;
  request_.light_angle = 20;
  request_.light.towards_light = glm::dvec3(0.5, 1, -0.3);
  const Image8 whole = picture_of_one(request_, options, request_.light);
  on_ranks(4, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
    std::size_t num_images = 0;
    FrameRequest request = request_;
    request.on_pass = [&](const PassStats &) {
      num_images += renderer.shade(request.light).pixels.empty() ? 0 : 1;
      return true;
    };
    for (const OnPass &on_pass : {request.on_pass, OnPass()}) {
      request.on_pass = on_pass;
      renderer.render(request);
      const Image8 image = renderer.shade(request.light);
      EXPECT_TRUE(rank != 0 || image.pixels == whole.pixels);
    }
    EXPECT_TRUE(rank != 0 || num_images > 3);
  });
}

/// Light comes by way of places in other bricks. Passes show the rounds so far.
TEST_P(BrickTeamOnDevice, BouncedLight) {
  request_.bounce_rays = 3;
  request_.light.towards_light = glm::dvec3(0.5, 1, -0.3);
  const glm::dvec3 middle = 0.5 * glm::dvec3(volume_.info().dims - 1u);
  for (const std::uint32_t shadow_rays : {0u, 2u}) {
    const RendererOptions options{.size = kFrame, .with_bounce = true};
    request_.shadow_rays = shadow_rays;
    if (shadow_rays != 0) request_.clip = {{{{0.1, 1, 0.2}, glm::dot({0.1, 1, 0.2}, middle)}}};
    const Image8 whole = picture_of_one(request_, options, request_.light);
    FrameRequest plain = request_;
    plain.bounce_rays = 0;
    EXPECT_NE(picture_of_one(plain, options, request_.light).pixels, whole.pixels);
    on_ranks(4, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
      for (const bool in_step : {false, true}) {
        FrameRequest request = request_;
        std::size_t num_images = 0;
        if (in_step) {
          request.on_pass = [&](const PassStats &) {
            num_images += renderer.shade(request.light).pixels.empty() ? 0 : 1;
            return true;
          };
        }
        renderer.render(request);
        const Image8 image = renderer.shade(request.light);
        if (rank != 0) continue;
        EXPECT_EQ(image.pixels, whole.pixels);
        EXPECT_EQ(num_images > 3, in_step);
      }
    });
  }
}

/// What is seen through bricks is blended in their order, up to 16 crossings of all bricks.
TEST_P(BrickTeamOnDevice, TranslucentSurfaces) {
  for (const std::uint32_t samples : {1u, 2u}) {
    const RendererOptions options{.size = {25, 17, samples}, .max_surfaces = 3};
    for (const float opacity : {0.02f, 0.4f}) {
      request_.surfaces = {{-0.3f, {0.9f, 0.2f, 0.1f}, opacity},
                           {0.2f, {0.2f, 0.4f, 0.9f}, opacity},
                           {0.5f, {0.8f, 0.8f, 0.3f}, 1}};
      if (opacity < 0.1f) request_.surfaces.pop_back();
      request_.clip = {{{{0.3, 1, 0.2}, 12}}, opacity < 0.1f};
      request_.light.diffuse = 0.6f;
      ocl::Device device(GetParam());
      DeviceRenderer alone(device, volume_.compressed, options);
      const FrameStats expected = alone.render(request_);
      EXPECT_GT(expected.layers.layers, 4u);
      EXPECT_EQ(expected.layers.rays_cut != 0, opacity < 0.1f) << "some rays have too many hits";
      const Appearance transparent{.transparent = true};
      const Image8 opaque = alone.shade({}), whole = alone.shade(transparent);
      const std::vector<float> depth = alone.depth();
      for (const std::uint32_t num_ranks : {2u, 5u}) {
        on_ranks(num_ranks, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
          const FrameStats stats = renderer.render(request_);
          EXPECT_EQ(stats.layers.layers, expected.layers.layers);
          EXPECT_EQ(stats.layers.hits, expected.layers.hits);
          EXPECT_EQ(stats.layers.rays_cut, expected.layers.rays_cut);
          const Image8 image = renderer.shade({}), clear = renderer.shade(transparent);
          const std::vector<float> of_team = renderer.depth();
          const std::uint64_t num_hits = renderer.num_hits(stats);
          if (rank != 0) return;
          EXPECT_EQ(image.pixels, opaque.pixels);
          EXPECT_EQ(clear.pixels, whole.pixels);
          EXPECT_EQ(of_team, depth);
          EXPECT_EQ(num_hits, expected.rays_hit);
        });
      }
    }
  }
}

std::size_t num_drawn(const Image8 &image) {
  std::size_t drawn = 0;
  for (std::size_t i = 0; i < image.pixels.size(); i += 3)
    drawn += image.pixels[i] != 255 || image.pixels[i + 1] != 255 || image.pixels[i + 2] != 255;
  return drawn;
}

/// Ranks are through after different numbers of passes. More and more rays have hits, and the last
/// picture is the whole's.
TEST_P(BrickTeamOnDevice, PicturesPassByPass) {
  for (const std::uint32_t samples : {1u, 2u}) {
    // A small cache, so that there are many passes.
    const RendererOptions options{.size = {kFrame.width, kFrame.height, samples},
                                  .cache_slots = 60};
    const Image8 whole = picture_of_one(request_, options);
    std::vector<std::size_t> num_calls(3), num_passes(3);
    std::vector<Image8> images;
    Image8 last;
    on_ranks(3, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
      FrameRequest request = request_;
      request.on_pass = [&](const PassStats &) {
        ++num_calls[rank];
        Image8 image = renderer.shade({});
        if (rank == 0) images.push_back(std::move(image));
        return true;
      };
      const FrameStats stats = renderer.render(request);
      EXPECT_FALSE(stats.cancelled);
      num_passes[rank] = stats.passes.size() + stats.normals.passes;
      Image8 image = renderer.shade({});
      if (rank == 0) last = std::move(image);
    });
    const std::size_t most = std::ranges::max(num_passes);
    EXPECT_THAT(num_calls, testing::Each(most));
    EXPECT_GT(most, std::ranges::min(num_passes)) << "one is through before others";
    ASSERT_EQ(images.size(), most);
    EXPECT_LT(num_drawn(images.front()), num_drawn(whole));
    for (std::size_t i = 1; i < images.size(); ++i)
      EXPECT_GE(num_drawn(images[i]), num_drawn(images[i - 1]));
    EXPECT_EQ(images.back().pixels, whole.pixels);
    EXPECT_EQ(last.pixels, whole.pixels);
  }
}

TEST_P(BrickTeamOnDevice, AllStopInTheSamePass) {
  const RendererOptions options{.size = kFrame, .cache_slots = 60};
  const Image8 whole = picture_of_one(request_, options);
  on_ranks(3, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
    FrameRequest request = request_;
    int calls = 0;
    request.on_pass = [&](const PassStats &) { return ++calls < 3; };
    EXPECT_TRUE(renderer.render(request).cancelled);
    EXPECT_EQ(calls, 3);
    EXPECT_FALSE(renderer.render(request_).cancelled);
    const Image8 image = renderer.shade({});
    if (rank == 0) {
      EXPECT_EQ(image.pixels, whole.pixels);
    }
  });
}

/// In a pass, or between rounds of ambient rays; then all throw, and the next frame is drawn as
/// any.
TEST_P(BrickTeamOnDevice, WhereOneFailsAllDo) {
  const RendererOptions options{.size = kFrame, .cache_slots = 60, .with_given_rays = true};
  const Image8 whole = picture_of_one(request_, options);
  on_ranks(3, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
    for (const bool in_ambient : {false, true}) {
      FrameRequest request = request_;
      request.ambient_rays = 2;
      const std::uint64_t before = renderer.composition().reductions;
      int calls = 0;
      request.on_pass = [&](const PassStats &) {
        const bool fails = in_ambient ? renderer.composition().reductions > before : ++calls == 2;
        if (rank == 1 && fails) throw Error("the disk is full");
        return true;
      };
      std::string failure;
      try {
        renderer.render(request);
      } catch (const Error &error) {
        failure = error.what();
      }
      EXPECT_EQ(failure, "rank 1: the disk is full");
    }
    renderer.render(request_);
    const Image8 image = renderer.shade({});
    if (rank == 0) {
      EXPECT_EQ(image.pixels, whole.pixels);
    }
  });
}

TEST_P(BrickTeamOnDevice, AmbientRays) {
  request_.ambient_rays = 3;
  for (const std::uint32_t samples : {1u, 2u}) {
    const ImageSize size{kFrame.width, kFrame.height, samples};
    const RendererOptions options{.size = size, .with_given_rays = true};
    const Image8 whole = picture_of_one(request_, options);
    on_ranks(4, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
      for (const bool in_step : {false, true}) {
        FrameRequest request = request_;
        std::size_t calls = 0;
        if (in_step) request.on_pass = [&](const PassStats &) { return ++calls != 0; };
        const CompositionStats before = renderer.composition();
        const FrameStats stats = renderer.render(request);
        EXPECT_GE(stats.ambient.passes, request_.ambient_rays);
        EXPECT_EQ(calls != 0, in_step);
        // Eight fields of a hit; then a bit for each ray of a hit.
        const std::uint64_t rays = size.num_rays();
        EXPECT_EQ(renderer.composition().reductions - before.reductions, 8 + request_.ambient_rays);
        EXPECT_EQ(renderer.composition().bytes - before.bytes,
                  8 * (8 * rays + request_.ambient_rays * ((rays + 63) / 64)));
        const Image8 image = renderer.shade({});
        const std::vector<float> depth = renderer.depth();
        if (rank != 0) continue;
        EXPECT_EQ(image.pixels, whole.pixels);
        EXPECT_EQ(
            std::uint64_t(std::ranges::count_if(depth, [](float t) { return std::isfinite(t); })),
            renderer.num_hits({}));
      }
    });
  }
}

TEST_P(BrickTeamOnDevice, PicturesWithinATime) {
  request_.ambient_rays = 2;
  const RendererOptions options{.size = kFrame, .with_kept_picture = true, .with_given_rays = true};
  const Image8 whole = picture_of_one(request_, options);
  on_ranks(3, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
    TimedRenderer timed(renderer);
    EXPECT_FALSE(timed.render(within_ms(1e-6, request_)).complete);
    const Image8 coarse = renderer.shade({});
    EXPECT_TRUE(timed.render(within_ms(1e9, request_)).complete);
    const Image8 image = renderer.shade({});
    if (rank != 0) return;
    EXPECT_EQ(image.pixels, whole.pixels);
    EXPECT_EQ(coarse.pixels.size(), whole.pixels.size());
    EXPECT_GT(num_drawn(coarse), num_drawn(whole) / 2);
    EXPECT_NE(coarse.pixels, whole.pixels);
  });
}

/// A frame within an error, and what a user gets of it.
struct BoundedCase {
  FrameRequest request;
  double max_surface_error;
  Evidence by = Evidence::kProof;
};
struct BoundedFrame {
  DetailChoice choice;
  std::vector<float> depth;
  Certificate certificate;
};

/// volume: that this process's renderer was made for.
BoundedFrame draw_within(Renderer &renderer, const CompressedVolume &volume, double rate,
                         const BoundedCase &of) {
  BoundedRenderer bounded(renderer, volume, rate);
  FrameRequest request = of.request;
  request.max_surface_error = of.max_surface_error;
  request.by = of.by;
  BoundedFrame frame;
  frame.choice = bounded.render(request).detail.value();
  frame.depth = bounded.depth();
  frame.certificate = certify(renderer, volume, with_detail(of.request, frame.choice.detail),
                              std::span<const float>(frame.depth));
  return frame;
}

/// All that is known of a choice, but for its time, to the last bit.
std::string text_of(const DetailChoice &choice) {
  std::string text =
      fmt::format("{} {}: reachable {}, median {}, tolerance {}, {}", choice.detail.voxel_pixels,
                  choice.detail.voxel_error, choice.reachable, choice.median,
                  choice.tolerance.value_or(0), choice.advice);
  if (choice.sample) {
    text += fmt::format(", {} of {} of {}, {}", choice.sample->num_within, choice.sample->num_hits,
                        choice.sample->num_rays, choice.sample->lowest);
  }
  for (const DetailChoice::Try &each : choice.tries)
    text +=
        fmt::format("; {} {}: {}", each.detail.voxel_pixels, each.detail.voxel_error, each.kept);
  return text;
}

/// Each of a team's ranks must choose what one renderer has chosen; rank 0 has its frame. Where the
/// bricks cannot be cut at all levels of detail, the coarsest must be refused.
void expect_by_team(std::uint32_t size, const CompressedVolume &volume,
                    const RendererOptions &options, const ocl::DeviceInfo &on,
                    std::span<const BoundedCase> cases, std::span<const BoundedFrame> expected) {
  SCOPED_TRACE(fmt::format("{} ranks", size));
  const std::vector<VolumeInfo> levels = level_infos(volume, true);
  const std::size_t num_levels = num_cut_levels(volume.info, levels.size(), size);
  const Cuts cuts(blocks_along(volume.info), size, num_blocks, cut_unit(num_levels));
  test::ThreadMeeting meeting(size);
  const auto work = [&](std::uint32_t rank) {
    ThreadTeam team(meeting, rank);
    ocl::Device device(on);
    CompressedVolume brick = cut_brick(volume, cuts.bricks()[rank], num_levels);
    const double rate = agree_on_voxels(team, brick);
    EXPECT_EQ(rate, volume.rate());
    std::optional<TeamRenderer> made;
    in_turns(team, rank == 0, [&] { made.emplace(device, brick, options, cuts, levels, team); });
    TeamRenderer &renderer = *made;
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const BoundedFrame frame = draw_within(renderer, brick, rate, cases[i]);
      EXPECT_EQ(text_of(frame.choice), text_of(expected[i].choice));
      EXPECT_EQ(frame.depth, rank == 0 ? expected[i].depth : std::vector<float>());
      EXPECT_EQ(frame.certificate.bounds,
                rank == 0 ? expected[i].certificate.bounds : std::vector<float>());
    }
    if (num_levels == levels.size()) return;
    FrameRequest coarse = cases[0].request;
    coarse.voxel_pixels = 1000;
    EXPECT_THAT([&] { renderer.render(coarse); },
                testing::ThrowsMessage<Error>(testing::HasSubstr("or compress it with ")));
  };
  std::vector<std::jthread> threads;
  for (std::uint32_t rank = 0; rank < size; ++rank) threads.emplace_back(work, rank);
}

/// Coarse levels are chosen, and few bit planes; eyes are far away, and in a brick; and rays begin
/// between the bounds, where a surface goes through the volume's faces.
TEST_P(BrickTeamOnDevice, WithinAnError) {
  const VolumeInfo info = test::grid_info({64, 61, 58}, {1, 1.25, 0.75});
  const std::vector<float> source = test::sample(info.dims, [&](const glm::dvec3 &at) {
    return test::sphere_field(info.dims)(at) + 0.01 * std::sin(0.4 * at.x) * std::cos(0.3 * at.z);
  });
  Camera far = orbit_cameras(info, 1)[0];
  far.eye += 0.6 * (far.eye - far.at);
  const Camera inside = test::camera_along(0.45 * glm::dvec3(info.dims), {1, 0.25, -0.5}),
               at_face = test::camera_along({49.5, 37.5, -5}, {0, 0, 1});
  const std::vector<BoundedCase> cases = {
      {{.camera = far, .isovalue = 0.5f}, 3},
      {{.camera = inside, .isovalue = 0.5f}, 2},
      {{.camera = at_face, .isovalue = 0.35f}, 1e-6},
      {{.camera = far, .isovalue = 0.5f}, 3, Evidence::kSample},
      {{.camera = far, .surfaces = {{0.5f}, {0.4f, {}, 0.5f}}, .slices = {{{{{1, 0, 0}, 40}}}}}, 1},
      {{.camera = inside, .surfaces = {{0.5f}, {0.7f}}}, 1, Evidence::kSample}};
  double most_pixels = 0, most_error = 0;
  std::uint64_t num_uncertain = 0;
  for (const bool is_bounded : {false, true}) {
    ArrayReader reader(info, source);
    CompressOptions how{.rate = 20, .measure_error = true, .levels = 0};
    if (is_bounded) how.precision = BlockPrecision{.min_exponent = -6};
    const CompressedVolume volume = compress(reader, how);
    RendererOptions options{
        .size = kFrame, .with_levels = true, .with_bounds = true, .max_surfaces = 2};
    std::vector<BoundedFrame> expected;
    {
      ocl::Device device(GetParam());
      DeviceRenderer renderer(device, volume, options);
      for (const BoundedCase &each : cases) {
        expected.push_back(draw_within(renderer, volume, volume.rate(), each));
        most_pixels = std::max(most_pixels, expected.back().choice.detail.voxel_pixels);
        most_error = std::max(most_error, expected.back().choice.detail.voxel_error);
      }
    }
    EXPECT_GT(summarize(expected[0].certificate, 3).num_certified, 100u);
    EXPECT_FALSE(expected[2].choice.reachable);
    num_uncertain += summarize(expected[2].certificate, 1).num_uncertain;
    options.cache_slots = 300;
    for (const std::uint32_t size : is_bounded ? std::vector{3u} : std::vector{2u, 8u})
      expect_by_team(size, volume, options, GetParam(), cases, expected);
  }
  EXPECT_GT(most_pixels, 0);
  EXPECT_GT(most_error, 0);
  EXPECT_GT(num_uncertain, 5u);
}

/// Rays that are chosen for an error of the picture, as one renderer chooses them.
TEST_P(BrickTeamOnDevice, WithinAnErrorOfThePicture) {
  if (is_simulator(GetParam())) GTEST_SKIP() << "too many rays";
  const RendererOptions options{.size = {256, 256}};
  FrameRequest request = request_;
  request.size = {24, 20, 8};
  request.max_image_error = 0.12;
  const auto draw = [&](Renderer &renderer) {
    BoundedRenderer bounded(renderer, volume_.compressed, volume_.compressed.rate());
    const ImageError error = bounded.render(request).detail.value().image.value();
    return std::tuple(error.samples, error.mean, error.highest, bounded.shade().pixels);
  };
  ocl::Device device(GetParam());
  DeviceRenderer renderer(device, volume_.compressed, options);
  auto expected = draw(renderer);
  EXPECT_GT(std::get<0>(expected), 1u);
  EXPECT_LT(std::get<0>(expected), 8u);
  on_ranks(2, options, [&](TeamRenderer &of_team, std::uint32_t rank) {
    auto of_rank = expected;
    if (rank != 0) std::get<3>(of_rank).clear();
    EXPECT_EQ(draw(of_team), of_rank);
  });
}

}  // namespace
}  // namespace isowave::core
