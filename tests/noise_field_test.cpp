// noise_field.cl against the host's rows of the same fields.

#include "core/sources/noise_field.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "core/bricks/brick_volume.hpp"
#include "core/io/raw_reader.hpp"
#include "core/sources/noise_on_device.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr Field kNoise[] = {Field::kMixingLayer, Field::kTurbulence, Field::kJet, Field::kScan,
                            Field::kNoisyScan};

/// Made by the host.
std::vector<double> values_of(Field field, const glm::uvec3 &dims, std::uint32_t z_begin,
                              std::uint32_t num_layers) {
  GenerateOptions options;
  options.field = field;
  options.dims = dims;
  options.type = VoxelType::kFloat64;
  options.seed = 7;
  std::vector<double> values(std::size_t{dims.x} * dims.y * num_layers);
  open_generated(options)->read_exact_layers(z_begin, num_layers, values);
  return values;
}

class NoiseFieldOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void SetUp() override {
    if (!GetParam().capabilities.fp64) GTEST_SKIP() << "the device has no doubles";
  }

  /// layers: the first and how many, of each call.
  void expect_host_bits(const glm::uvec3 &dims,
                        const std::vector<std::pair<std::uint32_t, std::uint32_t>> &layers) {
    for (const Field field : kNoise) {
      SCOPED_TRACE(to_string(field));
      NoiseOnDevice noise(device_, *make_noise_field(field, dims, 7), dims, VoxelType::kFloat64);
      for (const auto &[z_begin, num_layers] : layers) {
        std::vector<double> made(std::size_t{dims.x} * dims.y * num_layers);
        noise.evaluate(z_begin, num_layers, std::as_writable_bytes(std::span(made)));
        EXPECT_EQ(made, values_of(field, dims, z_begin, num_layers));
      }
    }
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, NoiseFieldOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(NoiseFieldOnDevice, SmallVolumesHaveTheHostsBits) {
  expect_host_bits({11, 7, 6}, {{0, 1}, {4, 2}});
}

TEST_P(NoiseFieldOnDevice, VolumesWithFineOctavesHaveTheHostsBits) {
  expect_host_bits({143, 97, 98}, {{0, 4}, {93, 5}});
}

TEST_P(NoiseFieldOnDevice, EveryTypeIsStoredAsTheHostStoresIt) {
  const glm::uvec3 dims(30, 17, 16);
  for (const VoxelType type :
       {VoxelType::kUint8, VoxelType::kInt8, VoxelType::kUint16, VoxelType::kInt16,
        VoxelType::kUint32, VoxelType::kInt32, VoxelType::kFloat32, VoxelType::kFloat64}) {
    SCOPED_TRACE(to_string(type));
    GenerateOptions options;
    options.dims = dims;
    options.type = type;
    std::vector<double> expected(std::size_t{dims.x} * dims.y * dims.z), made(expected.size());
    open_generated(options)->read_exact_layers(0, dims.z, expected);
    std::vector<std::byte> stored(expected.size() * size_of(type));
    NoiseOnDevice(device_, *make_noise_field(options.field, dims, options.seed), dims, type)
        .evaluate(0, dims.z, stored);
    convert_to_double(type, stored, made);
    EXPECT_EQ(made, expected);
  }
}

TEST_P(NoiseFieldOnDevice, RefusesOtherSizes) {
  const glm::uvec3 dims(8);
  NoiseOnDevice noise(device_, *make_noise_field(Field::kJet, dims, 1), dims, VoxelType::kInt16);
  std::vector<std::byte> one_short(8 * 8 * 2 * 2 - 1);
  EXPECT_THROW(noise.evaluate(0, 2, one_short), std::invalid_argument);
}

/// The reader takes the device where that is a GPU.
TEST_P(NoiseFieldOnDevice, ReadersGiveTheSameVoxels) {
  GenerateOptions options;
  options.field = Field::kScan;
  options.dims = {33, 30, 21};
  options.type = VoxelType::kUint8;
  std::vector<float> by_host(33 * 30 * 21), by_device(by_host.size());
  open_generated(options)->read_layers(0, 21, by_host);
  options.noise = noise_on(GetParam());
  open_generated(options)->read_layers(0, 21, by_device);
  EXPECT_EQ(by_host, by_device);
}

/// Noise that the encoder's device makes, also on CPUs; nothing can be read.
class InPlaceAlone : public NoiseVoxels {
 public:
  InPlaceAlone(ocl::Device &device, const NoiseField &field, VoxelType type)
      : in_place_(device, field, type) {}
  void evaluate(std::uint32_t, std::uint32_t, std::span<std::byte>) override {
    throw std::logic_error("read");
  }
  DeviceVoxels *in_place() override { return &in_place_; }

 private:
  NoiseInPlace in_place_;
};

/// Nothing of the voxels comes to the host, and bricks have the words that the host's voxels have.
TEST_P(NoiseFieldOnDevice, BricksAreCompressedWhereTheyAreMade) {
  for (const std::string type : {"uint8", "int16"}) {
    SCOPED_TRACE(type);
    const std::string name = "generate:scan_45x38x41_" + type;
    const VolumeInfo whole = read_levels(name, {}).front();
    Storage by_host{.rate = 4, .measure_error = true}, in_place = by_host;
    in_place.encoder = encoder_on(device_);
    in_place.noise = [&](const NoiseField &field, const glm::uvec3 &, VoxelType of_type) {
      return std::make_unique<InPlaceAlone>(device_, field, of_type);
    };
    for (const BlockBox &own :
         {BlockBox{{0, 0, 0}, {12, 10, 11}}, BlockBox{{3, 2, 4}, {7, 9, 11}}}) {
      const CompressedVolume expected = load_brick(name, {}, by_host, whole, 1, own),
                             made = load_brick(name, {}, in_place, whole, 1, own);
      EXPECT_TRUE(made.words == expected.words);
      EXPECT_EQ(made.value_range, expected.value_range);
      EXPECT_EQ(made.max_voxel_error, expected.max_voxel_error);
      EXPECT_GT(made.value_range[1], made.value_range[0]) << "else nothing is tested";
    }
    in_place.levels = 2;
    EXPECT_THROW(
        compress_volume([&] { return open_any_volume(name, {}, in_place.noise); }, name, in_place),
        std::logic_error)
        << "levels of detail need the voxels";
  }
}

TEST(NoiseField, CpusAndDevicesWithoutDoublesAreLeftOut) {
  ocl::DeviceInfo gpu;
  gpu.type = ocl::DeviceType::kGpu;
  EXPECT_FALSE(NoiseOnDevice::suits(gpu));
  gpu.capabilities.fp64 = true;
  EXPECT_TRUE(NoiseOnDevice::suits(gpu));
  gpu.type = ocl::DeviceType::kCpu;
  EXPECT_FALSE(NoiseOnDevice::suits(gpu));
  EXPECT_FALSE(make_noise_field(Field::kSphere, glm::uvec3(8), 1));
}

}  // namespace
}  // namespace isowave::core
