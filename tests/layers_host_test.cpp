// Several and translucent surfaces on the host: hits, colours, pictures and statistics are the
// twin's, bit for bit.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <future>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/frame/soon_renderer.hpp"
#include "core/host/host_renderer.hpp"
#include "core/io/open_volume.hpp"
#include "core/platform/memory.hpp"
#include "reference/twin.hpp"
#include "tests/clip_scene.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

constexpr ImageSize kSize{47, 33};

struct VolumeCase {
  std::string name;
  CompressedVolume volume;
  std::vector<SurfaceStyle> three, eight;
};

/// Surfaces of several colours at these isovalues, with opacities in turn.
std::vector<SurfaceStyle> surfaces_at(const std::vector<float> &isovalues,
                                      const std::vector<float> &opacities) {
  std::vector<SurfaceStyle> surfaces;
  for (std::size_t i = 0; i < isovalues.size(); ++i) {
    const float share = static_cast<float>(i) / static_cast<float>(isovalues.size());
    surfaces.push_back(
        {isovalues[i], {share, 1 - share, 0.3f + 0.5f * share}, opacities[i % opacities.size()]});
  }
  return surfaces;
}

/// unit: an isovalue's distance from the middle one
VolumeCase of_volume(const char *name, CompressedVolume volume, float middle, float unit) {
  std::vector<float> eight;
  for (const int i : {3, -1, 0, -4, 2, 1, -2, -3})
    eight.push_back(middle + unit * static_cast<float>(i));
  return {name, std::move(volume),
          surfaces_at({middle, middle + 3 * unit, middle - 2 * unit}, {0.3f, 1, 0.5f}),
          surfaces_at(eight, {0.2f, 0.45f, 0.1f, 0.8f, 0.05f})};
}

/// With levels of detail.
VolumeCase pyramid() {
  const glm::uvec3 dims(33, 29, 38);
  ArrayReader gyroid(test::grid_info(dims), test::sample(dims, test::gyroid_field(12)));
  return of_volume("pyramid", compress(gyroid, {.rate = 14, .levels = 0}), 0.1f, 0.3f);
}

std::vector<VolumeCase> volumes() {
  std::vector<VolumeCase> cases;
  VolumeInfo placed = test::grid_info({33, 29, 38}, {1, 1.3, 0.8});
  placed.origin = {-20, 35, 7};
  ArrayReader gyroid(placed, test::sample(placed.dims, test::gyroid_field(12)));
  cases.push_back(of_volume("gyroid", compress(gyroid, {.rate = 14}), 0.1f, 0.3f));
  const glm::uvec3 dims(22, 25, 19);
  const TestVolume noise(test::grid_info(dims), test::sample(dims, test::noise_field(7)),
                         ErrorGoal{.exact = true});
  cases.push_back(of_volume("noise, lossless", noise.compressed, 0.05f, 0.2f));
  const glm::uvec3 of_holes(31, 26, 29);
  const auto with_holes = test::with_hole(
      of_holes, test::sample(of_holes, test::gyroid_field(9)), [](const glm::uvec3 &at) {
        return glm::length(glm::dvec3(at) - glm::dvec3(15)) < 6 ||
               (at.x + 3 * at.y + 7 * at.z) % 97 == 0;
      });
  cases.push_back(of_volume("holes", test::compressed(of_holes, with_holes), 0.1f, 0.25f));
  const auto head = open_volume(std::string(ISOWAVE_TEST_DATA) + "/head_41x41x41_uint8.raw.gz");
  cases.push_back(of_volume("head", compress(*head, {.rate = 6}), 60.5f, 12));
  return cases;
}

/// Voxels of -1 and 1 in turns: rays have up to three crossings in a cell.
TestVolume thin_sheets() {
  const glm::uvec3 dims(11, 9, 10);
  const auto alternating = [](const glm::dvec3 &at) {
    return std::fmod(at.x + at.y + at.z, 2) == 0 ? 1.0 : -1.0;
  };
  return {test::grid_info(dims), test::sample(dims, alternating), ErrorGoal{.exact = true}};
}

/// From outside in perspective and in parallel, and from within.
std::vector<Camera> cameras_of(const VolumeInfo &info) {
  const Camera outside = orbit_cameras(info, 3)[1];
  Camera within{test::place_in(info, {0.4, 0.55, 0.5}), test::place_in(info, {0.7, 0.2, 0.9})};
  within.fovy_deg = 100;
  return {outside, in_parallel(outside), within};
}

