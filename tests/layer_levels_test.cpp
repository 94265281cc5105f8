// Several and translucent surfaces, and slices, in bands of several levels of detail: layers and
// pictures of the twin by devices and by the host, and the twin against a field sampled densely in
// double precision.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <vector>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/view/color_maps.hpp"
#include "reference/twin.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{43, 31};
constexpr double kPixels[] = {0.7, 1.5, 6};

CompressedVolume pyramid(const glm::uvec3 &dims, const test::VoxelFunction &field,
                         bool has_gaps = false) {
  VolumeInfo info = test::grid_info(dims);
  info.spacing = {0.5, 0.7, 0.4};
  info.origin = {3, -20, 11};
  std::vector<float> voxels = test::sample(dims, field);
  for (std::size_t i = 0; has_gaps && i < voxels.size(); i += 97) voxels[i] = NAN;
  ArrayReader reader(info, voxels);
  return compress(reader, {.rate = 9, .levels = 0});
}

CompressedVolume gyroid() {
  return pyramid({40, 37, 44}, test::gyroid_field(11));
}

ClipPlane through(const VolumeInfo &info, double place, const glm::dvec3 &normal) {
  const glm::dvec3 index = place * (glm::dvec3(info.dims) - 1.0);
  return {normal, glm::dot(normal, info.origin + info.index_to_world() * index)};
}

/// Scenes without light rays: translucent surfaces, clipped or not, slices, one of them whole.
std::vector<FrameRequest> scenes_of(const VolumeInfo &info, ImageSize size) {
  const std::vector<ClipPlane> planes{through(info, 0.5, {-0.3, -1, 0.2}),
                                      through(info, 0.6, {-1, -0.1, -0.5})};
  FrameRequest glass{.camera = orbit_cameras(info, 1)[0], .size = size};
  glass.surfaces = {{0.2f, {0.9f, 0.9f, 0.2f}, 0.3f},
                    {0.6f, {0.1f, 0.4f, 0.8f}, 0.5f},
                    {-0.4f, {0.3f, 0.8f, 0.2f}, 0.1f}};
  std::vector<FrameRequest> all{glass};
  all.push_back(glass);
  all.back().clip.planes = planes;
  all.back().surfaces[1].clipped = false;
  all.push_back(all.back());
  all.back().clip.caps = false;
  all.push_back(glass);
  all.back().surfaces.resize(1);
  all.back().slices = {{{through(info, 0.4, {0.2, 1, 0.3}), 0.4f},
                        {through(info, 0.55, {1, 0, 0.2}), 0.6f, false},
                        {through(info, 0.5, {0, 0, 1}), 0.3f}},
                       -1,
                       1,
                       color_map("viridis")};
  all.back().clip.planes = {planes[0]};
  all.push_back(glass);
  all.back().surfaces = {{0.4f, {0.8f, 0.2f, 0.1f}, 0.05f}};  // more layers than are drawn
  all.back().camera.eye =
      info.origin + info.index_to_world() * (0.3 * (glm::dvec3(info.dims) - 1.0));
  all.push_back(glass);
  all.back().camera.parallel_height = 0.8 * glm::distance(glass.camera.eye, glass.camera.at);
  return all;
}

bool is_at_border(const HitRecord &hit) {
  return std::isfinite(hit.t) && (hit.cell & ISO_CAP) == 0 &&
         (hit.cell >> ISO_CROSSING_BIT & 3u) == 3u;
}

struct Seen {
  std::uint64_t levels = 0, borders = 0, behind_borders = 0, caps = 0;
};

/// What the twin's layers have.
void add_seen(const LayeredFrame &frame, Seen &seen) {
  for (std::size_t layer = 0; layer < frame.layers.size(); ++layer) {
    for (std::size_t ray = 0; ray < frame.layers[layer].size(); ++ray) {
      const HitRecord &hit = frame.layers[layer][ray];
      seen.caps += is_cap(hit) ? 1 : 0;
      if (!is_at_border(hit)) continue;
      ++seen.borders;
      seen.behind_borders +=
          layer + 1 < frame.layers.size() && std::isfinite(frame.layers[layer + 1][ray].t) ? 1 : 0;
    }
  }
}

