// Slices, and surfaces that clipping planes leave whole: the same bits of all renderers, and the
// twin's slices against geometry in double precision.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "core/view/color_maps.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{43, 31};

VolumeInfo placed_grid(const glm::uvec3 &dims) {
  VolumeInfo info = test::grid_info(dims);
  info.spacing = {0.5, 0.7, 0.4};
  info.origin = {300, -20, 11};
  info.direction = glm::dmat3({0.8, 0.6, 0}, {-0.6, 0.8, 0}, {0, 0, 1});
  return info;
}

CompressedVolume compressed(const VolumeInfo &info, const std::vector<float> &voxels) {
  ArrayReader reader(info, voxels);
  return compress(reader, {.rate = 12});
}

CompressedVolume gyroid() {
  const VolumeInfo info = placed_grid({40, 37, 44});
  return compressed(info, test::sample(info.dims, test::gyroid_field(11)));
}

CompressedVolume noise_with_gaps() {
  const VolumeInfo info = placed_grid({40, 37, 44});
  std::vector<float> voxels = test::sample(info.dims, test::noise_field(5));
  for (std::size_t i = 0; i < voxels.size(); i += 37) voxels[i] = NAN;
  return compressed(info, voxels);
}

/// The plane through a voxel.
ClipPlane through(const VolumeInfo &info, const glm::dvec3 &voxel, const glm::dvec3 &normal) {
  return {normal, glm::dot(normal, info.origin + info.index_to_world() * voxel)};
}

/// The plane of all voxels with this coordinate along z.
ClipPlane voxel_plane(const VolumeInfo &info, double z) {
  return through(info, {0, 0, z}, info.direction[2]);
}

Slices slices_of(std::vector<Slice> planes) {
  return {std::move(planes), -0.8, 1.1, color_map("viridis")};
}

/// Opaque and translucent slices, on voxels, on the border, across each other, on a clipping plane,
/// and whole where others are clipped; a whole surface.
std::vector<FrameRequest> requests(const VolumeInfo &info) {
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0;
  const ClipPlane oblique = through(info, 0.5 * last, {-0.3, -1, 0.2}),
                  across = through(info, 0.4 * last, {1, 0.2, -0.4});
  FrameRequest plain{.camera = orbit_cameras(info, 1)[0], .size = kSize};
  plain.camera.eye = glm::mix(plain.camera.eye, plain.camera.at, 0.4);  // the box fills the picture
  plain.surfaces = {{0.2f, {0.8f, 0.2f, 0.1f}, 0.4f}, {-0.3f, {0.1f, 0.4f, 0.8f}, 1}};
  std::vector<FrameRequest> all;
  const auto add = [&](const Slices &slices, const std::vector<ClipPlane> &clip = {}) {
    FrameRequest &request = all.emplace_back(plain);
    request.slices = slices;
    request.clip.planes = clip;
    return all.size() - 1;
  };
  add(slices_of({{voxel_plane(info, 12), 1, true}}));
  add(slices_of({{oblique, 0.4f, true}, {across, 0.7f, true}, {voxel_plane(info, 0), 0.5f, true}}));
  add(slices_of({{oblique, 0.6f, true}, {across, 0.5f, false}}), {oblique});
  add(slices_of({{{-oblique.normal, -oblique.offset}, 1, true}, {across, 0.1f, true}}), {oblique});
  const std::size_t whole = add(slices_of({{across, 0.3f, true}}), {oblique, across});
  all[whole].surfaces[0].clipped = false;
  all[whole].clip.caps = false;
  const std::size_t other = add({}, {oblique});
  all[other].surfaces[1].clipped = false;
  const std::size_t thin = add(slices_of({{voxel_plane(info, 20.5), 0.02f, true}}), {across});
  all[thin].surfaces = {{0.4f, {0.8f, 0.2f, 0.1f}, 0.02f}};
  Camera parallel = plain.camera;
  parallel.parallel_height = 0.8 * glm::distance(parallel.eye, parallel.at);
  Camera within = plain.camera;
  within.eye = info.origin + info.index_to_world() * (0.3 * last);
  for (const Camera &camera : {parallel, within}) all[add(all[1].slices, {across})].camera = camera;
  return all;
}

