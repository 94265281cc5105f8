// Colours by the values of the volume that is drawn: they are read from its own blocks, take no
// memory but for the values, and are those of a second volume that is equal to it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "core/base/error.hpp"
#include "core/frame/field_values.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "tests/bounds_scene.hpp"
#include "tests/field_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr ImageSize kSize{51, 37};
constexpr double kVoxelError = 0.05;  ///< of frames of fewer bit planes

FrameRequest request_of(const VolumeInfo &info) {
  FrameRequest request{
      .camera = orbit_cameras(info, 1)[0], .isovalue = 0.2f, .size = kSize, .field_values = true};
  request.clip = test::far_half(info, request.camera);
  return request;
}

/// A volume with levels of detail and bounds of their errors.
CompressedVolume volume_with_bounds() {
  return test::BoundsScene(
             {30, 27, 34}, test::gyroid_field(11),
             {.precision = BlockPrecision{.min_exponent = -16, .max_voxel_error = 0x1p-16}})
      .volume;
}

/// Clipped with caps; the same of caps alone, with gradients of cells and ambient rays; two
/// isovalues of fewer bit planes, with ambient rays behind the values; levels of detail, and the
/// same of fewer bit planes; a bound; the first again.
std::vector<FrameRequest> requests(const VolumeInfo &info) {
  std::vector<FrameRequest> all(8, request_of(info));
  all[1].field_on_caps = true;
  all[1].normals = Normals::kCell;
  all[1].ambient_rays = 3;
  all[2].voxel_error = all[3].voxel_error = all[5].voxel_error = kVoxelError;
  all[2].ambient_rays = all[3].ambient_rays = 2;
  all[3].isovalue = -0.3f;
  all[4].voxel_pixels = 30;  // none of the finest
  all[5].voxel_pixels = 2;
  all[6].clip = {};
  all[6].bound = FieldBound::kUpper;
  return all;
}

/// Two translucent surfaces and an opaque one; the same of fewer bit planes, with ambient rays.
std::vector<FrameRequest> layered_requests(const VolumeInfo &info) {
  std::vector<FrameRequest> all(3, request_of(info));
  for (FrameRequest &request : all) {
    request.light = test::by_field();
    request.surfaces = {{0.2f, {0.8f, 0.2f, 0.1f}, 0.4f},
                        {-0.3f, {0.1f, 0.4f, 0.8f}, 0.3f},
                        {0.5f, {0.3f, 0.7f, 0.2f}, 1}};
  }
  all[1].voxel_error = kVoxelError;
  all[1].ambient_rays = 2;
  return all;
}

std::vector<std::uint32_t> bits_of(const std::vector<float> &values) {
  std::vector<std::uint32_t> bits;
  for (const float value : values) bits.push_back(std::bit_cast<std::uint32_t>(value));
  return bits;
}

/// Draws frames by two renderers. To one of them, the field is a second volume.
template <class Made>
void expect_same_values(Made &shares, Made &separate, std::span<const FrameRequest> frames) {
  for (int time = 0; time < 2; ++time) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      SCOPED_TRACE(i);
      separate.render(frames[i]);
      shares.render(frames[i]);
      test::expect_same_hits(shares.hits(), separate.hits(), kSize.ray_columns());
      if (frames[i].surfaces.empty()) {
        EXPECT_EQ(shares.field_range(), separate.field_range());
        EXPECT_EQ(bits_of(shares.field_values()), bits_of(separate.field_values()));
      }
      const Appearance by = frames[i].surfaces.empty() ? test::by_field() : Appearance{};
      EXPECT_EQ(shares.shade(by).pixels, separate.shade(by).pixels);
    }
  }
}

std::uint64_t decoded_blocks(const FrameStats &stats) {
  std::uint64_t sum = stats.normals.decoded_blocks + stats.field.decoded_blocks;
  for (const PassStats &pass : stats.passes) sum += pass.counts.decoded_count;
  return sum;
}

