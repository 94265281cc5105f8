#pragma once
// Headers of MetaImage (.mha, .mhd): https://itk.org/Wiki/ITK/MetaIO/Documentation
//
// Keys that the format does not know may be anything, unless only their case tells them from one
// that it knows. Refused, besides what is broken: voxels in several files, 64-bit integers, more
// than one value per voxel, values that are scaled.

#include <memory>

#include "core/io/volume_header.hpp"

namespace isowave::core {

/// Reads and judges the header, not the voxels.
///
/// Throws  Error
VolumeHeader read_meta_image_header(const std::shared_ptr<const InputFile> &file);

}  // namespace isowave::core