struct Seen {
  std::uint64_t slices = 0, layers = 0, cut = 0;
};

Seen check(Renderer &renderer, const CompressedVolume &volume, ImageSize size) {
  Seen seen;
  TwinRenderer twin(volume, size);
  const std::vector<FrameRequest> all = requests(volume.info);
  for (std::size_t i = 0; i < all.size(); ++i) {
    SCOPED_TRACE(fmt::format("request {}", i));
    FrameRequest request = all[i];
    request.size = size;
    const FrameStats expected = twin.render(request), got = renderer.render(request);
    EXPECT_EQ(got.layers.layers, expected.layers.layers);
    EXPECT_EQ(got.layers.hits, expected.layers.hits);
    EXPECT_EQ(got.layers.rays_cut, expected.layers.rays_cut);
    EXPECT_EQ(got.rays_hit, expected.rays_hit);
    expect_same_hits(renderer.hits(), twin.hits(), size.ray_columns());
    for (const bool transparent : {false, true}) {
      const Appearance appearance{.background = {0.2f, 0.3f, 0.1f}, .transparent = transparent};
      EXPECT_EQ(renderer.shade(appearance).pixels, twin.shade(appearance).pixels);
    }
    for (const HitRecord &hit : twin.hits())
      seen.slices += std::isfinite(hit.t) && surface_of(hit) >= request.surfaces.size() ? 1 : 0;
    seen.layers += expected.layers.layers;
    seen.cut += expected.layers.rays_cut;
  }
  return seen;
}

class SlicesOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, SlicesOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(SlicesOnDevice, SmallFrame) {
  const VolumeInfo info = placed_grid({14, 13, 17});
  const CompressedVolume volume = compressed(info, test::sample(info.dims, test::gyroid_field(6)));
  constexpr ImageSize kSmall{11, 9};
  DeviceRenderer renderer(device_, volume, {.size = kSmall, .cache_slots = 30, .max_surfaces = 2});
  TwinRenderer twin(volume, kSmall);
  FrameRequest request = requests(info)[1];
  request.size = kSmall;
  twin.render(request);
  renderer.render(request);
  expect_same_hits(renderer.hits(), twin.hits(), kSmall.width);
  EXPECT_EQ(renderer.shade().pixels, twin.shade().pixels);
}

TEST_P(SlicesOnDevice, FramesAreTheTwins) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(device_, volume, {.size = kSize, .max_surfaces = 2});
  const Seen seen = check(renderer, volume, kSize);
  EXPECT_GT(seen.slices, 500u);
  EXPECT_GT(seen.layers, 30u);
}

/// So few slots that slices wait for blocks.
TEST_P(SlicesOnDevice, FramesOfFewSlotsAreTheTwins) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(device_, volume, {.size = kSize, .cache_slots = 40, .max_surfaces = 2});
  check(renderer, volume, kSize);
}

TEST_P(SlicesOnDevice, FramesWithGapsAreTheTwins) {
  const CompressedVolume volume = noise_with_gaps();
  DeviceRenderer renderer(device_, volume, {.size = {20, 15, 2}, .max_surfaces = 2});
  EXPECT_GT(check(renderer, volume, {20, 15, 2}).cut, 10u);
}

