// Colours by a second volume: the values at hits against an oracle in double precision, and the
// same bits of all renderers.

#include "core/frame/field_values.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

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

constexpr ImageSize kSize{51, 37};

FrameRequest request_of(const VolumeInfo &info) {
  return {
      .camera = orbit_cameras(info, 1)[0], .isovalue = 0.2f, .size = kSize, .field_values = true};
}

/// A whole frame, levels of detail, clipped with caps, values of caps alone, and gradients of cells
/// with ambient rays.
std::vector<FrameRequest> requests(const VolumeInfo &info) {
  const FrameRequest plain = request_of(info);
  FrameRequest levels = plain, clipped = plain, open = plain;
  levels.voxel_pixels = 3;
  clipped.clip = test::far_half(info, plain.camera);
  open.normals = Normals::kCell;
  open.ambient_rays = 3;
  FrameRequest on_caps = clipped;
  on_caps.field_on_caps = true;
  return {plain, levels, clipped, on_caps, open};
}

std::vector<std::uint32_t> bits_of(const std::vector<float> &values) {
  std::vector<std::uint32_t> bits;
  bits.reserve(values.size());
  for (const float value : values) bits.push_back(std::bit_cast<std::uint32_t>(value));
  return bits;
}

std::size_t num_values(const std::vector<float> &values) {
  return values.size() - static_cast<std::size_t>(std::ranges::count_if(
                             values, [](float value) { return std::isnan(value); }));
}

/// The trilinear value at a world position, in double precision; NaN outside.
double oracle(const VolumeInfo &info, const std::vector<float> &voxels, const glm::dvec3 &world) {
  const glm::dvec3 p = glm::inverse(info.index_to_world()) * (world - info.origin);
  double sum = 0;
  std::array<std::size_t, 3> cell{};
  std::array<double, 3> at{};
  for (int axis = 0; axis < 3; ++axis) {
    const double last = info.dims[axis] - 1.0;
    if (!(p[axis] >= 0 && p[axis] <= last)) return NAN;
    cell[std::size_t(axis)] = std::size_t(std::min(std::floor(p[axis]), last - 1));
    at[std::size_t(axis)] = p[axis] - double(cell[std::size_t(axis)]);
  }
  for (std::size_t corner = 0; corner < 8; ++corner) {
    double weight = 1;
    std::array<std::size_t, 3> v = cell;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const bool high = (corner >> axis & 1) != 0;
      weight *= high ? at[axis] : 1 - at[axis];
      v[axis] += high ? 1 : 0;
    }
    sum += weight * voxels[v[0] + info.dims.x * (v[1] + std::size_t{info.dims.y} * v[2])];
  }
  return sum;
}

TEST(FieldValues, AreTrilinearAtTheHits) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  const std::vector<float> voxels = decode_with_libzfp(other);
  TwinRenderer twin(volume, kSize, kDefaultSolver, &other);
  // A place in the field sums eight floats of at most 64 voxels, each rounded by 2^-24 of it, and
  // voxels differ by less than 1 from their neighbours: less than 3 axes * 8 * 64 * 2^-24.
  constexpr double kTolerance = 3 * 8 * 64.0 / (1 << 24);
  std::size_t inside = 0, outside = 0, at_border = 0;
  for (const FrameRequest &request : requests(volume.info)) {
    if (request.field_on_caps) continue;
    twin.render(request);
    const FrameArrays arrays = twin.fetch({.positions = true}, {});
    for (std::size_t ray = 0; ray < twin.field_values().size(); ++ray) {
      const auto [x, y, z] = arrays.positions[ray];
      const float value = twin.field_values()[ray];
      if (std::isnan(x)) {
        EXPECT_TRUE(std::isnan(value)) << "no hit";
        continue;
      }
      const double expected = oracle(other.info, voxels, {x, y, z});
      if (std::isnan(expected) != std::isnan(value)) {
        ++at_border;
        continue;
      }
      ++(std::isnan(value) ? outside : inside);
      if (std::isnan(value)) continue;
      EXPECT_NEAR(value, expected, kTolerance);
    }
  }
  EXPECT_GT(inside, 1000u);
  EXPECT_GT(outside, 300u);
  EXPECT_LT(at_border, 10u) << "within ISO_FIELD_REACH of the border";
}

