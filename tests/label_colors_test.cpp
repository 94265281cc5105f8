// Colours by label: of the nearest voxel of another segmentation, without its background, or on
// surfaces of labels, of the nearest voxel with one of the surface's labels; against an oracle in
// double precision, and the same bits of all renderers.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>

#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/twin_renderer.hpp"
#include "tests/field_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{47, 39}, kSmall{12, 10};
constexpr std::array<std::uint16_t, 8> kLabels{0, 3, 300, 65535, 4, 256, 77, 1023};

/// Each voxel has the label of the nearest of some points.
struct Segmentation {
  explicit Segmentation(const glm::uvec3 &dims) : info(test::grid_info(dims)) {
    info.spacing = {0.5, 0.7, 0.4};
    info.origin = {300, -20, 11};
    info.direction = glm::dmat3({0.8, 0.6, 0}, {-0.6, 0.8, 0}, {0, 0, 1});
    info.type = VoxelType::kUint16;
    std::mt19937 random(5);
    std::vector<glm::dvec3> points(3 * kLabels.size());
    for (glm::dvec3 &point : points) {
      for (int axis = 0; axis < 3; ++axis)
        point[axis] = std::uniform_real_distribution<double>(0, dims[axis])(random);
    }
    for (std::uint32_t z = 0; z < dims.z; ++z) {
      for (std::uint32_t y = 0; y < dims.y; ++y) {
        for (std::uint32_t x = 0; x < dims.x; ++x) {
          const auto distance = [&](const glm::dvec3 &p) {
            return glm::distance(p, glm::dvec3(x, y, z));
          };
          const auto nearest = std::ranges::min_element(points, {}, distance) - points.begin();
          voxels.push_back(kLabels[static_cast<std::size_t>(nearest) % kLabels.size()]);
        }
      }
    }
    volume = test::TestVolume(info, voxels, ErrorGoal{.exact = true}).compressed;
  }

  float voxel(const glm::uvec3 &v) const {
    return voxels[v.x + info.dims.x * (v.y + std::size_t{info.dims.y} * v.z)];
  }

  VolumeInfo info;
  std::vector<float> voxels{};
  CompressedVolume volume{};
};

/// The label of the voxel that is nearest to p [index space] among the corners of its cell. None:
/// it is in doubt, as two are within 1e-4 voxels of being equally near.
std::optional<float> nearest_label(const Segmentation &of, const glm::dvec3 &p,
                                   const std::vector<std::uint16_t> &labels) {
  double least = 9, next = 9;
  float label = -1, next_label = -1;
  const glm::uvec3 cell(glm::min(glm::floor(p), glm::dvec3(of.info.dims) - 2.0));
  for (std::uint32_t corner = 0; corner < 8; ++corner) {
    const glm::uvec3 v = cell + glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2);
    const float at = of.voxel(v);
    if (std::ranges::find(labels, static_cast<std::uint16_t>(at)) == labels.end()) continue;
    const double distance = glm::distance(p, glm::dvec3(v));
    if (distance < least) {
      next = least;
      next_label = label;
      least = distance;
      label = at;
    } else if (distance < next) {
      next = distance;
      next_label = at;
    }
  }
  if (next - least < 1e-4 && next_label != label) return std::nullopt;
  return label;
}

/// Colours alone, without lights: label L has red L % 256, and green 255 minus that.
Appearance flat() {
  Appearance flat{.ambient = 1, .diffuse = 0, .specular = 0, .above = 0};
  flat.surface = {0, 0, 1};
  ColorByField by{.labels = true};
  for (uint i = 0; i < by.colors.size(); ++i) by.colors[i] = i | (255 - i) << 8;
  flat.color_by_field = by;
  return flat;
}

