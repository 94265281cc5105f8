// Scenes that teams draw in bricks, with the bits of one renderer: several surfaces with light
// rays, slices, colours by a field, labels.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/frame/labels.hpp"
#include "core/view/color_maps.hpp"
#include "core/view/detail.hpp"
#include "tests/brick_team.hpp"
#include "tests/field_scene.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;

constexpr ImageSize kFrame{37, 29};

/// What a frame shows, and its counts.
struct Shown {
  Image8 picture, transparent;
  std::vector<float> depth;
  std::optional<std::array<float, 2>> field_range;
  std::uint64_t num_hits = 0;
  LayerStats layers;
};

Shown draw(Renderer &renderer, const FrameRequest &request, Appearance appearance) {
  Shown shown;
  const FrameStats stats = renderer.render(request);
  shown.field_range = renderer.field_range();
  shown.picture = renderer.shade(appearance);
  shown.depth = renderer.depth();
  shown.num_hits = renderer.num_hits(stats);
  shown.layers = stats.layers;
  appearance.transparent = true;
  shown.transparent = renderer.shade(appearance);
  return shown;
}

class BrickScenesOnDevice : public test::BrickTeam {
 protected:
  /// Compares with one renderer, for several numbers of ranks.
  Shown expect_of_one(const CompressedVolume &volume, const CompressedVolume *field,
                      RendererOptions options, const FrameRequest &request,
                      const Appearance &appearance = {}) {
    options.size = request.size.value();
    ocl::Device device(GetParam());
    RendererOptions of_one = options;
    of_one.field = field;
    DeviceRenderer alone(device, volume, of_one);
    const Shown expected = draw(alone, request, appearance);
    for (const std::uint32_t num_ranks : {2u, 5u}) {
      on_ranks(num_ranks, volume, field, options, [&](TeamRenderer &renderer, std::uint32_t rank) {
        const Shown got = draw(renderer, request, appearance);
        EXPECT_EQ(got.layers.layers, expected.layers.layers);
        EXPECT_EQ(got.layers.hits, expected.layers.hits);
        EXPECT_EQ(got.layers.rays_cut, expected.layers.rays_cut);
        EXPECT_EQ(got.field_range, expected.field_range);
        if (rank != 0) {
          EXPECT_TRUE(got.picture.pixels.empty() && got.depth.empty());
          return;
        }
        EXPECT_EQ(got.picture.pixels, expected.picture.pixels);
        EXPECT_EQ(got.transparent.pixels, expected.transparent.pixels);
        EXPECT_EQ(got.depth, expected.depth);
        EXPECT_EQ(got.num_hits, expected.num_hits);
      });
    }
    return expected;
  }
};
INSTANTIATE_TEST_SUITE_P(Devices, BrickScenesOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Light rays of each layer go through all bricks, and meet the opaque surfaces, clipped or not.
TEST_P(BrickScenesOnDevice, LightOfSeveralSurfaces) {
  request_.size = kFrame;
  request_.surfaces = {{-0.3f, {0.9f, 0.2f, 0.1f}, 0.4f},
                       {0.2f, {0.2f, 0.4f, 0.9f}, 1},
                       {0.5f, {0.8f, 0.8f, 0.3f}, 1, false}};
  request_.clip = {{{{0.3, 1, 0.2}, 12}}, true};
  const RendererOptions options{.max_surfaces = 3, .with_bounce = true};
  const Shown unlit = expect_of_one(volume_.compressed, nullptr, options, request_);
  EXPECT_GT(unlit.layers.layers, 2u);
  request_.ambient_rays = 2;
  request_.shadow_rays = 2;
  request_.light_angle = 20;
  request_.light.towards_light = glm::dvec3(0.5, 1, -0.3);
  const Shown lit = expect_of_one(volume_.compressed, nullptr, options, request_);
  EXPECT_EQ(lit.layers.hits, unlit.layers.hits);
  EXPECT_NE(lit.picture.pixels, unlit.picture.pixels);
  request_.bounce_rays = 2;
  const Shown bounced = expect_of_one(volume_.compressed, nullptr, options, request_);
  EXPECT_NE(lit.picture.pixels, bounced.picture.pixels);
}

/// Within bricks, in the planes of cuts and across each other.
const Slices kSlices{{{{{1, 0, 0}, 16}, 0.5f},
                      {{{0, 0, 1}, 12}, 0.6f},
                      {{{0.3, -1, 0.4}, -8.3}, 0.7f, false},
                      {{{0, 1, 0}, 29}, 0.2f}},
                     -1,
                     1,
                     color_map("viridis")};

TEST_P(BrickScenesOnDevice, SlicesBesideASurface) {
  for (const std::uint32_t samples : {1u, 2u}) {
    request_.size = {kFrame.width, kFrame.height, samples};
    request_.surfaces = {{0.2f, {0.2f, 0.4f, 0.9f}, 0.3f}};
    request_.slices = kSlices;
    request_.clip = {{{{0.3, 1, 0.2}, 9}}, true};
    const RendererOptions options{.max_surfaces = 1, .with_given_rays = true};
    const Shown whole = expect_of_one(volume_.compressed, nullptr, options, request_);
    EXPECT_GT(whole.layers.layers, 4u);
    // Behind an opaque surface, no brick's hits count.
    request_.surfaces[0].opacity = 1;
    request_.ambient_rays = 1;
    const Shown opaque = expect_of_one(volume_.compressed, nullptr, options, request_);
    EXPECT_LT(opaque.layers.hits, whole.layers.hits);
    request_.ambient_rays = 0;
  }
}

/// Several levels of detail draw surfaces and slices, and their light rays go through all bricks in
/// the level of their hit.
TEST_P(BrickScenesOnDevice, LevelsOfDetail) {
  ArrayReader reader(test::grid_info({41, 37, 33}),
                     test::sample({41, 37, 33}, test::gyroid_field(9)));
  const CompressedVolume volume = compress(reader, {.rate = 12, .levels = 3});
  request_.size = kFrame;
  request_.camera = orbit_cameras(volume.info, 3)[1];
  request_.surfaces = {{-0.3f, {0.9f, 0.2f, 0.1f}, 0.4f},
                       {0.2f, {0.2f, 0.4f, 0.9f}, 1},
                       {0.5f, {0.8f, 0.8f, 0.3f}, 1, false}};
  request_.clip = {{{{0.3, 1, 0.2}, 12}}, true};
  RendererOptions options{.with_levels = true, .max_surfaces = 3, .with_bounce = true};
  request_.ambient_rays = 1;
  request_.shadow_rays = 1;
  request_.light.towards_light = glm::dvec3(0.5, 1, -0.3);
  request_.bounce_rays = 1;
  const Shown finest = expect_of_one(volume, nullptr, options, request_);
  request_.voxel_pixels = 0.8;
  const auto frames = make_level_frames(level_infos(volume, true), request_.camera, kFrame, 0, 0.8);
  EXPECT_GT(std::ranges::count_if(frames, draws), 1);
  const Shown lit = expect_of_one(volume, nullptr, options, request_);
  EXPECT_NE(lit.picture.pixels, finest.picture.pixels);
  request_.ambient_rays = request_.shadow_rays = request_.bounce_rays = 0;
  request_.surfaces = {{0.2f, {0.2f, 0.4f, 0.9f}, 0.3f}, {-0.5f, {0.2f, 0.9f, 0.4f}, 0.3f}};
  request_.slices = kSlices;
  const Shown sliced = expect_of_one(volume, nullptr, options, request_);
  EXPECT_GT(sliced.layers.layers, 6u);
}

/// Nothing is seen of hits there, and rays go on behind them.
TEST_P(BrickScenesOnDevice, SlicesOfVoxelsWithoutData) {
  std::vector<float> voxels = test::sample(volume_.info().dims, test::gyroid_field(9));
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (i / 5 % 7 == 0) voxels[i] = std::nanf("");
  }
  const TestVolume with_holes(volume_.info(), voxels, 12);
  request_.size = kFrame;
  request_.surfaces = {{0.2f, {0.2f, 0.4f, 0.9f}, 0.3f}};
  request_.slices = kSlices;
  const Shown whole = expect_of_one(volume_.compressed, nullptr, {.max_surfaces = 1}, request_);
  const Shown holes = expect_of_one(with_holes.compressed, nullptr, {.max_surfaces = 1}, request_);
  EXPECT_NE(holes.picture.pixels, whole.picture.pixels);
}