/// Pictures, first hits and counts of the twin.
void expect_as_the_twin(Renderer &renderer, const LayeredFrame &expected,
                        const CompressedVolume &volume, const FrameRequest &request) {
  const FrameStats got = renderer.render(request);
  EXPECT_EQ(got.layers.layers, expected.stats.layers);
  EXPECT_EQ(got.layers.hits, expected.stats.hits);
  EXPECT_EQ(got.layers.rays_cut, expected.stats.rays_cut);
  EXPECT_EQ(got.rays_hit, test::num_hits(expected.first_hits));
  expect_same_hits(renderer.hits(), expected.first_hits, request.size->width);
  const FrameParams frame = make_frame_params(volume.info, request.camera, *request.size, 0);
  EXPECT_EQ(
      renderer.shade(request.light).pixels,
      shade_layers_scalar(frame, make_shade_params(volume.info, request.light), expected.colors)
          .pixels);
}

/// Every hit of every layer.
void expect_same_layers(DeviceRenderer &renderer, const LayeredFrame &expected,
                        const FrameRequest &request) {
  std::vector<std::vector<RayHit>> got;
  renderer.render_layers(request, got);
  for (std::size_t layer = 0; layer < expected.layers.size(); ++layer) {
    std::vector<HitRecord> hits(expected.first_hits.size(), no_hit());
    if (layer < got.size()) {
      for (const RayHit &hit : got[layer]) {
        const bool is_slice = hit.hit.cell >> ISO_SURFACE_BIT >= request.surfaces.size();
        if (!is_slice || !std::isnan(hit.value)) hits[hit.ray] = hit.hit;
      }
    }
    SCOPED_TRACE(fmt::format("layer {}", layer));
    expect_same_hits(hits, expected.layers[layer], request.size->width);
  }
}

/// Draws all scenes at all levels, and at the finest.
Seen check(Renderer &renderer, const CompressedVolume &volume,
           const std::vector<FrameRequest> &scenes, Normals normals = Normals::kSmooth) {
  Seen seen;
  for (const double pixels : {kPixels[0], kPixels[1], 0.0, kPixels[2]}) {
    const Twin twin(volume, pixels);
    for (std::size_t scene = 0; scene < scenes.size(); ++scene) {
      SCOPED_TRACE(fmt::format("scene {}, voxels {} pixels apart", scene, pixels));
      FrameRequest request = scenes[scene];
      request.voxel_pixels = pixels;
      request.normals = normals;
      const LayeredFrame expected = twin.render_layers(request);
      add_seen(expected, seen);
      const auto frames =
          make_level_frames(level_infos(volume, true), request.camera, *request.size, 0, pixels);
      seen.levels = std::max<std::uint64_t>(
          seen.levels, static_cast<std::uint64_t>(std::ranges::count_if(frames, draws)));
      expect_as_the_twin(renderer, expected, volume, request);
      if (auto *device = dynamic_cast<DeviceRenderer *>(&renderer); device != nullptr)
        expect_same_layers(*device, expected, request);
    }
  }
  return seen;
}

Seen check(Renderer &renderer, const CompressedVolume &volume) {
  return check(renderer, volume, scenes_of(volume.info, kSize));
}

void expect_seen(const Seen &seen) {
  EXPECT_GE(seen.levels, 3u);
  EXPECT_GT(seen.borders, 50u);
  EXPECT_GT(seen.behind_borders, 30u);
  EXPECT_GT(seen.caps, 300u);
}

/// Light of each kind, with surfaces that planes clip or leave whole.
std::vector<FrameRequest> lit_scenes(const VolumeInfo &info, ImageSize size) {
  FrameRequest lit{.camera = orbit_cameras(info, 1)[0], .size = size};
  lit.surfaces = {{0.7f, {0.1f, 0.4f, 0.8f}, 1},
                  {0.2f, {0.9f, 0.9f, 0.2f}, 0.3f},
                  {0.5f, {0.3f, 0.9f, 0.4f}, 1, false}};
  lit.light.towards_light = glm::dvec3(0.4, -0.5, 0.8);
  lit.ambient_rays = 3;
  lit.shadow_rays = 2;
  lit.light_angle = 5;
  std::vector<FrameRequest> all(3, lit);
  all[1].clip.planes = {through(info, 0.5, {-0.3, -1, 0.2}), through(info, 0.6, {-1, -0.1, -0.5})};
  all[2].clip = all[1].clip;
  all[2].clip.caps = false;
  all[1].bounce_rays = 2;
  all[0].slices = {{{through(info, 0.4, {0.2, 1, 0.3}), 0.6f}}, -1, 1, color_map("viridis")};
  return all;
}