/// Surfaces of labels, coloured by each.
FrameRequest request_of(const Segmentation &scene, ImageSize size = kSize) {
  FrameRequest request{.camera = orbit_cameras(scene.info, 1)[0], .size = size};
  request.camera.eye = glm::mix(request.camera.eye, request.camera.at, 0.3);
  for (const std::vector<std::uint16_t> &labels :
       std::vector<std::vector<std::uint16_t>>{{3, 300, 65535}, {4, 77}}) {
    SurfaceStyle style{.color = {0, 0, 1}};
    style.labels = labels;
    request.surfaces.push_back(style);
  }
  request.light = flat();
  request.field_values = request.field_labels = true;
  return request;
}

/// Checks the colours of the last frame's first hits.
void expect_nearest_labels(Renderer &renderer, const Segmentation &scene,
                           const FrameRequest &request) {
  const Image8 picture = renderer.shade();  // the frame has blended the colours
  const FrameArrays arrays = renderer.fetch({.positions = true}, {});
  const std::vector<HitRecord> hits = renderer.hits();
  std::array<int, 256> seen{};
  const std::vector<std::uint16_t> all(kLabels.begin(), kLabels.end());
  std::size_t in_doubt = 0, of_others = 0;
  for (std::size_t ray = 0; ray < hits.size(); ++ray) {
    if (!std::isfinite(hits[ray].t)) continue;
    const auto [x, y, z] = arrays.positions[ray];
    const glm::dvec3 p =
        glm::inverse(scene.info.index_to_world()) * (glm::dvec3(x, y, z) - scene.info.origin);
    const uint surface = hits[ray].cell >> ISO_SURFACE_BIT;
    const std::optional<float> label = nearest_label(scene, p, request.surfaces[surface].labels);
    if (!label) {
      ++in_doubt;
      continue;
    }
    ASSERT_GE(*label, 0) << "the cell of a hit has a voxel of its surface";
    const auto expected = static_cast<std::uint8_t>(static_cast<std::uint32_t>(*label) % 256);
    EXPECT_EQ(picture.pixels[3 * ray], expected) << "ray " << ray;
    EXPECT_EQ(picture.pixels[3 * ray + 1], 255 - expected);
    EXPECT_EQ(picture.pixels[3 * ray + 2], 0);
    ++seen[expected];
    of_others += nearest_label(scene, p, all) != label ? 1 : 0;
  }
  EXPECT_GE(256 - std::ranges::count(seen, 0), request.size == kSmall ? 3 : 4);
  EXPECT_GT(of_others, request.size == kSmall ? 3u : 100u)
      << "the nearest voxel is of another surface";
  EXPECT_LT(in_doubt, hits.size() / 20);
}

TEST(LabelColors, OfTheHostAreThoseOfTheNearestLabelOfTheSurface) {
  const Segmentation scene({31, 28, 35});
  HostRenderer host(scene.volume, {.field = &scene.volume});
  FrameRequest request = request_of(scene);
  host.render(request);
  expect_nearest_labels(host, scene, request);
  request.surfaces.pop_back();
  request.surfaces[0].labels = {256, 1023, 0, 3, 77};
  host.render(request);
  expect_nearest_labels(host, scene, request);
}

TEST(LabelColors, OfAnotherSegmentationAreThoseOfTheNearestVoxel) {
  const Segmentation scene({31, 28, 35});
  const CompressedVolume volume = test::turned_gyroid();
  HostRenderer host(volume, {.field = &scene.volume});
  TwinRenderer twin(volume, kSize, kDefaultSolver, &scene.volume);
  const FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0],
                             .isovalue = 0.2f,
                             .size = kSize,
                             .field_values = true,
                             .field_labels = true};
  host.render(request);
  twin.render(request);
  const Image8 picture = host.shade(flat());
  EXPECT_EQ(picture.pixels, twin.shade(flat()).pixels);
  const std::vector<std::uint16_t> all(kLabels.begin() + 1, kLabels.end());  // without 0
  const FrameArrays arrays = host.fetch({.positions = true}, {});
  const std::vector<float> values = host.field_values();
  std::size_t checked = 0, background = 0;
  for (std::size_t ray = 0; ray < values.size(); ++ray) {
    const auto [x, y, z] = arrays.positions[ray];
    if (std::isnan(x)) continue;
    const glm::dvec3 p =
        glm::inverse(scene.info.index_to_world()) * (glm::dvec3(x, y, z) - scene.info.origin);
    const auto label = nearest_label(scene, glm::max(p, glm::dvec3(0)), all);
    if (!label) continue;
    if (*label < 0) {  // all eight are background
      EXPECT_TRUE(std::isnan(values[ray]));
      EXPECT_EQ(picture.pixels[3 * ray + 2], 255) << "the surface's own colour";
      ++background;
      continue;
    }
    EXPECT_EQ(values[ray], *label);
    ++checked;
  }
  EXPECT_GT(checked, 500u);
  EXPECT_GT(background, 10u);
}