TEST(FieldValues, OfTheVolumeItselfAreTheIsovalue) {
  const CompressedVolume volume = test::turned_gyroid();
  TwinRenderer twin(volume, kSize, kDefaultSolver, &volume);
  FrameRequest request = requests(volume.info)[2];
  twin.render(request);
  std::size_t on_surface = 0, on_cap = 0;
  const std::vector<HitRecord> hits = twin.hits();
  for (std::size_t ray = 0; ray < hits.size(); ++ray) {
    if (!std::isfinite(hits[ray].t)) continue;
    const float value = twin.field_values()[ray];
    if (is_cap(hits[ray])) {
      EXPECT_GT(value, 0.2f - 1e-3f);
      if (value > 0.3f) ++on_cap;
    } else {
      EXPECT_NEAR(value, 0.2f, 1e-3f);
      ++on_surface;
    }
  }
  EXPECT_GT(on_surface, 100u);
  EXPECT_GT(on_cap, 50u) << "caps show the voxels";
}

TEST(FieldValues, ColoursGoFromTheLeastToTheLargestAtTheHits) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  TwinRenderer twin(volume, kSize, kDefaultSolver, &other);
  twin.render(request_of(volume.info));
  Appearance flat{.ambient = 1, .diffuse = 0, .specular = 0, .above = 0};
  flat.color_by_field = ColorByField{.colors = color_map("gray")};
  const Image8 picture = twin.shade(flat);
  const std::array<float, 2> range = twin.field_range().value();
  const std::vector<float> &values = twin.field_values();
  std::array<int, 2> ends{};
  for (std::size_t ray = 0; ray < values.size(); ++ray) {
    if (std::isnan(values[ray])) continue;
    EXPECT_GE(values[ray], range[0]);
    EXPECT_LE(values[ray], range[1]);
    const double expected = 255.0 * (values[ray] - range[0]) / (range[1] - range[0]);
    EXPECT_NEAR(picture.pixels[3 * ray], expected, 0.51);
    for (std::size_t end = 0; end < 2; ++end) ends[end] += values[ray] == range[end] ? 1 : 0;
  }
  EXPECT_GE(ends[0], 1);
  EXPECT_GE(ends[1], 1);
  // A given range, and hits without a value, which keep the surface's colour.
  flat.color_by_field->low = range[1] + 1;
  flat.color_by_field->high = range[1] + 2;
  flat.surface = {1, 0, 0};
  const Image8 low = twin.shade(flat);
  const std::vector<float> depth = twin.depth();
  for (std::size_t ray = 0; ray < values.size(); ++ray) {
    if (std::isinf(depth[ray])) continue;
    EXPECT_EQ(low.pixels[3 * ray], std::isnan(values[ray]) ? 255 : 0);
  }
}

TEST(FieldValues, CapsAloneHaveValues) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  TwinRenderer twin(volume, kSize, kDefaultSolver, &other);
  FrameRequest request = requests(volume.info)[2];
  twin.render(request);
  const std::vector<float> all = twin.field_values();
  request.field_on_caps = true;
  twin.render(request);
  const std::vector<HitRecord> hits = twin.hits();
  std::size_t num_caps = 0;
  for (std::size_t ray = 0; ray < hits.size(); ++ray) {
    const bool is_cap = std::isfinite(hits[ray].t) && (hits[ray].cell & ISO_CAP) != 0;
    num_caps += is_cap && !std::isnan(all[ray]) ? 1 : 0;
    if (is_cap && !std::isnan(all[ray])) {
      ASSERT_EQ(twin.field_values()[ray], all[ray]);
    } else {
      ASSERT_TRUE(std::isnan(twin.field_values()[ray]));
    }
  }
  EXPECT_GT(num_caps, 100u);
  EXPECT_LT(num_caps + 100, num_values(all));
}

