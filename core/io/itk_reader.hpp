#pragma once
// NRRD, MetaImage and NIfTI through ITK's image readers.
//
// World space is ITK's: millimetres, and where the format is anatomical LPS (+x left, +y posterior,
// +z superior). ITK converts NRRD's `space` and NIfTI's RAS to it, so the same head has the same world
// coordinates from any of the formats. Direction cosines go to VolumeInfo::direction; a negative spacing is
// stored as a flipped direction.

#include <filesystem>
#include <memory>
#include <optional>

#include "core/volume.hpp"

namespace isowave {

enum class ItkFormat { kNrrd, kMetaImage, kNifti };

/// Opens a file whose format is known from its name; `spacing` replaces the file's. Before any allocation
/// the header is checked: 3D, one component, a VoxelType, sane dims, and a data file that is long enough.
/// Uncompressed MetaImage is read layer by layer. ITK reads the others whole: the first read_layers()
/// then holds all voxels in the file's type until the last layer was read. Everything ITK throws becomes
/// one line of Error.
///
/// ITK's parsers report to std::cout and std::cerr; both are muted while they run, so no other thread may
/// write to them meanwhile.
std::unique_ptr<VolumeReader> open_with_itk(const std::filesystem::path &path, ItkFormat format,
                                            const std::optional<glm::dvec3> &spacing);

}  // namespace isowave
