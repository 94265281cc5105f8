#pragma once
// Fields of gradient noise, made by a device.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/sources/generate.hpp"
#include "core/sources/noise_field.hpp"
#include "core/stages/zfp_encode.hpp"
#include "kernels/noise_field.hpp"

namespace isowave::core {

/// The field's voxels, made by a device.
class NoiseOnDevice : public NoiseVoxels {
 public:
  /// Whether it has doubles. A CPU that has is left to other work: the host's rows share more.
  static bool suits(const ocl::DeviceInfo &device);

  /// type: what voxels are stored as, see generate.hpp.
  NoiseOnDevice(ocl::Device &device, const NoiseField &field, const glm::uvec3 &dims,
                VoxelType type);

  /// Throws  std::invalid_argument: not the size of so many layers
  /// Waits   yes
  void evaluate(std::uint32_t z_begin, std::uint32_t num_layers,
                std::span<std::byte> voxels) override;

 private:
  ocl::Device &device_;
  NoiseShape shape_;
  glm::uvec3 dims_;
  VoxelType type_;
  ocl::Buffer<NoiseOctave> octaves_;
  std::optional<ocl::Buffer<std::byte>> voxels_{};  ///< as many as were asked for at once
  ocl::Kernel<kernels::noise_field> kernel_;
};

/// The field's voxels, made by the device that encodes them. Nothing of them comes to the host.
class NoiseInPlace : public VoxelsInPlace {
 public:
  /// Whether voxels of the type can be made so.
  static bool suits(VoxelType type) { return size_of(type) <= 2; }

  /// device  must outlive this
  NoiseInPlace(ocl::Device &device, const NoiseField &field, VoxelType type);
  void make(const glm::uvec3 &begin, const glm::uvec3 &dims, ocl::Buffer<float> &voxels) override;
  std::array<float, 2> range() override;

 private:
  ocl::Device &device_;
  NoiseShape shape_;
  ocl::Buffer<NoiseOctave> octaves_;
  ocl::Buffer<cl_int> range_;
  ocl::Kernel<kernels::noise_in_place> kernel_;
};

/// GenerateOptions::noise by a device, if it suits: opened once more for each volume whose layers
/// are read, since they are read beside other work on it.
NoiseMaker noise_on(const ocl::DeviceInfo &device);
/// The same. What this device encodes, it also makes; it must outlive the readers.
NoiseMaker noise_on(ocl::Device &device);

}  // namespace isowave::core
