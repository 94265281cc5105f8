#pragma once
// Synthetic fields of gradient noise (kernels_cl/portable/noise.h), on the host or a device.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/sources/field_rows.hpp"
#include "kernels/noise_field.hpp"
#include "kernels_cl/portable/noise.h"

namespace isowave::core {

/// A field on a grid.
struct NoiseField {
  NoiseShape shape{};
  std::vector<NoiseOctave> octaves{};  ///< group a, then group b
};

/// None where the field is not of noise.
std::optional<NoiseField> make_noise_field(Field field, const glm::uvec3 &dims, std::uint64_t seed);

/// The field's rows of nx voxels, evaluated by the host.
std::unique_ptr<FieldRows> make_noise_rows(NoiseField field, std::uint32_t nx);

/// The field's voxels, made by a device.
class NoiseOnDevice {
 public:
  /// Whether it has doubles. A CPU that has is left to other work: the host's rows share more.
  static bool suits(const ocl::DeviceInfo &device);

  /// type: what voxels are stored as, see generate.hpp.
  NoiseOnDevice(ocl::Device &device, const NoiseField &field, const glm::uvec3 &dims,
                VoxelType type);

  /// The bytes of voxels [num_layers][ny][nx] from layer z_begin on: those that the host makes.
  ///
  /// Throws  std::invalid_argument: not the size of so many layers
  /// Waits   yes
  void evaluate(std::uint32_t z_begin, std::uint32_t num_layers, std::span<std::byte> voxels);

 private:
  ocl::Device &device_;
  NoiseShape shape_;
  glm::uvec3 dims_;
  VoxelType type_;
  ocl::Buffer<NoiseOctave> octaves_;
  std::optional<ocl::Buffer<std::byte>> voxels_{};  ///< as many as were asked for at once
  ocl::Kernel<kernels::noise_field> kernel_;
};

}  // namespace isowave::core