TEST(FieldValues, TheHostDrawsTheTwinsBytes) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  TwinRenderer twin(volume, kSize, kDefaultSolver, &other);
  const std::uint64_t least = HostLevels::least_bytes(volume) + HostBlocks::bytes(other.info);
  for (const std::uint64_t limit : {std::uint64_t{0}, least + (1u << 16)}) {
    HostRenderer host(volume, {.memory_limit = limit, .field = &other});
    for (const FrameRequest &request : requests(volume.info)) {
      twin.render(request);
      host.render(request);
      EXPECT_EQ(bits_of(host.field_values()), bits_of(twin.field_values()));
      EXPECT_EQ(host.field_range(), twin.field_range());
      EXPECT_EQ(host.shade(test::by_field()).pixels, twin.shade(test::by_field()).pixels);
    }
  }
}

/// The last band of values is not the end if shadow rays follow.
TEST(FieldValues, FramesStoppedBeforeTheirShadowsAreCancelled) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  HostRenderer host(volume, {.field = &other});
  FrameRequest request = request_of(volume.info);
  request.light.towards_light = glm::dvec3(0.2, 1, 0.3);
  request.shadow_rays = 1;
  request.on_pass = [](const PassStats &) { return true; };
  const FrameStats whole = host.render(request);
  const std::size_t before = whole.passes.size() + whole.field.passes;
  request.on_pass = [&, calls = std::size_t{0}](const PassStats &) mutable {
    return ++calls < before;
  };
  const FrameStats stopped = host.render(request);
  EXPECT_TRUE(stopped.cancelled);
  EXPECT_EQ(stopped.field.passes, whole.field.passes);
}

TEST(FieldValues, RefuseWhatCannotBeShown) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  HostRenderer host(volume, {.field = &other}), without(volume);
  FrameRequest request = request_of(volume.info);
  EXPECT_THAT([&] { without.render(request); }, ThrowsMessage<Error>(HasSubstr("has no field")));
  request.field_values = false;
  host.render(request);
  EXPECT_THAT([&] { host.shade(test::by_field()); }, ThrowsMessage<Error>(HasSubstr("no values")));
  for (const double low : {double(NAN), double(INFINITY), 1e39, 1.0}) {
    EXPECT_THAT([&] { check_color_by_field(ColorByField{.low = low, .high = 1.0}); },
                ThrowsMessage<Error>(HasSubstr("colours cannot")));
  }
}

class FieldValuesOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, FieldValuesOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

void expect_twins_bytes(ocl::Device &device, const CompressedVolume &volume,
                        const CompressedVolume &other, RendererOptions options,
                        std::span<const FrameRequest> frames) {
  options.size = kSize;
  options.field = &other;
  options.with_given_rays = true;
  TwinRenderer twin(volume, kSize, kDefaultSolver, &other);
  DeviceRenderer renderer(device, volume, options);
  EXPECT_LE(device.ledger().peak(), renderer.memory_plan().peak());
  for (int time = 0; time < 2; ++time) {
    for (const FrameRequest &request : frames) {
      twin.render(request);
      const FrameStats stats = renderer.render(request);
      EXPECT_GT(num_values(twin.field_values()), 100u);
      EXPECT_GE(stats.field.passes, 1u);
      EXPECT_EQ(renderer.field_range(), twin.field_range());
      EXPECT_EQ(bits_of(renderer.field_values()), bits_of(twin.field_values()));
      EXPECT_EQ(renderer.shade(test::by_field()).pixels, twin.shade(test::by_field()).pixels);
    }
  }
}

/// Small enough for Oclgrind.
TEST_P(FieldValuesOnDevice, SmallFrameHasTheTwinsBytes) {
  constexpr ImageSize kSmall{21, 15};
  const CompressedVolume volume =
      test::compressed_at_12_bits(test::grid_info({10, 9, 12}), test::gyroid_field(6));
  VolumeInfo info = test::grid_info({9, 7, 8});
  info.origin = {0.5, 1, 2.5};
  const CompressedVolume other = test::compressed_at_12_bits(
      info, [](const glm::dvec3 &p) { return std::sin(p.x) + 0.3 * p.y - 0.2 * p.z; });
  FrameRequest request = request_of(volume.info);
  request.size = kSmall;
  TwinRenderer twin(volume, kSmall, kDefaultSolver, &other);
  twin.render(request);
  EXPECT_GT(num_values(twin.field_values()), 20u);
  DeviceRenderer renderer(device_, volume, {.size = kSmall, .cache_slots = 30, .field = &other});
  for (int time = 0; time < 2; ++time) {
    renderer.render(request);
    EXPECT_EQ(bits_of(renderer.field_values()), bits_of(twin.field_values()));
    EXPECT_EQ(renderer.field_range(), twin.field_range());
    EXPECT_EQ(renderer.shade(test::by_field()).pixels, twin.shade(test::by_field()).pixels);
  }
}