/// One opaque surface is the plain frame: hits, but for the surface's number, and picture.
void expect_plain(Renderer &renderer, const VolumeInfo &info) {
  for (const double pixels : kPixels) {
    FrameRequest request{.camera = orbit_cameras(info, 1)[0],
                         .isovalue = 0.4f,
                         .size = kSize,
                         .voxel_pixels = pixels,
                         .ambient_rays = 2};
    request.light.towards_light = glm::dvec3(0.4, -0.5, 0.8);
    request.light.color_by = ColorByAxis{{1, 0.2, 0}, 0, 20, color_map("magma")};
    request.shadow_rays = 1;
    const FrameStats of_plain = renderer.render(request);
    const Image8 plain = renderer.shade(request.light);
    const std::vector<HitRecord> hits = renderer.hits();
    request.surfaces = {{0.4f, request.light.surface, 1}};
    const FrameStats of_layers = renderer.render(request);
    EXPECT_EQ(of_layers.first_level, of_plain.first_level);
    EXPECT_EQ(of_layers.last_level, of_plain.last_level);
    expect_same_hits(renderer.hits(), hits, kSize.width);
    EXPECT_EQ(renderer.shade(request.light).pixels, plain.pixels) << pixels;
  }
}

class LayerLevelsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, LayerLevelsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(LayerLevelsOnDevice, SmallFrames) {
  const CompressedVolume volume = pyramid({24, 22, 26}, test::gyroid_field(9));
  const bool is_slow = is_simulator(GetParam());
  const ImageSize size = is_slow ? ImageSize{5, 4} : ImageSize{11, 9};
  DeviceRenderer renderer(
      device_, volume, {.size = size, .cache_slots = 30, .with_levels = true, .max_surfaces = 2});
  const std::vector<FrameRequest> scenes = scenes_of(volume.info, size);
  for (const std::size_t scene :
       is_slow ? std::vector<std::size_t>{3} : std::vector<std::size_t>{1, 3}) {
    FrameRequest request = scenes[scene];
    request.surfaces.resize(std::min<std::size_t>(request.surfaces.size(), 2));
    request.slices.planes.resize(std::min<std::size_t>(request.slices.planes.size(), 1));
    request.voxel_pixels = 0.05 * size.height;
    const LayeredFrame expected = Twin(volume, request.voxel_pixels).render_layers(request);
    expect_as_the_twin(renderer, expected, volume, request);
    const auto frames =
        make_level_frames(level_infos(volume, true), request.camera, size, 0, request.voxel_pixels);
    EXPECT_GT(std::ranges::count_if(frames, draws), 1) << "no border is tested";
  }
}

TEST_P(LayerLevelsOnDevice, FramesAreTheTwins) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(device_, volume, {.size = kSize, .with_levels = true, .max_surfaces = 3});
  expect_seen(check(renderer, volume));
}

/// With so few slots that most rays wait, and go on one by one.
TEST_P(LayerLevelsOnDevice, FramesOfFewSlotsAreTheTwins) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(
      device_, volume, {.size = kSize, .cache_slots = 40, .with_levels = true, .max_surfaces = 3});
  expect_seen(check(renderer, volume));
}

TEST_P(LayerLevelsOnDevice, FramesWithoutPacketsAreTheTwins) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(
      device_, volume,
      {.size = kSize, .packets = RayPackets::kOff, .with_levels = true, .max_surfaces = 3});
  expect_seen(check(renderer, volume));
}

/// Cells hold several sheets, and voxels without data end surfaces.
TEST_P(LayerLevelsOnDevice, NoiseWithGaps) {
  const CompressedVolume volume = pyramid({40, 37, 44}, test::noise_field(5), true);
  DeviceRenderer renderer(device_, volume, {.size = kSize, .with_levels = true, .max_surfaces = 3});
  check(renderer, volume, scenes_of(volume.info, kSize), Normals::kCell);
}

TEST_P(LayerLevelsOnDevice, LightIsTheTwins) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(
      device_, volume,
      {.size = kSize, .with_levels = true, .max_surfaces = 3, .with_bounce = true});
  check(renderer, volume, lit_scenes(volume.info, kSize));
}