TEST(LabelColors, FieldsThatAreNoLabelsAreOneLine) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  HostRenderer host(volume, {.field = &other});
  FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0],
                       .isovalue = 0.2f,
                       .size = kSize,
                       .field_values = true,
                       .field_labels = true};
  EXPECT_THAT([&] { host.render(request); }, ThrowsMessage<Error>(HasSubstr("are no labels")));
  request.field_labels = false;
  host.render(request);
}

class LabelColorsOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, LabelColorsOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(LabelColorsOnDevice, SmallFrameHasTheLabelsOfItsSurfaces) {
  const Segmentation scene({13, 12, 15});
  DeviceRenderer renderer(
      device_, scene.volume,
      {.size = kSmall, .max_surfaces = 2, .with_labels = true, .field = &scene.volume});
  const FrameRequest request = request_of(scene, kSmall);
  renderer.render(request);
  expect_nearest_labels(renderer, scene, request);
}

/// Translucent surfaces, clipping with caps, other labels, trilinear values in between; so few
/// slots that rays wait for blocks of the field.
TEST_P(LabelColorsOnDevice, FramesAreTheHosts) {
  const Segmentation scene({31, 28, 35});
  HostRenderer host(scene.volume, {.field = &scene.volume});
  DeviceRenderer renderer(device_, scene.volume,
                          {.size = kSize,
                           .max_surfaces = 2,
                           .with_labels = true,
                           .field = &scene.volume,
                           .field_slots = 30});
  const FrameRequest plain = request_of(scene);
  FrameRequest translucent = plain, clipped = plain, others = plain, trilinear = plain;
  for (SurfaceStyle &surface : translucent.surfaces) surface.opacity = 0.4f;
  clipped.clip = test::far_half(scene.info, plain.camera);
  others.surfaces[0].labels = {256, 300};
  others.surfaces[1].labels = {77, 3, 4};
  trilinear.field_labels = false;
  trilinear.light.color_by_field = ColorByField{.low = 0, .high = 300, .colors = color_map("gray")};
  for (const FrameRequest &request : {plain, translucent, clipped, others, trilinear, plain}) {
    host.render(request);
    renderer.render(request);
    EXPECT_EQ(renderer.shade().pixels, host.shade().pixels);
    if (request.surfaces[0].opacity == 1 && request.field_labels && request.clip.planes.empty())
      expect_nearest_labels(renderer, scene, request);
  }
}

TEST_P(LabelColorsOnDevice, LabelsOfAnotherSegmentationAreTheTwins) {
  const Segmentation scene({31, 28, 35});
  const CompressedVolume volume = test::turned_gyroid();
  TwinRenderer twin(volume, kSize, kDefaultSolver, &scene.volume);
  DeviceRenderer renderer(device_, volume, {.size = kSize, .field = &scene.volume});
  FrameRequest request{.camera = orbit_cameras(volume.info, 1)[0],
                       .isovalue = 0.2f,
                       .size = kSize,
                       .field_values = true,
                       .field_labels = true};
  for (const bool is_clipped : {false, true}) {
    if (is_clipped) request.clip = test::far_half(volume.info, request.camera);
    twin.render(request);
    renderer.render(request);
    EXPECT_EQ(renderer.shade(flat()).pixels, twin.shade(flat()).pixels);
  }
}

}  // namespace
}  // namespace isowave::core