/// Whole, clipped by a plane and by a slab, with caps and without.
std::vector<Clip> clips_of(const VolumeInfo &info) {
  const glm::dvec3 middle = test::place_in(info, {0.52, 0.47, 0.55}), normal(-2, 0.7, -1.1);
  const ClipPlane plane{normal, glm::dot(normal, middle)};
  const ClipPlane other{-normal, -glm::dot(normal, middle) - 3 * glm::length(normal)};
  return {{}, {{plane}, true}, {{plane, other}, true}, {{plane}, false}};
}

Appearance light() {
  Appearance light;
  light.ambient = 0.3f;
  light.background = {0.1f, 0.2f, 0.4f};
  light.background_top = {0.9f, 0, 0.5f};
  return light;
}

/// Frames' statistics, so that no test is passed by pictures of nothing.
struct Seen {
  std::uint64_t hits = 0, behind_in_cell = 0, caps = 0, cut = 0;
};

void expect_same_picture(HostRenderer &renderer, const FrameRequest &request,
                         const std::vector<RayColor> &colors) {
  const FrameParams frame =
      make_frame_params(renderer.levels().front(), request.camera, *request.size, 0);
  for (const bool transparent : {false, true}) {
    Appearance appearance = request.light;
    appearance.transparent = transparent;
    const auto arrays = renderer.fetch({.picture = true}, appearance);
    const Image8 expected =
        shade_layers_scalar(frame, make_shade_params(renderer.levels().front(), appearance), colors,
                            request.size->samples);
    ASSERT_EQ(arrays.picture.size(), expected.pixels.size());
    EXPECT_TRUE(std::ranges::equal(arrays.picture, expected.pixels));
  }
}

/// Draws the frame, and compares all of it with the twin's.
void expect_twins(HostRenderer &renderer, const Twin &twin, const FrameRequest &request,
                  Seen &seen) {
  const LayeredFrame expected = twin.render_layers(request);
  const FrameStats stats = renderer.render(request);
  expect_same_hits(renderer.hits(), expected.layers.front(), request.size->ray_columns());
  ASSERT_EQ(renderer.colors().size(), expected.colors.size());
  EXPECT_EQ(std::memcmp(renderer.colors().data(), expected.colors.data(),
                        expected.colors.size() * sizeof(RayColor)),
            0);
  if (request.size->stride == 1) expect_same_picture(renderer, request, expected.colors);
  EXPECT_EQ(stats.layers.layers, expected.stats.layers);
  EXPECT_EQ(stats.layers.hits, expected.stats.hits);
  EXPECT_EQ(stats.layers.rays_cut, expected.stats.rays_cut);
  EXPECT_EQ(stats.rays_hit, test::num_hits(expected.layers.front()));
  EXPECT_TRUE(stats.complete);
  seen.hits += expected.stats.hits;
  seen.cut += expected.stats.rays_cut;
  for (const auto &layer : expected.layers) {
    for (const HitRecord &hit : layer) {
      if (hit.t == INFINITY) continue;
      seen.behind_in_cell += crossings_up_to(hit) > 1;
      seen.caps += is_cap(hit);
    }
  }
}

