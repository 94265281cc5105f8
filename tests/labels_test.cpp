// Surfaces of labels: the bits of isosurfaces of the labels' indicators, by the twin and by other
// renderers of a device; layers of several groups; other labels of the same volume; what is
// refused.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/base/error.hpp"
#include "core/frame/labels.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{53, 41};

VolumeInfo placed_grid(const glm::uvec3 &dims, VoxelType type = VoxelType::kUint16) {
  VolumeInfo info = test::grid_info(dims);
  info.spacing = {0.5, 0.7, 0.4};
  info.origin = {30, -20, 11};
  info.direction = glm::dmat3({0.8, 0.6, 0}, {-0.6, 0.8, 0}, {0, 0, 1});
  info.type = type;
  return info;
}

/// Ellipsoids that touch and cut each other, on a background of 0, and single voxels.
std::vector<float> segmentation(const glm::uvec3 &dims) {
  struct Ellipsoid {
    glm::dvec3 middle, radii;
    float label;
  };
  const std::vector<Ellipsoid> all{{{0.4, 0.5, 0.5}, {0.35, 0.4, 0.3}, 3},
                                   {{0.7, 0.5, 0.5}, {0.25, 0.25, 0.4}, 300},
                                   {{0.45, 0.45, 0.5}, {0.12, 0.2, 0.15}, 65535},
                                   {{0.3, 0.8, 0.2}, {0.15, 0.15, 0.15}, 4},
                                   {{0.9, 0.9, 0.9}, {0.3, 0.3, 0.3}, 256}};
  std::vector<float> voxels;
  voxels.reserve(std::size_t{dims.x} * dims.y * dims.z);
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x) {
        float label = (7 * x + 5 * y + 3 * z) % 211 == 0 ? 9.0f : 0.0f;
        for (const Ellipsoid &ellipsoid : all) {
          const glm::dvec3 at = glm::dvec3(x, y, z) / (glm::dvec3(dims) - 1.0);
          if (glm::length((at - ellipsoid.middle) / ellipsoid.radii) < 1) label = ellipsoid.label;
        }
        voxels.push_back(label);
      }
    }
  }
  return voxels;
}

CompressedVolume lossless(const VolumeInfo &info, const std::vector<float> &voxels) {
  return test::TestVolume(info, voxels, ErrorGoal{.exact = true}).compressed;
}

/// 1 at voxels with one of the labels, 0 at the others.
std::vector<float> indicator(const std::vector<float> &voxels,
                             const std::vector<std::uint16_t> &labels) {
  std::vector<float> values(voxels.size());
  std::ranges::transform(voxels, values.begin(), [&](float voxel) {
    return std::ranges::find(labels, static_cast<std::uint16_t>(voxel)) != labels.end() ? 1.0f
                                                                                        : 0.0f;
  });
  return values;
}

SurfaceStyle group(std::vector<std::uint16_t> labels, float opacity = 1,
                   const glm::vec3 &color = {0.8f, 0.4f, 0.2f}) {
  SurfaceStyle style{.color = color, .opacity = opacity};
  style.labels = std::move(labels);
  return style;
}

/// A request of the same surface, of the labels' indicator.
FrameRequest of_indicator(FrameRequest request, std::size_t surface) {
  SurfaceStyle style = request.surfaces[surface];
  style.labels.clear();
  style.isovalue = ISO_LABEL_ISOVALUE;
  request.surfaces = {style};
  return request;
}

struct Scene {
  explicit Scene(const glm::uvec3 &dims, VoxelType type = VoxelType::kUint16)
      : info(placed_grid(dims, type)), voxels(segmentation(dims)), volume(lossless(info, voxels)) {}

  CompressedVolume indicator_of(const SurfaceStyle &surface) const {
    VolumeInfo of_type = info;
    of_type.type = VoxelType::kUint8;
    return lossless(of_type, indicator(voxels, surface.labels));
  }

  /// From near, so that the volume fills the picture.
  FrameRequest request(std::vector<SurfaceStyle> surfaces, ImageSize size = kSize) const {
    FrameRequest request{.camera = orbit_cameras(info, 1)[0], .size = size};
    request.camera.eye = glm::mix(request.camera.eye, request.camera.at, 0.4);
    request.surfaces = std::move(surfaces);
    return request;
  }

  ClipPlane through_middle() const {
    const glm::dvec3 middle = info.origin + info.index_to_world() * (glm::dvec3(info.dims) * 0.5);
    const glm::dvec3 normal{-0.3, -1, 0.2};
    return {normal, glm::dot(normal, middle)};
  }

