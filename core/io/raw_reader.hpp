#pragma once
// Headerless voxel files in the Open-SciVis naming: `NAME_XxYxZ_TYPE.raw`, optionally gzipped (`.raw.gz`).

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/volume.hpp"

namespace isowave {

/// What an Open-SciVis file name says. name is what stands before the dims.
struct RawName {
  std::string name;
  glm::uvec3 dims{0};
  VoxelType type = VoxelType::kUint8;
};

/// Parses `NAME_XxYxZ_TYPE` (no folder, no extension). Empty unless the whole pattern is there and the type
/// is known; dims may be anything that fits 32 bits.
std::optional<RawName> parse_raw_name(std::string_view stem);

/// Converts little-endian voxels of `type` to float32. voxels.size() == out.size() * size_of(type).
void convert_to_float(VoxelType type, std::span<const std::byte> voxels, std::span<float> out);
/// The same to float64, which holds all of them exactly.
void convert_to_double(VoxelType type, std::span<const std::byte> voxels, std::span<double> out);

/// Opens a .raw or .raw.gz file; see open_volume. An uncompressed file of the wrong size is refused here, a
/// gzip stream of the wrong length by the read that meets its end (the last layer's).
std::unique_ptr<VolumeReader> open_raw(const std::filesystem::path &path, const RawOverrides &overrides);

/// deflate cannot shrink data more than this: a bound on what a compressed file may unpack to.
inline constexpr std::uint64_t kMaxDeflateRatio = 1032;

}  // namespace isowave