TEST(OwnField, FramesOfTheHostAreThoseOfASecondVolume) {
  const CompressedVolume volume = volume_with_bounds(), copy = volume;
  const std::uint64_t least =
      HostLevels::least_bytes(volume, 3) + HostBlocks::bytes(volume.info) + (1u << 16);
  for (const std::uint64_t limit : {std::uint64_t{0}, least}) {
    HostRenderer shares(volume, {.memory_limit = limit, .field = &volume}),
        separate(volume, {.field = &copy});
    expect_same_values(shares, separate, requests(volume.info));
    EXPECT_GT(shares.render(requests(volume.info)[4]).first_level, 0u);
    expect_same_values(shares, separate, layered_requests(volume.info));
  }
}

TEST(OwnField, TakesNoMemoryOfTheHost) {
  const CompressedVolume volume = volume_with_bounds();
  HostRenderer shares(volume, {.field = &volume}), without(volume);
  EXPECT_EQ(shares.memory_bytes(), without.memory_bytes());
  FrameRequest request = request_of(volume.info);
  shares.render(request);
  request.field_values = false;
  without.render(request);
  EXPECT_EQ(shares.memory_bytes(), without.memory_bytes());
  EXPECT_EQ(shares.num_decoded_blocks(), without.num_decoded_blocks());
  HostRenderer limited(volume, {.memory_limit = HostLevels::least_bytes(volume), .field = &volume});
  request.field_values = true;
  limited.render(request);
  EXPECT_EQ(bits_of(limited.field_values()), bits_of(shares.field_values()));
  request.voxel_error = kVoxelError;
  EXPECT_THAT([&] { limited.render(request); },
              ThrowsMessage<Error>(HasSubstr("of memory at least")));
}

class OwnFieldOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// options: without a field
  void expect_values_of_a_copy(const CompressedVolume &volume, RendererOptions options,
                               std::span<const FrameRequest> frames) {
    const CompressedVolume copy = volume;
    options.size = kSize;
    options.field = &copy;
    DeviceRenderer separate(device_, volume, options);
    options.field = &volume;
    DeviceRenderer shares(device_, volume, options);
    expect_same_values(shares, separate, frames);
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, OwnFieldOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// Small enough for Oclgrind.
TEST_P(OwnFieldOnDevice, SmallFrameHasTheHostsValues) {
  constexpr ImageSize kSmall{17, 13};
  const CompressedVolume volume =
      test::compressed_at_12_bits(test::grid_info({10, 9, 12}), test::gyroid_field(6));
  FrameRequest request = request_of(volume.info);
  request.size = kSmall;
  HostRenderer host(volume, {.field = &volume});
  DeviceRenderer renderer(device_, volume, {.size = kSmall, .cache_slots = 8, .field = &volume});
  host.render(request);
  renderer.render(request);
  EXPECT_EQ(bits_of(renderer.field_values()), bits_of(host.field_values()));
  EXPECT_EQ(renderer.field_range(), host.field_range());
}

TEST_P(OwnFieldOnDevice, TakesTheMemoryOfTheValuesAlone) {
  const CompressedVolume volume = volume_with_bounds(), copy = volume;
  const auto plan_with = [&](const CompressedVolume *field, RendererOptions options) {
    options.size = kSize;
    options.field = field;
    ocl::Device device(GetParam());
    const DeviceRenderer renderer(device, volume, options);
    if (field != &copy) {
      EXPECT_EQ(device.ledger().current(), renderer.memory_plan().total());
    }
    return renderer.memory_plan();
  };
  // Instead of the byte of a buffer without values.
  const std::uint64_t values = kSize.num_rays() * sizeof(float) - 1 + FieldValues::sizes(0).bytes();
  for (const RendererOptions &options :
       {RendererOptions{}, RendererOptions{.stream = StreamPlace::kHost, .with_levels = true}}) {
    const MemoryPlan without = plan_with(nullptr, options), shares = plan_with(&volume, options);
    EXPECT_EQ(shares.total(), without.total() + values);
    EXPECT_EQ(shares.cache_slots, without.cache_slots);
  }
  EXPECT_GT(plan_with(&copy, {}).total(), plan_with(&volume, {}).total() + volume.word_count());
  // All of a budget is the volume's.
  constexpr std::uint64_t kBudget = 500'000;
  const MemoryPlan without = plan_with(nullptr, {.memory_budget = kBudget - values}),
                   shares = plan_with(&volume, {.memory_budget = kBudget});
  EXPECT_EQ(shares.cache_slots, without.cache_slots);
  EXPECT_LE(shares.peak(), kBudget);
}

TEST_P(OwnFieldOnDevice, DecodesBlocksOnce) {
  const CompressedVolume volume = volume_with_bounds(), copy = volume;
  FrameRequest request = request_of(volume.info);
  request.clip = {};
  const auto stats_with = [&](const CompressedVolume *field) {
    DeviceRenderer renderer(device_, volume, {.size = kSize, .field = field});
    request.field_values = field != nullptr;
    return renderer.render(request);
  };
  const FrameStats without = stats_with(nullptr), shares = stats_with(&volume);
  EXPECT_EQ(shares.field.decoded_blocks, 0u) << "rays have decoded the blocks of their hits";
  EXPECT_EQ(shares.field.passes, 1u);
  EXPECT_EQ(decoded_blocks(shares), decoded_blocks(without));
  EXPECT_GT(stats_with(&copy).field.decoded_blocks, 20u);
}

TEST_P(OwnFieldOnDevice, FramesAreThoseOfASecondVolume) {
  const CompressedVolume volume = volume_with_bounds();
  expect_values_of_a_copy(volume,
                          {.with_levels = true, .with_bounds = true, .with_given_rays = true},
                          requests(volume.info));
}

/// So few slots that hits wait for blocks, also of a level of detail that the frame does not draw.
TEST_P(OwnFieldOnDevice, FramesOfFewSlotsAreThoseOfASecondVolume) {
  const CompressedVolume volume = volume_with_bounds();
  const std::vector<FrameRequest> all = requests(volume.info), frames{all[0], all[2], all[4]};
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost})
    expect_values_of_a_copy(
        volume, {.cache_slots = 24, .stream = place, .with_levels = true, .with_given_rays = true},
        frames);
}