TEST_P(SlicesOnDevice, StopsWithThePictureSoFar) {
  const CompressedVolume volume = gyroid();
  DeviceRenderer renderer(device_, volume, {.size = kSize, .cache_slots = 60, .max_surfaces = 2});
  FrameRequest request = requests(volume.info)[1];
  renderer.render(request);
  const std::vector<std::uint8_t> whole = renderer.shade().pixels;
  std::uint32_t num_passes = 0;
  request.on_pass = [&](const PassStats &) {
    ++num_passes;
    renderer.shade();
    return true;
  };
  renderer.render(request);
  EXPECT_EQ(renderer.shade().pixels, whole);
  std::uint32_t num_stopped = 0;
  for (std::uint32_t stop = 1; stop < num_passes; stop += 3) {  // the number of passes varies
    std::uint32_t pass = 0;
    request.on_pass = [&](const PassStats &) { return ++pass < stop; };
    num_stopped += renderer.render(request).cancelled ? 1 : 0;
    renderer.shade();
  }
  EXPECT_GT(num_stopped, 0u);
  request.on_pass = {};
  renderer.render(request);
  EXPECT_EQ(renderer.shade().pixels, whole);
}

TEST(SlicesOnTheHost, FramesAreTheTwins) {
  for (const CompressedVolume &volume : {gyroid(), noise_with_gaps()}) {
    HostRenderer renderer(volume);
    check(renderer, volume, kSize);
    check(renderer, volume, {20, 15, 3});
  }
}

/// With the least memory, blocks of slices come and go.
TEST(SlicesOnTheHost, FramesOfLittleMemoryAreTheTwins) {
  const CompressedVolume volume = gyroid();
  HostRenderer renderer(volume, {.memory_limit = HostLevels::least_bytes(volume, 2) + (64u << 10)});
  check(renderer, volume, kSize);
}

/// Rays, planes and values in double precision.
struct Geometry {
  const VolumeInfo &info;
  const std::vector<float> &voxels;
  Camera camera;

  /// Origin and direction, of length 1, of a ray.
  std::pair<glm::dvec3, glm::dvec3> ray(std::uint32_t column, std::uint32_t row) const {
    const glm::dvec3 forward = glm::normalize(camera.at - camera.eye),
                     right = glm::normalize(glm::cross(forward, camera.up)),
                     up = glm::cross(right, forward);
    const double half = camera.parallel_height ? 0.5 * *camera.parallel_height
                                               : std::tan(0.5 * glm::radians(camera.fovy_deg));
    const double u = half * (2 * (column + 0.5) - kSize.width) / kSize.height,
                 v = half * (1 - 2 * (row + 0.5) / kSize.height);
    const glm::dvec3 aside = u * right + v * up;
    if (camera.parallel_height) return {camera.eye + aside, forward};
    return {camera.eye, glm::normalize(forward + aside)};
  }

  glm::dvec3 index(const glm::dvec3 &world) const {
    return glm::inverse(info.index_to_world()) * (world - info.origin);
  }

  double value(const glm::dvec3 &at) const {
    const glm::dvec3 last = glm::dvec3(info.dims) - 1.0;
    const glm::dvec3 cell = glm::min(glm::max(glm::floor(at), 0.0), last - 1.0);
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 side(corner & 1, corner >> 1 & 1, corner >> 2);
      const glm::uvec3 voxel(cell + side);
      const glm::dvec3 weight = glm::mix(1.0 - (at - cell), at - cell, side);
      sum += weight.x * weight.y * weight.z *
             double{voxels[voxel.x + info.dims.x * (voxel.y + std::size_t{info.dims.y} * voxel.z)]};
    }
    return sum;
  }
};

/// The least distance of a point from the box's faces; below 0 outside [voxels].
double depth_in_box(const VolumeInfo &info, const glm::dvec3 &at) {
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0, inside = glm::min(at, last - at);
  return std::min({inside.x, inside.y, inside.z});
}

