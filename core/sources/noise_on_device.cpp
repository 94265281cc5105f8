#include "core/sources/noise_on_device.hpp"

#include <array>
#include <limits>
#include <memory>
#include <stdexcept>

namespace isowave::core {

namespace {

ocl::Defines defines_for(VoxelType type) {
  switch (type) {
    case VoxelType::kUint8:
      return {{"ISO_VOXEL", "uchar"}, {"ISO_LARGEST_VOXEL", "255.0"}};
    case VoxelType::kInt8:
      return {{"ISO_VOXEL", "char"}, {"ISO_LARGEST_VOXEL", "127.0"}};
    case VoxelType::kUint16:
      return {{"ISO_VOXEL", "ushort"}, {"ISO_LARGEST_VOXEL", "65535.0"}};
    case VoxelType::kInt16:
      return {{"ISO_VOXEL", "short"}, {"ISO_LARGEST_VOXEL", "32767.0"}};
    case VoxelType::kUint32:
      return {{"ISO_VOXEL", "uint"}, {"ISO_LARGEST_VOXEL", "4294967295.0"}};
    case VoxelType::kInt32:
      return {{"ISO_VOXEL", "int"}, {"ISO_LARGEST_VOXEL", "2147483647.0"}};
    case VoxelType::kFloat32:
      return {{"ISO_VOXEL", "float"}, {"ISO_LARGEST_VOXEL", "0"}};
    case VoxelType::kUint64:
      return {{"ISO_VOXEL", "ulong"}, {"ISO_LARGEST_VOXEL", "18446744073709551615.0"}};
    case VoxelType::kInt64:
      return {{"ISO_VOXEL", "long"}, {"ISO_LARGEST_VOXEL", "9223372036854775807.0"}};
    case VoxelType::kFloat64:
      break;
  }
  return {{"ISO_VOXEL", "double"}, {"ISO_LARGEST_VOXEL", "0"}};
}

/// With a device of its own, if layers are read.
class OwnDeviceNoise : public NoiseVoxels {
 public:
  /// encoder  the device that may encode the voxels, or null
  OwnDeviceNoise(const ocl::DeviceInfo &info, ocl::Device *encoder, const NoiseField &field,
                 const glm::uvec3 &dims, VoxelType type)
      : info_(info), encoder_(encoder), field_(field), dims_(dims), type_(type) {}
  void evaluate(std::uint32_t z_begin, std::uint32_t num_layers,
                std::span<std::byte> voxels) override {
    if (!noise_) noise_.emplace(device_.emplace(info_), field_, dims_, type_);
    noise_->evaluate(z_begin, num_layers, voxels);
  }
  DeviceVoxels *in_place() override {
    if (encoder_ == nullptr || !NoiseInPlace::suits(type_)) return nullptr;
    return &in_place_.emplace(*encoder_, field_, type_);
  }

 private:
  ocl::DeviceInfo info_;
  ocl::Device *encoder_;
  NoiseField field_;
  glm::uvec3 dims_;
  VoxelType type_;
  std::optional<ocl::Device> device_{};
  std::optional<NoiseOnDevice> noise_{};
  std::optional<NoiseInPlace> in_place_{};
};

}  // namespace

bool NoiseOnDevice::suits(const ocl::DeviceInfo &device) {
  return device.capabilities.fp64 && device.type != ocl::DeviceType::kCpu;
}

NoiseOnDevice::NoiseOnDevice(ocl::Device &device, const NoiseField &field, const glm::uvec3 &dims,
                             VoxelType type)
    : device_(device),
      shape_(field.shape),
      dims_(dims),
      type_(type),
      octaves_(device_, "octaves", std::span<const NoiseOctave>(field.octaves)),
      kernel_(device_, defines_for(type)) {}

void NoiseOnDevice::evaluate(std::uint32_t z_begin, std::uint32_t num_layers,
                             std::span<std::byte> voxels) {
  const std::uint64_t num_rows = std::uint64_t{dims_.y} * num_layers;
  if (voxels.size() != num_rows * dims_.x * size_of(type_))
    throw std::invalid_argument("NoiseOnDevice: not the size of so many layers");
  if (!voxels_ || voxels_->size() < voxels.size()) {
    voxels_.reset();
    voxels_.emplace(device_, "voxels", voxels.size());
  }
  const std::uint64_t num_runs = num_rows * ((dims_.x + 3u) / 4u);
  kernel_(ocl::Range::strided(num_runs, ocl::kGroupSize, device_, 4), octaves_, shape_, dims_.x,
          dims_.y, z_begin, num_layers, *voxels_);
  voxels_->read(voxels);
}

NoiseInPlace::NoiseInPlace(ocl::Device &device, const NoiseField &field, VoxelType type)
    : device_(device),
      shape_(field.shape),
      octaves_(device_, "octaves", std::span<const NoiseOctave>(field.octaves)),
      range_(device_, "range of voxels", 2),
      kernel_(device_, defines_for(type)) {
  if (!suits(type)) throw std::invalid_argument("NoiseInPlace: voxels of more than 16 bits");
  range_.write(std::array{std::numeric_limits<cl_int>::max(), std::numeric_limits<cl_int>::min()});
}

void NoiseInPlace::make(const glm::uvec3 &begin, const glm::uvec3 &dims,
                        ocl::Buffer<float> &voxels) {
  if (voxels.size() < std::uint64_t{dims.x} * dims.y * dims.z)
    throw std::invalid_argument("NoiseInPlace: the buffer is too small for the voxels");
  const std::uint64_t num_runs = std::uint64_t{dims.y} * dims.z * ((dims.x + 3u) / 4u);
  kernel_(ocl::Range::strided(num_runs, ocl::kGroupSize, device_, 4), octaves_, shape_, dims.x,
          dims.y, dims.z, begin.x, begin.y, begin.z, voxels, range_);
}

std::array<float, 2> NoiseInPlace::range() {
  const std::vector<cl_int> found = range_.read();
  return {static_cast<float>(found[0]), static_cast<float>(found[1])};
}

namespace {

NoiseMaker noise_on(const ocl::DeviceInfo &info, ocl::Device *encoder) {
  if (!NoiseOnDevice::suits(info)) return {};
  return [info, encoder](const NoiseField &field, const glm::uvec3 &dims, VoxelType type) {
    return std::make_unique<OwnDeviceNoise>(info, encoder, field, dims, type);
  };
}

}  // namespace

NoiseMaker noise_on(const ocl::DeviceInfo &device) {
  return noise_on(device, nullptr);
}

NoiseMaker noise_on(ocl::Device &device) {
  return noise_on(device.info(), &device);
}

}  // namespace isowave::core