/// From parallel rays along an axis: slices at right angles to them, one in the plane of a cut.
TEST_P(BrickScenesOnDevice, SlicesInPlanesOfCuts) {
  const glm::dvec3 middle = 0.5 * (glm::dvec3(volume_.info().dims) - 1.0);
  for (const int axis : {0, 1, 2}) {
    glm::dvec3 along(0);
    along[axis] = 1;
    request_.camera = in_parallel({middle - 60.0 * along, middle, {0.3, 0.5, 0.7}, 30});
    request_.size = kFrame;
    request_.surfaces = {{0.2f, {0.2f, 0.4f, 0.9f}, 0.5f}};
    request_.slices = {{}, -1, 1, color_map("gray")};
    for (const double plane : {0.0, 8.0, 12.0, 16.0, 20.0})
      request_.slices.planes.push_back({{along, plane}, 0.3f});
    expect_of_one(volume_.compressed, nullptr, {.max_surfaces = 1}, request_);
  }
}

/// Values of the volume itself, and of another one, whose grid is turned. The range that colours
/// have by default is that of all bricks' visible hits.
TEST_P(BrickScenesOnDevice, ColorsByAField) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  request_.camera = orbit_cameras(volume.info, 3)[1];
  for (const CompressedVolume *field : {&volume, &other}) {
    for (const std::uint32_t samples : {1u, 2u}) {
      request_.size = {kFrame.width, kFrame.height, samples};
      request_.field_values = true;
      request_.clip = test::far_half(volume.info, request_.camera);
      for (const std::uint32_t ambient_rays : {0u, 1u}) {
        request_.ambient_rays = ambient_rays;
        for (const bool on_caps : {false, true}) {
          request_.field_on_caps = on_caps;
          const Shown shown =
              expect_of_one(volume, field, {.with_given_rays = true}, request_, test::by_field());
          ASSERT_TRUE(shown.field_range);
          EXPECT_LT((*shown.field_range)[0], (*shown.field_range)[1]);
        }
      }
    }
  }
}