TEST_P(OwnFieldOnDevice, LayersAreThoseOfASecondVolume) {
  const CompressedVolume volume = volume_with_bounds();
  for (const std::uint32_t slots : {0u, 40u})
    expect_values_of_a_copy(volume,
                            {.cache_slots = slots, .max_surfaces = 3, .with_given_rays = true},
                            layered_requests(volume.info));
}

/// Voxels of 8 bits, which slots hold as they are, and voxels without data.
TEST_P(OwnFieldOnDevice, IntegersAndHolesAreThoseOfASecondVolume) {
  VolumeInfo info = test::turned_gyroid().info;
  std::vector<float> voxels = test::sample(info.dims, test::gyroid_field(11));
  for (float &voxel : voxels) voxel = std::round(20 * voxel);
  info.type = VoxelType::kInt8;
  FrameRequest request = request_of(info);
  request.isovalue = 4.5f;
  const test::TestVolume of_integers(info, voxels, ErrorGoal{.exact = true});
  expect_values_of_a_copy(of_integers.compressed, {}, {&request, 1});
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (i / 900 % 4 == 0) voxels[i] = NAN;
  }
  info.type = VoxelType::kFloat32;
  ArrayReader reader(info, voxels);
  const CompressedVolume holes = compress(reader, {.rate = 12, .levels = 0});
  expect_values_of_a_copy(holes, {.cache_slots = 30}, {&request, 1});
}

TEST_P(OwnFieldOnDevice, StoppedFramesLeaveNothing) {
  const CompressedVolume volume = volume_with_bounds();
  HostRenderer host(volume, {.field = &volume});
  DeviceRenderer renderer(
      device_, volume, {.size = kSize, .cache_slots = 16, .with_levels = true, .field = &volume});
  std::size_t in_field = 0;
  for (const std::size_t of : {std::size_t{4}, std::size_t{2}}) {
    FrameRequest request = requests(volume.info)[of];
    request.ambient_rays = 0;
    host.render(request);
    for (std::size_t last = 1; last < 60; last += 5) {
      FrameRequest stopped = request;
      stopped.on_pass = [&, left = last](const PassStats &) mutable { return --left != 0; };
      const FrameStats stats = renderer.render(stopped);
      in_field += stats.cancelled && stats.field.passes != 0 ? 1 : 0;
      renderer.render(request);
      ASSERT_EQ(bits_of(renderer.field_values()), bits_of(host.field_values())) << last;
    }
  }
  EXPECT_GT(in_field, 0u);
}

}  // namespace
}  // namespace isowave::core