TEST_P(FieldValuesOnDevice, FrameHasTheTwinsBytes) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  expect_twins_bytes(device_, volume, other, {}, std::array{request_of(volume.info)});
}

TEST_P(FieldValuesOnDevice, FewSlotsServeAllHits) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  expect_twins_bytes(device_, volume, other, {.cache_slots = 8, .field_slots = 8},
                     std::array{request_of(volume.info)});
}

TEST_P(FieldValuesOnDevice, HolesHaveNoValue) {
  const CompressedVolume volume = test::turned_gyroid();
  VolumeInfo info = volume.info;
  std::vector<float> voxels = test::sample(info.dims, test::gyroid_field(7));
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (i / 900 % 3 == 0) voxels[i] = NAN;
  }
  ArrayReader reader(info, voxels);
  const CompressedVolume holes = compress(reader, {.rate = 12, .levels = 0});
  ASSERT_FALSE(holes.no_data.empty());
  expect_twins_bytes(device_, volume, holes, {}, std::array{request_of(volume.info)});
  TwinRenderer twin(volume, kSize, kDefaultSolver, &holes);
  HostRenderer host(volume, {.field = &holes});
  twin.render(request_of(volume.info));
  host.render(request_of(volume.info));
  EXPECT_EQ(bits_of(host.field_values()), bits_of(twin.field_values()));
  const auto num_hits =
      std::ranges::count_if(twin.hits(), [](const HitRecord &hit) { return std::isfinite(hit.t); });
  EXPECT_LT(num_values(twin.field_values()) + 100, std::size_t(num_hits));
}

TEST_P(FieldValuesOnDevice, StoppedFramesLeaveNothing) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  const FrameRequest request = request_of(volume.info);
  TwinRenderer twin(volume, kSize, kDefaultSolver, &other);
  twin.render(request);
  DeviceRenderer renderer(device_, volume, {.size = kSize, .field = &other, .field_slots = 8});
  std::size_t num_stopped = 0, in_field = 0;
  for (std::size_t last = 1; last < 40; last += 3) {
    FrameRequest stopped = request;
    stopped.on_pass = [&, left = last](const PassStats &) mutable { return --left != 0; };
    const FrameStats stats = renderer.render(stopped);
    num_stopped += stats.cancelled ? 1 : 0;
    in_field += stats.cancelled && stats.field.passes != 0 ? 1 : 0;
    renderer.render(request);
    ASSERT_EQ(bits_of(renderer.field_values()), bits_of(twin.field_values())) << last;
  }
  EXPECT_GT(num_stopped, 2u);
  EXPECT_GT(in_field, 0u);
}

TEST_P(FieldValuesOnDevice, BudgetsAreShared) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  expect_twins_bytes(device_, volume, other, {.memory_budget = 600'000},
                     std::array{request_of(volume.info)});
  EXPECT_LE(device_.ledger().peak(), 600'000u);
  EXPECT_THAT(
      [&] {
        DeviceRenderer(device_, volume, {.size = kSize, .memory_budget = 30'000, .field = &other});
      },
      ThrowsMessage<Error>(HasSubstr("budget of 30000 bytes is too small")));
}

TEST_P(FieldValuesOnDevice, HaveTheTwinsBytesWithLevelsClippedAndOpen) {
  const CompressedVolume volume = test::turned_gyroid(), other = test::field_of_gyroid();
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost})
    expect_twins_bytes(device_, volume, other,
                       {.stream = place, .with_levels = true, .field_slots = 40},
                       requests(volume.info));
}

}  // namespace
}  // namespace isowave::core
