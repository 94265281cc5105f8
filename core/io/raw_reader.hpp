#pragma once
// Voxels of any file, by what its header said or, for headerless files in the Open-SciVis naming,
// its name: `NAME_XxYxZ_TYPE.raw`, optionally gzipped (`.raw.gz`).

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/io/volume_header.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core {

/// Replaces what a raw file's name says, and chooses. Unset fields come from the file.
struct RawOverrides {
  std::optional<glm::uvec3> dims{};
  std::optional<VoxelType> type{};
  std::optional<glm::dvec3> spacing{};  ///< also replaces the spacing of other formats
  std::optional<std::uint32_t>
      step{};  ///< which volume of a file of other formats with a fourth axis
};

/// Parts of an Open-SciVis file name. name: the text before the dims.
struct RawName {
  std::string name;
  glm::uvec3 dims{0};
  VoxelType type = VoxelType::kUint8;
};

/// Parses `NAME_XxYxZ_TYPE` (no folder, no extension). Empty unless the whole pattern is there and
/// the type is known; dims may be anything that fits 32 bits.
std::optional<RawName> parse_raw_name(std::string_view stem);

/// The step that "t=3" asks for; none if the text is empty.
///
/// name    of the text, in messages
/// Throws  Error: it asks for something else
std::optional<std::uint32_t> parse_index(std::string_view name, std::string_view text);

/// Converts little-endian voxels of `type` to float32. voxels.size() == out.size() * size_of(type).
void convert_to_float(VoxelType type, std::span<const std::byte> voxels, std::span<float> out);
/// The same to float64. Throws Error on integers that float64 does not hold.
void convert_to_double(VoxelType type, std::span<const std::byte> voxels, std::span<double> out);

/// Reads the voxels that a header describes, whose info has passed check_volume_info(). Layers are
/// read as they are asked for, in pieces. The reader throws Error where voxels cannot be unpacked
/// or parsed, and with the last layer if the data does not end with it.
///
/// Throws  Error before anything is allocated if the file has too few bytes for the voxels: by
///         its exact length if they are not packed, by what could become of it if they are
std::unique_ptr<VolumeReader> open_voxels(const VolumeHeader &header);

/// Opens a .raw or .raw.gz file; see open_volume.
std::unique_ptr<VolumeReader> open_raw(const std::shared_ptr<const InputFile> &file,
                                       bool is_gzipped, const RawOverrides &overrides);

}  // namespace isowave::core