  VolumeInfo info;
  std::vector<float> voxels;
  CompressedVolume volume;
};

/// One group: hits, layers and picture are those of the twin, which draws the indicator.
void expect_the_twins(Renderer &renderer, const Scene &scene, const FrameRequest &request) {
  const CompressedVolume indicator = scene.indicator_of(request.surfaces[0]);
  TwinRenderer twin(indicator, *request.size);
  const FrameStats expected = twin.render(of_indicator(request, 0)), got = renderer.render(request);
  EXPECT_GT(expected.rays_hit, 10u);
  EXPECT_EQ(got.rays_hit, expected.rays_hit);
  EXPECT_EQ(got.layers.layers, expected.layers.layers);
  EXPECT_EQ(got.layers.hits, expected.layers.hits);
  EXPECT_EQ(got.layers.rays_cut, expected.layers.rays_cut);
  expect_same_hits(renderer.hits(), twin.hits(), request.size->ray_columns());
  EXPECT_EQ(renderer.depth(), twin.depth());
  for (const bool transparent : {false, true}) {
    const Appearance appearance{.background = {0.2f, 0.3f, 0.1f}, .transparent = transparent};
    EXPECT_EQ(renderer.shade(appearance).pixels, twin.shade(appearance).pixels);
  }
}

class LabelsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, LabelsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(LabelsOnDevice, SmallFrame) {
  const Scene scene({14, 13, 17});
  constexpr ImageSize kSmall{11, 9};
  DeviceRenderer renderer(
      device_, scene.volume,
      {.size = kSmall, .cache_slots = 30, .max_surfaces = 2, .with_labels = true});
  expect_the_twins(renderer, scene, scene.request({group({3, 65535}, 0.4f)}, kSmall));
}

TEST_P(LabelsOnDevice, FramesOfOneGroupAreTheTwins) {
  const Scene scene({41, 38, 45});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kSize, .max_surfaces = 1, .with_labels = true});
  for (const std::vector<std::uint16_t> &labels :
       std::vector<std::vector<std::uint16_t>>{{3}, {300, 4}, {65535}, {0}, {9}, {256, 3, 300}}) {
    for (const float opacity : {1.0f, 0.3f}) {
      SCOPED_TRACE(fmt::format("label {}, opacity {}", labels[0], opacity));
      FrameRequest request = scene.request({group(labels, opacity)});
      expect_the_twins(renderer, scene, request);
      request.clip.planes = {scene.through_middle()};
      expect_the_twins(renderer, scene, request);
      request.clip.caps = false;
      request.normals = Normals::kCell;
      request.camera.parallel_height = 0.8 * glm::distance(request.camera.eye, request.camera.at);
      expect_the_twins(renderer, scene, request);
    }
  }
}

/// So few slots that rays wait for blocks; blocks of a window on a volume that stays on the host;
/// rays one at a time, with blocks that passes decode.
TEST_P(LabelsOnDevice, FramesOfOtherOptionsAreTheTwins) {
  const Scene scene({41, 38, 45}, VoxelType::kInt32);
  RendererOptions few{.size = kSize, .cache_slots = 40, .max_surfaces = 1, .with_labels = true};
  RendererOptions window = few;
  window.stream = StreamPlace::kHost;
  RendererOptions single = few;
  single.cache_slots = 0;
  single.packets = RayPackets::kOff;
  single.on_demand = DecodeOnDemand::kOff;
  for (const RendererOptions &options : {few, window, single}) {
    DeviceRenderer renderer(device_, scene.volume, options);
    FrameRequest request = scene.request({group({3, 300}, 0.4f)}, {20, 15, 2});
    expect_the_twins(renderer, scene, request);
    request.clip.planes = {scene.through_middle()};
    expect_the_twins(renderer, scene, request);
    // Cut rays begin outside the few active blocks.
    request.surfaces[0].labels = {65535};
    expect_the_twins(renderer, scene, request);
  }
}

/// Ambient and shadow rays, and none of any origin.
TEST_P(LabelsOnDevice, LightRaysAreTheTwins) {
  const Scene scene({41, 38, 45});
  DeviceRenderer renderer(
      device_, scene.volume,
      {.size = kSize, .max_surfaces = 1, .with_labels = true, .with_bounce = true});
  FrameRequest request = scene.request({group({300, 3})});
  request.light.towards_light = {0.3, -0.4, 1};
  request.ambient_rays = 3;
  request.shadow_rays = 2;
  expect_the_twins(renderer, scene, request);
  request.clip.planes = {scene.through_middle()};
  request.bounce_rays = 3;
  expect_the_twins(renderer, scene, request);
  EXPECT_THAT([&] { renderer.cast_rays({}, 3, Normals::kCell); },
              ThrowsMessage<Error>(HasSubstr("draws labels alone")));
}