TEST(LayersOnTheHost, FramesAreTheTwins) {
  Seen seen;
  for (const VolumeCase &of : volumes()) {
    HostRenderer renderer(of.volume);
    const Twin twin(of.volume);
    const std::vector<SurfaceStyle> one = {{of.three[0].isovalue, {0.2f, 0.7f, 0.3f}, 0.3f}};
    Normals normals = Normals::kSmooth;
    for (const Camera &camera : cameras_of(of.volume.info)) {
      for (const Clip &clip : clips_of(of.volume.info)) {
        for (const auto &surfaces : {one, of.three, of.eight}) {
          SCOPED_TRACE(fmt::format("{}: {} surfaces, {} planes, {}", of.name, surfaces.size(),
                                   clip.planes.size(), camera.parallel_height.value_or(0)));
          FrameRequest request{.camera = camera, .size = kSize};
          request.clip = clip;
          request.surfaces = surfaces;
          request.light = light();
          request.normals = normals;
          expect_twins(renderer, twin, request, seen);
          normals = normals == Normals::kSmooth ? Normals::kCell : Normals::kSmooth;
        }
      }
    }
  }
  EXPECT_GT(seen.hits, 200'000u);
  EXPECT_GT(seen.behind_in_cell, 1'000u);
  EXPECT_GT(seen.caps, 10'000u);
}

/// Rays that go on within a cell; more layers than are drawn; samples.
TEST(LayersOnTheHost, ThinSheetsAreTheTwins) {
  const TestVolume volume = thin_sheets();
  HostRenderer renderer(volume.compressed);
  const Twin twin(volume.compressed);
  Seen seen;
  for (const Camera &camera : cameras_of(volume.info())) {
    for (const std::uint32_t samples : {1, 2, 3}) {
      for (const float opacity : {0.05f, 0.4f}) {
        FrameRequest request{.camera = camera, .size = ImageSize{23, 17, samples}};
        request.surfaces = surfaces_at({0, 0.25f, -0.5f}, {opacity});
        request.light = light();
        expect_twins(renderer, twin, request, seen);
      }
    }
  }
  EXPECT_GT(seen.hits, 20'000u);
  EXPECT_GT(seen.behind_in_cell, 3'000u);
  EXPECT_GT(seen.cut, 1'000u);
}

/// What is drawn of some rays alone, and of voxels with fewer bit planes.
TEST(LayersOnTheHost, SamplesAndFewerPlanes) {
  const VolumeCase of = std::move(volumes().front());
  HostRenderer renderer(of.volume);
  FrameRequest request{.camera = cameras_of(of.volume.info)[0], .size = ImageSize{101, 67, 1, 3}};
  request.surfaces = of.three;
  request.light = light();
  Seen seen;
  expect_twins(renderer, Twin(of.volume), request, seen);
  request.size = kSize;
  request.voxel_error = 0.05;
  expect_twins(renderer, Twin(of.volume, 0, 0.05), request, seen);
  const auto coarse = renderer.hits();
  request.voxel_error = 0;
  expect_twins(renderer, Twin(of.volume), request, seen);
  const auto fine = renderer.hits();
  EXPECT_NE(std::memcmp(coarse.data(), fine.data(), fine.size() * sizeof(HitRecord)), 0);
}

TEST(LayersOnTheHost, OneOpaqueSurfaceIsThePlainPicture) {
  for (const VolumeCase &of : volumes()) {
    SCOPED_TRACE(of.name);
    HostRenderer renderer(of.volume);
    for (const std::uint32_t samples : {1, 2, 3}) {
      for (const bool transparent : {false, true}) {
        Appearance appearance = light();
        appearance.transparent = transparent;
        FrameRequest request{.camera = cameras_of(of.volume.info)[0],
                             .isovalue = of.three[0].isovalue,
                             .size = ImageSize{47, 33, samples},
                             .clip = clips_of(of.volume.info)[samples % 2]};
        const FrameStats plain = renderer.render(request);
        EXPECT_EQ(plain.layers.layers, 0u);
        EXPECT_TRUE(renderer.colors().empty());
        const auto hits = renderer.hits();
        EXPECT_GT(test::num_hits(hits), 300u);
        const WantedArrays all{true, true, true, true};
        const FrameArrays expected = renderer.fetch(all, appearance);
        request.surfaces = {{request.isovalue, appearance.surface, 1}};
        request.isovalue = 0;
        request.light = appearance;
        const FrameStats stats = renderer.render(request);
        EXPECT_EQ(stats.layers.layers, 1u);
        EXPECT_EQ(stats.layers.hits, plain.rays_hit);
        EXPECT_EQ(stats.rays_hit, plain.rays_hit);
        expect_same_hits(renderer.hits(), hits, request.size->ray_columns());
        const FrameArrays arrays = renderer.fetch(all, appearance);
        EXPECT_TRUE(std::ranges::equal(arrays.picture, expected.picture));
        EXPECT_TRUE(std::ranges::equal(arrays.depth, expected.depth));
        EXPECT_TRUE(std::ranges::equal(arrays.normals, expected.normals));
        ASSERT_EQ(arrays.positions.size(), expected.positions.size());  // NaN where nothing is hit
        EXPECT_EQ(std::memcmp(arrays.positions.data(), expected.positions.data(),
                              arrays.positions.size() * sizeof(arrays.positions[0])),
                  0);
      }
    }
  }
}

/// The loops for any processor, and for this one.
TEST(LayersOnTheHost, AllLoopsGiveTheSameBits) {
  std::vector<VolumeCase> all_volumes = volumes();
  all_volumes.push_back(pyramid());
  for (const VolumeCase &of : all_volumes) {
    HostLevels levels(of.volume, HostRoom::kNoLimit, 0);
    const double pixels = of.volume.coarser_levels.empty() ? 0 : 1.5;
    const Twin twin(of.volume, pixels);
    const VolumeInfo &info = of.volume.info;
    const Camera camera = cameras_of(info)[2];
    const auto frames = make_level_frames(levels.infos(), camera, kSize, 0, pixels);
    EXPECT_EQ(std::ranges::count_if(frames, draws) > 1, pixels != 0);
    const FrameParams &frame = frames.front();
    for (const Clip &clip_by : clips_of(info)) {
      const LayeredFrame expected = twin.render_layers({.camera = camera,
                                                        .size = kSize,
                                                        .clip = clip_by,
                                                        .surfaces = of.three,
                                                        .light = light()});
      const ClipParams clip = make_clip_params(info, frame.view, camera, clip_by);
      const LayerBlend by{.shading = make_shade_params(info, light()),
                          .colors = make_layer_params(of.three, {}, info, frame.view, camera),
                          .numbers = innermost_first(of.three),
                          .clip = clip,
                          .finest = &frame};
      std::vector<float> isovalues;
      for (const std::uint32_t number : by.numbers) isovalues.push_back(of.three[number].isovalue);
      std::vector<LeveledSurface> surfaces = levels.open_surfaces(frames, isovalues, 0);
      for (LeveledSurface &surface : surfaces) {
        for (HostLevel &level : surface) level.clip = clip_by.planes.empty() ? nullptr : &clip;
      }
      const RayTile all{0, 0, kSize.width, kSize.height};
      for (const HostLoops &loops : all_host_loops()) {
        for (const bool by_rays : {false, true}) {
          const auto trace = by_rays ? loops.trace_rays_of_levels : loops.trace_levels;
          const auto blend = by_rays ? loops.blend_rays : loops.blend;
          levels.forget();
          std::vector<HitRecord> next(kSize.num_rays() * surfaces.size());
          for (std::size_t k = 0; k < surfaces.size(); ++k) {
            std::vector<HitRecord> of_one(kSize.num_rays(), no_hit());
            trace(surfaces[k], all, false, of_one.data());
            for (std::size_t i = 0; i < of_one.size(); ++i)
              next[k + surfaces.size() * i] = of_one[i];
          }
          std::vector<HitRecord> hits(kSize.num_rays(), no_hit());
          std::vector<RayColor> colors(kSize.num_rays());
          LayerStats stats;
          const std::uint32_t num_hits =
              blend(surfaces, by, all, next.data(), {hits.data(), colors.data(), &stats});
          EXPECT_EQ(num_hits, test::num_hits(hits));
          expect_same_hits(hits, expected.layers.front(), kSize.width);
          EXPECT_EQ(
              std::memcmp(colors.data(), expected.colors.data(), colors.size() * sizeof(RayColor)),
              0);
          EXPECT_EQ(stats.hits, expected.stats.hits);
          EXPECT_EQ(stats.layers, expected.stats.layers);
          std::vector<std::uint8_t> picture(3 * kSize.num_pixels());
          for (std::uint32_t row = 0; row < kSize.height; ++row)
            loops.shade_layers(frame, by.shading.params, 1, row, colors.data(),
                               picture.data() + std::size_t{3} * kSize.width * row);
          EXPECT_EQ(picture, shade_layers_scalar(frame, by.shading.params, expected.colors).pixels);
        }
      }
    }
  }
}

/// The layers of rows that are done are there after each pass, and stay if on_pass stops the frame.
TEST(LayersOnTheHost, OnPassStops) {
  const VolumeCase of = std::move(volumes().front());
  constexpr ImageSize kTall{40, 150};
  FrameRequest request{.camera = cameras_of(of.volume.info)[0], .size = kTall};
  request.surfaces = of.three;
  request.light = light();
  HostRenderer renderer(of.volume, {.num_threads = 1});
  const FrameStats whole = renderer.render(request);
  const auto hits = renderer.hits();
  const auto colors = renderer.colors();
  const auto picture = renderer.fetch({.picture = true}, request.light).picture;
  std::size_t num_passes = 0;
  request.on_pass = [&](const PassStats &pass) {
    const std::size_t left = pass.counts.next_active_count, done = hits.size() - left;
    EXPECT_GT(left, 0u);
    EXPECT_EQ(std::memcmp(renderer.colors().data(), colors.data(), done * sizeof(RayColor)), 0);
    for (std::size_t ray = done; ray < hits.size(); ++ray)
      EXPECT_EQ(renderer.colors()[ray].transmittance, 1) << ray;
    const auto so_far = renderer.fetch({.picture = true}, request.light).picture;
    EXPECT_EQ(std::memcmp(so_far.data(), picture.data(), 3 * done), 0);
    EXPECT_NE(std::memcmp(so_far.data(), picture.data(), picture.size()), 0);
    return ++num_passes < 2;
  };
  const FrameStats stats = renderer.render(request);
  EXPECT_TRUE(stats.cancelled);
  EXPECT_FALSE(stats.complete);
  ASSERT_EQ(stats.passes.size(), 2u);
  EXPECT_EQ(stats.rays_hit, test::num_hits(renderer.hits()));
  EXPECT_GT(stats.rays_hit, 0u);
  EXPECT_LT(stats.rays_hit, whole.rays_hit);
  EXPECT_LT(stats.layers.hits, whole.layers.hits);
  EXPECT_GE(stats.layers.hits, stats.rays_hit);
}

/// Blocks that do not fit are decoded anew. A limit that leaves no room for the surfaces is
/// refused.
TEST(LayersOnTheHost, AnyLimitGivesTheSameBits) {
  const TestVolume volume({70, 41, 53}, test::gyroid_field(13), 9);
  const Twin twin(volume.compressed);
  FrameRequest request{.camera = cameras_of(volume.info())[0], .size = kSize};
  request.surfaces = surfaces_at({0.2f, -0.3f, 0.9f}, {0.3f});
  request.clip = clips_of(volume.info())[1];
  request.light = light();
  const std::uint64_t least = HostLevels::least_bytes(volume.compressed, 3);
  ASSERT_EQ(least, HostLevels::least_bytes(volume.compressed) +
                       2 * HostBlocks::bytes_per_isovalue(volume.info()));
  Seen seen;
  for (const std::uint64_t pages : {0, 50}) {
    const std::uint64_t limit = least + pages * platform::page_bytes();
    HostRenderer renderer(volume.compressed, {.memory_limit = limit, .num_threads = 2});
    expect_twins(renderer, twin, request, seen);
    EXPECT_LE(renderer.memory_bytes(), limit);
  }
  HostRenderer renderer(volume.compressed, {.memory_limit = least - 1});
  EXPECT_THAT([&] { renderer.render(request); },
              ThrowsMessage<Error>(
                  AllOf(HasSubstr("drawing 3 surfaces on the host takes"), Not(HasSubstr("\n")))));
  request.surfaces.resize(2);
  expect_twins(renderer, twin, request, seen);
}

/// Frames of one surface take no more memory after one of several.
TEST(LayersOnTheHost, MemoryOfSurfacesIsGivenBack) {
  const TestVolume volume({70, 41, 53}, test::gyroid_field(13), 9);
  HostBlocks blocks(volume.compressed, HostBlocks::kNoLimit, 0);
  const FrameParams frame =
      make_frame_params(volume.info(), cameras_of(volume.info())[0], kSize, 0.2f);
  const auto draw = [&](std::size_t selection) {
    FrameParams of = frame;
    of.surface = blocks.surface(selection);
    std::vector<HitRecord> hits(kSize.num_rays(), no_hit());
    host_loops().trace(of, blocks.field(selection), {0, 0, kSize.width, kSize.height}, false,
                       hits.data());
    return test::num_hits(hits);
  };
  blocks.select(0.2f);
  const std::uint64_t expected = draw(0), bytes = blocks.bytes();
  blocks.select(std::vector<float>{0.2f, 0.2f, -5.0f});
  EXPECT_EQ(blocks.bytes(), bytes + 2 * HostBlocks::bytes_per_isovalue(volume.info()));
  EXPECT_EQ(draw(1), expected);
  EXPECT_EQ(draw(0), expected);
  EXPECT_EQ(draw(2), 0u);
  EXPECT_GT(blocks.bytes(), bytes + 2 * HostBlocks::bytes_per_isovalue(volume.info()));
  blocks.select(0.2f);
  EXPECT_EQ(blocks.bytes(), bytes);
  EXPECT_EQ(draw(0), expected);
  EXPECT_EQ(blocks.bytes(), bytes);
}

/// A picture that is put aside shows its first layer, as of one surface.
TEST(LayersOnTheHost, KeptPicturesShowTheFirstLayer) {
  const VolumeCase of = std::move(volumes().front());
  HostRenderer renderer(of.volume);
  FrameRequest request{.camera = cameras_of(of.volume.info)[0], .size = kSize};
  request.surfaces = of.three;
  renderer.render(request);
  const auto hits = renderer.hits();
  renderer.keep_picture();
  renderer.enlarge_kept(request);
  expect_same_hits(renderer.hits(), hits, kSize.width);
  EXPECT_TRUE(renderer.colors().empty());
  EXPECT_EQ(renderer.fetch({.picture = true}, {}).picture.size(), 3 * kSize.num_pixels());
}

TEST(LayersOnTheHost, DrawsUntilADeviceIsReady) {
  const VolumeCase of = std::move(volumes().front());
  std::promise<void> made;
  SoonRenderer renderer(
      {.abilities = HostRenderer::abilities_of(of.volume),
       .make = [&](const std::stop_token &) -> std::shared_ptr<Renderer> {
         made.get_future().wait();
         return std::make_shared<HostRenderer>(of.volume);
       },
       .meanwhile_abilities = HostRenderer::abilities_of(of.volume),
       .make_meanwhile = [&] { return std::make_unique<HostRenderer>(of.volume); }});
  FrameRequest request{.camera = cameras_of(of.volume.info)[0], .size = kSize};
  request.surfaces = of.three;
  EXPECT_TRUE(renderer.ready_for(request));
  EXPECT_EQ(renderer.render(request).layers.hits,
            Twin(of.volume).render_layers(request).stats.hits);
  EXPECT_FALSE(renderer.ready());
  made.set_value();
  renderer.wait();
}

/// A picture that the device would refuse is refused meanwhile, too.
TEST(LayersOnTheHost, IsRefusedUntilADeviceIsReadyThatCannot) {
  const VolumeCase of = std::move(volumes().front());
  SoonRenderer renderer(
      {.abilities = {.clipping = true},
       .make = [](const std::stop_token &) -> std::shared_ptr<Renderer> { throw Error("none"); },
       .meanwhile_abilities = HostRenderer::abilities_of(of.volume),
       .make_meanwhile = [&] { return std::make_unique<HostRenderer>(of.volume); }});
  FrameRequest request{.camera = cameras_of(of.volume.info)[0], .size = kSize};
  request.surfaces = of.three;
  EXPECT_THAT([&] { renderer.render(request); },
              ThrowsMessage<Error>(HasSubstr("leave out surfaces")));
}

TEST(LayersOnTheHost, RefusesInOneLine) {
  const VolumeCase of = std::move(volumes().front());
  HostRenderer renderer(of.volume);
  FrameRequest good{.camera = cameras_of(of.volume.info)[0], .size = kSize};
  good.surfaces = of.three;
  const auto expect_refusal = [&](auto change, const char *line) {
    FrameRequest request = good;
    change(request);
    EXPECT_THAT([&] { renderer.render(request); },
                ThrowsMessage<Error>(AllOf(HasSubstr(line), Not(HasSubstr("\n")))));
  };
  expect_refusal(
      [](FrameRequest &request) {
        for (int i = 0; i < 6; ++i) request.surfaces.push_back({static_cast<float>(5 + i)});
      },
      "9 surfaces are more than a frame can have: give at most 8");
  expect_refusal([](FrameRequest &request) { request.surfaces[1].isovalue = NAN; },
                 "the isovalue is NaN");
  for (const float opacity : {0.0f, 1.5f, -0.5f, NAN}) {
    expect_refusal([&](FrameRequest &request) { request.surfaces[1].opacity = opacity; },
                   "is out of range: give more than 0, at most 1");
  }
  expect_refusal([](FrameRequest &request) { request.surfaces[2].color.g = 1.01f; },
                 "a colour of 1.01 is out of range");
  expect_refusal(
      [](FrameRequest &request) { request.surfaces[2].isovalue = request.surfaces[0].isovalue; },
      "two surfaces have the isovalue 0.1");
  expect_refusal([](FrameRequest &request) { request.voxel_pixels = 1; },
                 "leave out voxel_pixels, or draw");
  expect_refusal(
      [](FrameRequest &request) {
        request.ambient_rays = 2;
        for (SurfaceStyle &surface : request.surfaces) surface.opacity = 0.9f;
      },
      "end at surfaces of opacity 1, and there is none");
  expect_refusal([](FrameRequest &request) { request.bound = FieldBound::kLower; },
                 "leave out bound");
  expect_refusal([](FrameRequest &request) { request.max_surface_error = 1; },
                 "leave out max_surface_error");
  expect_refusal([](FrameRequest &request) { request.time_budget_ms = 20; },
                 "leave out time_budget_ms");
  EXPECT_GT(renderer.render(good).layers.hits, 0u);
}

}  // namespace
}  // namespace isowave::core
