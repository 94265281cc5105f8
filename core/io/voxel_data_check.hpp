#pragma once
// Is there enough data behind the header of an NRRD, MetaImage or NIfTI file? ITK allocates what the header
// asks for before it looks; a crafted header must not make us ask for terabytes.

#include <cstdint>
#include <filesystem>

#include "core/io/itk_reader.hpp"

namespace isowave {

enum class VoxelEncoding { kRaw, kDeflate, kHex, kText };

/// Where a header says its voxels are.
struct VoxelData {
  std::filesystem::path file;  ///< the header's own file or the one it names
  VoxelEncoding encoding = VoxelEncoding::kRaw;
  std::uint64_t offset = 0;  ///< bytes before the voxels; of the compressed file, unless it is a .nii.gz
  std::uint64_t bytes = 0;   ///< of the voxels, unpacked
};

/// Throws Error on NIfTI headers that make niftilib write to stderr by itself.
void check_before_itk(const std::filesystem::path &path, ItkFormat format);

/// Finds the voxels. Throws Error when their file is missing or too short: by its exact length where they are
/// not compressed, by what deflate could make of it where they are. Refuses voxels spread over several files.
VoxelData find_voxel_data(const std::filesystem::path &path, ItkFormat format, const VolumeInfo &info);

/// Unpacks deflated voxels without keeping them. ITK's parsers take broken and short streams for zeros.
/// Throws Error when the stream is broken or holds too few bytes. Does nothing for other encodings.
void verify_deflated(const VoxelData &data);

}  // namespace isowave