/// An ordinary renderer of the same device draws the indicator with the same bytes.
TEST_P(LabelsOnDevice, PicturesAreThoseOfTheIndicator) {
  const Scene scene({41, 38, 45});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kSize, .max_surfaces = 1, .with_labels = true});
  const FrameRequest request = scene.request({group({300, 3, 9}, 0.5f)});
  const CompressedVolume indicator = scene.indicator_of(request.surfaces[0]);
  DeviceRenderer ordinary(device_, indicator, {.size = kSize, .max_surfaces = 1});
  renderer.render(request);
  ordinary.render(of_indicator(request, 0));
  EXPECT_EQ(renderer.shade().pixels, ordinary.shade().pixels);
}

/// Each ray's first hit is the nearest of the groups' own first hits; of hits at one place, that of
/// the group that was given first.
TEST_P(LabelsOnDevice, FirstHitsOfGroupsAreTheNearest) {
  const Scene scene({41, 38, 45});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kSize, .max_surfaces = 8, .with_labels = true});
  for (const bool is_clipped : {false, true}) {
    SCOPED_TRACE(is_clipped);
    FrameRequest request = scene.request({group({300}), group({3}), group({4, 3}), group({65535}),
                                          group({9}), group({256}), group({4}), group({17})});
    if (is_clipped) request.clip.planes = {scene.through_middle()};
    request.surfaces[1].clipped = false;
    std::vector<HitRecord> nearest;
    for (std::size_t i = 0; i < request.surfaces.size(); ++i) {
      const CompressedVolume indicator = scene.indicator_of(request.surfaces[i]);
      TwinRenderer twin(indicator, kSize);
      twin.render(of_indicator(request, i));
      const std::vector<HitRecord> hits = twin.hits();
      if (nearest.empty()) nearest.resize(hits.size(), no_hit());
      for (std::size_t ray = 0; ray < hits.size(); ++ray) {
        if (hits[ray].t < nearest[ray].t)
          nearest[ray] = with_surface(hits[ray], static_cast<std::uint32_t>(i));
      }
    }
    renderer.render(request);
    expect_same_hits(renderer.hits(), nearest, kSize.width);
    std::array<int, ISO_MAX_SURFACES> seen{};
    for (const HitRecord &hit : nearest) {
      if (std::isfinite(hit.t)) ++seen[surface_of(hit)];
    }
    EXPECT_GT(seen[0], 10);
    EXPECT_GT(seen[1], 10);
    EXPECT_GT(seen[4], 10);
  }
}

/// All crossings of translucent groups, each of its own indicator, in the order along the ray.
TEST_P(LabelsOnDevice, LayersOfGroupsAreThoseOfTheirIndicators) {
  const Scene scene({30, 29, 33});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kSize, .max_surfaces = 3, .with_labels = true});
  const FrameRequest request = scene.request(
      {group({65535}, 0.5f, {1, 0, 0}), group({3, 65535}, 0.2f, {0, 1, 0}), group({300}, 0.3f)});
  using Crossing = std::pair<float, std::uint32_t>;
  std::vector<std::vector<Crossing>> expected(kSize.num_rays()), got(kSize.num_rays());
  const auto add = [](Renderer &, std::vector<std::vector<RayHit>> &layers, auto &&number_of,
                      std::vector<std::vector<Crossing>> &crossings) {
    for (const std::vector<RayHit> &layer : layers) {
      for (const RayHit &hit : layer)
        crossings[hit.ray].emplace_back(hit.hit.t, number_of(hit.hit));
    }
  };
  for (std::size_t i = 0; i < request.surfaces.size(); ++i) {
    const CompressedVolume indicator = scene.indicator_of(request.surfaces[i]);
    DeviceRenderer one(device_, indicator, {.size = kSize, .max_surfaces = 1});
    FrameRequest alone = of_indicator(request, i);
    alone.surfaces[0].opacity = 0.01f;  // rays go on behind all hits
    std::vector<std::vector<RayHit>> layers;
    one.render_layers(alone, layers);
    add(
        one, layers, [&](const HitRecord &) { return static_cast<std::uint32_t>(i); }, expected);
  }
  std::vector<std::vector<RayHit>> layers;
  const FrameStats stats = renderer.render_layers(request, layers);
  add(
      renderer, layers, [](const HitRecord &hit) { return surface_of(hit); }, got);
  EXPECT_EQ(stats.layers.rays_cut, 0u);
  std::size_t longest = 0;
  for (std::size_t ray = 0; ray < got.size(); ++ray) {
    std::ranges::sort(expected[ray]);
    expected[ray].resize(std::min(got[ray].size(), expected[ray].size()));
    std::ranges::sort(got[ray]);
    EXPECT_EQ(got[ray], expected[ray]) << "ray " << ray;
    longest = std::max(longest, got[ray].size());
  }
  EXPECT_GT(longest, 4u);
}

