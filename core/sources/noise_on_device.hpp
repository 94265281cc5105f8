#pragma once
// Fields of gradient noise, made by a device.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/sources/generate.hpp"
#include "core/sources/noise_field.hpp"
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

/// GenerateOptions::noise by a device, if it suits: opened once more for each volume, since layers
/// are read beside other work on it.
NoiseMaker noise_on(const ocl::DeviceInfo &device);

}  // namespace isowave::core