/// An opaque slice, before a surface far away from it: where it lies, its normal, and its colours.
TEST(Slices, AreWhereGeometryHasThem) {
  const CompressedVolume volume = gyroid();
  const std::vector<float> voxels = decode_with_libzfp(volume);
  const VolumeInfo &info = volume.info;
  TwinRenderer twin(volume, kSize);
  std::uint32_t seen = 0, clipped = 0, outside = 0;
  for (FrameRequest request : requests(info)) {
    if (request.slices.planes.empty()) continue;
    request.surfaces = {{1e6f, {1, 0, 0}, 1}};  // nothing has that value
    request.slices.planes.resize(1);
    request.slices.planes[0].opacity = 1;
    request.slices.low = -2;
    request.slices.high = 2;
    request.slices.colors = color_map("gray");
    twin.render(request);
    const std::vector<HitRecord> hits = twin.hits();
    const Image8 picture = twin.shade({.background = {1, 1, 1}, .transparent = true});
    const FrameArrays arrays = twin.fetch({.normals = true}, {});
    const Geometry geometry{info, voxels, request.camera};
    const ClipPlane &plane = request.slices.planes[0].plane;
    for (std::uint32_t pixel = 0; pixel < kSize.num_pixels(); ++pixel) {
      const auto [origin, direction] = geometry.ray(pixel % kSize.width, pixel / kSize.width);
      const double t =
          (plane.offset - glm::dot(plane.normal, origin)) / glm::dot(plane.normal, direction);
      const glm::dvec3 world = origin + t * direction, at = geometry.index(world);
      const double depth = depth_in_box(info, at);
      double front = t > 0 ? 1 : -1;  // of all clipping planes, but one that the slice lies on
      for (const ClipPlane &cut : request.clip.planes) {
        const double distance =
            (glm::dot(cut.normal, world) - cut.offset) / glm::length(cut.normal);
        if (std::abs(distance) > 1e-9) front = std::min(front, distance);
      }
      // On a whole voxel plane, along an edge of the box, or near a clipping plane, rounding
      // decides.
      if (std::abs(depth) < 0.01 && plane != voxel_plane(info, 0)) continue;
      if (std::abs(front) < 0.01) continue;
      const bool is_seen = depth > -0.001 && front > 0;
      ASSERT_EQ(std::isfinite(hits[pixel].t), is_seen) << "pixel " << pixel << ", depth " << depth;
      EXPECT_EQ(picture.pixels[4 * pixel + 3], is_seen ? 255 : 0);
      ++(is_seen ? seen : depth > 0 ? clipped : outside);
      if (!is_seen) continue;
      EXPECT_EQ(surface_of(hits[pixel]), 1u);
      EXPECT_NEAR(hits[pixel].t, t, 1e-3 * info.spacing.x);
      const double gray = 255 * (geometry.value(at) + 2) / 4;
      EXPECT_NEAR(picture.pixels[4 * pixel], gray, 0.5 + 0.05);
      const auto &got = arrays.normals[pixel];
      EXPECT_NEAR(
          std::abs(glm::dot(glm::normalize(plane.normal), glm::dvec3(got[0], got[1], got[2]))), 1,
          1e-5);
    }
  }
  EXPECT_GT(seen, 2'000u);
  EXPECT_GT(clipped, 100u);
  EXPECT_GT(outside, 2'000u);
}

/// Slices and surfaces of a field that grows along x alone, which lie in a known order.
TEST(Slices, LieBetweenSurfacesInTheirOrder) {
  const VolumeInfo info = test::grid_info({24, 24, 24});
  const CompressedVolume volume =
      compressed(info, test::sample(info.dims, [](const glm::dvec3 &p) { return p.x; }));
  Camera camera = orbit_cameras(info, 1)[0];
  camera.eye = {-60, 12, 11};
  camera.at = {12, 11.5, 11.5};
  FrameRequest request{.camera = camera, .size = kSize};
  request.surfaces = {{6.5f, {1, 0, 0}, 0.5f}, {15.5f, {0, 1, 0}, 0.5f}};
  request.slices = {{{{{1, 0, 0}, 10}, 0.5f, true},
                     {{{-2, 0, 0}, -6}, 0.5f, true},
                     {{{1, 0, 0}, 20}, 0.5f, true}},
                    0,
                    20,
                    color_map("gray")};
  const Twin twin(volume);
  const LayeredFrame frame = twin.render_layers(
      {.camera = camera, .size = kSize, .surfaces = request.surfaces, .slices = request.slices});
  const std::size_t middle = kSize.width / 2 + kSize.width * std::size_t{kSize.height / 2};
  const std::vector<std::uint32_t> expected{3, 0, 2, 1, 4};
  float before = 0;
  for (std::size_t layer = 0; layer < expected.size(); ++layer) {
    const HitRecord &hit = frame.layers[layer][middle];
    ASSERT_TRUE(std::isfinite(hit.t));
    EXPECT_EQ(surface_of(hit), expected[layer]);
    EXPECT_GT(hit.t, before);
    before = hit.t;
  }
  EXPECT_FALSE(std::isfinite(frame.layers[expected.size()][middle].t));
  // Slices at 3, 10 and 20 have their value's gray, without light; each lets half of the rest
  // through.
  TwinRenderer renderer(volume, kSize);
  request.surfaces = {{1e6f, {1, 0, 0}, 1}};
  renderer.render(request);
  const double gray = 255 * (3 / 20.0 / 2 + 10 / 20.0 / 4 + 20 / 20.0 / 8);
  EXPECT_NEAR(renderer.shade({.background = {0, 0, 0}}).pixels[3 * middle], gray, 1);
}

/// A whole surface has the hits of a frame that is not clipped, and the others those of one that
/// is.
TEST(Slices, SurfacesMayStayWhole) {
  const CompressedVolume volume = gyroid();
  const VolumeInfo &info = volume.info;
  TwinRenderer twin(volume, kSize);
  FrameRequest request = requests(info)[4];
  request.slices = {};
  for (const bool is_whole : {true, false}) {
    request.surfaces = {{0.2f, {1, 0, 0}, 1, !is_whole}};
    twin.render(request);
    const std::vector<HitRecord> hits = twin.hits();
    FrameRequest one = request;
    one.surfaces.clear();
    one.isovalue = 0.2f;
    if (is_whole) one.clip = {};
    twin.render(one);
    expect_same_hits(hits, twin.hits(), kSize.width);
  }
}

TEST(Slices, BadOnesAreRefused) {
  const CompressedVolume volume = gyroid();
  TwinRenderer twin(volume, kSize);
  const FrameRequest good = requests(volume.info)[0];
  const auto expect_refused = [&](auto change, const char *what) {
    FrameRequest request = good;
    change(request);
    EXPECT_THAT([&] { twin.render(request); }, ThrowsMessage<Error>(HasSubstr(what)));
  };
  const auto plane_of = [](FrameRequest &r) -> Slice & { return r.slices.planes[0]; };
  expect_refused(
      [&](FrameRequest &r) {
        plane_of(r).plane.normal = {0, 0, 0};
      },
      "a slice's normal is 0 0 0");
  expect_refused([&](FrameRequest &r) { plane_of(r).plane.offset = NAN; }, "a slice's offset");
  expect_refused([&](FrameRequest &r) { plane_of(r).opacity = 0; }, "an opacity of 0");
  expect_refused([&](FrameRequest &r) { r.slices.low = r.slices.high; }, "cannot go from 1.1 to");
  expect_refused([&](FrameRequest &r) { r.slices.low = INFINITY; }, "begin or end at inf");
  expect_refused([&](FrameRequest &r) { r.slices.planes.resize(7, plane_of(r)); },
                 "2 surfaces and 7 slices are more");
  expect_refused([&](FrameRequest &r) { r.surfaces.clear(); }, "give a surface");
  expect_refused(
      [&](FrameRequest &r) {
        r.ambient_rays = 3;
        for (SurfaceStyle &surface : r.surfaces) surface.opacity = 0.5f;
      },
      "surfaces of opacity 1, and there is none");
}

}  // namespace
}  // namespace isowave::core