/// Other labels decode the volume's blocks anew; other colours do not.
TEST_P(LabelsOnDevice, OtherLabelsNeedNoOtherRenderer) {
  const Scene scene({41, 38, 45});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kSize, .max_surfaces = 2, .with_labels = true});
  FrameRequest request = scene.request({group({3}, 0.3f), group({300})});
  const auto decoded = [](const FrameStats &stats) {
    std::uint64_t blocks = stats.normals.decoded_blocks + stats.behind.decoded_blocks;
    for (const PassStats &pass : stats.passes) blocks += pass.counts.decoded_count;
    return blocks;
  };
  const std::uint64_t before = renderer.memory_bytes();
  EXPECT_GT(decoded(renderer.render(request)), 0u);
  const std::vector<std::uint8_t> first = renderer.shade().pixels;
  request.surfaces[0].color = {0, 0, 1};
  request.surfaces[1].opacity = 0.7f;
  renderer.render(request);  // behind surfaces that were opaque are further blocks
  EXPECT_EQ(decoded(renderer.render(request)), 0u);
  EXPECT_NE(renderer.shade().pixels, first);
  request.surfaces[0].labels = {4};
  EXPECT_GT(decoded(renderer.render(request)), 0u);
  request = scene.request({group({3}, 0.3f), group({300})});
  renderer.render(request);
  EXPECT_EQ(renderer.shade().pixels, first);
  EXPECT_EQ(renderer.memory_bytes(), before);
  EXPECT_EQ(renderer.memory_bytes(), device_.ledger().current());
}

/// A camera of labels, which the surface of all of them fills.
TEST_P(LabelsOnDevice, CamerasAreThoseOfTheIndicator) {
  const Scene scene({41, 38, 45});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kSize, .max_surfaces = 2, .with_labels = true});
  const SurfaceStyle surface = group({4, 256});
  DeviceRenderer ordinary(device_, scene.indicator_of(surface), {.size = kSize});
  const Camera expected = ordinary.camera(std::array{ISO_LABEL_ISOVALUE}),
               got = renderer.label_camera(surface.labels);
  EXPECT_EQ(got.eye, expected.eye);
  EXPECT_EQ(got.at, expected.at);
  EXPECT_THAT([&] { renderer.camera(std::array{0.5f}); },
              ThrowsMessage<Error>(HasSubstr("draws labels alone")));
  EXPECT_THAT([&] { ordinary.label_camera(surface.labels); },
              ThrowsMessage<Error>(HasSubstr("draws no labels")));
  HostRenderer host(scene.volume, {.largest = kSize});
  EXPECT_EQ(host.label_camera(surface.labels).eye, got.eye);
}

