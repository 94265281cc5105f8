#pragma once
// Synthetic volumes of any size and type, made layer by layer.
//
// Every field has values in [0, 1]. Float types store the value; integer types store it mapped to
// [0, largest value of the type] and rounded to nearest. Positions: p = (2 i - (n - 1)) / (m - 1)
// per axis, with n that axis' and m the largest number of voxels: [-1, 1] along the longest axis, 0
// at the centre.
//
//   sphere          1 - |p| / sqrt(3): spheres of radius r at isovalue 1 - r / sqrt(3)
//   plane           0.5 + n.p / (2 |n|_1), n = (0.36, 0.48, 0.8): trilinear, its surfaces are exact
//   saddle          0.5 + (p.z - p.x p.y) / 4: trilinear as well
//   marschner_lobb  ((1 - sin(pi z / 2)) + a (1 + cos(2 pi f cos(pi r / 2)))) / (2 (1 + a)),
//                   r = hypot(x, y), f = 6, a = 1/4 [Marschner and Lobb 1994]
//   gyroid          0.5 + (sin X cos Y + sin Y cos Z + sin Z cos X) / 3, (X, Y, Z) = 4 pi p
//   mixing_layer    a smooth step across the mid-plane of y, displaced and wrinkled by octaves of
//                   gradient noise; the surface at 0.5 is a turbulent mixing layer. Larger volumes
//                   get finer octaves.
//   turbulence      gradient noise of the same octaves' spectrum everywhere
//   jet             a round jet along x, smooth where it begins, that widens and breaks up
//   scan            an ellipsoid with bumps, at 0.15 to 0.3, and thin curved walls in it, at 0.4 to
//                   0.9, about 20 voxels apart at any size
//   noisy_scan      scan, and for each voxel a random value of -0.06 to 0.06
//   shell           one closed, smooth surface: (128 + 127 s (3 - s^2) / 2) / 255, with
//                   s = d / 0.12 clamped to [-1, 1] and
//                   d = 0.8 - |p| + 0.02 (sin(5 x + 1) + sin(6 y + 2) + sin(7 z + 3)):
//                   a bent sphere of 0.4 of the volume's longest edge, inside where d > 0. As
//                   uint8 it is at 128. A function of p alone: the same at any size.
//
// The same field, dims, type and seed give the same bytes for any number of threads, and on a
// device. Fields of noise (those with seeds), plane, sphere and saddle use correctly rounded
// operations only and are the same on every machine; the other three use the C library's sin and
// cos.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/volume/volume.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

enum class Field {
  kSphere,
  kPlane,
  kSaddle,
  kMarschnerLobb,
  kGyroid,
  kShell,
  kMixingLayer,
  kTurbulence,
  kJet,
  kScan,
  kNoisyScan
};

/// "sphere", "plane", ... "noisy_scan".
std::string_view to_string(Field field);
/// Throws  Error naming the fields
Field field_from_string(std::string_view name);
/// All names, for help texts.
std::vector<std::string> field_names();
/// Whether a seed makes another volume of it.
bool has_seed(Field field);

struct NoiseField;

/// The voxels of a field of noise, made in place of the host's threads: the same bytes.
class NoiseVoxels {
 public:
  virtual ~NoiseVoxels() = default;
  /// The bytes of voxels [num_layers][ny][nx] from layer z_begin on.
  virtual void evaluate(std::uint32_t z_begin, std::uint32_t num_layers,
                        std::span<std::byte> voxels) = 0;
  /// VolumeReader::on_device().
  virtual DeviceVoxels *in_place() { return nullptr; }
};
using NoiseMaker = std::function<std::unique_ptr<NoiseVoxels>(
    const NoiseField &field, const glm::uvec3 &dims, VoxelType type)>;

struct GenerateOptions {
  Field field = Field::kMixingLayer;
  glm::uvec3 dims{0};
  VoxelType type = VoxelType::kFloat32;
  std::uint64_t seed = 1;         ///< of fields of noise
  std::uint32_t num_threads = 0;  ///< 0: one per processor
  NoiseMaker noise{};             ///< for fields of noise: noise_on() a device; none: the host
};

/// The volume as a reader, without a file: the voxels that generate_to_file() would write. Layers
/// may be read in any order.
///
/// Throws  Error on bad dims
std::unique_ptr<VolumeReader> open_generated(const GenerateOptions &options);

/// Writes the volume as raw little-endian voxels, in a `.nrrd` file behind a header, in memory
/// O(nx * ny); nothing is left behind on an error. A path without file name, or an existing folder,
/// gets the Open-SciVis name. Returns the file's path.
///
/// Throws  Error: bad dims, unwritable, a file name that says other dims or another type
std::filesystem::path generate_to_file(const GenerateOptions &options,
                                       const std::filesystem::path &path,
                                       const Progress &progress = {});

}  // namespace isowave::core