TEST_P(LayerLevelsOnDevice, OneOpaqueSurfaceIsThePlainFrame) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(
      device_, volume,
      {.size = kSize, .with_levels = true, .max_surfaces = 1, .with_given_rays = true});
  expect_plain(renderer, volume.info);
}

/// Coarser levels have fewer blocks, also for what lies behind.
TEST_P(LayerLevelsOnDevice, DecodesFewerBlocks) {
  const CompressedVolume volume = pyramid({72, 70, 66}, test::gyroid_field(23));
  DeviceRenderer renderer(device_, volume, {.size = kSize, .with_levels = true, .max_surfaces = 3});
  FrameRequest request = scenes_of(volume.info, kSize)[3];
  const auto decoded = [&](double pixels) {
    request.voxel_pixels = pixels;
    renderer.clear_cache();
    const FrameStats stats = renderer.render(request);
    std::uint64_t sum =
        stats.behind.decoded_blocks + stats.slices.decoded_blocks + stats.normals.decoded_blocks;
    for (const PassStats &pass : stats.passes) sum += pass.counts.decoded_count;
    return sum;
  };
  EXPECT_LT(4 * decoded(3), decoded(0));
}

TEST(LayerLevelsOnHost, FramesAreTheTwins) {
  const CompressedVolume volume = gyroid();
  HostRenderer renderer(volume);
  expect_seen(check(renderer, volume));
}

/// A thread traces alone if not one tile's blocks fit.
TEST(LayerLevelsOnHost, FramesWithinTheLeastMemory) {
  const CompressedVolume volume = gyroid();
  HostRenderer renderer(volume, {.memory_limit = HostLevels::least_bytes(volume, 3, true)});
  const std::vector<FrameRequest> scenes = scenes_of(volume.info, kSize);
  check(renderer, volume, {scenes[1], scenes[3]});
  HostRenderer less(volume, {.memory_limit = HostLevels::least_bytes(volume, 3, true) - 1});
  FrameRequest request = scenes[0];
  EXPECT_NO_THROW(less.render(request));
  request.voxel_pixels = 1;
  EXPECT_THAT([&] { less.render(request); },
              ThrowsMessage<Error>(HasSubstr("drawing 3 surfaces on the host takes")));
}

TEST(LayerLevelsOnHost, NoiseWithGaps) {
  const CompressedVolume volume = pyramid({40, 37, 44}, test::noise_field(5), true);
  HostRenderer renderer(volume);
  check(renderer, volume, scenes_of(volume.info, kSize), Normals::kCell);
}

TEST(LayerLevelsOnHost, LightIsTheTwins) {
  const CompressedVolume volume = gyroid();
  HostRenderer renderer(volume);
  check(renderer, volume, lit_scenes(volume.info, kSize));
}

TEST(LayerLevelsOnHost, OneOpaqueSurfaceIsThePlainFrame) {
  const CompressedVolume volume = gyroid();
  HostRenderer renderer(volume);
  expect_plain(renderer, volume.info);
  TwinRenderer twin(volume, kSize);
  expect_plain(twin, volume.info);
}

TEST(LayerLevels, LabelsHaveOneLevel) {
  FrameRequest request{.voxel_pixels = 1};
  request.surfaces = {{.labels = {1}}};
  Abilities all;
  all.levels = all.labels = true;
  all.most_surfaces = 1;
  EXPECT_THAT([&] { check(request, all); }, ThrowsMessage<Error>(HasSubstr("voxel_pixels")));
}

// ---- the twin itself

/// The field of a frame's levels along a ray, in double precision.
class SampledRay {
 public:
  SampledRay(const CompressedVolume &volume, double voxel_pixels, const FrameRequest &request)
      : frames_(make_level_frames(level_infos(volume, true), request.camera, *request.size, 0,
                                  voxel_pixels)) {
    for (const CompressedVolume *level : levels_of(volume, true)) {
      dims_.push_back(level->info.dims);
      voxels_.push_back(decode_with_libzfp(*level));
    }
  }
  const FrameParams &finest() const { return frames_.front(); }
  bool draws_several() const { return std::ranges::count_if(frames_, draws) > 2; }