TEST_P(LabelsOnDevice, WhatTheyCannotDoIsOneLine) {
  const Scene scene({14, 13, 17});
  const RendererOptions options{.size = kSize, .max_surfaces = 2, .with_labels = true};
  DeviceRenderer renderer(device_, scene.volume, options);
  const FrameRequest plain = scene.request({group({3})});
  const auto refuses = [&](const char *text, auto &&change) {
    FrameRequest request = plain;
    change(request);
    EXPECT_THAT([&] { renderer.render(request); }, ThrowsMessage<Error>(HasSubstr(text)));
  };
  refuses("without bound", [](FrameRequest &r) { r.bound = FieldBound::kLower; });
  refuses("without voxel_pixels", [](FrameRequest &r) { r.voxel_pixels = 1; });
  refuses("without voxel_error", [](FrameRequest &r) { r.voxel_error = 1; });
  refuses("made with_rays", [](FrameRequest &r) { r.ambient_rays = 4; });
  refuses("without slices", [](FrameRequest &r) { r.slices.planes = {{{{0, 0, 1}, 12}}}; });
  refuses("labels alone", [](FrameRequest &r) { r.surfaces = {{.isovalue = 1}}; });
  refuses("labels alone", [](FrameRequest &r) { r.surfaces.clear(); });
  refuses("without isosurfaces", [](FrameRequest &r) { r.surfaces.push_back({.isovalue = 1}); });
  refuses("made for 2 surfaces", [](FrameRequest &r) { r.surfaces.resize(3, group({4})); });
  renderer.render(plain);

  DeviceRenderer ordinary(device_, scene.volume, {.size = kSize, .max_surfaces = 2});
  TwinRenderer twin(scene.volume, kSize);
  for (Renderer *other : {static_cast<Renderer *>(&ordinary), static_cast<Renderer *>(&twin)})
    EXPECT_THAT([&] { other->render(plain); }, ThrowsMessage<Error>(HasSubstr("draws no labels")));

  const auto cannot_open = [&](const CompressedVolume &volume, const RendererOptions &with,
                               const char *text) {
    EXPECT_THAT([&] { DeviceRenderer(device_, volume, with); },
                ThrowsMessage<Error>(HasSubstr(text)));
  };
  RendererOptions none = options, bounds = options;
  none.max_surfaces = 0;
  bounds.with_bounds = true;
  cannot_open(scene.volume, none, "give with_surfaces");
  cannot_open(scene.volume, bounds, "leave out with_bounds");
  const auto volume_of = [&](float value, VoxelType type) {
    std::vector<float> voxels = scene.voxels;
    voxels[5] = value;
    return lossless(placed_grid(scene.info.dims, type), voxels);
  };
  cannot_open(volume_of(1.5f, VoxelType::kFloat32), options, "voxels of type float32");
  cannot_open(volume_of(-1, VoxelType::kInt32), options, "-1 to 65535, are no labels");
  cannot_open(volume_of(65536, VoxelType::kInt32), options, "0 to 65536, are no labels");
  ArrayReader reader(scene.info, scene.voxels);
  cannot_open(compress(reader, {.rate = 8}), options, "with a loss");
}

TEST(LabelsOnTheHost, FramesOfOneGroupAreTheTwins) {
  const Scene scene({41, 38, 45});
  HostRenderer renderer(scene.volume);
  for (const std::vector<std::uint16_t> &labels :
       std::vector<std::vector<std::uint16_t>>{{3}, {300, 4}, {65535}, {0}, {9}}) {
    SCOPED_TRACE(labels[0]);
    FrameRequest request = scene.request({group(labels, 0.3f)}, {20, 15, 2});
    expect_the_twins(renderer, scene, request);
    request.clip.planes = {scene.through_middle()};
    request.surfaces[0].opacity = 1;
    expect_the_twins(renderer, scene, request);
  }
}

/// Isosurfaces and labels in turn, also with the least memory.
TEST_P(LabelsOnDevice, FramesOfTheHostAreTheSame) {
  const Scene scene({41, 38, 45});
  DeviceRenderer device(
      device_, scene.volume,
      {.size = kSize, .max_surfaces = 3, .with_labels = true, .with_given_rays = true});
  FrameRequest request =
      scene.request({group({3}, 0.3f), group({300, 9}), group({65535, 3}, 0.5f)});
  const std::uint64_t least = HostLevels::least_bytes(scene.volume) +
                              HostLevels::bytes_of_labels(scene.info, request.surfaces.size());
  for (const std::uint64_t limit : {std::uint64_t{0}, least + (64u << 10)}) {
    HostRenderer host(scene.volume, {.memory_limit = limit});
    for (const int label : {3, 4, 3}) {
      request.surfaces[0].labels = {static_cast<std::uint16_t>(label)};
      request.ambient_rays = label == 4 ? 2 : 0;
      const FrameStats expected = device.render(request), got = host.render(request);
      EXPECT_EQ(got.layers.hits, expected.layers.hits);
      expect_same_hits(host.hits(), device.hits(), kSize.width);
      EXPECT_EQ(host.shade().pixels, device.shade().pixels);
      FrameRequest plain = scene.request({});
      plain.isovalue = 100;
      host.render(plain);
    }
    EXPECT_LE(host.memory_bytes(), limit == 0 ? ~std::uint64_t{0} : limit);
  }
  HostRenderer little(scene.volume, {.memory_limit = HostLevels::least_bytes(scene.volume)});
  EXPECT_THAT([&] { little.render(request); },
              ThrowsMessage<Error>(HasSubstr("of memory at least")));
}

TEST(Labels, TablesHaveABitForEachSurface) {
  const LabelTable table = label_table({group({0, 7}), group({7, 65535}), group({})});
  EXPECT_EQ(table.size(), ISO_NUM_LABELS);
  EXPECT_EQ(table[0], 1);
  EXPECT_EQ(table[7], 3);
  EXPECT_EQ(table[65535], 2);
  EXPECT_EQ(std::ranges::count(table, 0), std::ptrdiff_t{ISO_NUM_LABELS} - 3);
}

}  // namespace
}  // namespace isowave::core
