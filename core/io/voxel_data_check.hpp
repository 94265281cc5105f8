#pragma once
// Is there enough data behind the header of an NRRD, MetaImage or NIfTI file? ITK allocates what the header
// asks for before it looks; a crafted header must not make us ask for terabytes.

#include <cstdint>
#include <filesystem>

#include "core/io/itk_reader.hpp"

namespace isowave {

/// Throws Error when the file that holds the voxels (the header's own, or the one it names) is missing or too
/// short for info's voxels, by its exact length where they are not compressed, by what deflate could make of
/// it where they are. Refuses voxels spread over several files.
/// Returns true when the voxels are stored uncompressed.
bool check_voxel_data(const std::filesystem::path &path, ItkFormat format, const VolumeInfo &info);

}  // namespace isowave