  /// None outside the level's domain.
  std::optional<double> at(const Ray &ray, double t) const {
    const float t_scale = frames_.front().view.t_scale;
    for (std::size_t level = 0; level < frames_.size(); ++level) {
      const FrameParams &frame = frames_[level];
      const double ratio = double{frame.view.t_scale} / t_scale;
      if (!draws(frame) || t < ratio * frame.band.begin_t || t >= ratio * frame.band.end_t)
        continue;
      const glm::dvec3 place =
          (glm::dvec3(ray.x.o, ray.y.o, ray.z.o) + t * glm::dvec3(ray.x.d, ray.y.d, ray.z.d)) /
          std::ldexp(1.0, static_cast<int>(level));
      return field(level, place);
    }
    return {};
  }

 private:
  std::optional<double> field(std::size_t level, const glm::dvec3 &place) const {
    const glm::uvec3 dims = dims_[level];
    if (glm::any(glm::lessThan(place, glm::dvec3(0))) ||
        glm::any(glm::greaterThan(place, glm::dvec3(dims) - 1.0)))
      return {};
    const glm::uvec3 cell = glm::min(glm::uvec3(place), dims - 2u);
    const glm::dvec3 share = place - glm::dvec3(cell);
    double sum = 0;
    for (std::uint32_t i = 0; i < 8; ++i) {
      const glm::uvec3 corner(i & 1, i >> 1 & 1, i >> 2), v = cell + corner;
      const glm::dvec3 weight = glm::mix(1.0 - share, share, glm::dvec3(corner));
      sum += weight.x * weight.y * weight.z *
             voxels_[level][v.x + dims.x * (v.y + std::size_t{dims.y} * v.z)];
    }
    return sum;
  }

  std::vector<FrameParams> frames_;
  std::vector<glm::uvec3> dims_;
  std::vector<std::vector<float>> voxels_;
};

/// Between two hits, and before the first, the field is on one side of the isovalue, and at each
/// hit it changes. Places within half a step of a hit decide nothing.
TEST(LayerLevels, HitsAreWhereTheFieldChanges) {
  const CompressedVolume volume = pyramid({36, 33, 30}, test::gyroid_field(13));
  FrameRequest request = scenes_of(volume.info, {24, 18})[4];  // from within
  request.surfaces = {{0.2f, {1, 1, 1}, 0.01f}};
  constexpr double kStep = 0.03;  // voxels of the finest level, about
  std::size_t num_hits = 0, num_samples = 0, num_wrong = 0;
  for (const double pixels : {2.0, 3.5}) {
    const SampledRay field(volume, pixels, request);
    EXPECT_TRUE(field.draws_several());
    const LayeredFrame frame = Twin(volume, pixels).render_layers(request);
    for (uint pixel = 0; pixel < request.size->num_rays(); ++pixel) {
      const Ray ray = make_ray(&field.finest(), pixel);
      const double speed = glm::length(glm::dvec3(ray.x.d, ray.y.d, ray.z.d)), step = kStep / speed;
      std::vector<double> hits;
      for (const auto &layer : frame.layers) {
        if (std::isfinite(layer[pixel].t))
          hits.push_back(double{layer[pixel].t} / field.finest().view.t_scale);
      }
      if (hits.size() == frame.layers.size()) continue;  // the rest is left out
      num_hits += hits.size();
      std::optional<bool> side;
      std::size_t next = 0;
      for (double t = 0; t < 400 / speed; t += step) {
        const std::optional<double> value = field.at(ray, t);
        for (; next < hits.size() && hits[next] <= t; ++next) side = side ? !*side : side;
        if (!value) side.reset();  // what begins inside has no hit
        if (!value) continue;
        const bool is_near =
            std::ranges::any_of(hits, [&](double hit) { return std::abs(hit - t) < step / 2; });
        if (!side) side = *value >= double{0.2f};
        if (is_near || std::abs(*value - double{0.2f}) < 1e-4) continue;
        ++num_samples;
        num_wrong += (*value >= double{0.2f}) != *side;
      }
      EXPECT_EQ(next, hits.size());
    }
  }
  EXPECT_EQ(num_wrong, 0u);
  EXPECT_GT(num_hits, 1000u);
  EXPECT_GT(num_samples, 100'000u);
}

}  // namespace
}  // namespace isowave::core