/// Layers have colours by the field, whose range is that of all its voxels.
TEST_P(BrickScenesOnDevice, LayersWithColorsByAField) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  request_.camera = orbit_cameras(volume.info, 3)[1];
  request_.size = kFrame;
  request_.surfaces = {{-0.3f, {0.9f, 0.2f, 0.1f}, 0.4f},
                       {0.2f, {0.2f, 0.4f, 0.9f}, 0.5f, true, false},
                       {0.5f, {0.8f, 0.8f, 0.3f}, 1}};
  const RendererOptions options{.max_surfaces = 3, .with_given_rays = true};
  const Shown plain = expect_of_one(volume, nullptr, options, request_);
  request_.field_values = true;
  request_.light = test::by_field();
  request_.ambient_rays = 1;
  for (const CompressedVolume *field : {&volume, &other}) {
    const Shown shown = expect_of_one(volume, field, options, request_);
    EXPECT_NE(shown.picture.pixels, plain.picture.pixels);
  }
}

/// Groups of labels, with the colours of their own labels.
TEST_P(BrickScenesOnDevice, Labels) {
  VolumeInfo info = test::grid_info({33, 30, 29});
  info.spacing = {0.5, 0.7, 0.4};
  info.type = VoxelType::kUint16;
  const std::vector<float> voxels = test::sample(info.dims, [](const glm::dvec3 &at) {
    const double value = test::gyroid_field(9)(at);
    return value > 0.6 ? 300.0 : value > 0.1 ? 7.0 : value < -0.5 ? 65535.0 : 0.0;
  });
  const CompressedVolume volume = TestVolume(info, voxels, ErrorGoal{.exact = true}).compressed;
  request_.camera = orbit_cameras(info, 3)[1];
  request_.size = kFrame;
  SurfaceStyle one{.color = {0.9f, 0.2f, 0.1f}, .opacity = 0.4f};
  SurfaceStyle two{.color = {0.2f, 0.4f, 0.9f}, .opacity = 1};
  one.labels = {7, 300};
  two.labels = {65535};
  request_.surfaces = {one, two};
  const RendererOptions options{.max_surfaces = 2, .with_labels = true};
  const Shown own = expect_of_one(volume, nullptr, options, request_);
  EXPECT_GT(own.layers.layers, 2u);
  request_.field_values = request_.field_labels = true;
  request_.light.color_by_field = ColorByField{.colors = color_map("viridis"), .labels = true};
  const Shown by_label = expect_of_one(volume, &volume, options, request_);
  EXPECT_NE(by_label.picture.pixels, own.picture.pixels);
  ocl::Device device(GetParam());
  RendererOptions of_one = options;
  of_one.size = kFrame;
  DeviceRenderer alone(device, volume, of_one);
  const Camera camera = alone.label_camera(two.labels);
  on_ranks(3, volume, nullptr, of_one, [&](TeamRenderer &renderer, std::uint32_t) {
    EXPECT_EQ(renderer.label_camera(two.labels).eye, camera.eye);
  });
}

/// All ranks refuse colours by a field whose values the frame does not have.
TEST_P(BrickScenesOnDevice, ColorsWithoutValuesAreRefused) {
  RendererOptions options{.size = kFrame};
  on_ranks(2, volume_.compressed, &volume_.compressed, options,
           [&](TeamRenderer &renderer, std::uint32_t) {
             renderer.render(request_);
             EXPECT_THAT([&] { renderer.shade(test::by_field()); },
                         testing::ThrowsMessage<Error>(testing::HasSubstr("has no values")));
           });
}

}  // namespace
}  // namespace isowave::core
