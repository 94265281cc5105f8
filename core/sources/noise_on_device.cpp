#include "core/sources/noise_on_device.hpp"

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

/// With a device of its own.
class OwnDeviceNoise : public NoiseVoxels {
 public:
  OwnDeviceNoise(const ocl::DeviceInfo &device, const NoiseField &field, const glm::uvec3 &dims,
                 VoxelType type)
      : device_(device), noise_(device_, field, dims, type) {}
  void evaluate(std::uint32_t z_begin, std::uint32_t num_layers,
                std::span<std::byte> voxels) override {
    noise_.evaluate(z_begin, num_layers, voxels);
  }

 private:
  ocl::Device device_;
  NoiseOnDevice noise_;
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

NoiseMaker noise_on(const ocl::DeviceInfo &device) {
  if (!NoiseOnDevice::suits(device)) return {};
  return [device](const NoiseField &field, const glm::uvec3 &dims, VoxelType type) {
    return std::make_unique<OwnDeviceNoise>(device, field, dims, type);
  };
}

}  // namespace isowave::core
